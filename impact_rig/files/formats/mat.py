"""MATLAB's files: by scipy, and since MATLAB 7.3 by h5py."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from impact_rig.files.formats.arrays import NamedArray, make_measurement
from impact_rig.files.formats.hdf5 import read_hdf5
from impact_rig.files.measurement import (
    Measurement,
    make_unique,
    read_described,
    write_described,
)

HDF5_MARK = b"\x89HDF\r\n\x1a\n"
CHANNELS = "channels"
"""Ours: names, units, rates, starts and dates of all variables, as JSON."""
NAME_LETTERS = 27
"""Longest name of a variable: of the 31 that every MATLAB reads some are left for a number."""


def read_mat(path: Path) -> Measurement:
    """Read all arrays of real numbers, those in structs and cells too.

    They are named as MATLAB does: `run.hits(2).front`, `tests{3}`. Time and rate are variables by
    their names, see `make_measurement`.

    Raises
    ------
    FileError
        If the file is no file of MATLAB, is cut off, or has no vector of real numbers.
    """
    with path.open("rb") as file:
        # 512 bytes with words for people stand before the mark.
        if HDF5_MARK in file.read(512 + len(HDF5_MARK)):
            return read_hdf5(path)

    from scipy.io import loadmat
    from scipy.io.matlab import MatlabFunction, MatlabObject, MatlabOpaque

    found = loadmat(path, appendmat=False, simplify_cells=True)
    text = found.get(CHANNELS)
    if isinstance(text, str):
        return read_described(path, text, found)
    unknown = MatlabFunction, MatlabObject, MatlabOpaque  # what only MATLAB knows
    arrays = [
        array
        for name, value in found.items()
        if not name.startswith("__") and not isinstance(value, unknown)
        for array in _list_arrays(_part(name), value)
    ]
    return make_measurement(path, arrays)


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
    with path.open("wb") as file:
        savemat(file, {CHANNELS: write_described(channels, names)})
        for name, channel in zip(names, channels, strict=True):
            savemat(file, {name: channel.values[:, np.newaxis]})


def _clean(name: str) -> str:
    """Return a name that begins with a letter and has letters, digits and underscores."""
    name = re.sub(r"\W", "_", name, flags=re.ASCII)
    return (name if name[:1].isalpha() else f"x{name}")[:NAME_LETTERS]
