"""Arrays as numpy stores them: `.npy` and `.npz`. Nothing is ever unpickled."""

import zipfile
from pathlib import Path

import numpy as np

from impact_rig.core.errors import FileError
from impact_rig.recordings.formats.measurement import (
    LARGEST_PACKING,
    MeasuredChannel,
    Measurement,
    NamedArray,
    check_claim,
    keep_values,
    make_measurement,
    split_columns,
)


def read_npy(path: Path) -> Measurement:
    """Read an array of one or two axes, of which the longer is time; its columns have no names.

    Raises
    ------
    FileError
        If the file is no sound `.npy` file, or holds no real numbers.
    """
    # A map refuses a file that is shorter than its header says.
    array = np.load(path, mmap_mode="r", allow_pickle=False)
    if not isinstance(array, np.ndarray):
        raise FileError(f"{path} is no .npy file: it holds several arrays")
    if array.dtype.kind not in "fiu":
        raise FileError(f"{path} holds {array.dtype}: traces are real numbers")
    if array.ndim not in (1, 2) or 0 in array.shape:
        raise FileError(
            f"{path} has shape {array.shape}: it should be (points,), (columns, points)"
            " or (points, columns)"
        )
    return Measurement(
        path,
        tuple(
            MeasuredChannel(f"column {number}", keep_values(column, f"{path}, column {number}"))
            for number, column in enumerate(split_columns(array), start=1)
        ),
    )


def read_npz(path: Path) -> Measurement:
    """Read an archive of arrays, see `make_measurement`.

    Raises
    ------
    FileError
        If the file is no sound archive, holds objects, or no vector of real numbers.
    SignalError
        If it holds times that do not run in even steps.
    """
    arrays = []
    with zipfile.ZipFile(path) as archive:
        for member in archive.infolist():
            if not member.filename.endswith(".npy"):
                continue
            name = member.filename.removesuffix(".npy")
            check_claim(path, name, member.file_size, LARGEST_PACKING)
            with archive.open(member) as file:
                values = np.lib.format.read_array(file, allow_pickle=False)
            arrays.append(NamedArray(name, values))
    return make_measurement(path, arrays)
