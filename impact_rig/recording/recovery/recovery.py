"""Makes a good recording of one that was cut off, never closed or damaged."""

import json
import os
import shutil
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from impact_rig.core.errors import FileError
from impact_rig.recording.interfaces.qos_profiles import parse_offered_qos
from impact_rig.recording.reading.source import SUFFIX
from impact_rig.recording.recovery.contents import Contents, FileContents
from impact_rig.recording.recovery.inspection import MessageCheck, inspect_recording
from impact_rig.recording.recovery.recorded_hits import HitState
from impact_rig.recording.recovery.recovered_file import write_recovered_file
from impact_rig.recording.writing.bag_metadata import FileSummary, TopicSummary, write_bag_metadata
from impact_rig.recording.writing.new_file import PART_SUFFIX, write_new_file

PASSES = 3
"""How often the bytes of a recording are looked at [-]."""
RECOVERED = ".recovered"
"""What is added to the name of a recording that was recovered."""


@dataclass(frozen=True)
class Recovery:
    """What became of a recording.

    Attributes
    ----------
    contents : Contents
        What was found in it.
    output : Path, optional
        The good recording; None: nothing was wrong with it.
    written : int
        Messages in the good recording [-].
    unverified : mapping
        Numbers of the messages in it that no checksum vouches for, by topic.
    """

    contents: Contents
    output: Path | None = None
    written: int = 0
    unverified: Mapping[str, tuple[int, ...]] = field(default_factory=dict)

    @property
    def is_complete(self) -> bool:
        """Whether everything that is known to have been written is in the good recording."""
        contents = self.contents
        has_gaps = any(damage.has_data for file in contents.files for damage in file.damages)
        return not (has_gaps or contents.unverified or contents.lost or contents.missing_files)


def name_output(path: Path) -> Path:
    """Return where a recovered recording goes: beside the damaged one."""
    if path.is_dir():
        return path.absolute().with_name(path.absolute().name + RECOVERED)
    return path.with_name(f"{path.stem}{RECOVERED}{SUFFIX}")


def recover_recording(
    path: Path,
    output: Path,
    *,
    keep_unverified: bool = False,
    report: Callable[[int], None] = lambda _: None,
) -> Recovery:
    """Write everything that is sound in a recording to a new one, which any reader opens.

    Topics, offered QoS, hashes, messages, their order, times and numbers, metadata and
    attachments are taken over as they are. The original is only read.

    Parameters
    ----------
    path : Path
        Of the file, or of a folder as rosbag2 writes it.
    output : Path
        Of the new file, or folder.
    keep_unverified : bool
        Whether to keep messages that fit their schema although no checksum vouches for them.
    report : callable, optional
        Told how many bytes were looked at, now and then; in the end three times those of the
        recording: to see what is there, to write it, and to hold the result against it.

    Raises
    ------
    FileError
        If nothing can be recovered, or the output exists already or cannot be written.
    """
    contents = inspect_recording(path, keep_unverified=keep_unverified, report=report)
    if contents.is_sound:
        return Recovery(contents)
    kept = contents.messages + (contents.unverified if keep_unverified else 0)
    if kept == 0:
        raise FileError(f"nothing of {path} can be recovered: {'; '.join(contents.problems)}")
    size = sum(file.size for file in contents.files)

    def report_later(place: int) -> None:
        report(size + place)

    unverified: dict[str, list[int]] = defaultdict(list)
    check = MessageCheck(keep_unverified=keep_unverified)
    fields = _describe(contents)
    if not path.is_dir():
        with write_new_file(output) as part:
            write_recovered_file(
                part, output.name, contents.files[0], check, fields, unverified, report_later
            )
            _verify(part, output, kept)
    else:
        with _write_new_folder(output) as part:
            for number, file in enumerate(_list_useful(contents, check)):
                name = f"{output.name}_{number}{SUFFIX}"
                write_recovered_file(
                    part / name, name, file, check, fields, unverified, report_later
                )
            _write_list(part, _verify(part, output, kept))
    report(PASSES * size)
    numbers = {topic: tuple(found) for topic, found in unverified.items()}
    return Recovery(contents, output, kept, numbers)


def _list_useful(contents: Contents, check: MessageCheck) -> Iterator[FileContents]:
    """Yield the files of which something is left."""
    for file in contents.files:
        if file.messages or (check.keep_unverified and file.chunks):
            yield file


def _verify(part: Path, output: Path, kept: int) -> Contents:
    """Read the new recording back before it gets its name."""
    found = inspect_recording(part)
    if not found.is_sound or found.messages != kept:
        reason = "; ".join(found.problems) or f"{found.messages} of {kept} messages are in it"
        raise FileError(f"{output} was not written: reading it back showed that {reason}")
    return found


def _describe(contents: Contents) -> dict[str, str]:
    """Return what the new recording says of the old one."""
    return {
        "recovered_from": contents.path.name,
        "problems": json.dumps(contents.problems, ensure_ascii=False),
        "unread_bytes": str(sum(file.unread for file in contents.files)),
        "messages_lost": str(contents.lost),
        "messages_unverified": str(contents.unverified),
        **{
            f"hits_{state.value}": str(contents.count_hits(state))
            for state in (HitState.SAVED, HitState.DAMAGED, HitState.LOST)
        },
    }


def _write_list(folder: Path, contents: Contents) -> None:
    write_bag_metadata(
        folder,
        [
            FileSummary(file.path.name, file.messages, file.start_time, file.end_time)
            for file in contents.files
        ],
        [
            TopicSummary(
                topic.name,
                topic.type_name,
                topic.metadata.get("topic_type_hash", ""),
                parse_offered_qos(topic.metadata.get("offered_qos_profiles", "")),
                topic.messages,
            )
            for topic in contents.topics
        ],
    )


@contextmanager
def _write_new_folder(path: Path) -> Iterator[Path]:
    """Lend a folder to write to; it gets its name at the end of the block, or is removed."""
    part = path.with_name(f".{path.name}.{os.getpid()}{PART_SUFFIX}")
    if path.exists():
        raise FileError(f"{path} exists already: name another folder, none is overwritten")
    try:
        part.mkdir(parents=True)
        yield part
        if path.exists():
            raise FileError(f"{path} exists already: name another folder, none is overwritten")
        part.rename(path)
    except OSError as error:
        raise FileError(f"{path} cannot be written: {error.strerror or error}") from None
    finally:
        shutil.rmtree(part, ignore_errors=True)
