"""Universal file format, data sets 58 and 58b, by pyuff."""

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from impact_rig.core.given.errors import FileError
from impact_rig.files.measurement import ORIGIN, MeasuredChannel, Measurement
from impact_rig.files.times import (
    SPECTRUM_WORDS,
    TIME_UNITS,
    Clock,
    compute_rounding,
    normalize_time_unit,
    read_clock,
    round_rate,
)

TIME_RESPONSE = 1
"""Function type of a trace over time."""
FUNCTIONS = {
    0: "a general function", 2: "an auto spectrum", 3: "a cross spectrum",
    4: "a frequency response", 5: "a transmissibility", 6: "a coherence",
    7: "an auto correlation", 8: "a cross correlation", 9: "a power spectral density",
    12: "a spectrum",
}  # fmt: skip
"""Other contents of a data set, by function type."""
REAL_TYPES = (2, 4)
"""Ordinate data types of real numbers, in single and double precision."""
NONE = "NONE"
"""Stands for missing text."""

END = re.compile(rb" -1[\s\x1a]*\Z")
END_LETTERS = 200
"""Where the end of the last data set is looked for, our choice: blanks may follow it."""
LINE_POINTS = 6
"""Points in a line of text, at most."""
STEP_DIGITS = (5, 6)
"""Digits of the step, as Fortran and as C write E13.5."""
NAME_LETTERS = 80
"""Longest name: one line of the header."""
UNIT_LETTERS = 20
"""Longest unit."""
STATED = re.compile(r"sampling rate \[Hz\]: (\S+), start \[s\]: (\S+)")
"""Ours, in the fifth line: the header gives the step to six digits only."""


def read_uff(path: Path) -> Measurement:
    """Read the time responses of all data sets 58.

    The first line of a data set is the channel's name, or its place in the file.

    Raises
    ------
    FileError
        If the file is no universal file, is cut off, or has no time response.
    SignalError
        If it is over frequencies.
    """
    import pyuff

    file = pyuff.UFF(str(path))
    types = [int(number) for number in file.get_set_types()]
    if not types:
        raise FileError(f"{path} is no universal file: it has no data set between lines of -1")
    if END.search(path.read_bytes()[-END_LETTERS:]) is None:
        raise FileError(f"{path} is cut off: its last data set has no end")
    channels: list[MeasuredChannel] = []
    others: list[str] = []
    for index, kind in enumerate(types):
        if kind != 58:  # noqa: PLR2004 - the name of the data set
            others.append(f"data set {kind}")
            continue
        function = file.read_sets(index)
        if found := _name_function(function):
            others.append(found)
        else:
            channels.append(_make_channel(path, function, len(channels) + 1))
    if not channels:
        found = ", ".join(dict.fromkeys(others))
        raise FileError(
            f"{path} holds no trace over time (data set 58, function 1): it has {found}"
        )
    return Measurement(path, tuple(channels))


def _name_function(function: dict[str, Any]) -> str | None:
    """Return the kind of a data set that is no trace; None: it is one."""
    kind = int(function["func_type"])
    if kind != TIME_RESPONSE:
        return FUNCTIONS.get(kind, f"a function of type {kind}")
    axis = str(function["abscissa_axis_units_lab"]).strip()
    if axis.lower() in SPECTRUM_WORDS:
        return f"a spectrum, whose axis is in {axis}"
    return None if function["ord_data_type"] in REAL_TYPES else "complex numbers"


def _make_channel(path: Path, function: dict[str, Any], number: int) -> MeasuredChannel:
    name = str(function["id1"]).strip()
    values = np.asarray(function["data"], dtype=np.float64)
    points = int(function["num_pts"])
    if points < values.size < points + LINE_POINTS and not values[points:].any():
        values = values[:points]  # the last line of text is filled up
    if values.size != points:
        what = "is cut off" if values.size < points else "contradicts itself"
        raise FileError(
            f"{path} {what}: {name!r} should have {points} points, it has {values.size}"
        )
    clock, start = _read_clock(path, function, points)
    return MeasuredChannel(
        name=name if name not in ("", NONE) else f"channel {number}",
        values=values,
        unit=str(function["ordinate_axis_units_lab"]).strip().replace(NONE, ""),
        start=start,
        origin=_read_origin(str(function["id2"])),
        **clock.stated,
    )


def _read_origin(line: str) -> str:
    mark = f"{ORIGIN}: "
    return line.strip().removeprefix(mark) if line.startswith(mark) else ""


def _read_clock(path: Path, function: dict[str, Any], points: int) -> tuple[Clock, float]:
    """Return the file's clock, and the start [s]."""
    stated = STATED.match(str(function["id5"]))
    if stated is not None:
        return Clock(float(stated[1]), "s"), float(stated[2])
    label = str(function["abscissa_axis_units_lab"])
    unit = normalize_time_unit(label)
    scale = TIME_UNITS.get(unit, 1.0)
    if function["abscissa_spacing"] == 0:
        times = np.asarray(function["x"], dtype=np.float64)[:points]
        return replace(read_clock(path, "", times, unit), unit=unit), scale * float(times[0])
    step = float(function["abscissa_inc"])
    digits = next((n for n in STEP_DIGITS if float(f"{step:.{n - 1}e}") == step), None)
    error = compute_rounding(step, digits) if digits and step > 0 else 0.0
    start = scale * float(function["abscissa_min"])
    return Clock(round_rate(scale * step, scale * error), unit), start


def write_uff(path: Path, measurement: Measurement) -> None:
    """Write each channel as a data set 58b in double precision.

    Parameters
    ----------
    path : Path
        Of the new file.
    measurement : Measurement
        Every channel of finite numbers with a sampling rate, a name of 80 letters and a unit of
        20 at most, on one line.

    Raises
    ------
    FileError
        If a channel has not.
    """
    import pyuff

    sets = [_make_set(measurement.path, channel) for channel in measurement.channels]
    pyuff.UFF(str(path)).write_sets(sets, mode="add")


def _make_set(path: Path, channel: MeasuredChannel) -> dict[str, Any]:
    what = f"{path}: channel {channel.name!r}"
    name, unit = channel.name, channel.unit
    if math.isnan(channel.sampling_rate):
        raise FileError(f"{what} has no sampling rate: a universal file needs one")
    if not np.isfinite(channel.values).all():
        raise FileError(
            f"{what} has points that are no finite numbers: a universal file needs such"
        )
    if len(name) > NAME_LETTERS or len(unit) > UNIT_LETTERS or not (name + unit).isprintable():
        raise FileError(
            f"{what} in {unit!r}: a universal file has {NAME_LETTERS} letters for the name and"
            f" {UNIT_LETTERS} for the unit, on a line each"
        )
    return {
        "type": 58,
        "binary": 1,
        "func_type": TIME_RESPONSE,
        **dict.fromkeys(("rsp_node", "rsp_dir", "ref_node", "ref_dir"), 0),
        "id1": name or NONE,
        "id2": f"{ORIGIN}: {channel.origin}"[:NAME_LETTERS] if channel.origin else NONE,
        "id5": f"sampling rate [Hz]: {channel.sampling_rate!r}, start [s]: {channel.start!r}",
        "data": channel.values.astype(np.float64),
        # Of the abscissa the first two alone are looked at.
        "x": channel.start + np.arange(2) / channel.sampling_rate,
        "abscissa_spacing": 1,
        "abscissa_spec_data_type": 17,
        "abscissa_axis_lab": "Time",
        "abscissa_axis_units_lab": "s",
        "orddenom_spec_data_type": 0,
        "ordinate_axis_units_lab": unit or NONE,
    }
