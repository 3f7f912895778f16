"""All formats by suffix."""

import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path

from impact_rig.core.given.errors import FileError, ParameterError, RigError
from impact_rig.files.formats.arrays import read_npy, read_npz, read_sep005
from impact_rig.files.formats.bags import read_bag
from impact_rig.files.formats.bounds import read_apart
from impact_rig.files.formats.hdf5 import read_hdf5, write_hdf5
from impact_rig.files.formats.lvm import read_any_text, read_lvm
from impact_rig.files.formats.mat import read_mat, write_mat
from impact_rig.files.formats.parquet import read_parquet, write_parquet
from impact_rig.files.formats.scopes import read_scope
from impact_rig.files.formats.sheets import read_sheets
from impact_rig.files.formats.tdms import read_tdms, write_tdms
from impact_rig.files.formats.text import write_text
from impact_rig.files.formats.uff import read_uff, write_uff
from impact_rig.files.formats.wav import read_wav
from impact_rig.files.measurement import Measurement
from impact_rig.recordings.new_file import open_regular, write_new_file
from impact_rig.recordings.source import POINTER, find_recordings, is_other_form, refuse_pointer

Read = Callable[[Path], Measurement]
Write = Callable[[Path, Measurement], None]
FORMATS: dict[str, tuple[Read, Write | None]] = {
    ".lvm": (read_lvm, None),
    ".tdms": (read_tdms, write_tdms),
    ".uff": (read_uff, write_uff),
    **dict.fromkeys((".unv", ".58"), (read_uff, None)),
    ".mat": (partial(read_apart, "scipy.io", read_mat), write_mat),
    ".h5": (partial(read_apart, "h5py", read_hdf5), write_hdf5),
    ".hdf5": (partial(read_apart, "h5py", read_hdf5), None),
    ".parquet": (read_parquet, write_parquet),
    ".wav": (read_wav, None),
    ".csv": (read_any_text, write_text),
    **dict.fromkeys((".txt", ".dat", ".tsv", ".asc"), (read_any_text, None)),
    ".npy": (read_npy, None),
    ".npz": (read_npz, None),
    ".mcap": (read_bag, None),
    ".json": (partial(read_apart, "json", read_sep005), None),
    **dict.fromkeys(
        (".xlsx", ".xlsm", ".xls", ".xlsb", ".ods"),
        (partial(read_apart, "python_calamine", read_sheets), None),
    ),
    **dict.fromkeys(
        (".wfm", ".trc", ".bin", ".isf"), (partial(read_apart, "RigolWFM.wfm", read_scope), None)
    ),
}
"""Reader and writer of a format, by suffix; None: it is not written."""
WRITABLE = tuple(suffix for suffix, (_, write) in FORMATS.items() if write)
"""Suffixes of what can be written."""
_ASAMMDF = "from asammdf import MDF; MDF('{0}').export('csv', '{0}.csv', add_units=True)"
_MENU = "the program that wrote it exports it as text or MATLAB's"
OTHER_WAYS = {
    **dict.fromkeys((".mf4", ".mdf"), f'asammdf makes text of it: python3 -c "{_ASAMMDF}"'),
    ".bag": "rosbags makes MCAP of it: rosbags-convert --src {0} --dst {0}.converted"
    " --dst-storage mcap",
    ".ide": "enDAQ's idelib makes text of it: ideexport -r -t csv {0}",
    **dict.fromkeys((".dxd", ".dxz", ".d7d", ".d7z"), f"{_MENU} (Dewesoft: Export)"),
    ".psdata": f"{_MENU} (PicoScope: File, Save as)",
    ".raw": f"imc FAMOS: {_MENU} (imc FAMOS or STUDIO: Export)",
    ".tdm": "DIAdem or LabVIEW saves it as .tdms",
    ".catman": f"HBM catman: {_MENU} (catman: Export, ASCII or MATLAB)",
    ".wdf": f"{_MENU} (Yokogawa: Xviewer, or the oscilloscope itself)",
}
"""How to make a file that is read out of one that is not."""
SIGNATURES = {
    b"|CF,": ".raw",
    b"MDF ": ".mf4",
    **dict.fromkeys([number.to_bytes(2, "little") for number in range(5010, 5016)], ".catman"),
}
"""First bytes of files that are not read, whatever their suffix, with the key of `OTHER_WAYS`."""
SHOWN_LETTERS = 200
"""Longest excerpt of a library's complaint, our choice."""


def read_measurement(path: Path) -> Measurement:
    """Read the channels of a file, whose suffix tells its format.

    Returns
    -------
    Measurement
        Text and `.npy` files state all columns, one of times among them; elsewhere a channel of
        times gives the others their sampling rate and start.

    Raises
    ------
    FileError
        If the file is not there, of a kind unknown here, damaged, unpacks to more than one of its
        size may, or holds no channel.
    SignalError
        If its times do not run in even steps.
    """
    path = Path(path)
    if is_other_form(path):
        find_recordings(path)  # says how to convert it
    beginning = _check_readable(path)
    for signature, suffix in SIGNATURES.items():
        if beginning.startswith(signature):
            raise _make_suffix_error(path, (), suffix)
    read, _ = FORMATS.get(path.suffix.lower(), (None, None))
    if read is None:
        raise _make_suffix_error(path, tuple(FORMATS))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return read(path)
    except ParameterError as error:  # of a channel: it does not know its file
        raise FileError(f"{path}: {error}") from None
    except (RigError, ImportError):
        raise
    except MemoryError:
        raise FileError(
            f"{path} cannot be read: it asks for more memory than a file of its size may"
        ) from None
    except Exception as error:  # noqa: BLE001 - damaged files break libraries in every way there is
        words = str(error).strip().splitlines() or [type(error).__name__]
        raise FileError(
            f"{path} is no sound {path.suffix.lower()} file: {words[0][:SHOWN_LETTERS]}"
        ) from None


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
    _, write = FORMATS.get(path.suffix.lower(), (None, None))
    if write is None:
        raise _make_suffix_error(path, WRITABLE)
    with write_new_file(path) as part:
        write(part, measurement)


def _make_suffix_error(path: Path, known: tuple[str, ...], suffix: str = "") -> FileError:
    if way := OTHER_WAYS.get(suffix or path.suffix.lower()):
        return FileError(f"{path} cannot be read here: {way.format(path)}")
    return FileError(
        f"{path} is of a kind unknown here ({path.suffix or 'no suffix'}): it should be"
        f" {', '.join(known)}"
    )


def _check_readable(path: Path) -> bytes:
    """Return the first bytes of a file; refuse one that is none, is empty or a pointer."""
    try:
        with open_regular(path) as file:
            beginning = file.read(len(POINTER))
    except FileNotFoundError:
        raise FileError(f"there is no file {path}") from None
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}") from None
    if not beginning:
        raise FileError(f"{path} is empty")
    refuse_pointer(path, beginning)
    return beginning
