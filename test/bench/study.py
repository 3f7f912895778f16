"""The estimators where the truth is known: coverage and bias, faults found, good hits kept."""

from collections import Counter
from collections.abc import Iterator

from study.campaigns import (
    ASKED,
    COVERAGE,
    Outcome,
    find_least,
    find_most,
    run_campaign,
    summarize,
)
from study.laboratories import Cause, judge_all
from study.law_campaigns import ASKED as ASKED_OF_LAWS
from study.law_campaigns import run_many
from study.selection import FAULTS, SERIES_HITS, SURE, strike_fault, strike_good_hits

from bench.measure import Bench, Figure
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.devices.virtual.choices import Plant

PERCENT = 100.0
HITS = (3, 5, 10, 30)
"""Of campaigns in turn [-]."""
LARGEST_BIAS = 0.5
"""Over the half width of the 95 % interval [-], our choice."""
FOUND, REJECTED = 0.99, 0.002
"""Of faults that are to be found, and of good hits that may be left out [-], as asked for."""


def measure_study(bench: Bench) -> Iterator[Figure]:
    """Simulate campaigns on each plant, then series of good hits and of every fault."""
    count, seed = bench.extent.simulated, bench.extent.seed
    for plant in ASKED:
        outcomes: list[Outcome] = []
        for number in range(count):
            outcomes += run_campaign(plant, PAPER_SETUP, seed, number, HITS[number % len(HITS)])
        yield from _describe_campaigns(plant, outcomes)
    yield from _measure_selection(count, seed)
    yield from _measure_laboratories(count, seed)
    yield from _measure_laws(count, seed)


def _describe_campaigns(plant: Plant, outcomes: list[Outcome]) -> Iterator[Figure]:
    for found in summarize(outcomes):
        name, count = f"{plant.value}: {found.asked}", found.campaigns
        least = PERCENT * find_least(count, COVERAGE) / count
        percent = PERCENT * found.covered / count
        yield Figure(f"{name}, 95 % intervals that cover", percent, "%", least=least)
        is_another = plant is Plant.CONTACT and found.asked.method == "paper"
        yield Figure(
            f"{name}, bias over the interval",
            abs(found.bias),
            most=None if is_another else LARGEST_BIAS,
            note="2·w50 is no contact's duration there" if is_another else "",
        )


RIGHT_OR_NAMED = 0.97
"""Series of other laboratories of which no figure is wrong with nothing said [-], as asked for."""


def _measure_laboratories(count: int, seed: int) -> Iterator[Figure]:
    """Hold series with each cause of error against the truth: right, not given, or named."""
    number = len(Cause) * max(count // len(Cause), 1)
    verdicts = list(judge_all(number, seed))
    for cause in Cause:
        found = [item for item in verdicts if item.cause is cause]
        counts = Counter(item.outcome for item in found)
        percent = PERCENT * (1.0 - counts["silent"] / len(found))
        yield Figure(f"{cause.value}: {dict(counts)}, not silent", percent, "%")
    silent = sum(item.is_silent for item in verdicts)
    least = PERCENT * find_least(number, RIGHT_OR_NAMED) / number
    percent = PERCENT * (1.0 - silent / number)
    yield Figure("right, not given, or named: all causes", percent, "%", least=least)


LAWS_GIVEN = 0.92
"""Of campaigns of mixed losses through sensors that nothing states [-]: 138 of 150."""


def _measure_laws(count: int, seed: int) -> Iterator[Figure]:
    """Hold laws of mixed losses, through sensors that nothing states, against the truth."""
    given = [outcome for outcome in run_many(count, seed) if outcome.law.is_known]
    least = PERCENT * find_least(count, LAWS_GIVEN) / count
    yield Figure("laws of mixed losses given", PERCENT * len(given) / count, "%", least=least)
    for name in ASKED_OF_LAWS:
        covered = sum(outcome.ratios[name] <= 1.0 for outcome in given)
        least = PERCENT * find_least(len(given), COVERAGE) / len(given)
        percent = PERCENT * covered / len(given)
        yield Figure(f"mixed losses: {name}, intervals that cover", percent, "%", least=least)


def _measure_selection(count: int, seed: int) -> Iterator[Figure]:
    rejected = sum(strike_good_hits(seed, number) for number in range(count))
    hits = SERIES_HITS * count
    most = PERCENT * find_most(hits, REJECTED) / hits
    yield Figure("good hits that are rejected", PERCENT * rejected / hits, "%", most=most)
    least = PERCENT * find_least(count, FOUND) / count
    for fault in FAULTS:
        found: Counter[str] = Counter()
        for number in range(count):
            found.update(strike_fault(fault, seed, number))
        for name in map(fault.name, fault.sizes):
            asked = least if name in SURE else None
            yield Figure(f"found: {name}", PERCENT * found[name] / count, "%", least=asked)
