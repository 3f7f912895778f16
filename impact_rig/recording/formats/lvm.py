"""LabVIEW's measurement files (`.lvm`).

Read here and not by the library lvm_read (1.26): that one makes NaN of whatever is no number and
of what is cut off, takes columns of times for channels, leaves step, start and length of each
channel to the caller, and unpickles any `.lvm.pkl` that lies beside the file.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

from impact_rig.core.errors import FileError
from impact_rig.recording.formats.lvm_segment import X_VALUE, Segment, make_channels
from impact_rig.recording.formats.measurement import Measurement
from impact_rig.recording.formats.text_table import Line, Style, read_lines

FIRST_WORDS = "LabVIEW Measurement"
SEPARATORS = {"Tab": "\t", "Comma": ","}
SPECIAL_START, SPECIAL_END = "***Start_Special***", "***End_Special***"
"""Around what a program adds for itself."""


def read_lvm(path: Path) -> Measurement:
    """Read the channels of all segments of a LabVIEW measurement file.

    A channel may be slower or shorter than its neighbours. Its rate and start are those of its
    header, since the table gives times to the microsecond only; starts count from that of the
    first channel, date and time in its header. These are local ones without a time zone: they are
    taken as UTC. Channels of later segments are named by their segment.

    Parameters
    ----------
    path : Path
        Of the file.

    Returns
    -------
    Measurement

    Raises
    ------
    FileError
        If the file is no `.lvm`, is cut off, or its table contradicts its header.
    """
    lines = read_lines(path)
    if not lines or not lines[0].text.startswith(FIRST_WORDS):
        raise FileError(f"{path} is no .lvm file: it should begin with {FIRST_WORDS!r}")
    segments = list(_split_segments(path, lines))
    if not segments:
        raise FileError(f"{path} is cut off: it holds no table of numbers")
    return Measurement(
        path,
        tuple(channel for segment in segments for channel in make_channels(segment, segments[0])),
    )


def _split_segments(path: Path, lines: Sequence[Line]) -> Iterator[Segment]:
    style = _find_style(path, lines)
    segment: Segment | None = None
    tags: dict[str, list[str]] = {}
    for line in _leave_out_special(lines):
        cells = style.split(line.text)
        key = cells[0]
        if key == X_VALUE:
            headings = cells[: len(cells) - next(i for i, cell in enumerate(cells[::-1]) if cell)]
            if segment is not None:
                yield segment
            number = 1 if segment is None else segment.number + 1
            segment = Segment(path, number, style, headings, tags)
            tags = {}
        elif segment is not None and not tags and (not key or style.is_number(key)):
            if any(cells):
                segment.rows.append((line.number, cells))
        else:
            tags[key] = cells
    if segment is not None:
        yield segment


def _leave_out_special(lines: Sequence[Line]) -> Iterator[Line]:
    is_special = False
    for line in lines:
        if line.text.startswith(SPECIAL_START):
            is_special = True
        elif line.text.startswith(SPECIAL_END):
            is_special = False
        elif not is_special:
            yield line


def _find_style(path: Path, lines: Sequence[Line]) -> Style:
    """Return the separator that the header states, by default a tab."""
    key = "Separator"
    stated = next((line.text for line in lines if line.text.startswith(key)), "")
    name = stated.removeprefix(key).strip(" \t,;")
    if name and name not in SEPARATORS:
        raise FileError(
            f"{path} states the separator {name!r}: it should be {' or '.join(SEPARATORS)}"
        )
    separator = SEPARATORS.get(name, "\t")
    return Style(separator, has_decimal_comma=separator != ",")
