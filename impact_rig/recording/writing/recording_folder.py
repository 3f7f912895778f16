"""The folder of a new recording."""

from pathlib import Path

from impact_rig.core.errors import FileError
from impact_rig.recording.reading.bag_files import SUFFIX
from impact_rig.recording.writing.bag_metadata import METADATA_NAME
from impact_rig.recording.writing.disk_file import sync_folder

BAG_SUFFIXES = frozenset({SUFFIX, ".db3"})
"""Of the files that make a folder one of rosbag2."""


def make_folders(folder: Path) -> list[Path]:
    """Make a folder and those above it, and put their names on the disk.

    Returns
    -------
    list of Path
        Those that were not there, innermost first.

    Raises
    ------
    FileError
        If one cannot be made.
    """
    try:
        missing = [item for item in (folder, *folder.parents) if not item.exists()]
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise FileError(f"folder {folder} cannot be made: a file is in its way") from None
    except OSError as error:
        raise FileError(f"folder {folder} cannot be made: {error.strerror}") from None
    for item in missing:
        sync_folder(item.parent)
    return missing


def refuse_existing_recording(folder: Path) -> None:
    """Make sure that a folder holds no recording yet.

    Raises
    ------
    FileError
        If it does, or cannot be read.
    """
    try:
        names = sorted(item.name for item in folder.iterdir())
    except OSError as error:
        raise FileError(f"folder {folder} cannot be read: {error.strerror}") from None
    for name in names:
        if name == METADATA_NAME or Path(name).suffix in BAG_SUFFIXES:
            raise FileError(
                f"folder {folder} holds a recording already ({name}): none is overwritten, name"
                " another folder"
            )
