"""Arrays as numpy stores them: `.npy` and `.npz`. Nothing is ever unpickled."""

import zipfile
from pathlib import Path

import numpy as np

from impact_rig.core.given.errors import FileError
from impact_rig.files.formats.arrays import NamedArray, make_measurement
from impact_rig.files.formats.bounds import check_size
from impact_rig.files.measurement import Measurement


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
