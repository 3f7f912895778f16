"""Measurements of other instruments as one series of hits, and as a recording of it.

A hit was at the time that its file states. One whose file states none, or one before the end of
the hit before, comes `PAUSE` after that end; a series begins with the first time that a file of it
states, or a second after the epoch. So times grow in the order of the files, without a gap of
decades, and the same files make the same recording, byte by byte.
"""

import json
import math
import re
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from impact_rig import __version__
from impact_rig.core.errors import ParameterError, SignalError
from impact_rig.core.origin import IMPORTED, MIXED, SIMULATED, Origin
from impact_rig.core.setup.calibration import (
    FORCES,
    TIME_UNITS,
    UNITS,
    VOLTAGES,
    Sensitivity,
    compute_scale,
    normalize_unit,
)
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.setup.sensors import ROLES, ChannelPlan, ChannelUse
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.detection import PULSE_NOISE, ImpactDetector, find_pulse_start
from impact_rig.core.signals.record import Block, ChannelBlock, HitLabel, RawArray, Trace
from impact_rig.core.signals.stream_cutter import cut_impacts
from impact_rig.recordings.formats.measurement import (
    LARGEST_TIME_ERROR,
    RATE_DIGITS,
    MeasuredChannel,
    Measurement,
    is_clock,
    read_clock,
)
from impact_rig.recordings.formats.registry import read_measurement
from impact_rig.recordings.messages import NANOSECONDS, MessageEncoder
from impact_rig.recordings.new_file import write_new_file
from impact_rig.recordings.provenance import (
    ORIGIN_RECORD,
    PROVENANCE_RECORD,
    compute_sha256,
    describe_origins,
)
from impact_rig.recordings.qos import OfferedQos
from impact_rig.recordings.writer import McapWriter

DEFAULT_ROLES = {1: ("hammer",), 2: ("time", "hammer"), 3: ("time", "hammer", "specimen")}
"""Roles of columns by their number, where none are given and the file states no rate."""
DEFAULT_UNIT = "m/s^2"
"""What a channel is taken for where neither file nor user state a unit."""

LONGEST_WIDTH, LONGEST_STEP = 10e-3, 1e-3
"""Widest pulse at half its height and longest step [s] that are believed of times whose unit
nobody states, our choice: the standard shock of 11 ms is 7 ms wide."""
SHOWN_CHANNELS = 12
"""Of a file whose channels are listed in a message [-], our choice."""
MINIMUM_POINTS = 16
"""Shortest trace that is taken for one [points], our choice: a pulse and some baseline."""

NO_SPECIMEN = ChannelBlock(np.empty(0), 1.0, 0.0, 0.0)
BODIES = {"hammer": "hammer", "specimen": "sample"}
"""What a person calls the body of a role."""


@dataclass(frozen=True)
class MappedChannels:
    """Both channels of one hit as they stand in its file, with their calibration.

    Attributes
    ----------
    sampling_rate : float
        [Hz]
    hammer, specimen : ChannelBlock
        Numbers or counts of the file, bit by bit; the specimen's without points: not measured.
    has_scale : bool
        The hammer's are accelerations; False: forces on an unknown mass, or voltages of an
        unknown sensitivity, as large as these.
    unit : str
        Of what the hammer's sensor measures: m/s^2, N, or V where its sensitivity is not known;
        empty: nobody states it.
    remarks : tuple of str
        What was taken for granted.
    names : tuple of str
        Of the channels in the file.
    stamp : int
        When the hammer's first point was taken, nanoseconds since the epoch; 0: not known.
    origin : str
        Where the hammer's numbers come from, in the file's words; empty: it does not say.
    """

    sampling_rate: float
    hammer: ChannelBlock
    specimen: ChannelBlock = NO_SPECIMEN
    has_scale: bool = True
    unit: str = DEFAULT_UNIT
    remarks: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    stamp: int = 0
    origin: str = ""


def map_channels(
    measurement: Measurement,
    plan: ChannelPlan,
    hammer_mass: float = math.nan,
    *,
    needs_scale: bool = True,
) -> list[MappedChannels]:
    """Find, check and calibrate the channels of each hit.

    Parameters
    ----------
    measurement : Measurement
        As read from its file.
    plan : ChannelPlan
        What the user says of its channels.
    hammer_mass : float
        m1 [kg], which makes accelerations of forces; NaN: not known.
    needs_scale : bool
        Refuse a force without a mass; False: contact times are all that is wanted.

    Returns
    -------
    list of MappedChannels
        One for each channel of the hammer.

    Raises
    ------
    SignalError
        If channels are missing, too short, not finite, of different lengths, rates or starts, or
        time does not run in even steps.
    ParameterError
        If the units do not fit, or the user contradicts the file.
    """
    return [
        _map_hit(measurement.path, found, plan, hammer_mass, needs_scale=needs_scale)
        for found in _assign_roles(measurement, plan)
    ]


def _map_hit(
    path: Path,
    found: dict[str, MeasuredChannel],
    plan: ChannelPlan,
    hammer_mass: float,
    *,
    needs_scale: bool,
) -> MappedChannels:
    for role, channel in found.items():
        _check_values(path, role, channel)
    hammer, specimen = found["hammer"], found.get("specimen")
    if specimen is not None:
        _check_pair(path, hammer, specimen)
    is_force = _is_force(hammer, plan.hammer)
    is_stated = bool(hammer.unit or plan.hammer.unit or plan.hammer.sensitivity)
    is_voltage = not plan.hammer.sensitivity and _is_voltage(hammer, plan.hammer)
    has_scale = needs_scale or (
        is_stated and not is_voltage and not (is_force and math.isnan(hammer_mass))
    )
    mass = hammer_mass if has_scale else 1.0
    unit = "V" if is_voltage else "N" if is_force else DEFAULT_UNIT if is_stated else ""
    return MappedChannels(
        sampling_rate=_choose_rate(path, plan, hammer, found.get("time")),
        hammer=_calibrate(path, "hammer", hammer, plan.hammer, mass, needs_scale=needs_scale),
        specimen=_calibrate(path, "specimen", specimen, plan.specimen, needs_scale=needs_scale)
        if specimen
        else NO_SPECIMEN,
        has_scale=has_scale,
        unit=unit,
        remarks=tuple(
            remark
            for role, use in (("hammer", plan.hammer), ("specimen", plan.specimen))
            if role in found
            for remark in _note_unit(BODIES[role], found[role], use)
        ),
        names=tuple(found[role].name for role in BODIES if role in found),
        stamp=hammer.stamp,
        origin=hammer.origin,
    )


def _assign_roles(measurement: Measurement, plan: ChannelPlan) -> list[dict[str, MeasuredChannel]]:
    """Return the channels of each hit by their roles."""
    channels, path = measurement.channels, measurement.path
    if plan.hammer.channel:
        return _assign_named(measurement, plan)
    if plan.columns is not None:
        if len(plan.columns) != len(channels):
            raise SignalError(
                f"{path} has {len(channels)} columns, but {len(plan.columns)} roles are given:"
                f" {', '.join(plan.columns)}"
            )
        roles = plan.columns
    elif not math.isnan(channels[0].sampling_rate):
        roles = ("hammer", "specimen")
    elif not math.isnan(plan.sampling_rate) and not is_clock(channels[0].values):
        roles = ("hammer", "specimen")[: len(channels)]
    else:
        roles = DEFAULT_ROLES.get(len(channels), ())
    if not roles or (math.isnan(channels[0].sampling_rate) and len(channels) > len(roles)):
        raise SignalError(_ask_for_roles(measurement))
    # More channels than roles: a file that states rates may hold what is of no use here.
    of: dict[str, list[MeasuredChannel]] = {role: [] for role in ROLES}
    for role, channel in zip(roles, channels, strict=False):
        of[role].append(channel)
    return _pair(of["hammer"], of["specimen"], of["time"])


def _pair(
    hammers: list[MeasuredChannel], specimens: list[MeasuredChannel], times: list[MeasuredChannel]
) -> list[dict[str, MeasuredChannel]]:
    """Return the channels of each hit by their roles: the first of each make the first."""
    roles: dict[str, list[MeasuredChannel]] = {
        "time": times * len(hammers),
        "hammer": hammers,
        "specimen": specimens,
    }
    given = {role: channels for role, channels in roles.items() if channels}
    return [
        dict(zip(given, channels, strict=True)) for channels in zip(*given.values(), strict=True)
    ]


def _assign_named(measurement: Measurement, plan: ChannelPlan) -> list[dict[str, MeasuredChannel]]:
    hammers, specimens = (
        _find_by_name(measurement, use.channel) if use.channel else []
        for use in (plan.hammer, plan.specimen)
    )
    if specimens and len(specimens) != len(hammers):
        raise ParameterError(
            f"{measurement.path}: {plan.hammer.channel!r} are {len(hammers)} channels and"
            f" {plan.specimen.channel!r} are {len(specimens)}: several hits need as many of both"
        )
    if any(hammer is specimen for hammer in hammers for specimen in specimens):
        raise ParameterError(
            f"{measurement.path}: {plan.hammer.channel!r} and {plan.specimen.channel!r} are the"
            " same channel: hammer and sample have one each"
        )
    first = measurement.channels[0]
    needs_time = math.isnan(hammers[0].sampling_rate) and math.isnan(plan.sampling_rate)
    is_free = not any(first is channel for channel in (*hammers, *specimens))
    return _pair(hammers, specimens, [first] if needs_time and is_free else [])


def _find_by_name(measurement: Measurement, name: str) -> list[MeasuredChannel]:
    """Return the channel of a name or a number, or all that fit a pattern with * or ?."""
    channels = measurement.channels
    same = [channel for channel in channels if channel.name == name]
    if len(same) == 1:
        return same
    if len(same) > 1:
        raise SignalError(
            f"{measurement.path} has {len(same)} channels {name!r}: name one by its number"
        )
    if name.isdecimal() and 1 <= int(name) <= len(channels):
        return [channels[int(name) - 1]]
    pattern = re.compile(re.escape(name).replace(r"\*", ".*").replace(r"\?", "."))
    fitting = [channel for channel in channels if pattern.fullmatch(channel.name)]
    if fitting:
        return fitting
    raise SignalError(
        f"{measurement.path} has no channel {name!r}: it has {_list_channels(measurement)}"
    )


def _list_channels(measurement: Measurement) -> str:
    """Return numbers, names, units and sizes of the first channels."""
    shown = [
        f"{number} {channel.name!r} ({channel.values.size} points{channel.unit and ' in '}"
        f"{channel.unit})"
        for number, channel in enumerate(measurement.channels[:SHOWN_CHANNELS], start=1)
    ]
    left = len(measurement.channels) - len(shown)
    return ", ".join([*shown, f"{left} more"] if left else shown)


def _ask_for_roles(measurement: Measurement) -> str:
    count = len(measurement.channels)
    left, guess = ["hammer", "specimen"], list[str]()
    for channel in measurement.channels:
        is_time = is_clock(channel.values) and "time" not in guess
        is_used = left and not channel.flaw
        guess.append("time" if is_time else left.pop(0) if is_used else "skip")
    return (
        f"{measurement.path} has {count} columns: give the role of each ({', '.join(ROLES)}). They"
        f" are {_list_channels(measurement)}. For example, `impact-rig analyze"
        f" {shlex.quote(str(measurement.path))} --columns {','.join(guess)}`; several"
        " hammers are several hits"
    )


def _check_values(path: Path, role: str, channel: MeasuredChannel) -> None:
    values = channel.values
    if channel.flaw:
        advice = "skip it (--columns) and give --rate" if role == "time" else "name another one"
        raise SignalError(f"{path}, {channel.flaw}: {channel.name!r} is not of numbers: {advice}")
    if values.size < MINIMUM_POINTS:
        raise SignalError(
            f"{path} has {values.size} points in {channel.name!r}: a trace needs at least"
            f" {MINIMUM_POINTS}"
        )
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise SignalError(
            f"{path}: {BODIES.get(role, role)} is {values[bad[0]]} at point {bad[0]} ({bad.size}"
            " such points): every point must be a finite number"
        )


def _check_pair(path: Path, hammer: MeasuredChannel, specimen: MeasuredChannel) -> None:
    """Require two channels that were taken at the same instants."""
    names = f"{hammer.name!r} and {specimen.name!r}"
    advice = "hammer and sample need the same; name the channels that belong together"
    if hammer.values.size != specimen.values.size:
        raise SignalError(
            f"{path}: {names} have {hammer.values.size} and {specimen.values.size} points:"
            f" {advice}"
        )
    rates = hammer.sampling_rate, specimen.sampling_rate
    if rates[0] != rates[1] and not all(map(math.isnan, rates)):
        raise SignalError(
            f"{path}: {names} are sampled at {rates[0]:g} Hz and {rates[1]:g} Hz: {advice}"
        )
    delay = specimen.start - hammer.start
    if abs(delay) * np.nan_to_num(rates[0], nan=0.0) > LARGEST_TIME_ERROR:
        raise SignalError(f"{path}: {names} start {abs(delay):g} s apart: {advice}")


def _choose_rate(
    path: Path, plan: ChannelPlan, hammer: MeasuredChannel, time: MeasuredChannel | None
) -> float:
    rate, unit, given = hammer.sampling_rate, hammer.time_unit, plan.sampling_rate
    if not math.isnan(given):
        is_stated = unit and not math.isnan(rate)
        if is_stated and not math.isclose(rate, given, rel_tol=10.0**-RATE_DIGITS):
            raise ParameterError(
                f"{path} is sampled at {rate:g} Hz, as it states, not at {given:g} Hz"
            )
        return given
    if time is not None:
        rate, unit = read_clock(path, time.name, time.values, time.unit)
    if math.isnan(rate):
        raise SignalError(
            hammer.time_flaw
            or f"{path} has no time and states no rate: give its sampling rate (--rate)"
        )
    if unit and plan.time_unit and unit != plan.time_unit:
        raise ParameterError(
            f"{path}: its times are in {unit}, as the file states, not in {plan.time_unit}"
        )
    if plan.time_unit and not unit:
        return float(f"{rate / TIME_UNITS[plan.time_unit]:.{RATE_DIGITS}g}")
    width = count_width(hammer.values) / rate
    if not unit and (width > LONGEST_WIDTH or 1.0 / rate > LONGEST_STEP):
        would = ", ".join(
            f"in {name} {_format_time(scale * width)} ({_format_time(scale / rate)})"
            for name, scale in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6))
        )
        raise SignalError(
            f"{path} does not state in what unit its times are. Its pulse would be so wide at half"
            f" its height (and its points so far apart): {would}. Give --time-unit s, ms or us, or"
            " --rate where they count points"
        )
    return rate


def count_width(values: RawArray) -> int:
    """Return how many points of the highest pulse are above half its height."""
    deviation = np.abs(values - float(np.median(values)))
    peak = int(np.argmax(deviation))
    below = deviation < 0.5 * deviation[peak]
    before, after = below[:peak][::-1], below[peak:]
    return sum(int(np.argmax(side)) if side.any() else side.size for side in (before, after))


def _format_time(seconds: float) -> str:
    """Return a time with a unit that suits people."""
    unit = next((unit for unit in ("s", "ms", "us") if seconds >= TIME_UNITS[unit]), "ns")
    return f"{seconds / TIME_UNITS[unit]:.3g} {unit}"


def _choose_unit(path: Path, role: str, channel: MeasuredChannel, use: ChannelUse) -> str:
    """Return the unit of a channel; what the file states goes, and must not be contradicted."""
    stated, given = normalize_unit(channel.unit), normalize_unit(use.unit)
    if use.sensitivity and not given:
        given = stated if stated in VOLTAGES else "V"
    what = f"{path}: the {BODIES[role]}'s channel {channel.name!r} is in {stated}"
    if given and stated in UNITS and stated != given:
        raise ParameterError(f"{what}, as the file states, not in {given}")
    if not given and stated and stated not in UNITS:
        raise ParameterError(f"{what}, which is no unit known here: give {', '.join(UNITS)}")
    return given or stated or DEFAULT_UNIT


def _note_unit(body: str, channel: MeasuredChannel, use: ChannelUse) -> Iterator[str]:
    """Yield what is taken for granted of a channel's unit."""
    unit = use.unit or channel.unit
    if not unit and not use.sensitivity:
        taken = "its peaks have none" if body == "hammer" else "m/s^2 is taken"
        yield f"nobody states the unit of the {body}'s channel: {taken} (--{body}-unit)"
    if normalize_unit(unit) == "kgn":
        yield f"the {body}'s channel is taken for thousands of g; a force in kilograms is kgf"


def _is_voltage(channel: MeasuredChannel, use: ChannelUse) -> bool:
    return normalize_unit(use.unit or channel.unit) in VOLTAGES


def _is_force(channel: MeasuredChannel, use: ChannelUse) -> bool:
    """Tell whether the channel is a force, or the voltage of one."""
    unit = normalize_unit(use.unit or channel.unit)
    if use.sensitivity and (not unit or unit in VOLTAGES):
        unit = normalize_unit(use.sensitivity.unit)
    return unit in FORCES


def _calibrate(
    path: Path,
    role: str,
    channel: MeasuredChannel,
    use: ChannelUse,
    mass: float = math.nan,
    *,
    needs_scale: bool = True,
) -> ChannelBlock:
    if not (needs_scale or use.sensitivity) and _is_voltage(channel, use):
        # Volts stay volts.
        use = replace(use, sensitivity=Sensitivity(1.0, DEFAULT_UNIT))
    unit = _choose_unit(path, role, channel, use)
    if role == "specimen" and _is_force(channel, use):
        raise ParameterError(
            f"{path}: the sample's channel {channel.name!r} is a force: it must be an acceleration"
        )
    try:
        scale = compute_scale(unit, mass, use.sensitivity)
        full_scale = use.full_scale and use.full_scale * abs(
            compute_scale(use.full_scale_unit, mass, use.sensitivity)
        )
    except ParameterError as error:
        option = "mass" if _is_force(channel, use) else "sensitivity"
        raise ParameterError(
            f"{path}: {BODIES[role]}: {error} (--{BODIES[role]}-{option})"
        ) from None
    return ChannelBlock(channel.values, scale, 0.0, full_scale)


FIRST_STAMP = NANOSECONDS
"""When the first hit begins if its file does not say so, nanoseconds since the epoch: not 0, which
in ROS 2 is no time."""
PAUSE = NANOSECONDS
"""Between two hits whose times are not known [ns], our choice: rigs are not struck faster."""
AROUND_CUE, BEFORE_CUE = 0.1, 0.4
"""A hit lies so near a cue [s], less where cues are nearer; this part before it [-]. Our choice:
people and recorders mark it that well."""
MANY_IMPACTS, IMPACT_DISTANCE, ALIKE = 3, 0.05, 0.5
"""So many impacts, so far apart [s] and of such a part of the highest's height are no bounces of
one [-], our choice."""
LONGEST_WINDOW = 20e-3
"""What is proposed for a hit [s], our choice: the longest pulses of hammers, and their decay."""
BLOCK_POINTS = 10_000
"""Points per block, our choice: 160 kB, small enough for any subscriber."""

SETUP_QOS = OfferedQos(durability="transient_local", depth=1)
BLOCK_QOS = OfferedQos(depth=200)
"""What the rig's nodes offer on these topics."""


@dataclass(frozen=True)
class ImportedHit:
    """A hit in a file.

    Attributes
    ----------
    path : Path
        Of the file.
    block : Block
        All of both channels, or what was cut out of them, bit by bit; stamped with
        the time that the file states, or with 0.
    has_scale : bool
        The hammer's numbers make accelerations; see `MappedChannels`, as of these:
    unit : str
    remarks : tuple of str
    channels : tuple of str
        Names of the channels in the file.
    """

    path: Path
    block: Block
    has_scale: bool
    unit: str
    remarks: tuple[str, ...]
    channels: tuple[str, ...]

    @property
    def duration(self) -> float:
        """Of the hit [s]."""
        return self.block.hammer.output.size / self.block.sampling_rate


def read_hits(
    path: Path,
    label: HitLabel,
    plan: ChannelPlan,
    hammer_mass: float = math.nan,
    *,
    needs_scale: bool = True,
    window: AnalysisSettings | None = None,
) -> list[ImportedHit]:
    """Read the hits of one file.

    Parameters
    ----------
    path : Path
        Of any of the formats in `impact_rig.recordings.formats.registry`.
    label : HitLabel
        Which hit the first one is; the others count on.
    plan : ChannelPlan
        Which channel is what.
    hammer_mass : float
        m1 [kg], which makes accelerations of forces; NaN: not known.
    needs_scale : bool
        Refuse a force without a mass.
    window : AnalysisSettings, optional
        Whose pre-trigger and record duration each impact is cut out by; None: the channels are one
        hit, whole.

    Raises
    ------
    FileError
        If the file cannot be read.
    SignalError, ParameterError
        If its channels do not fit; see `map_channels`. If it holds many impacts, and no window is
        given.
    """
    measurement = read_measurement(path)
    hits: list[ImportedHit] = []
    for channels in map_channels(measurement, plan, hammer_mass, needs_scale=needs_scale):
        whole = Block(
            0,
            channels.sampling_rate,
            channels.hammer,
            channels.specimen,
            label,
            last=True,
            stamp=channels.stamp,
        )
        for first, block in _cut_hits(path, whole, measurement.cues, window):
            number = label.record + len(hits)
            counted = replace(
                block,
                label=replace(label, record=number, impact=number),
                origin=_describe_origin(path, channels, first, block.hammer.output.size),
            )
            hits.append(
                ImportedHit(
                    path,
                    counted,
                    channels.has_scale,
                    channels.unit,
                    channels.remarks,
                    channels.names,
                )
            )
    return hits


def _cut_hits(
    path: Path, whole: Block, cues: Sequence[int], window: AnalysisSettings | None
) -> Iterator[tuple[int, Block]]:
    """Yield what is a record of its own, with its first point: around cues, or all of it."""
    size = whole.hammer.output.size
    length = min([round(AROUND_CUE * whole.sampling_rate), *map(int, np.diff(cues))])
    starts = [max(cue - round(BEFORE_CUE * length), 0) for cue in cues] if cues else [0]
    for start in starts:
        piece = whole.cut(start, start + length if cues else size)
        piece = replace(piece, first_sample=0, last=True)
        if window is None:
            _check_alone(path, piece)
        # Where no impact is found, the whole says why.
        for first, block in (cut_impacts(piece, window) if window else ()) or [(0, piece)]:
            yield start + first, block


def _check_alone(path: Path, block: Block) -> None:
    """Refuse a record that people strike again and again in, as one hit."""
    output, rate = block.hammer.output, block.sampling_rate
    if output.size < MANY_IMPACTS * IMPACT_DISTANCE * rate:
        return
    # Every stretch has its highest point; those that stand out in all directions are impacts.
    deviation = np.abs(output - float(np.median(output)))
    step = max(int(IMPACT_DISTANCE * rate), 1)
    tops = [
        first + int(np.argmax(deviation[first : first + step]))
        for first in range(0, output.size, step)
    ]
    high = [top for top in tops if deviation[top] >= ALIKE * deviation.max()]
    apart = [top for top, before in zip(high[1:], high, strict=False) if top - before >= step]
    noise = float(np.median(deviation))
    if len(apart) + 1 < MANY_IMPACTS or PULSE_NOISE * noise > ALIKE * deviation.max():
        return
    distances = np.diff(high)
    window = min(LONGEST_WINDOW, 0.4 * float(distances[distances >= step].min()) / rate)
    raise SignalError(
        f"{path} holds {len(apart) + 1} impacts of like height: --record-duration"
        f" {1e3 * window:.2g}ms --pre-trigger {1e2 * window:.2g}ms makes a hit of each"
    )


def _describe_origin(path: Path, channels: MappedChannels, first: int, count: int) -> Origin:
    """Return where in its file a hit stands; what was simulated stays so through any export."""
    place = f"{' and '.join(map(repr, channels.names))}, points {first} to {first + count - 1}"
    source = f"{path.suffix.lstrip('.').lower()} file"
    is_simulated = channels.origin.startswith((SIMULATED, MIXED))
    if channels.origin:
        source += f", exported as {channels.origin}"
    return Origin(SIMULATED if is_simulated else IMPORTED, source, str(path), place)


def check_series(hits: Sequence[ImportedHit], hit: ImportedHit) -> None:
    """Require a hit that can be averaged with the first of its series.

    Raises
    ------
    SignalError
        If its sampling rate is another, or the sample was measured in one of them only.
    """
    if not hits:
        return
    first, block = hits[0], hit.block
    if block.sampling_rate != first.block.sampling_rate:
        raise SignalError(
            f"{hit.path} is sampled at {block.sampling_rate:g} Hz and {first.path} at"
            f" {first.block.sampling_rate:g} Hz: all hits of a sample need the same rate"
        )
    if block.has_specimen is not first.block.has_specimen:
        with_it, without = (hit, first) if block.has_specimen else (first, hit)
        raise SignalError(
            f"{with_it.path} has a channel of the sample, {without.path} has none: all hits of a"
            " sample need the same channels"
        )


def choose_window(settings: AnalysisSettings, hits: Sequence[ImportedHit]) -> AnalysisSettings:
    """Return settings that make each file, whole, the record of its hit.

    The pre-trigger is the longest time before a pulse; where that cuts off points, it reaches to
    the pulse's peak, behind which no pulse is detected.
    """
    duration = max(hit.duration for hit in hits)
    for find_place in (_find_start, _find_peak):
        places = [max(find_place(hit, settings), 1) / hit.block.sampling_rate for hit in hits]
        chosen = replace(settings, pre_trigger=max(places), record_duration=duration)
        if all(_is_whole(hit, chosen) for hit in hits):
            break
    return chosen


def _is_whole(hit: ImportedHit, settings: AnalysisSettings) -> bool:
    records = ImpactDetector(settings).feed(hit.block)
    sizes = [record.hammer.acceleration.size for record in records]
    return sizes == [hit.block.hammer.output.size]


def _find_start(hit: ImportedHit, settings: AnalysisSettings) -> int:
    """Return where the pulse begins; a tenth of the way where there is none."""
    start = find_pulse_start(_make_trace(hit), settings)
    return hit.block.hammer.output.size // 10 if start is None else start


def _find_peak(hit: ImportedHit, _settings: AnalysisSettings) -> int:
    acceleration = _make_trace(hit).acceleration
    return int(np.argmax(np.abs(acceleration - np.median(acceleration))))


def _make_trace(hit: ImportedHit) -> Trace:
    channel = hit.block.hammer
    return Trace(channel.scale * channel.output.astype(np.float64), channel.full_scale)


def write_imported(output: Path, setup: RigSetup, hits: Sequence[ImportedHit]) -> None:
    """Write a recording of one series of hits.

    Parameters
    ----------
    output : Path
        Of the new `.mcap` file.
    setup : RigSetup
        Masses, sample and settings.
    hits : sequence of ImportedHit
        In their order.

    Raises
    ------
    FileError
        If the file exists already or cannot be written, or the rig's interfaces are not
        installed. Nothing is left then.
    """
    encoder = MessageEncoder()
    with write_new_file(output) as part, McapWriter(part) as writer:
        writer.add_metadata(PROVENANCE_RECORD, {"software_version": __version__})
        origins = describe_origins(hit.block.origin for hit in hits)
        writer.add_metadata(ORIGIN_RECORD, origins)
        writer.add_metadata(
            "impact_rig/import", {str(hit.block.label.record): _describe(hit) for hit in hits}
        )
        setups = writer.add_channel("/setup", encoder.setup_definition, (SETUP_QOS,))
        blocks = writer.add_channel("/acceleration", encoder.block_definition, (BLOCK_QOS,))
        stamps = _assign_stamps(hits)
        writer.add_message(setups, encoder.encode_setup(setup, stamps[0]), stamps[0], stamps[0])
        for hit, stamp in zip(hits, stamps, strict=True):
            for block in replace(hit.block, stamp=stamp).split(BLOCK_POINTS):
                arrival = block.stamp + _compute_duration(block)
                writer.add_message(blocks, encoder.encode_block(block), arrival, arrival)


def _assign_stamps(hits: Sequence[ImportedHit]) -> list[int]:
    """Return when each hit begins in the recording [ns since the epoch]."""
    stamps: list[int] = []
    end = next((hit.block.stamp for hit in hits if hit.block.stamp), FIRST_STAMP) - PAUSE
    for hit in hits:
        stated = hit.block.stamp
        stamps.append(stated if stated and stated >= end else end + PAUSE)
        end = stamps[-1] + _compute_duration(hit.block)
    return stamps


def _describe(hit: ImportedHit) -> str:
    """Return where a hit comes from, as JSON: enough to find the file and prove that it is it."""
    content: dict[str, object] = {
        "file": hit.path.name,
        "sha256": compute_sha256(hit.path),
        "channels": hit.channels,
    }
    if hit.block.stamp:
        # What the file states; the hit may be later in the recording.
        content["recorded_at"] = hit.block.stamp
    return json.dumps(content, ensure_ascii=False)


def _compute_duration(block: Block) -> int:
    """Return how long a block is [ns]."""
    return round(block.hammer.output.size / block.sampling_rate * NANOSECONDS)
