"""Scores of an estimator: bias and coverage on hits whose truth is known."""

import math
import threading
import warnings
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from numbers import Real
from statistics import fmean, stdev
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
import scipy

from impact_rig.analysis.hits import Hit
from impact_rig.analysis.sources import list_items
from impact_rig.api import VirtualRig
from impact_rig.core.given.errors import ParameterError, check_count
from impact_rig.core.given.quantity import Quantity
from impact_rig.core.given.records import Truth
from impact_rig.devices.virtual.choices import SourceKeys
from impact_rig.present.printed import Printed, make_frame
from impact_rig.results.numbers import MISSING, format_count
from impact_rig.results.table import Column, Table, make_table, make_text_column

if TYPE_CHECKING:
    from impact_rig.testing.running import RunningRig

Estimator = Callable[[Hit], Any]
"""Gets a hit; returns its estimate in SI units with or without its 95 % interval."""
Reader = Callable[[Any], tuple[Any, ...] | None]
"""Gets a message; returns sample, impact and attempt, then what an estimator returns."""
Estimate = tuple[float, float, float]
"""A value and both ends of its 95 % interval; NaN: there is none."""
NOTHING: Estimate = (math.nan, math.nan, math.nan)
FAR = 100.0
"""Times the truth, or a part of it, that is taken for another unit, our choice [-]."""


@dataclass(frozen=True)
class Score:
    """Score of an estimator on one sample."""

    sample: str
    hits: int
    failed: int  # it raised an error, or found no number
    bias: float  # mean of estimate over truth, minus 1 [-]
    spread: float  # standard deviation of the same [-]
    coverage: float  # part of the hits whose truth lies in their interval [-]; NaN: it has none
    # 95 % interval of the coverage by so many hits, Clopper and Pearson's [-]
    lowest_coverage: float
    highest_coverage: float


class Scores(Printed, tuple[Score, ...]):
    """Scores of all samples; they print themselves as a table."""

    def list_tables(self) -> list[Table]:
        """Return what is printed."""

        def show(values: list[float], digits: int = 3) -> list[str]:
            shown = (f"{100.0 * item:.{digits}f}" for item in values)
            return [text if text != "nan" else MISSING for text in shown]

        columns = [
            make_text_column("Sample", [item.sample for item in self]),
            Column("Hits", [str(item.hits) for item in self]),
            Column("Failed", [str(item.failed) for item in self]),
            Column("Bias [%]", show([item.bias for item in self])),
            Column("Spread [%]", show([item.spread for item in self])),
            Column("Coverage [%]", show([item.coverage for item in self], 1)),
            Column("from", show([item.lowest_coverage for item in self], 1)),
            Column("to", show([item.highest_coverage for item in self], 1)),
        ]
        return [make_table("Scores", columns)]

    def to_dataframe(self) -> Any:
        """Return a row for each sample, as `impact_rig.Results.to_dataframe`."""
        return make_frame([vars(item) for item in self], "sample")

    __repr__ = Printed.__str__


def score(
    estimator: Estimator,
    *,
    quantity: str = "contact_time",
    samples: str | Sequence[str] = (),
    impacts: int = 20,
    **source: Unpack[SourceKeys],
) -> Scores:
    """Let an estimator judge hits of the virtual rig, and compare it with the truth.

    Parameters
    ----------
    estimator : callable
        Gets an `impact_rig.Hit` and returns a number in SI units; with its expanded uncertainty U
        for 95 %, a pair; with both ends of its interval, three numbers; or an
        `impact_rig.Number`. An error, None or NaN counts as failed.
    quantity : str
        A field of `impact_rig.Truth`. `contact_time` is the time from first touch to separation;
        the paper's τp, twice the half-amplitude width, is the same on ``plant="published"``
        alone, and 5 to 10 % longer on a metal's contact.
    samples : str or sequence of str
        Names; empty: all.
    impacts : int
        Hits of each.
    **source
        As of `impact_rig.VirtualRig`; the plant is "contact" where nothing else is said. A faulty
        hit is scored like all others. Each hit is of another seed, on from the given one, whose
        masses, gains and clock are drawn within their ±.

    Raises
    ------
    ParameterError
        If the plant has no such quantity, or the estimator returns something else.

    Warns
    -----
    UserWarning
        If the estimator raises errors, of the first; if estimates are far from the truth.

    Examples
    --------
    >>> import numpy as np
    >>> def width(hit):
    ...     above = hit.time[np.abs(hit.hammer) > 0.5 * np.abs(hit.hammer).max()]
    ...     return 2.0 * (above[-1] - above[0])
    >>> (found,) = score(width, samples=["steel small"], impacts=5, plant="published")
    >>> found.failed, abs(found.bias) < 0.01
    (0, True)
    """
    check_count("impacts", impacts, 1)
    if not callable(estimator):
        raise ParameterError(f"estimator is {estimator!r:.40}: it must be a function of a hit")
    source.setdefault("plant", "contact")
    seed = source.get("seed") or 1
    each: list[SourceKeys] = [
        {**source, "seed": seed + number, "draw": True} for number in range(impacts)
    ]
    rigs = [VirtualRig(**keys) for keys in each]
    scores = []
    errors: list[str] = []
    for name in list_items(samples) or rigs[0].samples:
        hits = [rig.strike(name) for rig in rigs]
        found = [(_read_truth(hit.truth, quantity), *_ask(estimator, hit, errors)) for hit in hits]
        scores.append(_compute_score(name, found))
    _warn(scores, errors, "the estimator")
    return Scores(scores)


def score_node(
    rig: "RunningRig",
    topic: str,
    read: Reader,
    *,
    quantity: str = "contact_time",
    samples: str | Sequence[str] = (),
    impacts: int = 5,
    patience: float = 5.0,
) -> Scores:
    """Let a node judge the hits of a campaign, and compare what it publishes with the truth.

    Parameters
    ----------
    rig : RunningRig
        The fixture `virtual_rig`, in whose domain the node runs.
    topic : str
        The whole name of what it publishes its estimates on: "/mine/estimate".
    read : callable
        Gets a message, and returns sample, impact and attempt of its hit, then the estimate in SI
        units and, if it has them, U or both ends, as the estimator of `score`; None: the message
        is no estimate. A hit of which nothing has come so late counts as failed.
    patience : float
        How long after the campaign estimates may come [s].
    quantity, samples, impacts
        As of `score`.

    Raises
    ------
    RigError
        If not just one node publishes there, the campaign does not succeed, no estimate is of one
        of its hits, or the plant has no such quantity.

    Warns
    -----
    UserWarning
        If `read` raises errors, or returns something else; of the first. If estimates are far
        from the truth.
    """
    from impact_rig.nodes.listener import Listener

    found: dict[tuple[str, int, int], Estimate] = {}
    came = threading.Condition()
    errors: list[str] = []

    def take(message: Any, _: object) -> None:
        try:
            if (estimate := read(message)) is None:
                return
            sample, impact, attempt, *numbers = estimate
            given = _convert(numbers)
        except Exception as error:  # noqa: BLE001 - whatever a foreign reader does is its own
            errors.append(f"{type(error).__name__}: {error}")
            return
        with came:
            found[sample, impact, attempt] = given
            came.notify_all()

    with closing(Listener(rig.domain)) as listener:
        listener.subscribe(topic, take)
        results = rig.campaign(samples, impacts)
        hits = [hit.label for hit in results.record.hits]
        with came:
            came.wait_for(lambda: len(found) >= len(hits), patience)
    known = [(label.sample, label.impact, label.attempt) for label in hits]
    if found and found.keys().isdisjoint(known):
        (first, *_), (hit, *_) = found, known
        raise ParameterError(
            f"read gives hits that were not struck, as {first}: they are as {hit}"
        )
    scores = []
    for name in dict.fromkeys(label.sample for label in hits):
        judged = [
            (_read_truth(rig.find_truth(label), quantity), *found.get(key, NOTHING))
            for label, key in zip(hits, known, strict=True)
            if label.sample == name
        ]
        scores.append(_compute_score(name, judged))
    _warn(scores, errors, "read")
    return Scores(scores)


def _read_truth(truth: Truth | None, quantity: str) -> float:
    known = {
        name: value
        for name, value in vars(truth).items()
        if isinstance(value, Real) and math.isfinite(value)
    }
    if quantity not in known:
        names = ", ".join(map(repr, known))
        raise ParameterError(f"this plant has no true {quantity!r}: it has {names}")
    return float(known[quantity])


def _compute_score(name: str, hits: Sequence[tuple[float, float, float, float]]) -> Score:
    """Return the score of hits, each its truth, and its estimate with both ends of its interval.

    NaN: there is none; beside a lower end an upper one of NaN is open.
    """
    known = [hit for hit in hits if math.isfinite(hit[1])]
    ratios = [value / truth - 1.0 for truth, value, *_ in known]
    covered = [
        lower <= truth and not truth > upper
        for truth, _, lower, upper in known
        if not math.isnan(lower)
    ]
    lowest, highest = compute_part_interval(sum(covered), len(covered))
    return Score(
        name,
        len(hits),
        len(hits) - len(known),
        bias=fmean(ratios) if ratios else math.nan,
        spread=stdev(ratios) if len(ratios) > 1 else math.nan,
        coverage=fmean(covered) if covered else math.nan,
        lowest_coverage=lowest,
        highest_coverage=highest,
    )


def compute_part_interval(count: int, total: int) -> tuple[float, float]:
    """Return the 95 % interval of a part of which `count` of `total` were found, both may be 0."""
    if not total:
        return math.nan, math.nan
    found = scipy.stats.binomtest(count, total).proportion_ci()
    return float(found.low), float(found.high)


def _ask(estimator: Estimator, hit: Hit, errors: list[str]) -> Estimate:
    """Return an estimate; note errors."""
    try:
        found = estimator(hit)
    except Exception as error:  # noqa: BLE001 - whatever a foreign estimator does is its own
        errors.append(f"{type(error).__name__}: {error}, of {hit.sample}/{hit.impact}")
        return NOTHING
    try:
        return _convert(found)
    except ParameterError as error:
        place = f"{hit.sample}/{hit.impact}"
        raise ParameterError(f"the estimator's answer to {place} is {error}") from None


def _convert(found: Any) -> Estimate:
    """Return what an estimator found."""
    if found is None:
        return NOTHING
    if isinstance(found, Quantity):
        return found.value, found.lower, found.upper
    try:
        numbers = [float(item) for item in (found if np.ndim(found) else (found,))]
        if not isinstance(found, bool):
            match numbers:
                case [value]:
                    return value, math.nan, math.nan
                case [value, expanded] if not expanded < 0.0:
                    return value, value - expanded, value + expanded
                case [value, lower, upper] if not (lower > value or upper < value):
                    return value, lower, upper
    except (TypeError, ValueError):
        pass
    shown = " ".join(repr(found).split())
    raise ParameterError(
        f"{shown:.80}: it must be a number, a pair of a number and its expanded uncertainty, 0 or"
        " more, or a number and both ends of its interval"
    )


def _warn(scores: Sequence[Score], errors: Sequence[str], who: str) -> None:
    """Warn of errors, and of estimates that are in another unit."""
    if errors:
        text = f"{who} raised {format_count(len(errors), 'error')}, first {errors[0]}"
        warnings.warn(text, stacklevel=3)
    for item in scores:
        ratio = item.bias + 1.0
        if math.isfinite(ratio) and not 1.0 / FAR < abs(ratio) < FAR:
            text = f"estimates of {item.sample} are {ratio:.2g} times the truth"
            warnings.warn(f"{text}: see that they are in SI units", stacklevel=3)
