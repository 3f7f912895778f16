"""All formats by suffix."""

from collections.abc import Callable
from pathlib import Path

from impact_rig.core.errors import FileError
from impact_rig.recording.formats.hdf5 import read_hdf5, write_hdf5
from impact_rig.recording.formats.lvm import read_lvm
from impact_rig.recording.formats.mat import read_mat, write_mat
from impact_rig.recording.formats.measurement import Measurement
from impact_rig.recording.formats.numpy_files import read_npy, read_npz
from impact_rig.recording.formats.soundness import blame_file
from impact_rig.recording.formats.tdms import read_tdms, write_tdms
from impact_rig.recording.formats.text import read_text, write_text
from impact_rig.recording.formats.uff import read_uff, write_uff
from impact_rig.recording.formats.wav import read_wav
from impact_rig.recording.writing.new_file import write_new_file

READERS: dict[str, Callable[[Path], Measurement]] = {
    ".lvm": read_lvm,
    ".tdms": read_tdms,
    ".uff": read_uff,
    ".unv": read_uff,
    ".58": read_uff,
    ".mat": read_mat,
    ".h5": read_hdf5,
    ".hdf5": read_hdf5,
    ".wav": read_wav,
    ".csv": read_text,
    ".txt": read_text,
    ".dat": read_text,
    ".tsv": read_text,
    ".npy": read_npy,
    ".npz": read_npz,
}
WRITERS: dict[str, Callable[[Path, Measurement], None]] = {
    ".uff": write_uff,
    ".tdms": write_tdms,
    ".mat": write_mat,
    ".h5": write_hdf5,
    ".csv": write_text,
}
KINDS = {
    ".lvm": "LabVIEW measurement",
    ".tdms": "National Instruments TDMS",
    ".uff": "universal file, data set 58",
    ".unv": "universal file, data set 58",
    ".58": "universal file, data set 58",
    ".mat": "MATLAB",
    ".h5": "HDF5",
    ".hdf5": "HDF5",
    ".wav": "sound",
    ".csv": "text",
    ".txt": "text",
    ".dat": "text",
    ".tsv": "text",
    ".npy": "numpy array",
    ".npz": "numpy archive",
}

READABLE = {suffix: KINDS[suffix] for suffix in READERS}
"""What can be read: suffix and what it is."""
WRITABLE = {suffix: KINDS[suffix] for suffix in WRITERS}
"""What can be written."""


def read_measurement(path: Path) -> Measurement:
    """Read the channels of a file, whose suffix tells its format.

    Parameters
    ----------
    path : Path
        Of the file.

    Returns
    -------
    Measurement
        Text and `.npy` files state all columns, one of times among them; elsewhere a channel of
        times gives the others their sampling rate and start.

    Raises
    ------
    FileError
        If the file is not there, of a kind unknown here, damaged, or holds no channel.
    SignalError
        If its times do not run in even steps.
    """
    path = Path(path)
    _check_readable(path)
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise _make_suffix_error(path, READABLE)
    with blame_file(path):
        return reader(path)


def write_measurement(path: Path, measurement: Measurement) -> None:
    """Write channels to a new file, whose suffix tells its format.

    Parameters
    ----------
    path : Path
        Of the new file; nothing is overwritten, and it appears complete or not at all.
    measurement : Measurement
        What to write; its path is named in messages.

    Raises
    ------
    FileError
        If the format cannot hold the measurement, or the file cannot be written.
    """
    path = Path(path)
    writer = WRITERS.get(path.suffix.lower())
    if writer is None:
        raise _make_suffix_error(path, WRITABLE)
    with write_new_file(path) as part:
        writer(part, measurement)


def _make_suffix_error(path: Path, known: dict[str, str]) -> FileError:
    return FileError(
        f"{path} is of a kind unknown here ({path.suffix or 'no suffix'}): it should be"
        f" {', '.join(known)}"
    )


def _check_readable(path: Path) -> None:
    try:
        with path.open("rb") as file:
            is_empty = not file.read(1)
    except FileNotFoundError:
        raise FileError(f"there is no file {path}") from None
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}") from None
    if is_empty:
        raise FileError(f"{path} is empty")
