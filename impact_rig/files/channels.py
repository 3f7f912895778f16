"""The hammer's and the sample's channel of a measured file, calibrated, or a question.

For each hit, see `_map_hit`: values are checked, units make scales, times or the user a rate. All
that is missing then is asked in one question; else values that are held are taken once, and the
padding before the signal is left out.
"""

import contextlib
import json
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from impact_rig.core.given.errors import ParameterError, SignalError
from impact_rig.core.given.records import (
    IMPORTED,
    MIXED,
    SIMULATED,
    Block,
    ChannelBlock,
    HitLabel,
    Origin,
    RawArray,
)
from impact_rig.core.given.sensors import (
    ACCELERATIONS,
    FORCES,
    UNITS,
    VOLTAGES,
    Sensitivity,
    compute_scale,
    normalize_unit,
)
from impact_rig.files.measurement import NANOSECONDS, MeasuredChannel, Measurement
from impact_rig.files.names import find_unit, is_unit, split_name
from impact_rig.files.plan import ChannelPlan, ChannelUse
from impact_rig.files.questions import (
    BODIES,
    CHOICE,
    Missing,
    Questions,
    describe_channel,
    describe_channels,
)
from impact_rig.files.raster import MINIMUM_POINTS, find_hold, is_envelope, split_measurement
from impact_rig.files.roles import (
    Roles,
    ask_for_specimen,
    assign_roles,
    describe_roles,
    guess_roles,
)
from impact_rig.files.times import (
    LARGEST_TIME_ERROR,
    PIECE,
    RATE_DIGITS,
    RATE_MISMATCH,
    TIME_UNITS,
    Clock,
    find_axis,
    read_clock,
    split_points,
)

DEFAULT_UNIT = "m/s^2"
"""Assumed for a channel whose unit neither file nor user state."""
LONGEST_WIDTH, LONGEST_STEP = 10e-3, 1e-3
"""Longest plausible pulse at half its height and time step [s] where the file states no unit of
time: the standard shock of 11 ms is 7 ms wide."""
LONGEST_CONTACT = 0.2
"""Width of a pulse above which a stated unit of time is doubted [s], our choice: no hammer stays
on anything so long."""
SHORTEST_CONTACT = 2e-6
"""Width of a pulse below which a stated unit of time cannot be [s], our choice: a ball of 1 mm
touches for longer."""
LARGEST_RANGE = 1e12
"""Largest value over the unit, and over the pulse that is in it [-]: no instrument has more."""

NO_SPECIMEN = ChannelBlock(np.empty(0), 1.0, 0.0, 0.0)


@dataclass(frozen=True)
class MeasuredHit:
    """A hit of a measured file with its calibration, numbers bit by bit as in the file."""

    path: Path
    block: Block  # all of both channels or what was cut out, stamped with the file's time or 0
    has_scale: bool = True  # the hammer's are accelerations, not only as large as some numbers
    unit: str = DEFAULT_UNIT  # of what the hammer's sensor measures; empty: it is not stated
    remarks: tuple[str, ...] = ()  # what was taken for granted
    names: tuple[str, ...] = ()  # of the channels in the file
    taken: str = ""  # which channel was taken as what, for people

    @property
    def duration(self) -> float:
        """Duration of the hit [s]."""
        return self.block.hammer.output.size / self.block.sampling_rate


def map_channels(
    measurement: Measurement,
    plan: ChannelPlan,
    hammer_mass: float = math.nan,
    *,
    needs_scale: bool = False,
) -> list[MeasuredHit]:
    """Find, check and calibrate the channels of each hit.

    Parameters
    ----------
    plan : ChannelPlan
        The channels as the user states them.
    hammer_mass : float
        m1 [kg], which makes accelerations of forces; NaN: not known.
    needs_scale : bool
        Ask for all that makes accelerations; False: contact times are all that is wanted.

    Returns
    -------
    list of MeasuredHit
        One for each channel of the hammer, whole and without a label.

    Raises
    ------
    SignalError
        If something is missing, or channels are too short, not finite, beyond all measure, of
        different lengths, rates or starts, or time does not run in even steps.
    ParameterError
        If the units do not fit, or the user contradicts the file.
    """
    questions = Questions(split_measurement(measurement, plan), needs_scale)
    roles = assign_roles(questions, plan)
    return [_map_hit(questions, found, plan, hammer_mass) for found in roles]


def make_template(measurement: Measurement) -> str:
    """Return a file of channels for a measurement; what must be said stands in it as "?"."""
    measurement = split_measurement(measurement, ChannelPlan())
    questions = Questions(measurement, needs_scale=True)
    roles: list[Roles] = []
    with contextlib.suppress(SignalError, ParameterError):
        roles = assign_roles(questions, ChannelPlan())
        for each in roles:
            _map_hit(questions, each, ChannelPlan(), math.nan)
    lines = {item.line: item.table for item in questions.missing}
    text = [f"# {measurement.path.name}:"]
    text += [f"#   {line}" for line in describe_channels(measurement)]
    if not all(channel.sampling_rate > 0 for channel in measurement.channels):
        text += [f"# columns = {json.dumps(guess_roles(measurement.channels))}"]
    text += [line for line, table in lines.items() if not table]
    found = roles[0] if roles else Roles(measurement.channels[0])
    for role, channel in (("hammer", found.hammer), ("specimen", found.specimen)):
        asked = [line for line, table in lines.items() if table == role]
        if channel is None and not asked:
            continue
        text += ["", f"[{role}]{'' if channel is None else f'  # {describe_channel(channel)}'}"]
        if channel is not None and CHOICE not in asked:
            text.append(f"channel = {json.dumps(channel.name)}")
        text += [*asked, '# mass = "100 g"']
    return "\n".join(text) + "\n"


def _map_hit(
    questions: Questions, found: Roles, plan: ChannelPlan, hammer_mass: float
) -> MeasuredHit:
    """Return one hit; raises `SignalError` or `ParameterError` as `map_channels`."""
    path = questions.measurement.path
    for role, each in found.list_channels():
        _check_values(path, role, each)
    channel, specimen = found.hammer, NO_SPECIMEN
    hammer, unit, has_scale = _calibrate(questions, "hammer", channel, plan.hammer, hammer_mass)
    if found.specimen is not None:
        _check_pair(path, channel, found.specimen)
        specimen, *_ = _calibrate(
            questions, "specimen", found.specimen, plan.specimen, hammer_mass
        )
    elif found.open and questions.needs_scale:
        questions.missing.append(ask_for_specimen(found))
    rate = _choose_rate(questions, plan, channel, found.time)
    questions.ask()
    held = _find_hold(questions, channel, found.specimen)
    if held.step > 1:
        rate /= held.step
        hammer = replace(hammer, output=hammer.output[held])
        specimen = replace(specimen, output=specimen.output[held])
    block = Block(0, rate, hammer, specimen, HitLabel(""), last=True, stamp=channel.stamp)
    block = replace(block, origin=_describe_origin(path, channel.origin))
    block = _cut_padding(questions, block)
    names: tuple[str, ...] = (channel.name,)
    if found.specimen is not None and specimen.output.size:
        names += (found.specimen.name,)
    _tell_left_out(questions, found)
    remarks = tuple(dict.fromkeys((*questions.measurement.remarks, *questions.remarks)))
    taken = describe_roles(found, plan, has_sample=len(names) > 1)
    return MeasuredHit(path, block, has_scale, unit, remarks, names, taken)


def _tell_left_out(questions: Questions, found: Roles) -> None:
    """Remark which channels are left out since their unit is none of acceleration or force."""
    taken = [channel.name for _, channel in found.list_channels()]
    left = [
        f"{channel.name!r} [{unit}]"
        for channel in questions.measurement.channels
        if channel.name not in taken
        and (unit := channel.unit or split_name(channel.name)[1])
        and not is_unit(unit)
    ]
    if left:
        questions.remarks.append(f"left out for their units: {', '.join(left)}")


def _describe_origin(path: Path, stated: str) -> Origin:
    """Return the origin of a file's numbers; simulated ones stay so through any export."""
    source = f"{path.suffix.lstrip('.').lower()} file"
    is_simulated = stated.startswith((SIMULATED, MIXED))
    if stated:
        source += f", exported as {stated}"
    return Origin(SIMULATED if is_simulated else IMPORTED, source, str(path))


def _check_values(path: Path, role: str, channel: MeasuredChannel) -> None:
    values, what = channel.values, f"{path}: {BODIES.get(role, role)}"
    if channel.flaw:
        advice = "skip it (columns) and give --rate" if role == "time" else "name another one"
        raise SignalError(f"{path}, {channel.flaw}: {channel.name!r} is not of numbers: {advice}")
    if values.size < MINIMUM_POINTS:
        raise SignalError(
            f"{path} has {values.size} points in {channel.name!r}: a trace needs at least"
            f" {MINIMUM_POINTS}"
        )
    low, high = math.inf, -math.inf
    for first, piece in split_points(values):
        bad = np.flatnonzero(~np.isfinite(piece))
        if bad.size:
            advice = "beyond its range, so choose a larger one" * bool(np.isinf(piece[bad[0]]))
            raise SignalError(
                f"{what} is {piece[bad[0]]} at point {first + bad[0]}:"
                f" {advice or 'every point must be a finite number'}"
            )
        low, high = min(low, float(piece.min())), max(high, float(piece.max()))
    if role not in BODIES:
        return
    largest, span = max(high, -low), high - low
    if largest > LARGEST_RANGE:
        place = int(np.argmax(values) if high == largest else np.argmin(values))
        raise SignalError(
            f"{what} is {values[place]:.4g} at point {place}: no instrument shows more than"
            f" {LARGEST_RANGE:g} {channel.unit or 'of its unit'}"
        )
    if 0.0 < span < max(1.0, largest) / LARGEST_RANGE:
        raise SignalError(
            f"{what} changes by {span:.4g} on {largest:.4g} {channel.unit}: that is below a part"
            f" in {LARGEST_RANGE:g}, no instrument has such a dynamic range"
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
    if specimen.recorded_at and hammer.recorded_at:
        delay += (specimen.recorded_at - hammer.recorded_at) / NANOSECONDS
    if abs(delay) * np.nan_to_num(rates[0], nan=0.0) > LARGEST_TIME_ERROR:
        raise SignalError(f"{path}: {names} start {abs(delay):g} s apart: {advice}")


def _cut_padding(questions: Questions, block: Block) -> Block:
    """Return a block without the constant points that a logger puts before its signal."""
    first = max(count_padding(channel.output) for channel in block.channels)
    if not first:
        return block
    questions.remarks.append(
        f"the first {first} points have one value, and those behind them lie at another level:"
        " they are left out as padding"
    )
    return block.cut(first, block.hammer.output.size)


def _find_hold(
    questions: Questions, hammer: MeasuredChannel, specimen: MeasuredChannel | None
) -> slice:
    """Return the points to take where each value stands several times, as on a finer raster.

    Raises
    ------
    SignalError
        If hammer and sample stand otherwise, or not equally often everywhere.
    """
    held = [find_hold(channel.values) for channel in (hammer, specimen) if channel is not None]
    first, times = held[0]
    if all(count == 1 for _, count in held):
        return slice(0, None, 1)
    path = questions.measurement.path
    if times == 0 or any(found != held[0] for found in held):
        raise SignalError(
            f"{path}: values stand several times, and not equally often: it was exported onto"
            " another raster than it was measured on; export it with its own sampling rate"
        )
    questions.remarks.append(
        f"every value stands {times} times, as exported onto a finer raster: each is taken once"
    )
    return slice(first, None, times)


def count_padding(values: RawArray) -> int:
    """Return how many points before the signal are constant padding.

    That is a run of one value, behind which noise lies on another level, below half of the highest
    point.
    """
    run = 0
    for first, piece in split_points(values):
        if np.any(piece != values[0]):
            run = first + int(np.argmax(piece != values[0]))
            break
    behind = values[run : run + MINIMUM_POINTS].astype(np.float64)
    if run < MINIMUM_POINTS or behind.size < MINIMUM_POINTS:
        return 0
    level = abs(float(np.median(behind)) - float(values[0]))
    pieces = (piece.astype(np.float64) for _, piece in split_points(values))
    height = max(float(np.abs(piece - float(values[0])).max()) for piece in pieces)
    return run if 0.0 < float(np.ptp(behind)) < level < 0.5 * height else 0


def _choose_rate(
    questions: Questions, plan: ChannelPlan, hammer: MeasuredChannel, time: MeasuredChannel | None
) -> float:
    """Return the sampling rate [Hz]; NaN: it was asked for."""
    path = questions.measurement.path
    clock = Clock(hammer.sampling_rate, hammer.time_unit, hammer.time_flaw, hammer.has_gap)
    if time is not None:
        clock = read_clock(path, time.name, time.values, time.unit)
    words = _find_words(questions.measurement)
    if clock.rate == 1.0:  # points are counted, whatever unit the file states: no hit is that slow
        clock = replace(clock, unit="")
    if clock.unit and plan.time_unit and clock.unit != plan.time_unit:
        raise ParameterError(
            f"{path}: its times are in {clock.unit}, as the file states, not in {plan.time_unit}"
        )
    _check_clock(path, plan, clock, hammer, time)
    if not math.isnan(plan.sampling_rate):
        _check_rate(path, plan, clock.rate, clock.unit)
        if clock.flaw:
            questions.remarks.append("its times are uneven or rounded: --rate goes before them")
        elif words:
            questions.remarks.append(f"{words}: whether points are missing is not seen")
        return plan.sampling_rate
    rate = clock.rate
    if math.isnan(rate):
        what = f"{words or 'it has no time'} and states no rate: give its sampling rate"
        questions.missing.append(Missing(what, 'sampling_rate = "?"', option='--rate "25.6 kHz"'))
    elif plan.time_unit and not clock.unit:
        rate = float(f"{rate / TIME_UNITS[plan.time_unit]:.{RATE_DIGITS}g}")
    else:
        _check_width(questions, hammer, rate, clock.unit)
    return rate


def _check_clock(
    path: Path,
    plan: ChannelPlan,
    clock: Clock,
    hammer: MeasuredChannel,
    time: MeasuredChannel | None,
) -> None:
    """Refuse times that are those of no trace, or make no rate where none is given."""
    if time is not None and clock.flaw and is_envelope(time.values, hammer.values):
        raise SignalError(
            f"{path}: two values stand at each time, the lower and the higher one: it is the"
            " envelope of the trace (peak detect), and no rate makes a trace of it: record samples"
        )
    if clock.has_gap or (clock.flaw and math.isnan(plan.sampling_rate)):
        raise SignalError(clock.flaw)


def _check_rate(path: Path, plan: ChannelPlan, rate: float, unit: str) -> None:
    """Refuse a given rate that contradicts the file's; one in an unknown unit may be in any."""
    if math.isnan(rate) or (rate == 1.0 and not unit):  # no times, or points that are counted
        return
    scales = [TIME_UNITS[plan.time_unit]] if plan.time_unit else list(TIME_UNITS.values())
    rates = [rate] if unit else [rate / scale for scale in scales]
    if not any(math.isclose(plan.sampling_rate, of, rel_tol=RATE_MISMATCH) for of in rates):
        raise ParameterError(
            f"{path} is sampled at {rates[0]:g} Hz, as it states, not at"
            f" {plan.sampling_rate:g} Hz (--rate): leave that out, or its times (columns)"
        )


def _find_words(measurement: Measurement) -> str | None:
    """Return that times are written in words, with their name; None: they are not."""
    flawed = [channel for channel in measurement.channels if channel.flaw]
    names = [of.name for of in flawed if find_axis(of.name, of.unit) is not None]
    return f"its {names[0]!r} is not numeric" if names else None


def _check_width(questions: Questions, hammer: MeasuredChannel, rate: float, unit: str) -> None:
    """Ask for the unit of times that are too long to be seconds; doubt one that is stated."""
    if rate > LARGEST_RANGE:
        raise SignalError(
            f"{questions.measurement.path} is sampled at {rate:.4g} Hz: no instrument is that fast"
        )
    width = count_width(hammer.values) / rate
    if unit and width < SHORTEST_CONTACT:
        raise SignalError(
            f"{questions.measurement.path}: its times are in {unit}, as it states, and the pulse"
            f" would be {_format_time(width)} wide at half its height: no contact is that short."
            " If another unit was meant, skip the times (columns) and give --rate"
        )
    if unit and width > LONGEST_CONTACT:
        questions.remarks.append(
            f"the pulse is {_format_time(width)} wide at half its height: is the file's unit of"
            f" time, {unit!r}, right?"
        )
    if unit or (width <= LONGEST_WIDTH and 1.0 / rate <= LONGEST_STEP):
        return
    would = ", ".join(
        f"in {name} {_format_time(scale * width)} ({_format_time(scale / rate)})"
        for name, scale in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6))
    )
    what = (
        "it does not state in what unit its times are. Its pulse would be so wide at half its"
        f" height (and its points so far apart): {would}. If they count points, give --rate; else"
        " time_unit is 's', 'ms' or 'us'"
    )
    questions.missing.append(Missing(what, 'time_unit = "?"'))


def count_width(values: RawArray) -> int:
    """Return how many points of the highest pulse are above half its height."""
    step = 1 + values.size // PIECE
    some = [piece[::step].copy() for _, piece in split_points(values)]
    baseline = float(np.median(np.concatenate(some)))
    peak, height = 0, -1.0
    for first, piece in split_points(values):
        deviation = np.abs(piece - baseline)
        place = int(np.argmax(deviation))
        if deviation[place] > height:
            peak, height = first + place, float(deviation[place])
    before, after = values[max(peak - PIECE, 0) : peak][::-1], values[peak : peak + PIECE]
    sides = [np.abs(side - baseline) < 0.5 * height for side in (before, after)]
    return sum(int(np.argmax(side)) if side.any() else side.size for side in sides)


def _format_time(seconds: float) -> str:
    """Return a time with a unit that suits people."""
    unit = next((unit for unit in ("s", "ms", "us") if seconds >= TIME_UNITS[unit]), "ns")
    return f"{seconds / TIME_UNITS[unit]:.3g} {unit}"


def _calibrate(
    questions: Questions, role: str, channel: MeasuredChannel, use: ChannelUse, mass: float
) -> tuple[ChannelBlock, str, bool]:
    """Return a channel with its scale, the unit of what it shows, and whether that is known.

    It is as it is where nothing makes accelerations of it.
    """
    path, name = questions.measurement.path, f"the {BODIES[role]}'s channel"
    unit = _choose_unit(path, name, channel, use)
    sensor = use.sensitivity
    measured = normalize_unit(sensor.unit) if sensor else unit
    if measured in FORCES and role == "specimen":
        raise ParameterError(
            f"{path}: {name} {channel.name!r} is a force: it must be an acceleration"
        )
    missing = _find_missing(f"{name} {channel.name!r}", role, unit, measured, mass)
    if missing and questions.needs_scale:
        questions.missing.append(missing)
    remarks = questions.remarks
    if not unit:
        taken = "its peaks have none" if role == "hammer" else "m/s^2 is taken"
        advice = "--hammer-unit"
        if role == "specimen":
            advice = 'unit = "g" under [specimen] in the file of --channels changes that'
        remarks.append(f"the unit of {name} is not stated: {taken} ({advice})")
    elif measured == "kgn":
        remarks.append(f"{name} is taken for thousands of g; a force in kilograms is kgf")
    elif measured not in UNITS and role == "specimen":
        remarks.append(f"{name} is in {unit}, no acceleration: it is left out")
        return NO_SPECIMEN, unit, False
    elif measured not in UNITS:
        remarks.append(f"{name} is read as it is: {unit}")
    if missing:
        # Forces stay in N, volts in V, all else in its unit.
        mass, sensor = 1.0, sensor or Sensitivity(1.0, DEFAULT_UNIT)
    scale = compute_scale(unit, mass, sensor) if unit in UNITS else 1.0
    full_scale = use.full_scale and use.full_scale * abs(
        compute_scale(use.full_scale_unit, mass, sensor)
    )
    kinds = ((FORCES, "N"), (VOLTAGES, "V"), (ACCELERATIONS, DEFAULT_UNIT))
    shown = next((shown for units, shown in kinds if measured in units), unit)
    block = ChannelBlock(channel.values, scale, 0.0, full_scale)
    return block, shown, missing is None


def _choose_unit(path: Path, name: str, channel: MeasuredChannel, use: ChannelUse) -> str:
    """Return the unit of a channel: the file's, which the user must not contradict."""
    stated, given = channel.unit or find_unit(channel.name), normalize_unit(use.unit)
    if use.sensitivity and not given:
        given = stated if stated in VOLTAGES else "V"
    if given and stated in UNITS and stated != given:
        raise ParameterError(
            f"{path}: {name} {channel.name!r} is in {stated}, as the file states, not in {given}"
        )
    return given or stated


def _find_missing(name: str, role: str, unit: str, measured: str, mass: float) -> Missing | None:
    """Return the missing statement for accelerations of a channel; None: none is missing."""
    if measured in FORCES and math.isnan(mass):
        text = f"{name} is in {unit}, and acceleration is F/m: give the hammer's mass"
        return Missing(text, 'mass = "?"', role, "--hammer-mass 100g")
    if measured in VOLTAGES:
        text = f"{name}: a channel in {unit} needs a sensitivity, for example 10 mV/g"
        return Missing(text, 'sensitivity = "?"', role)
    if measured and measured not in UNITS:
        text = f"{name} is in {unit}, no unit of acceleration, force or voltage"
        return Missing(text, 'unit = "?"', role)
    if not measured and role == "hammer":
        text = f"the unit of {name} is not stated; it may be {', '.join(UNITS)}"
        return Missing(text, 'unit = "?"', role, "--hammer-unit g")
    return None
