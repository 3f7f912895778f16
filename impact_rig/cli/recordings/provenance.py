"""What a recording says of itself, for a report: what `impact-rig info` prints."""

import hashlib
from pathlib import Path

from impact_rig.cli.recordings.contents_report import (
    describe_losses,
    find_fields,
    find_health,
    find_parameters,
    find_versions,
)
from impact_rig.cli.recordings.reading_progress import inspect_with_progress
from impact_rig.core.errors import FileError
from impact_rig.recording.recovery.contents import Contents
from impact_rig.recording.writing.origin import ORIGIN_RECORD
from impact_rig.results.run import Note, Provenance, RecordedFile


def read_provenance(path: Path) -> Provenance:
    """Read all of a recording, checksums included.

    Parameters
    ----------
    path : Path
        Of the file, or of a folder as rosbag2 writes it.

    Raises
    ------
    FileError
        If it cannot be read.
    """
    contents = inspect_with_progress(path)
    return Provenance(
        start_time=contents.start_time,
        end_time=contents.end_time,
        files=tuple(_describe_file(file.path) for file in contents.files),
        problems=contents.problems,
        losses=describe_losses(contents),
        ended=find_health(contents).get("reason", ""),
        versions=tuple(find_versions(contents).items()),
        parameters=tuple(sorted(find_parameters(contents).items())),
        notes=_gather_notes(contents),
    )


def _describe_file(path: Path) -> RecordedFile:
    try:
        with path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        return RecordedFile(path.name, path.stat().st_size, digest)
    except OSError as error:
        raise FileError(f"{path} cannot be read: {error.strerror or error}") from None


def _gather_notes(contents: Contents) -> tuple[Note, ...]:
    first = find_fields(contents, ORIGIN_RECORD).get("notes", "")
    notes = (Note(0, first),) if first else ()
    return notes + tuple(Note(note.time, note.text) for note in contents.notes)
