"""Numbers in columns, as other laboratories store them: `.npy` and delimited text."""

from pathlib import Path

import numpy as np

from impact_rig.core.errors import FileError
from impact_rig.core.signals.record import FloatArray

TEXT_SUFFIXES = (".csv", ".txt", ".dat", ".tsv")
"""Files that are read as delimited text."""
COMMENT_MARKS = ("#", "%", "//")
"""Beginnings of lines that are skipped."""


def read_table(path: Path) -> FloatArray:
    """Read the columns of a file.

    Parameters
    ----------
    path : Path
        `.npy`: an array of one or two axes, of which the longer is time. Text: columns parted by
        semicolon, tab, comma or blanks, with a decimal point or (not beside commas) a decimal
        comma; comment lines and lines of names above the numbers are skipped.

    Returns
    -------
    ndarray, shape (columns, points)

    Raises
    ------
    FileError
        If the file is not there, of another kind, or not of numbers in columns of equal length.
    """
    suffix = path.suffix.lower()
    if suffix == ".npy":
        return _read_array(path)
    if suffix in TEXT_SUFFIXES:
        return _read_text(path)
    if suffix == ".npz":
        raise FileError(f"{path} is an archive of arrays: save the one with the traces as .npy")
    kinds = ", ".join((".npy", *TEXT_SUFFIXES))
    raise FileError(
        f"{path} is of a kind unknown here ({suffix or 'no suffix'}): traces are {kinds}"
    )


def _read_array(path: Path) -> FloatArray:
    try:
        # A map refuses a file that is shorter than its header says; nothing is unpickled.
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except OSError as error:
        raise _make_read_error(path, error) from None
    except (ValueError, EOFError, SyntaxError, OverflowError) as error:
        raise FileError(f"{path} is no sound .npy file: {error}") from None
    if not isinstance(array, np.ndarray):
        raise FileError(f"{path} is no .npy file: it holds several arrays")
    if array.dtype.kind not in "fiu":
        raise FileError(f"{path} holds {array.dtype}: traces are real numbers")
    if array.ndim not in (1, 2) or 0 in array.shape:
        raise FileError(
            f"{path} has shape {array.shape}: it should be (points,), (columns, points)"
            " or (points, columns)"
        )
    values = np.atleast_2d(np.array(array, dtype=np.float64))
    return values if values.shape[0] <= values.shape[1] else np.ascontiguousarray(values.T)


def _read_text(path: Path) -> FloatArray:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise _make_read_error(path, error) from None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    lines = [
        (number, line.strip())
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith(COMMENT_MARKS)
    ]
    delimiter, has_decimal_comma = _find_style([line for _, line in lines])
    if has_decimal_comma:
        lines = [(number, line.replace(",", ".")) for number, line in lines]
    rows = [(number, _split(line, delimiter)) for number, line in lines]
    start = next((i for i, (_, cells) in enumerate(rows) if any(map(_is_number, cells))), None)
    if start is None:
        raise FileError(f"{path} holds no numbers: it should have columns of them")
    width = len(rows[start][1])
    values = np.empty((width, len(rows) - start))
    for index, (number, cells) in enumerate(rows[start:]):
        if len(cells) != width:
            raise FileError(
                f"{path}, line {number}: {len(cells)} columns, above there are {width}"
            )
        try:
            values[:, index] = cells
        except ValueError:
            bad = next(cell for cell in cells if not _is_number(cell))
            raise FileError(f"{path}, line {number}: {bad!r} is no number") from None
    return values


def _find_style(lines: list[str]) -> tuple[str | None, bool]:
    """Return the delimiter (None: blanks) and whether the decimal sign is a comma."""
    for line in lines:
        for delimiter in (";", "\t"):
            cells = _split(line, delimiter)
            if delimiter in line and any(_is_number(cell.replace(",", ".")) for cell in cells):
                return delimiter, "," in line and "." not in line
        if "," in line:
            if all(map(_is_number, _split(line, ","))):
                return ",", False
            if all(_is_number(cell.replace(",", ".")) for cell in line.split()):
                return None, True
            if any(map(_is_number, _split(line, ","))):
                return ",", False
        elif any(map(_is_number, line.split())):
            return None, False
    return None, False


def _split(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return line.split()
    cells = [cell.strip() for cell in line.split(delimiter)]
    return cells[:-1] if len(cells) > 1 and not cells[-1] else cells


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _make_read_error(path: Path, error: OSError) -> FileError:
    if isinstance(error, FileNotFoundError):
        return FileError(f"there is no file {path}")
    return FileError(f"{path} cannot be read: {error.strerror or error}")
