"""MATLAB's files: by scipy, and since MATLAB 7.3 by h5py."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np

from impact_rig.recording.formats.hdf5 import read_hdf5
from impact_rig.recording.formats.measurement import Measurement
from impact_rig.recording.formats.named_arrays import NamedArray, make_measurement
from impact_rig.recording.formats.soundness import LARGEST_PACKING, check_claim
from impact_rig.recording.formats.unique_names import make_unique

HDF5_MARK = b"\x89HDF\r\n\x1a\n"
HDF5_BLOCK = 512
"""Where HDF5 begins in MATLAB's files [byte]: after words for people."""
LARGEST_NUMBER = 8
"""Size of a float64 [byte]."""
CHANNELS = "channels"
"""Ours: names, units, rates and starts of all variables, as one struct array."""
FIELDS = ("variable", "name", "unit", "sampling_rate", "start")
"""Of the struct array."""
NAME_LETTERS = 27
"""Longest name of a variable: of the 31 that every MATLAB reads some are left for a number."""


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

    from scipy.io import loadmat, whosmat

    for name, shape, _ in whosmat(path, appendmat=False):
        check_claim(path, name, LARGEST_NUMBER * math.prod(shape), LARGEST_PACKING)
    variables = loadmat(path, appendmat=False)
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
    table = variables.get(CHANNELS)
    if not isinstance(table, np.ndarray) or table.dtype.names != FIELDS:
        return {}
    stated = {}
    for row in table.ravel():
        variable, name, unit = ("".join(row[field].tolist()) for field in FIELDS[:3])
        rate, start = (float(row[field].item()) for field in FIELDS[3:])
        values = variables[variable].ravel()
        stated[variable] = NamedArray(name, values, rate, unit, start, is_channel=True)
    return stated


def write_mat(path: Path, measurement: Measurement) -> None:
    """Write each channel as a variable, and what is known of them as a struct array.

    Parameters
    ----------
    path : Path
        Of the new file.
    measurement : Measurement
        What to write. The names of variables are made of the channels' by letters that MATLAB
        allows; the struct array `channels` has the names themselves.
    """
    from scipy.io import savemat

    channels = measurement.channels
    names = make_unique([CHANNELS, *(channel.name for channel in channels)], _clean, "_{}")[1:]
    table = np.array(
        [
            (variable, channel.name, channel.unit, channel.sampling_rate, channel.start)
            for variable, channel in zip(names, channels, strict=True)
        ],
        dtype=[(field, object) for field in FIELDS],
    )
    variables = {
        name: channel.values[:, np.newaxis] for name, channel in zip(names, channels, strict=True)
    }
    savemat(path, {CHANNELS: table, **variables}, appendmat=False)


def _clean(name: str) -> str:
    """Return a name that begins with a letter and has letters, digits and underscores."""
    name = re.sub(r"\W", "_", name, flags=re.ASCII)
    return (name if name[:1].isalpha() else f"x{name}")[:NAME_LETTERS]
