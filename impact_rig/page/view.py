"""What the page shows of a rig: one sentence, and the tables beside it."""

import math
from dataclasses import dataclass
from datetime import datetime

from impact_rig.core.findings import Reason, join_findings
from impact_rig.core.paper_method import HammerEstimate
from impact_rig.page.states import NO_HAMMER, HammerStatus, Step, Task
from impact_rig.page.status import RigStatus
from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.numbers import MICRO, MISSING, format_number
from impact_rig.results.tables import tabulate_summary

LONGEST_LIST = 100
"""Most hits that are listed, the newest [-]."""
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
"""What a person can do so that the next hit is accepted."""


@dataclass(frozen=True)
class Sentence:
    """What a person reads from three metres."""

    kind: str  # its colour: wait, go, ask, good, bad, paused, stopped, done
    headline: str
    detail: str = ""
    until: int | None = None  # [ms since the epoch]; None: there is no limit


@dataclass(frozen=True)
class ShownSample:
    """A line of the list of samples."""

    name: str
    is_control: bool
    is_current: bool
    accepted: int
    wanted: int
    rejected: int
    marks: tuple[str, ...]  # accepted, rejected, or "" for one to come

    @property
    def is_done(self) -> bool:
        """Whether it has its hits."""
        return 0 < self.wanted <= self.accepted


@dataclass(frozen=True)
class ShownHit:
    """One hit in words and numbers."""

    record: int
    sample: str
    accepted: bool
    verdict: str
    advice: str
    peak: str
    contact_time: str
    numbers: tuple[tuple[str, str], ...]
    overruled: str  # by whom and why; empty: by nobody


@dataclass(frozen=True)
class Strength:
    """How strong a hit was, and has to be [% of the range]."""

    percent: int
    least: int
    most: int


@dataclass(frozen=True)
class View:
    """Everything that the page shows, but for traces."""

    is_simulated: bool | None  # None: no accelerometers have reported
    origin: str
    sentence: Sentence
    stopped: str  # beside STOP, once it was pressed
    samples: tuple[ShownSample, ...]
    choices: tuple[str, ...]  # samples that a campaign may have
    to_mount: str
    hit: ShownHit | None
    hits: tuple[ShownHit, ...]  # the newest first
    strength: Strength | None  # of the last hit; None: the range is not known
    mass: str  # of the sample by the traces, beside the stated one; empty: not known
    mass_differs: bool
    hammer: HammerStatus
    hammer_rows: tuple[tuple[str, str], ...]
    is_running: bool
    is_paused_by_hand: bool
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    health: tuple[tuple[str, str], ...]


def make_view(status: RigStatus, disk: str = "") -> View:
    """Return what the page shows now.

    Parameters
    ----------
    status : RigStatus
        What the rig has said.
    disk : str
        Room left for the recording, in words; empty: not known.
    """
    campaign, hammer = status.campaign, status.hammer
    last = status.last_hit
    hits = sorted(status.hits.values(), key=lambda hit: -hit.record)[:LONGEST_LIST]
    columns, rows = _tabulate(status)
    return View(
        is_simulated=None if status.acquisition is None else status.acquisition.hammerless,
        origin=_describe_origin(status),
        sentence=make_sentence(status),
        stopped=_describe_stop(status),
        samples=_show_samples(status),
        choices=status.setup.samples.names if status.setup else (),
        to_mount=campaign.sample if campaign.task is Task.MOUNT else "",
        hit=None if last is None else _show_hit(status, last),
        hits=tuple(_show_hit(status, hit) for hit in hits),
        strength=None if last is None else _measure_strength(status, last),
        mass="" if last is None else _weigh(status, last),
        mass_differs=last is not None and _is_other_sample(last),
        hammer=hammer,
        hammer_rows=(
            ("where", "unknown" if hammer is NO_HAMMER else hammer.state.name.lower()),
            ("armed", _describe_arming(hammer)),
        ),
        is_running=campaign.is_running,
        is_paused_by_hand=campaign.task is Task.RESUME,
        columns=columns,
        rows=rows,
        health=_describe_health(status, disk),
    )


def make_sentence(status: RigStatus) -> Sentence:
    """Return what a person is to know and do first."""
    if status.hammer.is_stopped:
        detail = f"{status.hammer.message}. To go on: reset, then arm."
        return Sentence("stopped", "STOPPED", detail)
    if status.campaign.task is not Task.NOTHING:
        return _say_task(status)
    return _say_step(status)


def _say_task(status: RigStatus) -> Sentence:
    """Return what a campaign asks of a person."""
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
    """Return what a campaign does by itself."""
    campaign, last = status.campaign, status.last_hit
    match campaign.state:
        case Step.PAUSED | Step.DISARMING:
            return Sentence("paused", "PAUSED", campaign.message)
        case Step.COMPLETE:
            return Sentence("done", "DONE", "Every sample has its hits.")
        case Step.ENDED:
            return _say_end(status)
        case Step.STRIKING:
            return Sentence("wait", "KEEP AWAY", f"The hammer swings. {_say_place(status)}")
    if last is None:
        return Sentence("wait", "WAIT", "The rig prepares the first hit.")
    kind, word = ("good", "ACCEPTED") if last.accepted else ("bad", "REJECTED")
    return Sentence(kind, word, _say_place(status) if last.accepted else _advise(last))


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
    return place if last is None else f"{place} {_say_verdict(last)}"


def _say_verdict(hit: HitResults) -> str:
    return "The last one was good." if hit.accepted else f"The last one: {_advise(hit)}."


def _say_by_hand(hit: HitResults) -> str:
    """Return what a person made of a hit, who and why; empty: nobody did."""
    told = (*hit.reasons, *hit.findings)
    return "; ".join(item.explanation for item in told if item.reason is Reason.OPERATOR)


def _is_other_sample(hit: HitResults) -> bool:
    return any(item.reason is Reason.OTHER_SAMPLE for item in hit.findings)


def _advise(hit: HitResults) -> str:
    """Return what to do after a rejected hit."""
    known = [ADVICE[item.reason] for item in hit.reasons if item.reason in ADVICE]
    return known[0] if known else join_findings(hit.reasons)


def _show_samples(status: RigStatus) -> tuple[ShownSample, ...]:
    campaign = status.campaign
    control = status.setup.samples.control_sample if status.setup else ""
    marks: dict[str, list[str]] = {}
    for hit in status.hits.values():
        marks.setdefault(hit.sample, []).append("accepted" if hit.accepted else "rejected")
    return tuple(
        ShownSample(
            name=count.sample,
            is_control=count.sample == control,
            is_current=campaign.is_running and count.sample == campaign.sample,
            accepted=count.accepted,
            wanted=campaign.impacts,
            rejected=count.rejected,
            marks=(
                *marks.get(count.sample, ())[-40:],
                *[""] * max(0, min(campaign.impacts, 40) - count.accepted),
            ),
        )
        for count in status.list_samples()
    )


def list_numbers(status: RigStatus, hit: HitResults) -> tuple[tuple[str, str], ...]:
    """Return what is known of a hit in numbers: names and texts."""
    mass = status.setup.hammer_mass if status.setup else math.nan
    numbers = (
        ("hammer", _with_unit(hit.hammer_peak, 1, "m/s²")),
        ("sample", _with_unit(hit.specimen_peak, 1, "m/s²")),
        ("force", _with_unit(mass * hit.hammer_peak, 1, "N")),
        ("τp", _with_unit(hit.contact_time * MICRO, 2, "µs")),
        ("off its series", _with_unit(status.compute_deviation(hit), 1, "times its scatter")),
    )
    return tuple((name, text) for name, text in numbers if text != MISSING)


def _show_hit(status: RigStatus, hit: HitResults) -> ShownHit:
    return ShownHit(
        record=hit.record,
        sample=hit.sample,
        accepted=hit.accepted,
        verdict="accepted" if hit.accepted else f"rejected: {join_findings(hit.reasons)}",
        advice="" if hit.accepted else _advise(hit),
        peak=_with_unit(hit.hammer_peak, 1, "m/s²"),
        contact_time=_with_unit(hit.contact_time * MICRO, 2, "µs"),
        numbers=list_numbers(status, hit),
        overruled=_say_by_hand(hit),
    )


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
    return Strength(
        round(100.0 * hit.hammer_peak / status.full_scale),
        round(100.0 * analysis.minimum_peak),
        round(100.0 * analysis.maximum_peak),
    )


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


def _describe_stop(status: RigStatus) -> str:
    """Return since when the hammer is stopped, and by whom; empty: it is not."""
    if not status.hammer.is_stopped:
        return ""
    who = f", by {status.stopped_by}" if status.stopped_by else ""
    return f"since {_format_clock(status.hammer.since)}{who}"


def _describe_arming(hammer: HammerStatus) -> str:
    if hammer.armed:
        return f"yes, since {_format_clock(hammer.since)}"
    return f"no: {hammer.message}"


def _describe_origin(status: RigStatus) -> str:
    acquisition = status.acquisition
    if acquisition is None:
        return ""
    if acquisition.hammerless:
        return f"SIMULATED: {acquisition.source}, no hammer strikes"
    return f"MEASURED: {acquisition.source}"


def _describe_health(status: RigStatus, disk: str) -> tuple[tuple[str, str], ...]:
    recorder = status.recorder
    rows = [
        ("recording", recorder.uri if recorder.recording else f"nothing: {recorder.message}"),
        ("disk", disk),
        ("lost", f"{recorder.messages_lost} messages"),
        ("nodes", "; ".join(status.list_troubles())),
    ]
    return tuple((name, text) for name, text in rows if text)


def _format_clock(moment: float) -> str:
    """Return the local time of day at the rig."""
    if math.isnan(moment):
        return "?"
    return datetime.fromtimestamp(moment).astimezone().strftime("%H:%M:%S")
