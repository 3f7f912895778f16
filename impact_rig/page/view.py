"""Content of the page: one sentence, and the tables beside it."""

import math
from dataclasses import dataclass, replace
from datetime import datetime
from types import SimpleNamespace

from impact_rig.core.estimates.paper_method import HammerEstimate
from impact_rig.core.given.findings import Reason, join_findings
from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.numbers import MICRO, MISSING, format_number
from impact_rig.results.tables import tabulate_summary
from impact_rig.status.levels import InputLevel, suggest_range, suggest_trigger_level
from impact_rig.status.rig_status import RigStatus
from impact_rig.status.states import NO_HAMMER, CampaignStatus, Step, Task

LONGEST_LIST = 100
"""Most hits that are listed, the newest [-]."""
MOST_MARKS = 40
"""Most marks for the hits of a sample [-]."""
INPUT_COLUMNS = ("zero", "noise", "largest", "range", "range that suits")
ADVICE = {
    Reason.NO_TRIGGER: "nothing was recorded: strike harder, or lower the trigger level",
    Reason.DISARMED: "the hammer was disarmed before the contact: it does not count",
    Reason.GAP: "points were lost: strike again, and see to the computer's load",
    Reason.DEAD_CHANNEL: "see to the cable of the channel",
    Reason.NO_PULSE: "nothing was struck: see to hammer and cable",
    Reason.OVERLOAD: "strike more gently, or set a larger range",
    Reason.STRONG: "strike more gently",
    Reason.WEAK: "strike harder, or lower minimum_peak",
    Reason.DOUBLE_HIT: "a second contact: strike more gently, and let the sample swing free",
    Reason.ZERO_SHIFT: "see to the sensor's mount",
    Reason.DRIFT: "let the sensor settle; see to its cable",
    Reason.RINGING: "see to the sensor's mount",
    Reason.POLARITY: "a sensor or cable was turned round since the first hit",
    Reason.INCONSISTENT: "unlike the other hits of this sample: see to sample and mount",
    Reason.OTHER_KIND: "recorded unlike the first hit of this sample: end the campaign",
}
"""Advice so that the next hit is accepted."""


@dataclass(frozen=True)
class Sentence:
    """The sentence that a person reads from three metres."""

    kind: str  # its colour: wait, go, ask, good, bad, paused, stopped, done
    headline: str
    detail: str = ""
    until: int | None = None  # [ms since the epoch]; None: there is no limit


@dataclass(frozen=True)
class Strength:
    """Strength of a hit, and its limits [% of the range]."""

    percent: int
    least: int
    most: int
    word: str


def make_view(status: RigStatus, disk: str = "") -> SimpleNamespace:
    """Return the page's content but for traces, by the names that its templates use.

    Parameters
    ----------
    status : RigStatus
        Of the rig.
    disk : str
        Room left for the recording, in words; empty: not known.
    """
    campaign, hammer, setup, last = status.campaign, status.hammer, status.setup, status.last_hit
    columns, rows = _tabulate(status)
    return SimpleNamespace(
        acquisition=status.acquisition,
        recorder=status.recorder,
        disk=disk,
        troubles=status.list_troubles(),
        stopped_by=status.stopped_by,
        sentence=make_sentence(status),
        campaign=campaign,
        samples=status.list_samples(),
        marks=_list_marks(status),
        control=setup.samples.control_sample if setup else "",
        choices=setup.samples.names if setup else (),  # that a campaign may have
        to_mount=campaign.sample if campaign.task is Task.MOUNT else "",
        hit=last,
        numbers=() if last is None else list_numbers(status, last),
        hits=sorted(status.hits.values(), key=lambda hit: -hit.record)[:LONGEST_LIST],
        # Functions that put a hit into words.
        say_verdict=_say_verdict,
        advise=_advise,
        say_by_hand=_say_by_hand,
        with_unit=_with_unit,
        format_clock=_format_clock,
        strength=None if last is None else _measure_strength(status, last),
        mass="" if last is None else _weigh(status, last),
        mass_differs=last is not None and _is_other_sample(last),
        hammer=hammer,
        place="unknown" if hammer is NO_HAMMER else hammer.state.name.lower(),
        input_columns=INPUT_COLUMNS,
        inputs=_list_inputs(status),
        is_monitoring=bool(status.levels.channels),
        trigger_level=_suggest_trigger_level(status),
        notes=tuple(status.notes),
        is_paused_by_hand=campaign.task is Task.RESUME,
        columns=columns,
        rows=rows,
    )


def make_sentence(status: RigStatus) -> Sentence:
    """Return the sentence that a person needs first."""
    if status.hammer.is_stopped:
        detail = f"{status.hammer.message}. To go on: reset, then arm."
        return Sentence("stopped", "STOPPED", detail)
    if status.campaign.task is not Task.NOTHING:
        return _say_task(status)
    last = status.last_hit
    if status.is_trial and last is not None and not status.campaign.is_running:
        verdict = "It would have been accepted" if last.accepted else _advise(last)
        return Sentence("done", "TRIAL HIT", f"It does not count. {verdict}.")
    return _say_step(status)


def _say_task(status: RigStatus) -> Sentence:
    """Return a campaign's task for a person, as a sentence."""
    campaign = status.campaign
    until = None if math.isnan(campaign.until) else round(campaign.until * 1000)
    match campaign.task:
        case Task.MOUNT:
            return Sentence("ask", f"MOUNT {campaign.sample}", campaign.message, until)
        case Task.LET_GO:
            return Sentence("go", "RELEASE NOW", _say_place(status), until)
        case Task.PUT_BACK:
            return Sentence("ask", "PUT THE HAMMER BACK", _say_place(status))
        case _:
            return Sentence("paused", "PAUSED", campaign.message)


def _say_step(status: RigStatus) -> Sentence:
    """Return a campaign's step, as a sentence."""
    campaign, last = status.campaign, status.last_hit
    match campaign.state:
        case Step.PAUSED | Step.DISARMING:
            return Sentence("paused", "PAUSED", campaign.message)
        case Step.COMPLETE:
            return _say_complete(campaign)
        case Step.ENDED:
            return _say_end(status)
        case Step.STRIKING:
            return Sentence("wait", "KEEP AWAY", f"The hammer swings. {_say_place(status)}")
    if last is None:
        return Sentence("wait", "WAIT", "The rig prepares the first hit.")
    kind, word = ("good", "ACCEPTED") if last.accepted else ("bad", "REJECTED")
    return Sentence(kind, word, _say_place(status) if last.accepted else _advise(last))


def _say_complete(campaign: CampaignStatus) -> Sentence:
    """Return that a campaign is complete, or what a person's verdict took from it since."""
    lacks = [
        f"{item.sample} lacks {campaign.impacts - item.accepted}"
        for item in campaign.counts
        if item.accepted < campaign.impacts
    ]
    if not lacks:
        return Sentence("done", "DONE", "Every sample has its hits.")
    found = sum(item.accepted for item in campaign.counts)
    wanted = campaign.impacts * len(campaign.counts)
    detail = f"{found} of {wanted} hits in the mean: {', '.join(lacks)}."
    return Sentence("paused", "ENDED", detail)


def _say_end(status: RigStatus) -> Sentence:
    if status.campaign.message:
        return Sentence("paused", "ENDED", status.campaign.message)
    if status.setup is None:
        return Sentence("wait", "WAIT", "No rig has said anything yet.")
    return Sentence("wait", "READY", "Start a campaign below, or by impact-rig campaign.")


def _say_place(status: RigStatus) -> str:
    """Return which hit is next, and how the last one was."""
    campaign, last = status.campaign, status.last_hit
    number = min(campaign.progress.accepted + 1, campaign.impacts)
    place = f"{campaign.sample}, hit {number} of {campaign.impacts}."
    if last is None:
        return place
    how = "The last one was good." if last.accepted else f"The last one: {_advise(last)}."
    return f"{place} {how}"


def _say_verdict(hit: HitResults) -> str:
    return "accepted" if hit.accepted else f"rejected: {join_findings(hit.reasons)}"


def _say_by_hand(hit: HitResults) -> str:
    """Return a person's verdict on a hit, with who and why; empty: there is none."""
    told = (*hit.reasons, *hit.findings)
    return "; ".join(item.explanation for item in told if item.reason is Reason.OPERATOR)


def _is_other_sample(hit: HitResults) -> bool:
    return any(item.reason is Reason.OTHER_SAMPLE for item in hit.findings)


def _advise(hit: HitResults) -> str:
    """Return advice after a rejected hit."""
    known = [ADVICE[item.reason] for item in hit.reasons if item.reason in ADVICE]
    return known[0] if known else join_findings(hit.reasons)


def _list_marks(status: RigStatus) -> dict[str, list[str]]:
    """Return the last hits of each sample: accepted, rejected, or empty for one to come."""
    marks = {count.sample: list[str]() for count in status.list_samples()}
    for hit in status.hits.values():
        word = "accepted" if hit.accepted else "rejected"
        marks.setdefault(hit.sample, []).append(word)
    for count in status.list_samples():
        to_come = min(status.campaign.impacts, MOST_MARKS) - count.accepted
        marks[count.sample] = marks[count.sample][-MOST_MARKS:] + [""] * to_come
    return marks


def list_numbers(status: RigStatus, hit: HitResults) -> tuple[tuple[str, str], ...]:
    """Return the figures of a hit: names and texts."""
    mass = status.setup.hammer_mass if status.setup else math.nan
    stated = status.setup.samples.get_moving_mass(hit.sample) if status.setup else math.nan
    numbers = (
        ("hammer", _with_unit(hit.hammer_peak, 1, "m/s²")),
        ("sample", _with_unit(hit.specimen_peak, 1, "m/s²")),
        ("force", _with_unit(mass * hit.hammer_peak, 1, "N")),
        ("τp", _with_unit(hit.contact_time * MICRO, 2, "µs")),
        ("momenta", format_number(stated / hit.sample_mass, 3)),
        ("impact speed", _with_unit(1e3 * _compute_speed(status, hit), 1, "mm/s")),
        ("off its series", _with_unit(status.compute_deviation(hit), 1, "times its scatter")),
    )
    return tuple((name, text) for name, text in numbers if text != MISSING)


def _compute_speed(status: RigStatus, hit: HitResults) -> float:
    """Return the speed before the hit [m/s]: measured, or of two free bodies; NaN: not known."""
    estimate = status.estimates.get(hit.sample)
    change = status.speed_changes.get(hit.record, math.nan)
    if status.setup is None or estimate is None or math.isfinite(hit.impact_speed):
        return hit.impact_speed
    moving = status.setup.samples.get_moving_mass(hit.sample)
    restitution = estimate.contact_law.restitution.value
    return change * (1.0 + status.setup.hammer_mass / moving) / (1.0 + restitution)


def _weigh(status: RigStatus, hit: HitResults) -> str:
    """Return the sample's mass by the traces beside the stated one; empty: not known."""
    if status.setup is None or math.isnan(hit.sample_mass):
        return ""
    stated = status.setup.samples.get_moving_mass(hit.sample)
    text = f"Mass by the traces {hit.sample_mass * 1e3:.1f} g, stated {stated * 1e3:.1f} g."
    return text + f" Is this {hit.sample}?" * _is_other_sample(hit)


def _measure_strength(status: RigStatus, hit: HitResults) -> Strength | None:
    if status.setup is None or not status.full_scale or math.isnan(hit.hammer_peak):
        return None
    analysis = status.setup.analysis
    percent, least, most = (
        round(100.0 * part)
        for part in (
            hit.hammer_peak / status.full_scale, analysis.minimum_peak, analysis.maximum_peak,
        )
    )  # fmt: skip
    word = "weak" if percent < least else "overload" if percent > most else "good"
    return Strength(percent, least, most, word)


def _list_inputs(status: RigStatus) -> list[tuple[str, int, bool, list[str]]]:
    """Return name, part of the range reached now [%], overload and numbers of each channel."""
    now = [level.peak for level in status.levels.channels] or [0.0, 0.0]
    rows = []
    for name, level, peak in zip(("hammer", "sample"), _list_levels(status), now, strict=False):
        percent = round(100.0 * peak / level.full_scale) if level.full_scale else 0
        suited = suggest_range(level.peak) if level.has_hit else math.nan
        unknown = math.nan
        values = (
            level.zero,
            level.noise or unknown,
            level.peak,
            level.full_scale or unknown,
            suited,
        )
        texts = [_with_unit(value, 1, "m/s²") for value in values]
        rows.append((name, percent, level.overloaded, texts))
    return rows


def _list_levels(status: RigStatus) -> tuple[InputLevel, ...]:
    """Return the levels of the monitor, or the peaks of a trial hit."""
    hit = status.last_hit
    if not status.is_trial or hit is None:
        return status.held
    levels = status.held or (InputLevel(math.nan),) * 2
    peaks = (hit.hammer_peak, hit.specimen_peak)
    return tuple(
        replace(level, peak=peak)
        for level, peak in zip(levels, peaks, strict=False)
        if math.isfinite(peak)
    )


def _suggest_trigger_level(status: RigStatus) -> str:
    levels = _list_levels(status)
    if not levels or not levels[0].has_hit:
        return ""
    level = suggest_trigger_level(levels[0].peak, levels[0].noise)
    return "none: strike harder, it is lost in noise" if math.isnan(level) else f"{level:.3g} m/s²"


def _with_unit(value: float, digits: int, unit: str) -> str:
    text = format_number(value, digits)
    return text if text == MISSING else f"{text} {unit}"


def _tabulate(status: RigStatus) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Return the table of results so far: headers and rows."""
    setup = status.setup
    if setup is None or not status.estimates:
        return (), ()
    samples = tuple(
        status.estimates[name] for name in setup.samples.names if name in status.estimates
    )
    results = Results(setup, HammerEstimate(), samples, tuple(status.hits.values()))
    tables = tabulate_summary(results)
    if not tables:
        return (), ()
    return tuple(column.header for column in tables[0].columns), tuple(tables[0].rows)


def _format_clock(moment: float) -> str:
    """Return the local time of day at the rig."""
    if math.isnan(moment):
        return "?"
    return datetime.fromtimestamp(moment).astimezone().strftime("%H:%M:%S")
