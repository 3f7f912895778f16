"""HDF5, by h5py: our own files, those of others, and MATLAB's since 7.3."""

import errno
import math
import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from impact_rig.core.given.errors import FileError
from impact_rig.files.formats.arrays import (
    DIMENSIONS,
    UNIT_NAMES,
    NamedArray,
    clean_name,
    make_measurement,
)
from impact_rig.files.formats.rates import (
    compute_stated_rate,
    is_rate_name,
    is_step_name,
    states_unit,
)
from impact_rig.files.measurement import DESCRIBED, ORIGIN, Measurement, make_unique

START_NAMES = {"start", "start s", "t0", "x0"}
"""Names of attributes, in small letters, underscores as blanks."""
ROOM = 4 << 20
"""Room left free on the disk [byte], our choice: the library has its descriptions in memory until
it closes a file, and takes this process with it where they find no room."""
UNIT_OF_RATE = " unit"
"""Ending of the name of a rate's unit, as `sampling_rate_unit`."""


def _says_rate(name: str) -> bool:
    name = name.removesuffix(UNIT_OF_RATE)
    return is_rate_name(name) or is_step_name(name)


FAMILIES = (_says_rate, UNIT_NAMES.__contains__, START_NAMES.__contains__)
"""Whether a name says one of these; in a family all say the same."""
NAME = "name"
"""Ours: a name may have slashes, which part groups here."""
RECORDED_AT = "recorded_at"
"""Ours: when the start's time was 0, nanoseconds since the epoch."""
MATLAB_NUMBERS = {
    "double", "single", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64",
}  # fmt: skip
"""MATLAB's names of arrays of numbers; words are numbers in its files, too."""


def read_hdf5(path: Path) -> Measurement:
    """Read all data sets of up to three axes, of which the longest is time.

    Rate, unit and start are attributes of the data set or of a group around it, or arrays by
    their names, see `make_measurement`.

    Raises
    ------
    FileError
        If the file is no HDF5, is cut off, or has no vector of real numbers.
    """
    import h5py

    with h5py.File(path, "r") as file:
        arrays = list(_read_group(path, file, {}, set()))
    return make_measurement(path, arrays)


def _read_group(
    path: Path, group: Any, stated: dict[str, Any], visited: set[int]
) -> Iterator[NamedArray]:
    """Yield the arrays of a group and of those in it; links to other files are left alone."""
    import h5py

    stated = _inherit(stated, group)
    for key in group:
        if not isinstance(group.get(key, getlink=True), h5py.HardLink) or key == "#refs#":
            continue
        item = group[key]
        address = h5py.h5o.get_info(item.id).addr
        if address in visited:
            continue
        visited.add(address)
        if isinstance(item, h5py.Group):
            yield from _read_group(path, item, stated, visited)
        elif isinstance(item, h5py.Dataset) and _is_readable(item):
            yield _read_array(path, item, _inherit(stated, item))


def _is_readable(item: Any) -> bool:
    """Return whether a data set holds real numbers, with few axes, in this file."""
    matlab = item.attrs.get("MATLAB_class", b"double")
    kind = matlab.decode() if isinstance(matlab, bytes) else str(matlab)
    return (
        item.shape is not None
        and len(item.shape) <= DIMENSIONS
        and item.dtype.kind in "iufc"
        and kind in MATLAB_NUMBERS
        and not item.is_virtual
        and not item.external
    )


def _read_array(path: Path, item: Any, stated: dict[str, Any]) -> NamedArray:
    name = item.name.strip("/")
    if item.size and not item.id.get_storage_size():
        raise FileError(f"{path}: {name} should have {item.size} numbers, the file has none")
    rate, has_unit = _find_rate(stated)
    units = [stated[key] for key in stated if key in UNIT_NAMES]
    recorded_at = item.attrs.get(RECORDED_AT)
    return NamedArray(
        name=str(item.attrs.get(NAME, name)),
        values=np.asarray(item[()]),
        stated={
            "sampling_rate": rate,
            "unit": str(units[-1]) if units else "",
            "start": _read_number(stated, START_NAMES, 0.0),
            "recorded_at": int(recorded_at) if isinstance(recorded_at, np.integer) else 0,
            ORIGIN: str(item.attrs.get(ORIGIN, "")),
            "time_unit": "s" if has_unit else "",
        },
        is_channel=NAME in item.attrs and len(item.shape) == 1,
    )


def _find_rate(stated: dict[str, Any]) -> tuple[float, bool]:
    """Return the sampling rate that is stated [Hz], NaN for none, and whether its unit is, too."""
    for name in stated:
        unit = str(stated.get(name + UNIT_OF_RATE, ""))
        rate = compute_stated_rate(name, _read_number(stated, {name}), unit)
        if rate > 0:
            return rate, states_unit(name, unit)
    return math.nan, False


def _inherit(stated: dict[str, Any], item: Any) -> dict[str, Any]:
    """Return the statements of the groups around an item, with its own in their place."""
    own = {}
    for name in item.attrs:
        if any(says(clean_name(name)) for says in FAMILIES):
            value = item.attrs[name]
            is_bytes = isinstance(value, bytes)
            own[clean_name(name)] = value.decode("utf-8", "replace") if is_bytes else value
    for family in FAMILIES:
        if any(map(family, own)):
            stated = {name: value for name, value in stated.items() if not family(name)}
    return stated | own


def _read_number(stated: dict[str, Any], names: set[str], default: float = math.nan) -> float:
    for name, value in stated.items():
        if name in names and np.size(value) == 1 and np.asarray(value).dtype.kind in "iuf":
            return float(np.ravel(value)[0])
    return default


def write_hdf5(path: Path, measurement: Measurement) -> None:
    """Write each channel as a data set with its rate, unit, start and date as attributes.

    A slash in a name becomes an underscore; the attribute `name` keeps it.
    """
    import h5py

    channels = measurement.channels
    names = make_unique([channel.name for channel in channels], _clean)
    _check_room(path, 0)
    with h5py.File(path, "w", track_order=True) as file:
        for name, channel in zip(names, channels, strict=True):
            values = channel.values
            _check_room(path, values.nbytes)
            item = file.create_dataset(name, data=values)
            for key in DESCRIBED:
                value = getattr(channel, key)
                if value or key not in (RECORDED_AT, ORIGIN):
                    item.attrs[key] = value


def _check_room(path: Path, size: int) -> None:
    if shutil.disk_usage(path.parent).free < size + ROOM:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _clean(name: str) -> str:
    name = re.sub(r"[/\0]", "_", name)
    return name if name.strip(".") else f"channel {name}"
