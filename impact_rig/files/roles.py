"""Roles of a file's channels, hammer, sample or time: one rule for all formats.

What the user says goes first. Else names and units decide::

    channels of the file              roles
    Time, Force [N], Acc [g]          the one force is the hammer's, the acceleration the sample's
    hammer, response                  by name
    ch1 [g], ch2 [g]                  neither says anything: by place, the first is the hammer's
    hammer, acc1 [g], acc2 [g]        the hammer's by name; which is the sample's is asked
    ch1, ch2, ch3                     asked: which is the hammer's?
    hit1/hammer, hit2/hammer          groups that differ by a number alone are a hit each
"""

import json
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, zip_longest
from operator import contains

from impact_rig.core.given.errors import ParameterError, SignalError
from impact_rig.files.measurement import MeasuredChannel, Measurement
from impact_rig.files.names import PARTS, Measured, find_kind, find_unit, says_hammer, says_sample
from impact_rig.files.plan import ROLES, ChannelPlan, ChannelUse
from impact_rig.files.questions import CHOICE, SHOWN_CHANNELS, Missing, Questions, list_channels
from impact_rig.files.times import (
    LARGEST_TIME_ERROR,
    TIME_UNITS,
    Axis,
    find_axis,
    find_time_unit,
    is_clock,
)

NUMBER = re.compile(r"\d+")
SEGMENT = re.compile(r" \(segment (\d+)\)$")
"""Behind the names of LabVIEW's later segments."""
EXPORTED = re.compile(r"(.+)/\d+\.\d+ hammer")
"""Name of a hit's channel in our own exports, behind that of its sample."""
HAMMER_OPTION, SAMPLE_OPTION = "--hammer-channel", "--sample-channel"
"""Options that choose a channel on the command line."""
Channels = Sequence[MeasuredChannel]


@dataclass(frozen=True)
class Roles:
    """The channels of one hit."""

    hammer: MeasuredChannel
    specimen: MeasuredChannel | None = None  # None: there is none, or it is open
    time: MeasuredChannel | None = None  # None: the file states the rate, or nothing does
    by_place: bool = False  # neither names nor units nor the user say which is which
    open: tuple[str, ...] = ()  # names of channels of which each may be the sample's

    def list_channels(self) -> list[tuple[str, MeasuredChannel]]:
        """Return role and channel of those that there are."""
        roles = (("hammer", self.hammer), ("specimen", self.specimen), ("time", self.time))
        return [(role, channel) for role, channel in roles if channel is not None]


def assign_roles(questions: Questions, plan: ChannelPlan) -> list[Roles]:
    """Return the channels of each hit.

    Parameters
    ----------
    questions : Questions
        Of the file; gets another if it is open which channel is the hammer's.
    plan : ChannelPlan
        What the user says.

    Returns
    -------
    list of Roles
        One for each channel of the hammer; where that is asked for, by place.

    Raises
    ------
    SignalError, ParameterError
        If the file has no channel of values, or not those that the user names.
    """
    measurement = questions.measurement
    if plan.columns is not None:
        return _assign_columns(measurement, plan.columns)
    time = find_clock(measurement.channels)
    _check_clocks(measurement)
    named = _find_by_name(measurement, plan.specimen.channel) if plan.specimen.channel else []
    if plan.hammer.channel:
        hammers = _find_by_name(measurement, plan.hammer.channel)
        time = None if time in (*hammers, *named) else time
        return _pair(measurement, plan, hammers, named, time)
    others = [
        channel
        for channel in measurement.channels
        if _is_of_numbers(channel) and channel not in (time, *named)
    ]
    candidates = [channel for channel in others if not is_clock(channel.values)] or others
    if not candidates:
        raise _refuse_nothing(measurement, time)
    hammers = _choose_hammers(candidates)
    if not hammers:
        questions.missing.append(_ask_for_hammer(measurement, candidates))
        return [Roles(candidates[0], time=time)]
    if named:
        return _pair(measurement, plan, hammers, named, time)
    groups = _group(candidates) if len(hammers) > 1 else [candidates]
    return [
        _add_specimen(hammer, group, time) for hammer, group in zip(hammers, groups, strict=True)
    ]


def find_clock(channels: Channels) -> MeasuredChannel | None:
    """Return the channel with the times of the others, if the file does not state their rate.

    One that is called so goes before one that never falls, this before one that counts, and all
    before one of frequencies.
    """
    if not any(math.isnan(channel.sampling_rate) for channel in channels):
        return None
    ranks: dict[Axis | None, int] = {Axis.TIME: 0, None: 1, Axis.COUNT: 2, Axis.FREQUENCY: 3}
    found: list[tuple[int, int]] = []
    for place, channel in enumerate(channels):
        if channel.flaw or channel.values.size <= 1:
            continue
        axis = find_axis(channel.name, channel.unit)
        if axis is Axis.TIME or is_clock(channel.values):
            is_index = axis is None and _is_index(channel)
            found.append((ranks[Axis.COUNT if is_index else axis], place))
    if not found and len(channels) > 1 and _is_constant(channels[0]):  # times to too few digits
        return channels[0]
    return channels[min(found)[1]] if found else None


def _check_clocks(measurement: Measurement) -> None:
    """Raise `SignalError` if there are two columns of times that differ: each has its channels.

    Times beside each other may be those of the record and those of the day.
    """
    clocks = [
        (place, channel)
        for place, channel in enumerate(measurement.channels)
        if find_axis(channel.name, channel.unit) is Axis.TIME and is_clock(channel.values)
    ]
    for (before, first), (place, other) in pairwise(clocks):
        units = [find_time_unit(it.name, it.unit) for it in (first, other)]
        if units[0] != units[1] and "" in units:  # they may be the same times
            continue
        begins, ends = (
            [
                TIME_UNITS.get(unit, 1.0) * float(it.values[at])
                for it, unit in zip((first, other), units, strict=True)
            ]
            for at in (0, -1)
        )
        length, delay = ends[0] - begins[0], abs(begins[1] - begins[0])
        are_apart = delay > LARGEST_TIME_ERROR * length / max(first.values.size - 1, 1)
        is_of_day = place == before + 1 and delay > length
        is_as_long = math.isclose(length, ends[1] - begins[1], rel_tol=1e-3)
        if is_as_long and (is_of_day or not are_apart):
            continue
        apart = f", which start {delay:g} s apart" if are_apart else ""
        raise SignalError(
            f"{measurement.path} has times in {first.name!r} and others in {other.name!r}{apart}:"
            " make a file of each with the channels that go with it, or name the one that holds"
            " for all (columns)"
        )


def _is_constant(channel: MeasuredChannel) -> bool:
    values = channel.values
    return values.size > 1 and values[0] > 0 and bool((values == values[0]).all())


def _is_index(channel: MeasuredChannel) -> bool:
    """Return whether a column counts its points from 0 or 1, as tables of pandas have one."""
    first, last = float(channel.values[0]), float(channel.values[-1])
    return first in (0.0, 1.0) and last - first == channel.values.size - 1


def _is_of_numbers(channel: MeasuredChannel) -> bool:
    """Return whether a channel is neither an axis nor of words; a damaged one is refused later."""
    is_axis = bool(channel.flaw) and find_axis(channel.name, channel.unit) is not None
    return not is_axis and bool(channel.values.size or not channel.flaw)


def _choose_hammers(candidates: Channels) -> list[MeasuredChannel]:
    """Return the channel of the hammer, one of each hit; empty: that is open."""
    forces = [channel for channel in candidates if _get_kind(channel) is Measured.FORCE]
    found = [channel for channel in candidates if says_hammer(channel.name)]
    if len(found) > 1:  # a hammer with two sensors is measured by its force
        found = [channel for channel in found if channel in forces] or found
    found = found or [channel for channel in forces if not says_sample(channel.name)]
    if len(found) > 1:
        groups = _group(candidates)
        is_one_each = len(groups) == len(found) and all(map(contains, groups, found))
        return found if is_one_each else []
    pair = _list_pair(candidates)
    others = [channel for channel in pair if not says_sample(channel.name)]
    if found or len(others) == 1:
        return found or others
    return pair[:1] if len(pair) <= 2 else []  # noqa: PLR2004 - a pair, by place


def _list_pair(candidates: Channels) -> list[MeasuredChannel]:
    """Return the accelerations if nothing else was taken with them, else all."""
    moved = [channel for channel in candidates if _get_kind(channel) is Measured.ACCELERATION]
    rest = [channel for channel in candidates if channel not in moved]
    is_alone = len(moved) > 1 and not any(_fits(moved[0], channel) for channel in rest)
    return moved if is_alone else [*candidates]


def _is_by_place(candidates: Channels) -> bool:
    """Return whether of two channels neither name nor unit says which is the hammer's."""
    says = [
        says_hammer(channel.name) or _get_kind(channel) is Measured.FORCE for channel in candidates
    ]
    pair = _list_pair(candidates)
    samples = sum(says_sample(channel.name) for channel in pair)
    return len(pair) == 2 and not any(says) and samples != 1  # noqa: PLR2004 - a pair


def _group(channels: Channels) -> list[list[MeasuredChannel]]:
    """Return the channels of each hit: those of groups whose names differ by a number alone."""
    groups: dict[str, list[MeasuredChannel]] = {}
    for channel in channels:
        segment = SEGMENT.search(channel.name)
        group = segment[1] if segment else ".".join(PARTS.split(channel.name)[:-1])
        groups.setdefault(group, []).append(channel)
    is_numbered = len({NUMBER.sub("", group) for group in groups}) == 1
    return [*groups.values()] if is_numbered else [[*channels]]


def _add_specimen(hammer: MeasuredChannel, group: Channels, time: MeasuredChannel | None) -> Roles:
    """Return the roles with the sample's channel, if one is called so or is all that is left."""
    if _is_by_place(group):
        return Roles(hammer, _list_pair(group)[1], time, by_place=True)
    rest = [item for item in group if item is not hammer and not says_hammer(item.name)]
    usable = [item for item in rest if _get_kind(item) not in (Measured.FORCE, Measured.OTHER)]
    named = [item for item in usable if says_sample(item.name)]
    moved = [item for item in named or usable if _get_kind(item) is Measured.ACCELERATION]
    found = moved or named or [item for item in usable if _fits(hammer, item)]
    if len(found) > 1:
        found = [item for item in found if _fits(hammer, item)] or found
    if len(found) == 1:
        return Roles(hammer, found[0], time)
    return Roles(hammer, None, time, open=tuple(item.name for item in found))


def _fits(hammer: MeasuredChannel, channel: MeasuredChannel) -> bool:
    """Return whether a channel has the points and the rate of the hammer's."""
    rates = hammer.sampling_rate, channel.sampling_rate
    return hammer.values.size == channel.values.size and (
        rates[0] == rates[1] or all(map(math.isnan, rates))
    )


def _get_kind(channel: MeasuredChannel) -> Measured:
    return find_kind(channel.name, channel.unit or find_unit(channel.name))


def _ask_for_hammer(measurement: Measurement, candidates: Channels) -> Missing:
    channels = measurement.channels
    for channel in channels:
        if exported := EXPORTED.fullmatch(channel.name):
            hammer, sample = (f"{exported[1]}/*.* {body}" for body in ("hammer", "specimen"))
            what = (
                f"it holds {len(channels)} channels of hits that were exported for other programs:"
                " analyze the recording itself, or the hits of one sample"
            )
            advice = f"{HAMMER_OPTION} {hammer!r} {SAMPLE_OPTION} {sample!r}"
            return Missing(what, CHOICE, "hammer", advice)
    likely = max(candidates, key=_rank_as_hammer)
    is_alone = [channel.name for channel in channels].count(likely.name) == 1
    number = channels.index(likely) + 1
    advice = f"{HAMMER_OPTION} {likely.name if is_alone else str(number)!r}"
    roles = ", ".join(map(json.dumps, guess_roles(channels)[:SHOWN_CHANNELS]))
    if len(channels) > SHOWN_CHANNELS:
        roles += ", …"
    what = (
        f"neither names nor units say which of its {len(channels)} channels is the hammer's:"
        f" {list_channels(measurement)}. If several are, each is a hit: columns = [{roles}] gives"
        f" the role of each ({', '.join(ROLES)})"
    )
    return Missing(what, CHOICE, "hammer", advice)


def _rank_as_hammer(channel: MeasuredChannel) -> int:
    """Return how likely a channel is the hammer's, by its name and unit."""
    kind = _get_kind(channel)
    if says_sample(channel.name) or kind is Measured.OTHER:
        return 0
    return 1 + (kind is Measured.FORCE) + says_hammer(channel.name)


def ask_for_specimen(roles: Roles) -> Missing:
    """Return the question which of several channels is the sample's."""
    names = ", ".join(map(repr, roles.open))
    what = f"which channel is the sample's is open: {names}"
    return Missing(what, CHOICE, "specimen", f"{SAMPLE_OPTION} {roles.open[0]!r}")


def describe_roles(roles: Roles, plan: ChannelPlan, *, has_sample: bool) -> str:
    """Return in one line which channel was taken as what, with its unit, and what is open."""
    hammer = _describe_taken("hammer", roles.hammer, plan.hammer)
    parts = [hammer, "no channel of the sample"]
    if roles.specimen is not None and has_sample:
        parts[1] = _describe_taken("sample", roles.specimen, plan.specimen)
    elif roles.open:
        parts[1] = f"which is the sample's is open: {', '.join(map(repr, roles.open))}"
        parts[1] += f" ({SAMPLE_OPTION})"
    if roles.by_place:
        parts.append(f"by their places ({HAMMER_OPTION} and {SAMPLE_OPTION} change that)")
    return ", ".join(parts)


def _describe_taken(body: str, channel: MeasuredChannel, use: ChannelUse) -> str:
    unit = use.unit or channel.unit or find_unit(channel.name)
    unit = unit or ("V" if use.sensitivity else "unit not stated")
    return f"{body} {channel.name!r} [{unit}]"


def guess_roles(channels: Channels) -> list[str]:
    """Return a role for each channel as a proposal, by place."""
    time = find_clock(channels)
    left = ["hammer", "specimen"]

    def guess(channel: MeasuredChannel) -> str:
        is_free = left and not channel.flaw and not is_clock(channel.values)
        return "time" if channel is time else left.pop(0) if is_free else "skip"

    return [guess(channel) for channel in channels]


def _refuse_nothing(measurement: Measurement, time: MeasuredChannel | None) -> SignalError:
    flawed = next((channel for channel in measurement.channels if channel.flaw), None)
    if flawed is not None:
        return SignalError(
            f"{measurement.path}, {flawed.flaw}: {flawed.name!r} is not of numbers, and no other"
            " channel has values"
        )
    times = measurement.channels[0] if time is None else time
    return SignalError(
        f"{measurement.path} has no values beside its times {times.name!r}: no channel goes up and"
        " down"
    )


def _assign_columns(measurement: Measurement, roles: tuple[str, ...]) -> list[Roles]:
    channels = measurement.channels
    if len(roles) != len(channels):
        raise SignalError(
            f"{measurement.path} has {len(channels)} columns, but {len(roles)} roles are given:"
            f" {', '.join(roles)}"
        )
    of: dict[str, list[MeasuredChannel]] = {role: [] for role in ROLES}
    for role, channel in zip(roles, channels, strict=True):
        of[role].append(channel)
    time = next(iter(of["time"]), None)
    return [Roles(*pair, time) for pair in zip_longest(of["hammer"], of["specimen"])]


def _pair(
    measurement: Measurement,
    plan: ChannelPlan,
    hammers: Channels,
    specimens: Channels,
    time: MeasuredChannel | None,
) -> list[Roles]:
    """Return the channels of each hit: the first of both make the first; samples may be none."""
    if specimens and len(specimens) != len(hammers):
        raise ParameterError(
            f"{measurement.path}: {plan.hammer.channel or 'the hammers'!r} are"
            f" {len(hammers)} channels and {plan.specimen.channel!r} are {len(specimens)}:"
            " each hit needs one of both"
        )
    if set(hammers) & set(specimens):
        raise ParameterError(
            f"{measurement.path}: {plan.hammer.channel!r} and {plan.specimen.channel!r} are the"
            " same channel: hammer and sample have one each"
        )
    return [Roles(*pair, time) for pair in zip_longest(hammers, specimens)]


def _find_by_name(measurement: Measurement, name: str) -> list[MeasuredChannel]:
    """Return the channel of a name or a number, or all that fit a pattern with * or ?."""
    channels = measurement.channels
    same = [channel for channel in channels if channel.name == name]
    if len(same) > 1:
        raise SignalError(
            f"{measurement.path} has {len(same)} channels {name!r}: name one by its number"
        )
    if not same and name.isdecimal() and 1 <= int(name) <= len(channels):
        same = [channels[int(name) - 1]]
    pattern = re.compile(re.escape(name).replace(r"\*", ".*").replace(r"\?", "."))
    if found := same or [channel for channel in channels if pattern.fullmatch(channel.name)]:
        return found
    raise SignalError(
        f"{measurement.path} has no channel {name!r}: it has {list_channels(measurement)}"
    )
