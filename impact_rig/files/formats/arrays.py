"""Named arrays of a file of arrays become channels, with times, rates and units among them.

Files that are nothing else are read here: numpy's `.npy` and `.npz`, of which nothing is ever
unpickled, and lists of channels in JSON, as the tools of sdypy exchange them (SEP 005).
"""

import json
import math
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.given.errors import FileError, SignalError
from impact_rig.files.formats.bounds import check_size
from impact_rig.files.formats.rates import compute_stated_rate, states_unit
from impact_rig.files.measurement import NANOSECONDS, MeasuredChannel, Measurement, keep_values
from impact_rig.files.names import PARTS, split_name
from impact_rig.files.times import TIME_UNITS, Axis, Clock, find_axis, is_clock, read_clock
from impact_rig.recordings.new_file import open_regular

UNIT_NAMES = {"unit", "units", "unit string", "quantity.label"}
"""Names of arrays that say in what unit others are, in small letters, underscores as blanks."""
DIMENSIONS = 3
"""Most axes of an array of channels side by side: hits, channels and time."""


@dataclass(frozen=True)
class NamedArray:
    """An array, and what its file states of it."""

    name: str  # in the file
    values: NDArray[Any]  # of any kind and shape
    stated: Mapping[str, Any] = field(default_factory=dict)  # fields of its `MeasuredChannel`
    is_channel: bool = False  # the file says that it is one; False: by name and shape


def make_measurement(path: Path, arrays: Sequence[NamedArray]) -> Measurement:
    """Make channels of the arrays of a file.

    Vectors are channels; of an array with more axes the longest is time. An array named as a time,
    a sampling rate or a step says when those were taken that share most groups with it, a text
    named as a unit is theirs; all else is left out.

    Parameters
    ----------
    path : Path
        Of the file, for messages.
    arrays : sequence of NamedArray
        All arrays of the file, in its order.

    Raises
    ------
    FileError
        If no array is a channel.
    """
    arrays = [_make_seconds(array) for array in arrays]
    rates = [array for array in arrays if read_stated_rate(array) > 0]
    clocks = [array for array in arrays if _is_time(array)]
    units = [array for array in arrays if _is_unit(array)]
    channels: list[MeasuredChannel] = []
    spectrum: SignalError | None = None
    for array in arrays:
        if _is_channel(array) and not _is_time(array):
            try:
                channels += _make_channels(path, _find_unit(array, units), clocks, rates)
            except SignalError as error:  # beside traces a spectrum is left out
                spectrum = error
    if channels:
        return Measurement(path, tuple(channels))
    if spectrum is not None:
        raise spectrum
    found = ", ".join(f"{a.name} ({a.values.dtype}, {a.values.shape})" for a in arrays[:5])
    raise FileError(f"{path} has no vector of real numbers: it holds {found or 'nothing'}")


def split_columns(values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Return the columns of an array, of whose axes the longest is time, the last of equals.

    Each has its number along the other axes, counted from 1, as text: " 3 1"; of a vector "".
    """
    values = np.atleast_1d(values)
    time = values.ndim - 1 - int(np.argmax(values.shape[::-1]))
    rows = np.moveaxis(values, time, -1)
    return {
        "".join(
            f" {number + 1}" for number, of in zip(place, rows.shape, strict=False) if of > 1
        ): (rows[place])
        for place in np.ndindex(rows.shape[:-1])
    }


def clean_name(name: str) -> str:
    """Return the last part of a name in small letters, underscores as blanks."""
    return get_last_part(name).replace("_", " ").strip().lower()


def get_last_part(name: str) -> str:
    """Return the last part of a name with groups; the strokes of a unit part nothing."""
    bare, _ = split_name(name)
    last = PARTS.split(bare)[-1]
    return last + name[len(bare) :]


def _make_channels(
    path: Path, array: NamedArray, clocks: Sequence[NamedArray], rates: Sequence[NamedArray]
) -> list[MeasuredChannel]:
    stated = dict(array.stated)
    if math.isnan(stated.get("sampling_rate", math.nan)) and not array.is_channel:
        if rates:
            nearest = _find_nearest(rates, array)
            has_unit = states_unit(get_last_part(nearest.name))
            stated |= Clock(read_stated_rate(nearest), "s" if has_unit else "").stated
        fitting = [clock for clock in clocks if clock.values.size == max(array.values.shape)]
        if fitting:
            of_time = [clock for clock in fitting if _find_axis(clock) is not Axis.FREQUENCY]
            time = _find_nearest(of_time or fitting, array)
            times = time.values.ravel()
            clock = read_clock(path, clean_name(time.name), times, time.stated.get("unit", ""))
            stated |= clock.stated
            if not clock.flaw:
                stated["start"] = TIME_UNITS[clock.unit or "s"] * float(times[0])
            if "recorded_at" in time.stated:
                stated["recorded_at"] = time.stated["recorded_at"]
    return [
        MeasuredChannel(array.name + place, keep_values(column, f"{path}, {array.name}"), **stated)
        for place, column in split_columns(array.values).items()
    ]


def _find_nearest(stated: Sequence[NamedArray], array: NamedArray) -> NamedArray:
    """Return that one of arrays that shares most groups with another; the outermost of equals."""
    parts = PARTS.split(array.name)

    def rank(other: NamedArray) -> tuple[int, int]:
        others = PARTS.split(other.name)
        same = [a == b for a, b in zip(parts, others, strict=False)]
        return [*same, False].index(False), -len(others)

    return max(stated, key=rank)


def _is_unit(array: NamedArray) -> bool:
    """Return whether a text is the unit of values, not of their times."""
    *groups, last = PARTS.split(array.name)
    names = {clean_name(last), f"{groups[-1] if groups else ''}.{last}"}
    is_clocks = any(clean_name(group) == "x values" for group in groups)
    return array.values.dtype.kind == "U" and bool(names & UNIT_NAMES) and not is_clocks


def _find_unit(array: NamedArray, units: Sequence[NamedArray]) -> NamedArray:
    """Return an array with the unit that is stated in its group, or around it."""
    groups = PARTS.split(array.name)[:-1]
    around = [
        unit
        for unit in units
        if unit.values.size == 1
        and (PARTS.split(unit.name.removesuffix(".quantity.label"))[: len(groups)] == groups)
    ]
    if array.stated.get("unit") or not around:
        return array
    unit = str(_find_nearest(around, array).values.item())
    return replace(array, stated={**array.stated, "unit": unit})


def read_stated_rate(array: NamedArray) -> float:
    """Return the sampling rate that a number in the file states [Hz]; NaN: it does not."""
    if array.values.size != 1:
        return math.nan
    try:
        value = float(array.values.item())  # some write numbers as text
    except (TypeError, ValueError):
        return math.nan
    return compute_stated_rate(get_last_part(array.name), value)


def _make_seconds(array: NamedArray) -> NamedArray:
    """Return stamps, as pandas writes them, as seconds from the first; all else as it is."""
    stamps = array.values
    if stamps.dtype.kind not in "mM" or not stamps.size or np.isnat(stamps).any():
        return array
    counts = (stamps - stamps.flat[0]).astype("timedelta64[ns]").astype(np.int64)
    stated: dict[str, Any] = {"unit": "s"}
    if stamps.dtype.kind == "M":
        first = stamps.flat[0].astype("datetime64[ns]").astype(np.int64)
        stated |= {"recorded_at": int(first)}
    return replace(array, values=counts / NANOSECONDS, stated=stated)


def _find_axis(array: NamedArray) -> Axis | None:
    return find_axis(clean_name(array.name), array.stated.get("unit", ""))


def _is_time(array: NamedArray) -> bool:
    """Return whether an array is an axis: called time, or called otherwise and rising evenly."""
    if array.is_channel or not _is_channel(array) or max(array.values.shape) != array.values.size:
        return False
    is_called_time = find_axis(clean_name(array.name)) is Axis.TIME
    return is_called_time or (_find_axis(array) is not None and is_clock(array.values.ravel()))


def _is_channel(array: NamedArray) -> bool:
    values = array.values
    is_large = 1 <= values.ndim <= DIMENSIONS and values.size > 1
    return values.dtype.kind in "iuf" and (array.is_channel or is_large)


def read_npy(path: Path) -> Measurement:
    """Read an array of up to three axes, of which the longest is time; its columns have no names.

    Raises
    ------
    FileError
        If the file is no sound `.npy` file, or holds no real numbers.
    """
    # A map refuses a file that is shorter than its header says.
    array = np.load(path, mmap_mode="r", allow_pickle=False)
    if not isinstance(array, np.ndarray):
        raise FileError(f"{path} is no .npy file: it holds several arrays")
    name = "column 1" if array.ndim == 1 else "column"
    return make_measurement(path, [NamedArray(name, array)])


def read_npz(path: Path) -> Measurement:
    """Read an archive of arrays, see `make_measurement`.

    Raises
    ------
    FileError
        If the file is no sound archive, holds objects, or no vector of real numbers.
    """
    arrays = []
    with zipfile.ZipFile(path) as archive:
        members = [item for item in archive.infolist() if item.filename.endswith(".npy")]
        check_size(path, sum(member.file_size for member in members))
        for member in members:
            name = member.filename.removesuffix(".npy")
            with archive.open(member) as file:
                values = np.lib.format.read_array(file, allow_pickle=False)
            arrays.append(NamedArray(name, values))
    return make_measurement(path, arrays)


LIST_MARK = b"["
"""Beginning of such a list; results of a rig begin otherwise."""


def is_list(path: Path) -> bool:
    """Return whether a file of JSON holds a list, not results."""
    try:
        with open_regular(path) as file:
            return file.read(64).lstrip().startswith(LIST_MARK)
    except (OSError, FileError):
        return False


def read_sep005(path: Path) -> Measurement:
    """Read the channels of a list: `name`, `data`, `fs` [Hz] and `unit_str` of each.

    Raises
    ------
    FileError
        If the file is no such list.
    """
    content = json.loads(path.read_text("utf-8"))
    if not isinstance(content, list) or not all(isinstance(item, dict) for item in content):
        raise FileError(
            f"{path} is no list of channels: each should have name, data, fs, unit_str"
        )
    arrays = [
        NamedArray(
            str(item.get("name", f"channel {number}")),
            np.asarray(item.get("data", ())),
            {
                "sampling_rate": float(item.get("fs", np.nan)),
                "unit": str(item.get("unit_str", "")),
            },
        )
        for number, item in enumerate(content, start=1)
    ]
    return make_measurement(path, arrays)
