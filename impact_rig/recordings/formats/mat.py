"""MATLAB's files: by scipy, and since MATLAB 7.3 by h5py."""

import math
import os
import re
import struct
import zlib
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from impact_rig.core.errors import FileError
from impact_rig.recordings.formats.hdf5 import read_hdf5
from impact_rig.recordings.formats.measurement import (
    Measurement,
    NamedArray,
    describe_channels,
    make_measurement,
    make_unique,
    read_described,
)
from impact_rig.recordings.formats.sizes import SizeLimit

READ = {1, 2, 4, *range(6, 16)}
"""Classes of variables that are read: cells, structs, text and numbers; objects, functions and
what only MATLAB knows are left alone."""
HEADING, TAG_SIZE = 128, 8
"""Sizes of what stands at the beginning, and before each variable [byte]."""
ORDERS = {b"IM": "<", b"MI": ">"}
"""Byte orders by the end of the heading; MATLAB 4, whose files are not compressed, has none."""
COMPRESSED = 15
"""Kind of a variable that is compressed."""
CLASS, SHAPE, SHORTEST_HEADING = 8, 24, 40
"""Where a variable says its class and its shape, and what stands before its numbers [byte]."""
PIECE = 1 << 20
"""What is unpacked at once to learn its size [byte]."""
NUMBER_SIZE = 8
"""Of a number, or of a place in a cell, in memory [byte]."""
HDF5_MARK = b"\x89HDF\r\n\x1a\n"
HDF5_BLOCK = 512
"""Where HDF5 begins in MATLAB's files [byte]: after words for people."""
CHANNELS = "channels"
"""Ours: names, units, rates, starts and dates of all variables, as JSON."""
NAME_LETTERS = 27
"""Longest name of a variable: of the 31 that every MATLAB reads some are left for a number."""


_POOL: list[ProcessPoolExecutor] = []
"""The process that reads MATLAB's files; none: it was not needed yet."""


def read_mat(path: Path) -> Measurement:
    """Read a file in a second process, since damaged ones crash scipy; see `parse_mat`.

    Raises
    ------
    FileError
        If the file is no file of MATLAB, is damaged, or has no vector of real numbers.
    """
    for _ in range(2):  # the process of an earlier file may have been killed since
        if not _POOL:
            _POOL.append(ProcessPoolExecutor(1, mp_context=get_context("spawn")))
        try:
            return _POOL[0].submit(parse_mat, path).result()
        except BrokenProcessPool:
            _POOL.clear()
    raise FileError(f"{path} is no sound .mat file: it crashes the library scipy")


def parse_mat(path: Path) -> Measurement:
    """Read all arrays of real numbers, those in structs and cells too.

    They are named as MATLAB does: `run.hits(2).front`, `tests{3}`. Time and rate are variables by
    their names, see `make_measurement`.

    Raises
    ------
    FileError
        If the file is no file of MATLAB, is cut off, or has no vector of real numbers.
    """
    with path.open("rb") as file:
        beginning = file.read(HDF5_BLOCK + len(HDF5_MARK))
    if HDF5_MARK in (beginning[: len(HDF5_MARK)], beginning[HDF5_BLOCK:]):
        return read_hdf5(path)

    from scipy.io import loadmat

    names = _list_variables(path)
    variables = loadmat(path, appendmat=False, variable_names=names, simplify_cells=True)
    text = variables.get(CHANNELS)
    if isinstance(text, str):
        return read_described(path, text, variables)
    arrays = [array for name in names for array in _list_arrays(_part(name), variables[name])]
    return make_measurement(path, arrays)


def _list_variables(path: Path) -> list[str]:
    """Return the names of what is read.

    Raises
    ------
    FileError
        If the file unpacks to more than one of its size may.
    """
    from scipy.io import whosmat

    limit = SizeLimit(path)
    names = []
    with path.open("rb") as file:
        order = ORDERS.get(file.read(HEADING)[-2:])
        if order is None:
            for name, shape, _ in whosmat(path, appendmat=False):
                limit.claim(math.prod(shape) * NUMBER_SIZE)
                names.append(name)
            return names
        while len(tag := file.read(TAG_SIZE)) == TAG_SIZE:
            kind, size = struct.unpack(f"{order}II", tag)
            if kind == COMPRESSED:
                head = _unpack(file.read(size), limit)[TAG_SIZE:]
            else:
                head = file.read(min(size, PIECE))
                file.seek(size - len(head), os.SEEK_CUR)
            names += _read_heading(head, order, limit)
    return names


def _unpack(packed: bytes, limit: SizeLimit) -> bytes:
    """Return the beginning of what is packed, its whole size counted."""
    engine, head = zlib.decompressobj(), b""
    while packed and not engine.eof:
        piece = engine.decompress(packed, PIECE)
        limit.claim(len(piece))
        head = head or piece
        packed = engine.unconsumed_tail
    return head


def _read_heading(head: bytes, order: str, limit: SizeLimit) -> list[str]:
    """Return the name of a variable that is read, its size counted; nothing of others."""
    if len(head) < SHORTEST_HEADING or head[CLASS if order == "<" else CLASS + 3] not in READ:
        return []
    # Class, then shape and name, each behind a tag of kind and size.
    (size,) = struct.unpack_from(f"{order}I", head, SHAPE - 4)
    shape = np.frombuffer(head, f"{order}i4", min(size, len(head) - SHAPE) // 4, SHAPE)
    limit.claim(math.prod(map(int, np.abs(shape))) * NUMBER_SIZE)
    place = SHAPE + -(-size // TAG_SIZE) * TAG_SIZE
    if place + TAG_SIZE > len(head):
        return []
    kind, size = struct.unpack_from(f"{order}II", head, place)
    start = place + TAG_SIZE
    if kind >> 16:  # a short name stands in its tag
        start, size = place + 4, kind >> 16
    name = head[start : start + size].decode("latin-1")
    return [name] if name else []


def _part(name: str) -> str:
    """Return the name of a variable with its channel as a separate part.

    B&K's PULSE writes `Channel_1_Data` and `Channel_1_Header`, Dewesoft `Data1_AI_1` and
    `Data1_time_AI_1`.
    """
    name = re.sub(r"^(Channel_\d+)_(?=Data$|Header$)", r"\1.", name)
    return re.sub(r"^(Data\d+)_time_(.+)$", r"\1_\2.time", name)


def _list_arrays(name: str, value: Any) -> Iterator[NamedArray]:
    """Yield the arrays of a variable, those in its structs and cells with their places."""
    if isinstance(value, np.ndarray) and value.dtype == object:
        value = value.ravel("F").tolist()
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _list_arrays(f"{name}.{key}", item)
    elif isinstance(value, list):
        is_struct = all(isinstance(item, dict) for item in value)
        for number, item in enumerate(value, start=1):
            yield from _list_arrays(
                f"{name}({number})" if is_struct else f"{name}{{{number}}}", item
            )
    else:
        # SigLab's measurements are in volts before the factor eu_val.
        unit = "V" if name.endswith(".tdmeas") else ""
        yield NamedArray(name, np.asarray(value), {"unit": unit})


def write_mat(path: Path, measurement: Measurement) -> None:
    """Write each channel as a variable, and what is known of them as JSON.

    The names of variables are made of the channels' by letters that MATLAB
    allows; the text `channels` has the names themselves: see MATLAB's `jsondecode`.
    """
    from scipy.io import savemat

    channels = measurement.channels
    names = make_unique([CHANNELS, *(channel.name for channel in channels)], _clean, "_{}")[1:]
    variables = {
        name: channel.values[:, np.newaxis] for name, channel in zip(names, channels, strict=True)
    }
    savemat(path, {CHANNELS: describe_channels(channels, names), **variables}, appendmat=False)


def _clean(name: str) -> str:
    """Return a name that begins with a letter and has letters, digits and underscores."""
    name = re.sub(r"\W", "_", name, flags=re.ASCII)
    return (name if name[:1].isalpha() else f"x{name}")[:NAME_LETTERS]
