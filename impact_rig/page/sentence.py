"""The sentence that a person reads from three metres, in words of the work."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

from impact_rig.core.given.findings import Reason, join_findings
from impact_rig.results.campaign import HitResults
from impact_rig.status.rig_status import RigStatus
from impact_rig.status.states import NO_HAMMER, CampaignStatus, Step, Task

UNCONFIRMED = 1.0
"""How long a stop may wait for the hammer's word before a person is sent to the switch [s]."""
CATCH, PULL_BACK = 2.0, 5.0
"""By hand, until when after a hit the hammer is caught, then pulled back [s], our choice."""
READ_REJECTION = 4.0
"""How long a rejected hit is the headline while the next one is asked for [s], our choice."""
LONGEST_MESSAGE = 300
"""Most characters that are shown of what a node says [-]."""
SWITCH = "keep away, use the switch"
SILENT: Mapping[str, tuple[str, str]] = {
    "hammer": (
        f"THE HAMMER DOES NOT ANSWER: {SWITCH}",
        "What it does is not known. STOP here may not reach it.",
    ),
    "campaign": ("THE RIG DOES NOT ANSWER: keep away", "Nobody leads the campaign. Press STOP."),
    "estimator": ("NO VERDICTS: keep away", "The analysis of the hits does not answer."),
    "recorder": ("NOTHING IS RECORDED: keep away", "The recorder does not answer."),
    "accelerometer": ("THE SENSORS DO NOT ANSWER: keep away", "Look at their device and cable."),
}
"""Headline and detail when a node does not answer."""
WORDS: Mapping[Reason, tuple[str, str]] = {
    Reason.NO_TRIGGER: (
        "nothing recorded",
        "nothing was recorded: strike harder, or lower the trigger level",
    ),
    Reason.DISARMED: (
        "disarmed",
        "the hammer was disarmed before the contact: it does not count",
    ),
    Reason.GAP: ("points lost", "points were lost: strike again, and see to the computer's load"),
    Reason.DEAD_CHANNEL: ("no signal", "see to the cable of the channel"),
    Reason.NO_PULSE: ("no pulse", "nothing was struck: see to hammer and cable"),
    Reason.OVERLOAD: ("overload", "strike more gently, or set a larger range"),
    Reason.STRONG: ("too strong", "strike more gently"),
    Reason.WEAK: ("too weak", "strike harder, or lower the least peak in the rig file"),
    Reason.DOUBLE_HIT: (
        "second contact",
        "a second contact: strike more gently, and let the sample swing free",
    ),
    Reason.ZERO_SHIFT: ("zero shifted", "see to the sensor's mount"),
    Reason.DRIFT: ("drift", "let the sensor settle; see to its cable"),
    Reason.RINGING: ("ringing", "see to the sensor's mount"),
    Reason.POLARITY: (
        "turned round",
        "a sensor or cable was turned round since the first hit",
    ),
    Reason.INCONSISTENT: (
        "unlike the others",
        "unlike the other hits of this sample: see to sample and mount",
    ),
    Reason.OTHER_KIND: (
        "other settings",
        "recorded unlike the first hit of this sample: end the campaign",
    ),
    Reason.COPY: ("a copy", "end the campaign: the source repeats what it delivered"),
    Reason.OPERATOR: ("by hand", ""),
}
"""Why a hit is rejected, in a word or two, and what to do so that the next one is accepted."""


@dataclass(frozen=True)
class Sentence:
    """The sentence, its colour and for how long it holds."""

    kind: str  # its colour: wait, go, ask, good, bad, paused, stopped, done
    headline: str
    detail: str = ""
    until: int | None = None  # [ms since the epoch]; None: there is no limit
    is_countdown: bool = False  # any key holds the hammer back

    @property
    def key(self) -> tuple[str, str]:
        """What makes it another sentence."""
        return self.kind, self.headline


def make_sentence(status: RigStatus) -> Sentence:
    """Return the sentence that a person needs first: from the ages first, then from the states."""
    if alarm := _say_alarm(status):
        return alarm
    if status.campaign.task is not Task.NOTHING:
        return _say_task(status)
    if status.campaign.is_running:
        return _say_step(status)
    end = _say_end(status)
    if not status.hammer.needs_person:
        return end
    if end.kind == "wait":  # for a campaign
        return Sentence("paused", "ARM FIRST", "The hammer is disarmed. Arm it, then start.")
    # What was reached stays in sight.
    return replace(end, headline=f"{end.headline}. ARM FIRST")


def _say_alarm(status: RigStatus) -> Sentence | None:
    """Return what goes before all else: silence, a stop, or one without an answer."""
    silent = status.list_silent()
    if "hammer" in silent:
        return Sentence("bad", *SILENT["hammer"])
    if status.hammer.is_stopped:
        by = f" by {status.hammer.stopped_by}" if status.hammer.stopped_by else ""
        return Sentence("stopped", "STOPPED", f"Stopped{by}. To go on: reset the stop, then arm.")
    if status.stop_asked_at is not None:
        if status.clock() - status.stop_asked_at > UNCONFIRMED:
            detail = "The hammer has not said that it is stopped."
            return Sentence("bad", f"STOP IS NOT CONFIRMED: {SWITCH}", detail)
        return Sentence("bad", "STOP SENT", "Keep away until the hammer has confirmed it.")
    if silent and (status.campaign.is_running or "campaign" in silent):
        return Sentence("bad", *SILENT[silent[0]])
    return None


def _say_task(status: RigStatus) -> Sentence:
    """Return a campaign's task for a person, as a sentence."""
    campaign = status.campaign
    until = None if math.isnan(campaign.until) else round(campaign.until * 1000)
    message = say_plainly(campaign.message)
    match campaign.task:
        case Task.MOUNT:
            detail = f"{ask_mass(status)} {message or 'Then say so.'}".strip()
            return Sentence("ask", f"MOUNT {campaign.sample}", detail, until)
        case Task.LET_GO:
            return _say_by_hand(status, until)
        case Task.PUT_BACK:
            return Sentence("ask", "PUT THE HAMMER BACK", f"Then say so. {say_place(status)}")
        case Task.KEEP_AWAY:
            detail = "The hammer goes. Any key holds it back."
            return Sentence("bad", "KEEP AWAY", detail, until, is_countdown=True)
        case _ if campaign.task is Task.ARM or status.hammer.needs_person:
            return Sentence("paused", "ARM FIRST", message)
        case _:
            return Sentence("paused", "PAUSED", message)


def _say_by_hand(status: RigStatus, until: int | None) -> Sentence:
    """Return the step of a hit by hand: the hammer must be back before it is let go again."""
    last, since = status.last_hit, status.compute_rest()
    if since < READ_REJECTION and (verdict := _say_verdict(status)).kind == "bad":
        detail = f"Catch the hammer. {verdict.detail[:1].upper()}{verdict.detail[1:]}"
        return replace(verdict, detail=detail)
    if since < CATCH:
        return Sentence("wait", "CATCH", f"Catch the hammer. {say_place(status)}")
    if since < PULL_BACK:
        return Sentence("ask", "PULL BACK and HOLD", say_place(status))
    is_first = last is None or last.sample != status.campaign.sample
    headline = "PULL BACK, then RELEASE" if is_first else "RELEASE"
    return Sentence("go", headline, say_place(status), until)


def _say_step(status: RigStatus) -> Sentence:
    """Return a campaign's step, as a sentence."""
    campaign = status.campaign
    match campaign.state:
        case Step.PAUSED | Step.DISARMING:
            return Sentence("paused", "PAUSED", say_plainly(campaign.message))
        case Step.STRIKING if status.hammer.is_by_hand:
            return Sentence("ask", "PULL BACK and HOLD", say_place(status))
        case Step.STRIKING:
            question = ask_mass(status)
            headline = f"KEEP AWAY. IS THIS {campaign.sample}?" if question else "KEEP AWAY"
            detail = question or f"The hammer swings. {say_place(status)}"
            return Sentence("wait", headline, detail)
        case _:
            return _say_verdict(status)


def _say_verdict(status: RigStatus) -> Sentence:
    last = status.last_hit
    if last is None:
        return Sentence("wait", "WAIT", "The rig prepares the first hit.")
    if question := ask_mass(status):
        return Sentence("bad", f"IS THIS {last.sample}?", question)
    if last.accepted:
        return Sentence("good", "ACCEPTED", say_place(status))
    return Sentence("bad", f"REJECTED: {word(last)}", f"{advise(last)}.")


def _say_end(status: RigStatus) -> Sentence:
    """Return how a campaign has ended, or that the next one may begin."""
    campaign, last = status.campaign, status.last_hit
    if status.is_trial and last is not None:
        verdict = "It would have been accepted" if last.accepted else advise(last)
        return Sentence("done", "TRIAL HIT", f"It does not count. {verdict}.")
    if campaign.state is Step.COMPLETE:
        return _say_complete(campaign)
    if campaign.message:
        return Sentence("paused", "ENDED", say_plainly(campaign.message))
    if status.setup is None or status.hammer is NO_HAMMER:
        return Sentence("wait", "WAIT", "The rig has not said anything yet.")
    return Sentence("wait", "READY", "Choose samples below, and start.")


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


def say_place(status: RigStatus) -> str:
    """Return which hit is next, and how the last one was."""
    campaign, last = status.campaign, status.last_hit
    number = min(campaign.progress.accepted + 1, campaign.impacts)
    place = f"{campaign.sample}, hit {number} of {campaign.impacts}."
    if last is None:
        return place
    how = "The last one was good." if last.accepted else f"The last one: {advise(last)}."
    return f"{place} {how}"


def say_plainly(message: str) -> str:
    """Return what a node says without names of options, services and topics."""
    text = re.sub(r"\s*\([^()]*--[^()]*\)|:? call \w+/\w+( first)?", "", message)
    text = re.sub(r"\bcampaign node\b|\bhammer node\b", lambda it: it[0].partition(" ")[0], text)
    return text[:LONGEST_MESSAGE]


def word(hit: HitResults) -> str:
    """Return why a hit is rejected, in a word or two."""
    known = [WORDS[item.reason][0] for item in hit.reasons if item.reason in WORDS]
    return known[0] if known else join_findings(hit.reasons)


def advise(hit: HitResults) -> str:
    """Return advice after a rejected hit."""
    known = [WORDS[it.reason][1] or it.explanation for it in hit.reasons if it.reason in WORDS]
    return known[0] if known else join_findings(hit.reasons)


def ask_mass(status: RigStatus) -> str:
    """Return what to do about a last hit that looks like one of another sample; empty: it fits."""
    last = status.last_hit
    if last is None or all(it.reason is not Reason.OTHER_SAMPLE for it in last.findings):
        return ""
    return (
        f"{weigh(status)} If {last.sample} is not what was struck: reject the hit, and mount it."
    )


def weigh(status: RigStatus) -> str:
    """Return the sample's mass by the last hit's traces beside the stated one; empty: unknown."""
    last = status.last_hit
    if status.setup is None or last is None or math.isnan(last.sample_mass):
        return ""
    stated = status.setup.samples.get_moving_mass(last.sample)
    return f"Mass by the traces {last.sample_mass * 1e3:.1f} g, stated {stated * 1e3:.1f} g."
