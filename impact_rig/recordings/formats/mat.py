"""MATLAB's files: by scipy, and since MATLAB 7.3 by h5py."""

import json
import math
import re
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from impact_rig.core.errors import FileError
from impact_rig.recordings.formats.hdf5 import read_hdf5
from impact_rig.recordings.formats.measurement import (
    LARGEST_PACKING,
    Measurement,
    NamedArray,
    make_measurement,
    make_unique,
)

FILE_HEADER = 128
"""Words for people, version and byte order [byte]."""
ORDER_MARKS = {b"IM": "<", b"MI": ">"}
TAG = 8
"""Type and size of an element [byte]; up to four bytes of data are in the tag itself."""
SMALL = 4

INT8, INT32, UINT32, MATRIX, COMPRESSED, UTF8 = 1, 5, 6, 14, 15, 16
HEADERS = {(UINT32, shape, name) for shape in (INT32, UINT32) for name in (INT8, UTF8)}
"""Types of flags, shape and name of a variable, as MATLAB and as others write them."""
WIDTHS = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8}
"""Types of numbers, and what one takes [byte]."""
LETTER_WIDTHS = {2: 1, 4: 2, 16: 1, 17: 2}
"""The same of letters."""
LETTERS = 4
"""Class of an array of letters."""
NUMBERS = range(6, 16)
"""Classes of arrays of numbers."""
COMPLEX = 1 << 11
"""Flag of an array that has an imaginary part, too."""
HDF5_MARK = b"\x89HDF\r\n\x1a\n"
HDF5_BLOCK = 512
"""Where HDF5 begins in MATLAB's files [byte]: after words for people."""
CHANNELS = "channels"
"""Ours: names, units, rates, starts and dates of all variables, as JSON."""
NAME_LETTERS = 27
"""Longest name of a variable: of the 31 that every MATLAB reads some are left for a number."""


class _Element(NamedTuple):
    """Type and data of an element."""

    kind: int
    data: memoryview


def list_variables(path: Path) -> list[str]:
    """Return the names of variables of real numbers and of letters, which are safe to read.

    Parameters
    ----------
    path : Path
        Of the file.

    Returns
    -------
    list of str

    Raises
    ------
    FileError
        If anything in the file is not as it should be.
    """
    data = memoryview(path.read_bytes())
    order = ORDER_MARKS.get(bytes(data[126:FILE_HEADER]))
    if order is None:
        raise FileError(f"{path} is no .mat file: it states no order of bytes")
    found = []
    for element in _split(path, data[FILE_HEADER:], order, alignment=1):
        matrix = _unpack(path, element, order) if element.kind == COMPRESSED else element
        if matrix.kind != MATRIX:
            raise _make_error(path, f"an element is of type {matrix.kind}")
        name = _check_variable(path, matrix, order)
        if name:
            found.append(name)
    return found


def _split(path: Path, data: memoryview, order: str, alignment: int) -> Iterator[_Element]:
    """Yield the elements that stand one behind the other."""
    position = 0
    while position < len(data):
        if position + TAG > len(data):
            raise _make_error(path, "an element has no size")
        kind, size = struct.unpack_from(f"{order}II", data, position)
        start = position + TAG
        if kind >> 16:
            kind, size, start = kind & 0xFFFF, kind >> 16, position + SMALL
            if size > SMALL:
                raise _make_error(path, f"an element of {size} bytes is in four")
            position += TAG
        else:
            position = start + -(-size // alignment) * alignment
        if start + size > len(data):
            raise FileError(
                f"{path} is cut off: an element should have {size} bytes, {len(data) - start} are"
                " left"
            )
        yield _Element(kind, data[start : start + size])


def _unpack(path: Path, element: _Element, order: str) -> _Element:
    """Return the element in a packed one."""
    unpacker = zlib.decompressobj()
    data = unpacker.decompress(element.data, LARGEST_PACKING * len(element.data))
    if not unpacker.eof:
        raise _make_error(path, "a packed element has no end")
    elements = list(_split(path, memoryview(data), order, TAG))
    if len(elements) != 1:
        raise _make_error(path, f"a packed element holds {len(elements)}")
    return elements[0]


def _check_variable(path: Path, matrix: _Element, order: str) -> str:
    """Return the name of a variable whose numbers are all there; empty: one of another kind."""
    parts = list(_split(path, matrix.data, order, TAG))
    kinds = tuple(part.kind for part in parts[:3])
    if kinds not in HEADERS or len(parts[0].data) != TAG:
        raise _make_error(path, "a variable has no type, shape and name")
    flags = struct.unpack_from(f"{order}I", parts[0].data)[0]
    kind, is_complex = flags & 0xFF, bool(flags & COMPLEX)
    dimensions = len(parts[1].data) // SMALL
    shape = struct.unpack_from(f"{order}{dimensions}i", parts[1].data)
    name = bytes(parts[2].data).decode("latin-1")
    if kind not in NUMBERS and kind != LETTERS:
        return ""
    widths = WIDTHS if kind in NUMBERS else WIDTHS | LETTER_WIDTHS
    values = parts[3:]
    if len(values) != 1 + is_complex or min(shape, default=0) < 0:
        raise _make_error(path, f"{name!r} has shape {shape} and {len(values)} parts")
    for part in values:
        width = widths.get(part.kind)
        if width is None:
            raise _make_error(path, f"{name!r} has elements of type {part.kind}")
        if len(part.data) != width * math.prod(shape) and kind in NUMBERS:
            raise _make_error(
                path, f"{name!r} of shape {shape} has {len(part.data)} bytes of {width} each"
            )
    return "" if is_complex else name


def _make_error(path: Path, what: str) -> FileError:
    return FileError(f"{path} is no sound .mat file: {what}")


def read_mat(path: Path) -> Measurement:
    """Read all variables that are vectors or matrices of real numbers.

    Time and rate are variables by their names, see `make_measurement`.

    Raises
    ------
    FileError
        If the file is none of MATLAB's, is cut off, or has no vector of real numbers.
    SignalError
        If it has times that do not run in even steps.
    """
    with path.open("rb") as file:
        beginning = file.read(HDF5_BLOCK + len(HDF5_MARK))
    if HDF5_MARK in (beginning[: len(HDF5_MARK)], beginning[HDF5_BLOCK:]):
        return read_hdf5(path)

    from scipy.io import loadmat

    # Version 4 has no header: it begins with a number below 5000, a byte of zero in it.
    names = None if 0 in beginning[:4] else list_variables(path)
    variables = loadmat(path, appendmat=False, variable_names=names)
    stated = _read_stated(variables)
    return make_measurement(
        path,
        [
            stated[name] if name in stated else NamedArray(name, np.asarray(values))
            for name, values in variables.items()
            if not name.startswith("__")
        ],
    )


def _read_stated(variables: dict[str, Any]) -> dict[str, NamedArray]:
    """Return the channels that the file describes in our way, by the names of their variables."""
    text = variables.get(CHANNELS)
    if not isinstance(text, np.ndarray) or text.dtype.kind != "U" or text.size != 1:
        return {}
    return {
        row["variable"]: NamedArray(
            name=row["name"],
            values=variables[row["variable"]].ravel(),
            sampling_rate=row["sampling_rate"] or math.nan,
            unit=row["unit"],
            start=row["start"],
            is_channel=True,
            recorded_at=int(row.get("recorded_at") or 0),  # MATLAB writes it as 1.6e18
        )
        for row in json.loads(text.item())
    }


def write_mat(path: Path, measurement: Measurement) -> None:
    """Write each channel as a variable, and what is known of them as JSON.

    Parameters
    ----------
    path : Path
        Of the new file.
    measurement : Measurement
        What to write. The names of variables are made of the channels' by letters that MATLAB
        allows; the text `channels` has the names themselves: see MATLAB's `jsondecode`.
    """
    from scipy.io import savemat

    channels = measurement.channels
    names = make_unique([CHANNELS, *(channel.name for channel in channels)], _clean, "_{}")[1:]
    table = [
        {
            "variable": variable,
            "name": channel.name,
            "unit": channel.unit,
            "sampling_rate": None if math.isnan(channel.sampling_rate) else channel.sampling_rate,
            "start": channel.start,
            "recorded_at": channel.recorded_at or None,
        }
        for variable, channel in zip(names, channels, strict=True)
    ]
    variables = {
        name: channel.values[:, np.newaxis] for name, channel in zip(names, channels, strict=True)
    }
    savemat(path, {CHANNELS: json.dumps(table), **variables}, appendmat=False)


def _clean(name: str) -> str:
    """Return a name that begins with a letter and has letters, digits and underscores."""
    name = re.sub(r"\W", "_", name, flags=re.ASCII)
    return (name if name[:1].isalpha() else f"x{name}")[:NAME_LETTERS]
