"""All formats by suffix."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from impact_rig.core.errors import FileError
from impact_rig.recordings.formats.hdf5 import read_hdf5, write_hdf5
from impact_rig.recordings.formats.lvm import read_lvm
from impact_rig.recordings.formats.mat import read_mat, write_mat
from impact_rig.recordings.formats.measurement import Measurement, blame_file
from impact_rig.recordings.formats.numpy_files import read_npy, read_npz
from impact_rig.recordings.formats.parquet import read_parquet, write_parquet
from impact_rig.recordings.formats.reading_process import ReadingProcess
from impact_rig.recordings.formats.tdms import read_tdms, write_tdms
from impact_rig.recordings.formats.text import read_text, write_text
from impact_rig.recordings.formats.uff import read_uff, write_uff
from impact_rig.recordings.formats.wav import read_wav
from impact_rig.recordings.new_file import write_new_file


class Format(NamedTuple):
    """What a file is, and who reads and writes it; None: it is not written.

    Text is read here, piece by piece, and its numbers may be more than memory holds; all else by
    libraries, in a process of its own.
    """

    kind: str
    read: Callable[[Path], Measurement]
    write: Callable[[Path, Measurement], None] | None = None

    @property
    def is_text(self) -> bool:
        """Whether reading it takes no more than a piece of it."""
        return self.read is read_text


_UFF = "universal file, data set 58"
FORMATS = {
    ".lvm": Format("LabVIEW measurement", read_lvm),
    ".tdms": Format("National Instruments TDMS", read_tdms, write_tdms),
    ".uff": Format(_UFF, read_uff, write_uff),
    ".unv": Format(_UFF, read_uff),
    ".58": Format(_UFF, read_uff),
    ".mat": Format("MATLAB", read_mat, write_mat),
    ".h5": Format("HDF5", read_hdf5, write_hdf5),
    ".hdf5": Format("HDF5", read_hdf5),
    ".parquet": Format("Apache Parquet", read_parquet, write_parquet),
    ".wav": Format("sound", read_wav),
    ".csv": Format("text", read_text, write_text),
    ".txt": Format("text", read_text),
    ".dat": Format("text", read_text),
    ".tsv": Format("text", read_text),
    ".npy": Format("numpy array", read_npy),
    ".npz": Format("numpy archive", read_npz),
}
"""All formats by suffix."""
READABLE = {suffix: item.kind for suffix, item in FORMATS.items()}
"""What can be read: suffix and what it is."""
WRITABLE = {suffix: item.kind for suffix, item in FORMATS.items() if item.write}
"""What can be written."""


PROCESS = ReadingProcess()
"""Where files are read, so that none of them can harm this process."""


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
        If the file is not there, of a kind unknown here, damaged, takes more memory or time than
        one of its size may, or holds no channel.
    SignalError
        If its times do not run in even steps.
    """
    path = Path(path)
    _check_readable(path)
    found = FORMATS.get(path.suffix.lower())
    if found is None:
        raise _make_suffix_error(path, READABLE)
    return parse_file(path) if found.is_text else PROCESS.read(path)


def parse_file(path: Path) -> Measurement:
    """Read the same here, without limits; see `read_measurement`."""
    with blame_file(path):
        return FORMATS[path.suffix.lower()].read(path)


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
    found = FORMATS.get(path.suffix.lower())
    if found is None or found.write is None:
        raise _make_suffix_error(path, WRITABLE)
    with write_new_file(path) as part:
        found.write(part, measurement)


def _make_suffix_error(path: Path, known: dict[str, str]) -> FileError:
    return FileError(
        f"{path} is of a kind unknown here ({path.suffix or 'no suffix'}): it should be"
        f" {', '.join(known)}"
    )


def _check_readable(path: Path) -> None:
    if path.exists() and not path.is_file():  # a pipe would never end
        raise FileError(f"{path} cannot be read: it is no file")
    try:
        with path.open("rb") as file:
            is_empty = not file.read(1)
    except FileNotFoundError:
        raise FileError(f"there is no file {path}") from None
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}") from None
    if is_empty:
        raise FileError(f"{path} is empty")
