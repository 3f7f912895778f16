"""Content of the page: one sentence, and the tables beside it."""

import math
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import PurePath
from types import SimpleNamespace

from impact_rig.core.estimates.paper_method import HammerEstimate
from impact_rig.core.given.findings import Reason, join_findings
from impact_rig.page.sentence import advise, ask_mass, make_sentence, say_plainly, weigh, word
from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.numbers import MICRO, MISSING, format_number
from impact_rig.results.tables import tabulate_summary
from impact_rig.status.levels import InputLevel, suggest_range, suggest_trigger_level
from impact_rig.status.rig_status import RigStatus
from impact_rig.status.states import HammerPlace, Level, Step, Task

LONGEST_LIST = 100
"""Most hits that are listed, the newest [-]."""
MOST_MARKS = 40
"""Most marks for the hits of a sample [-]."""
PLACES = {
    HammerPlace.HELD: "held",
    HammerPlace.SWINGING: "swings",
    HammerPlace.FAULT: "not known",
    HammerPlace.AWAY: "not in its holder",
}
PARTS = {"accelerometer": "sensors", "estimator": "analysis", "visualizer": "display"}
"""What nodes are called on the page, where that differs."""
REASONS = ("too strong", "too weak", "struck twice", "wrong place", "wrong sample")
"""Why a person rejects a hit, by the keys 1 to 5."""
OVERLOADED = 0.9
"""Part of the range from which a rejected overload is that channel's [-]: peaks are smoothed."""


@dataclass(frozen=True)
class Strength:
    """Strength of a hit, and its limits [% of the range]."""

    percent: int
    least: int
    most: int
    word: str


@dataclass(frozen=True)
class Button:
    """An act that is offered."""

    act: str  # name of its form
    label: str
    key: str = ""
    fields: tuple[tuple[str, str], ...] = ()


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
        is_simulated=status.is_simulated,
        recorder=status.recorder,
        folder=str(PurePath(status.recorder.uri).parent) if status.recorder.uri else "",
        disk=disk,
        troubles=_list_troubles(status),
        sentence=make_sentence(status),
        # Of the states that acts are made from: numbers and stamps.
        seen=f"{hammer.number} {hammer.stamp} {campaign.number} {campaign.stamp}",
        moment=_find_moment(status),
        campaign=campaign,
        is_over=campaign.state in (Step.COMPLETE, Step.ENDED) and bool(status.hits),
        time_left=_say_time_left(status.compute_time_left()),
        lamps=_list_lamps(status),
        samples=status.list_samples(),
        marks=_list_marks(status),
        control=setup.samples.control_sample if setup else "",
        choices=setup.samples.names if setup else (),  # that a campaign may have
        hit=last,
        numbers=() if last is None else list_numbers(status, last),
        hits=sorted(status.hits.values(), key=lambda hit: -hit.record)[:LONGEST_LIST],
        reasons=REASONS,
        strength=None if last is None else _measure_strength(status, last),
        mass=weigh(status),
        mass_differs=bool(ask_mass(status)),
        hammer=hammer,
        place=PLACES[hammer.state],
        armed=_say_armed(status),
        inputs=_list_inputs(status),
        is_monitoring=bool(status.levels.channels),
        trigger_level=_suggest_trigger_level(status),
        notes=tuple(status.notes),
        columns=columns,
        rows=rows,
    )


def _find_moment(status: RigStatus) -> Button | None:
    """Return the one act that is asked for now; None: there is none."""
    campaign, hammer = status.campaign, status.hammer
    if "hammer" in status.list_silent():
        return None
    if hammer.is_stopped:
        return Button("reset", "Reset the stop")
    if campaign.task is Task.MOUNT:
        fields = (("sample", campaign.sample),)
        return Button("mounted", f"{campaign.sample} is mounted", "Enter", fields)
    if campaign.task is Task.PUT_BACK or hammer.is_away:
        return Button("confirm", "It is back in its holder", "Enter")
    if campaign.task is Task.ARM or (hammer.needs_person and not hammer.armed):
        return Button("arm", "Arm")
    return Button("resume", "Go on", "P") if campaign.task is Task.RESUME else None


def _list_troubles(status: RigStatus) -> list[str]:
    return [
        f"{PARTS.get(it.name, it.name)}: {say_plainly(it.message)}"
        for it in status.list_nodes()
        if it.level is not Level.OK
    ]


def _say_armed(status: RigStatus) -> str:
    hammer = status.hammer
    if "hammer" in status.list_silent():
        return "not known"
    if hammer.armed:
        return f"yes, since {format_clock(hammer.since)}"
    return f"no: {say_plainly(hammer.message)}"


def _say_time_left(seconds: float) -> str:
    """Return a time in the words of a person; empty: it is not known."""
    if math.isnan(seconds):
        return ""
    minutes = math.ceil(seconds / 60.0)
    hours, rest = divmod(minutes, 60)
    return f"{hours} h {rest:02} min left" if hours else f"{minutes} min left"


def _list_lamps(status: RigStatus) -> list[tuple[str, str]]:
    """Return channel and word of each lamp: quiet, good, overload."""
    last, names = status.last_hit, ("hammer", "sample")
    if status.levels.channels:
        levels = zip(names, status.levels.channels, strict=False)
        return [
            (name, "overload" if it.overloaded else "good" if it.has_hit else "quiet")
            for name, it in levels
        ]
    if last is None:
        return []
    is_overload = any(item.reason is Reason.OVERLOAD for item in last.reasons)
    peaks, scales = (last.hammer_peak, last.specimen_peak), (*status.full_scales, 0.0, 0.0)
    lamps = []
    for name, peak, full_scale in zip(names, peaks, scales, strict=False):
        is_over = is_overload and not peak < OVERLOADED * full_scale
        lamps.append((name, "overload" if is_over else "quiet" if math.isnan(peak) else "good"))
    return lamps


def say_verdict(hit: HitResults) -> str:
    """Return the verdict on a hit, with all its reasons."""
    return "accepted" if hit.accepted else f"rejected: {join_findings(hit.reasons)}"


def say_by_hand(hit: HitResults) -> str:
    """Return a person's verdict on a hit, with who and why; empty: there is none."""
    told = (*hit.reasons, *hit.findings)
    return "; ".join(item.explanation for item in told if item.reason is Reason.OPERATOR)


def _list_marks(status: RigStatus) -> dict[str, list[str]]:
    """Return the last hits of each sample: accepted, rejected, or empty for one to come."""
    marks = {count.sample: list[str]() for count in status.list_samples()}
    for hit in status.hits.values():
        mark = "accepted" if hit.accepted else "rejected"
        marks.setdefault(hit.sample, []).append(mark)
    for count in status.list_samples():
        to_come = min(status.campaign.impacts, MOST_MARKS) - count.accepted
        marks[count.sample] = marks[count.sample][-MOST_MARKS:] + [""] * to_come
    return marks


def list_numbers(status: RigStatus, hit: HitResults) -> tuple[tuple[str, str], ...]:
    """Return the figures of a hit: names and texts."""
    load = status.setup.hammer_load if status.setup else math.nan
    stated = status.setup.samples.get_moving_mass(hit.sample) if status.setup else math.nan
    numbers = (
        ("hammer", with_unit(hit.hammer_peak, 1, "m/s²")),
        ("sample", with_unit(hit.specimen_peak, 1, "m/s²")),
        ("force", with_unit(load * hit.hammer_peak, 1, "N")),
        ("τp", with_unit(hit.contact_time * MICRO, 2, "µs")),
        ("momenta", format_number(stated / hit.sample_mass, 3)),
        ("impact speed", with_unit(1e3 * _compute_speed(status, hit), 1, "mm/s")),
        ("off its series", with_unit(status.compute_deviation(hit), 1, "times its scatter")),
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


def _measure_strength(status: RigStatus, hit: HitResults) -> Strength | None:
    if status.setup is None or not status.full_scale or math.isnan(hit.hammer_peak):
        return None
    analysis, percent = status.setup.analysis, round(100.0 * hit.hammer_peak / status.full_scale)
    least, most = round(100.0 * analysis.minimum_peak), round(100.0 * analysis.maximum_peak)
    is_weak = any(finding.reason is Reason.WEAK for finding in hit.reasons)
    found = "weak" if is_weak else "overload" if percent > most else "good"
    return Strength(percent, least, most, found)


def _list_inputs(status: RigStatus) -> list[tuple[str, int, bool, list[str]]]:
    """Return name, part of the range reached now [%], overload and numbers of each channel."""
    now = [level.peak for level in status.levels.channels] or [0.0, 0.0]
    rows = []
    for name, level, peak in zip(("hammer", "sample"), _list_levels(status), now, strict=False):
        percent = round(100.0 * peak / level.full_scale) if level.full_scale else 0
        suited = suggest_range(level.peak) if level.has_hit else math.nan
        noise, full_scale = level.noise or math.nan, level.full_scale or math.nan
        values = (level.zero, noise, level.peak, full_scale, suited)
        texts = [with_unit(value, 1, "m/s²") for value in values]
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


def with_unit(value: float, digits: int, unit: str) -> str:
    """Return a figure with its unit; no unit where there is no figure."""
    text = format_number(value, digits)
    return text if text == MISSING else f"{text} {unit}"


def _tabulate(status: RigStatus) -> tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Return the table of results so far: headers and rows."""
    setup = status.setup
    names = setup.samples.names if setup else ()
    samples = tuple(status.estimates[name] for name in names if name in status.estimates)
    if setup is None or not samples:
        return (), ()
    results = Results(setup, HammerEstimate(), samples, tuple(status.hits.values()))
    table, *_ = tabulate_summary(results)
    return tuple(column.header for column in table.columns), tuple(table.rows)


def format_clock(moment: float) -> str:
    """Return the local time of day at the rig."""
    if math.isnan(moment):
        return "?"
    return datetime.fromtimestamp(moment).astimezone().strftime("%H:%M:%S")


_TEXTS = (say_verdict, say_by_hand, word, advise, with_unit, format_clock)
TEXTS = {function.__name__: function for function in _TEXTS}
"""Functions that put a hit into words, for the templates."""
