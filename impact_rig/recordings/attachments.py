"""Writes the files that are attached to a recording into a folder."""

from pathlib import Path

from impact_rig.core.errors import FileError
from impact_rig.recordings.new_file import write_new_file
from impact_rig.recordings.records import Attachment
from impact_rig.recordings.scan import Scan

UNNAMED = "attachment"
"""Name of a file that has none that could be used."""


def extract_attachments(path: Path, folder: Path) -> tuple[Path, ...]:
    """Write every attachment of a recording to a folder, under the last part of its name.

    Folders in a name are left out. The same file is written once; others of the same name are
    numbered.

    Parameters
    ----------
    path : Path
        Of the recording.
    folder : Path
        Where to; it is made.

    Returns
    -------
    tuple of Path
        What was written.

    Raises
    ------
    FileError
        If a file of that name exists already or cannot be written, or the recording not be read.
    """
    contents: dict[tuple[str, bytes], Path] = {}
    for found in Scan(path, is_strict=False).read(kinds=frozenset({Attachment})):
        if not isinstance(found, Attachment):
            continue
        name = _make_safe(found.name)
        if (name, found.data) not in contents:
            taken = {item.name for item in contents.values()}
            target = folder / _number(name, taken)
            _write(target, found.data)
            contents[name, found.data] = target
    return tuple(contents.values())


def _write(path: Path, data: bytes) -> None:
    try:
        with write_new_file(path) as part:
            part.write_bytes(data)
    except ValueError as error:
        raise FileError(f"{path} cannot be written: {error}") from None


def _make_safe(name: str) -> str:
    last = name.replace("\\", "/").rpartition("/")[2]
    safe = "".join(letter if letter.isprintable() else "_" for letter in last).strip()
    return safe.lstrip(".") or UNNAMED


def _number(name: str, taken: set[str]) -> str:
    stem, suffix, number = Path(name).stem, Path(name).suffix, 1
    while name in taken:
        number += 1
        name = f"{stem}.{number}{suffix}"
    return name
