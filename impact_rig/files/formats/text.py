"""Columns of numbers in text, found however they were written, and written exactly.

Every instrument puts its own words above its numbers, and some beside them. There is one way
through all: the longest run of lines that are written alike is the table; it reaches up as far as
there are numbers in its columns; what stands above are names, units and statements::

    Sampling Period,1.95E-05       a statement
    Time,CH1,CH2                   names
    s,V,N                          units
    0.000,0.02,3.5                 the table: each line has the kinds "nnn", a number in each cell
    0.001,0.04,
    0.002,0.05,                    a column may end before the others

Some put statements beside the first lines of the table: cells that are empty further down are no
columns::

    Sample Interval,4e-7,,-0.001,1   a statement, and the first line of the table
    Vertical Units,V,,0.000,2        the same
    ,,,0.001,3                       kinds "---nn": there are two columns
    ,,,0.002,3

A line is a `TextLine`; how cells are parted is a `Style`; style, first line, kinds and columns of
the table are its `Layout`, by which a `RowReader` makes numbers of its lines.
"""

import codecs
import contextlib
import csv
import itertools
import math
import re
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import numpy as np

from impact_rig.core.given.errors import FileError
from impact_rig.core.given.records import FloatArray
from impact_rig.files.formats.rates import (
    compute_stated_rate,
    is_rate_name,
    is_step_name,
    states_unit,
)
from impact_rig.files.measurement import ORIGIN, MeasuredChannel, Measurement
from impact_rig.files.names import is_unit, split_name
from impact_rig.files.times import (
    RATE_MISMATCH,
    SAMPLES,
    find_time_unit,
    is_clock,
    normalize_time_unit,
)

WIDE_MARKS = (b"\xff\xfe", b"\xfe\xff")
"""Beginnings of text in two bytes for each letter, as LabVIEW and spreadsheets write it, too."""
PIECE, LONGEST_LINE = 1 << 20, 1 << 22
"""Letters that are read at once, and in a line, our choice: the table must begin in the first
piece. Pieces and lines take the memory, beside the numbers of a small file."""
MUCH = 1 << 24
"""Numbers that go to a temporary file [byte], our choice."""
ENOUGH_LINES = 100
"""Written alike they are the table, our choice: more than instruments put above it."""
SHOWN_LETTERS = 40
"""Longest excerpt in a message of a cell that is no number, our choice."""
COMMENT_MARKS = ("#", "%", "//")
"""Beginnings of lines that are no numbers."""
BLANKS_AND_MARKS = " \t#%/"
FORMULA_MARKS = ("=", "+", "-", "@", "\t", "\r", "'")
"""Beginnings of words that spreadsheets take for formulas: written behind an apostrophe, which
goes when they are read."""
MINUS, INFINITY = "\N{MINUS SIGN}", "∞"
"""A minus of typesetters; what PicoScope writes where a channel is beyond its range."""
STATEMENT = re.compile(
    r"(?<![\d.,'])(?<!\d )([+-]?(?:\d+(?:\.\d*|,(?!\d{3}\b)\d+)?|\.\d+)(?:[eE][+-]?\d+)?)"
    r"\s*([^\W\d]*(?:/s)?)$"
)
"""A value with its unit, at the end of `Analog:1e-8` or `25,6 kHz`; what may be thousands, as
`51,200`, is none."""
THOUSANDS = re.compile(r"(?<![\d.,])\d{1,3}(?:,\d{3})+(?=\.\d)")
"""Whole part of `1,227.64`; without a point behind them, commas may be decimal."""
GW_DATA, GW_SCALE, GW_COUNTS = "Waveform Data", "vertical scale", 25.0
"""Heading of GW Instek's column of counts, the statement of its scale [V per division], and how
many counts are a division, by the maker's manuals."""
HORIZONTAL, VERTICAL = "horizontal units", "vertical units"
RATE, START, TIME = "sampling rate [Hz]", "start [s]", "time"
"""Statements above the numbers in files written here, since printed times may be too coarse."""
STARTS = {START, "start", "t0"}
NUMBER, WORD, NOTHING = "n", "w", "-"
"""Kinds of cells."""

LISTED_COLUMN = re.compile(
    r"(?:col(?:umn)?|ch(?:annel)?)?\s*(\d+)\s*[:=.)]\s*(\S.*)", re.IGNORECASE
)
"""One column in a comment: `column 2: Force (N)`."""
LISTED_CELL = re.compile(r"\s*[,;\t]\s*|\s+(?![\[(])")
"""Between the names or units that a comment lists."""
ORIGIN_MARK = f"# {ORIGIN}: "


def _take_byte(error: UnicodeError) -> tuple[str, int]:
    """Take bytes that are no UTF-8 for Latin-1, as older instruments write it."""
    if not isinstance(error, UnicodeDecodeError):
        raise error
    return error.object[error.start : error.end].decode("latin-1"), error.end


codecs.register_error("take_latin_1", _take_byte)


class TextLine(NamedTuple):
    """A line that is not blank, and its number in the file, counted from 1."""

    number: int
    text: str


class Style(NamedTuple):
    """How a file parts its columns (None: by blanks), and whether its decimal sign is a comma."""

    delimiter: str | None = None
    has_decimal_comma: bool = False

    def split(self, line: str) -> list[str]:
        """Return the cells of a line, without blanks around them."""
        if self.delimiter is None:
            return line.split()
        return [cell.strip(' \t"') for cell in line.split(self.delimiter)]

    def is_number(self, cell: str) -> bool:
        """Return whether a cell holds a number."""
        try:
            float(self.make_point(cell))
        except ValueError:
            return False
        return True

    def make_point(self, text: str) -> str:
        """Return cells with decimal points."""
        text = text.replace(INFINITY, "inf").replace(MINUS, "-")
        if self.has_decimal_comma:
            return text.replace(",", ".")
        has_thousands = self.delimiter != "," and "," in text
        return THOUSANDS.sub(lambda it: it[0].replace(",", ""), text) if has_thousands else text

    def describe(self, line: str) -> str:
        """Return the kinds of a line's cells, a letter for each."""
        return "".join(
            (NUMBER if self.is_number(cell) else WORD) if cell else NOTHING
            for cell in self.split(line)
        )


def _refuse_cell(line: int, cell: str) -> str:
    return f"line {line}: {cell[:SHOWN_LETTERS]!r} is no number"


def read_pieces(path: Path) -> Iterator[str]:
    """Yield the text of a file in pieces of whole lines, whose ends are line feeds.

    Raises
    ------
    FileError
        If it is no text, or a line is longer than a piece.
    """
    with path.open("rb") as file:
        is_wide = file.read(2) in WIDE_MARKS
    encoding, errors = ("utf-16", "strict") if is_wide else ("utf-8-sig", "take_latin_1")
    with path.open(encoding=encoding, errors=errors) as text:
        try:
            while piece := text.read(PIECE):
                rest = text.readline(LONGEST_LINE)
                if len(rest) == LONGEST_LINE:
                    raise FileError(
                        f"{path} is no text: a line has more than {LONGEST_LINE} letters"
                    )
                # The last sign of old text files is one that ends the file.
                piece = (piece + rest).rstrip("\x1a")
                if "\0" in piece:
                    raise FileError(f"{path} is no text: it holds bytes of zero")
                yield piece
        except UnicodeDecodeError:
            raise FileError(f"{path} is no text: it ends within a letter") from None


def split_lines(piece: str, before: int = 0) -> list[TextLine]:
    """Return the lines of a piece that are not blank; so many are `before` it."""
    lines = enumerate(piece.split("\n"), start=before + 1)
    return [TextLine(number, text.strip(" ")) for number, text in lines if text.strip()]


class Layout(NamedTuple):
    """Where the numbers of a file stand, and how they are written."""

    style: Style
    first: int  # number of its first line
    kinds: str  # what the cells of its lines hold
    columns: tuple[int, ...]  # those that are channels
    heading: str = ""  # the line above them; it may stand again above a further record


def read_text(path: Path) -> Measurement:
    """Read the columns of a text file.

    Columns are parted by semicolon, tab, comma or blanks, with a decimal point or (beside commas
    in quotes only) a decimal comma. Names and units are taken from the lines above the numbers. A
    column may end before the others do; one of words is a channel without points. A column of
    times is a channel like the others, unless the file states its sampling rate beside it, as
    those of `write_text` do; one that counts samples becomes times where the file states their
    step. The text of a large file passes through memory piece by piece, its numbers go to a
    temporary file.

    Raises
    ------
    FileError
        If the file is not of numbers in columns.
    """
    return read_table(path, read_pieces(path))


def read_table(path: Path, pieces: Iterator[str]) -> Measurement:
    """Read the columns of a text in pieces of whole lines, as `read_text` does."""
    head = next(pieces, "")
    table, headings, statements = _find_table(path, split_lines(head))
    columns = _read_columns(path, table, head, pieces)
    units = [unit.rpartition(":")[2] for unit in statements.get(VERTICAL, [])]
    if len(columns) > 1:  # the first one is of times
        units = [*statements.get(HORIZONTAL, [""])[:1], *units] if units else []
    channels = [
        MeasuredChannel(
            name=_read_word(headings[column][0]) or f"column {number}",
            values=values,
            unit=headings[column][1] or (units[number - 1] if number <= len(units) else ""),
            flaw=flaw,
            origin="".join(statements.get(ORIGIN, [])),
        )
        for number, (column, (values, flaw)) in enumerate(
            zip(table.columns, columns, strict=True), 1
        )
    ]
    if channels[-1].name == GW_DATA:
        channels[-1] = _scale_counts(channels[-1], statements)
    return Measurement(path, _set_clock(path, channels, statements))


def _scale_counts(channel: MeasuredChannel, statements: dict[str, list[str]]) -> MeasuredChannel:
    """Return GW Instek's counts as volts where the file states their scale."""
    scale = STATEMENT.search("".join(statements.get(GW_SCALE, [])[:1]))
    if scale is None or channel.flaw:
        return replace(channel, unit="")
    return replace(channel, values=channel.values * np.float64(scale[1]) / GW_COUNTS)


def _read_word(cell: str) -> str:
    """Return a word without the apostrophe that keeps spreadsheets from computing it."""
    return cell[1:] if cell.startswith("'") and cell[1:].startswith(FORMULA_MARKS) else cell


def _set_clock(
    path: Path, channels: list[MeasuredChannel], statements: dict[str, list[str]]
) -> tuple[MeasuredChannel, ...]:
    """Return channels with the rate that their file states, where its times do not tell it."""
    rate, unit, flaw = _find_rate(path, statements)
    start = _find_start(statements)
    first = channels[0]
    if math.isnan(rate):
        return tuple(replace(channel, time_flaw=flaw) for channel in channels)
    if RATE in statements and first.name == TIME and len(channels) > 1:
        del channels[0]
    elif any(is_clock(channel.values) for channel in channels):
        if find_time_unit(first.name, first.unit) != SAMPLES:
            return tuple(channels)
        times = start + first.values / rate
        return MeasuredChannel(TIME, times, unit="s"), *channels[1:]
    return tuple(
        replace(item, sampling_rate=rate, start=start, time_unit=unit) for item in channels
    )


class StatedRate(NamedTuple):
    """A sampling rate, or a step, as a file states it above its numbers."""

    name: str
    rate: float  # [Hz]; of a step without a unit as of seconds
    has_unit: bool


def _list_rates(statements: dict[str, list[str]]) -> list[StatedRate]:
    """Return the rates that a file states, then its steps."""
    found: list[StatedRate] = []
    for name, values in statements.items():
        match = STATEMENT.search(values[0].strip())
        if match is None:
            continue
        unit = match[2]
        if not states_unit(name, unit):
            unit = "".join(statements.get(HORIZONTAL, [])[:1])
        rate = compute_stated_rate(name, float(match[1].replace(",", ".")), unit)
        if rate > 0:
            found.append(StatedRate(name.strip(), rate, states_unit(name, unit)))
    return sorted(found, key=lambda item: is_step_name(item.name))


def _find_rate(path: Path, statements: dict[str, list[str]]) -> tuple[float, str, str | None]:
    """Return the rate that a file states [Hz], the unit of its times, and why it is no sound one.

    It is NaN where the file states none, or two that differ.
    """
    if RATE in statements:
        return float(statements[RATE][0]), "s", None
    found = _list_rates(statements)
    if not found:
        return math.nan, "s", None
    first = found[0]
    for other in found[1:]:
        is_same = math.isclose(first.rate, other.rate, rel_tol=RATE_MISMATCH)
        if first.has_unit and other.has_unit and not is_same:
            told = f"{first.rate:g} Hz by {first.name!r} and {other.rate:g} Hz by {other.name!r}"
            return math.nan, "s", f"{path} states two sampling rates, {told}: give --rate"
    return first.rate, "s" if first.has_unit else "", None


def _find_start(statements: dict[str, list[str]]) -> float:
    """Return the time of the first point that a file states [s]; 0: it states none."""
    for name in STARTS & statements.keys():
        if match := STATEMENT.search(statements[name][0].strip()):
            return float(match[1].replace(",", "."))
    return 0.0


def _find_table(
    path: Path, lines: Sequence[TextLine]
) -> tuple[Layout, list[tuple[str, str]], dict[str, list[str]]]:
    """Find the numbers; return with them name and unit of each cell of a line, and statements."""
    plain = [
        TextLine(number, unquote(text))
        for number, text in lines
        if not text.startswith(COMMENT_MARKS)
    ]
    first, last, style, kinds = _find_longest_run(path, plain)
    # Settings of an instrument may stand beside the first rows: below them these cells are empty.
    below = style.describe(plain[last].text)
    if any(pair == (WORD, NOTHING) for pair in zip(kinds, below, strict=True)):
        kinds = "".join(
            NOTHING if end == NOTHING else kind for kind, end in zip(kinds, below, strict=True)
        )
    at = [cell for cell, kind in enumerate(kinds) if kind == NUMBER]
    while first > 0:
        above = style.describe(plain[first - 1].text)
        if len(above) != len(kinds) or any(above[cell] != NUMBER for cell in at):
            break
        first -= 1
    above_lines = [text for number, text in lines if number < plain[first].number]
    _refuse_decimal_commas(path, "".join(above_lines[-1:]), style, kinds)
    headings, beside = _read_headings(above_lines, style, kinds)
    columns = tuple(
        cell for cell, kind in enumerate(kinds) if kind != NOTHING or any(headings[cell])
    )
    statements = _collect_statements(above_lines, style) | beside
    for _, text in plain[first : last + 1]:
        cells = zip(style.split(text), kinds, strict=True)
        _add_statement(statements, [cell for cell, kind in cells if kind == NOTHING])
    table = Layout(style, plain[first].number, kinds, columns, "".join(above_lines[-1:]))
    return table, headings, statements


def _refuse_decimal_commas(path: Path, above: str, style: Style, kinds: str) -> None:
    """Refuse commas that part columns and are decimal, too: a row has two cells for each name."""
    cells = len(kinds.rstrip(NOTHING))
    names = above.lstrip(BLANKS_AND_MARKS).split(",")
    is_heading = len(names) > 1 and not any(map(style.is_number, names))
    if style.delimiter == "," and is_heading and cells == 2 * len(names):
        raise FileError(
            f"{path} has {len(names)} names and {cells} cells in a row: its decimal sign is a"
            " comma, as between its columns; export it with semicolons or decimal points"
        )


def _find_longest_run(path: Path, lines: Sequence[TextLine]) -> tuple[int, int, Style, str]:
    """Return first and last of lines that are written alike, how, and what their cells hold.

    Lines of numbers alone go before those that hold words, longer runs before shorter ones.
    """
    best = ((False, False, 0), 0, 0, Style(), "")
    begin, style, kinds = 0, Style(), ""
    for index, (_, text) in enumerate(lines):
        own = _guess_style(text.strip())
        found = own.describe(text)
        joined = _join_kinds(kinds, found) if own.delimiter == style.delimiter else ""
        if index == begin or not joined:
            begin, style, kinds = index, own, found
        else:
            style = Style(style.delimiter, style.has_decimal_comma or own.has_decimal_comma)
            kinds = joined
        length = index - begin + 1
        rank = (NUMBER in kinds, WORD not in kinds, length)
        if rank > best[0]:
            best = (rank, begin, index, style, kinds)
        if length == ENOUGH_LINES and NUMBER in kinds:
            return begin, index, style, kinds
    if not best[0][0]:
        raise FileError(f"{path} holds no numbers: it should have columns of them")
    return best[1:]


def _join_kinds(kinds: str, others: str) -> str:
    """Return the kinds of the cells of two lines; empty: the lines are not written alike."""
    if len(kinds) != len(others):
        return ""
    joined = "".join(
        a if b in (a, NOTHING) else b if a == NOTHING else ""
        for a, b in zip(kinds, others, strict=True)
    )
    return joined if len(joined) == len(kinds) else ""


def _split_quoted(text: str, delimiter: str) -> list[str]:
    return next(csv.reader([text], delimiter=delimiter, skipinitialspace=True))


def unquote(text: str) -> str:
    """Return a line without quotes; where all cells stand in quotes semicolons part them."""
    if '"' not in text:
        return text
    inner = text.strip()
    if inner.count('"') == 2 and inner[0] == inner[-1] == '"':  # noqa: PLR2004 - a pair
        return inner[1:-1]
    delimiter = next((sign for sign in ";\t" if sign in text), ",")
    cells = _split_quoted(text, delimiter)
    has_commas = delimiter == "," and text.count('"') == 2 * len(cells)
    return (";" if has_commas else delimiter).join(cells)


def _guess_style(line: str) -> Style:
    """Return how the columns of a line of numbers are parted."""
    for delimiter in (";", "\t"):
        if delimiter in line:
            return Style(delimiter, "," in line and "." not in line)
    if "," not in line:
        return Style()
    commas, blanks = Style(","), Style(None, has_decimal_comma=True)
    if all(map(commas.is_number, filter(None, commas.split(line)))):
        return commas
    return blanks if all(map(blanks.is_number, blanks.split(line))) else commas


def _read_columns(
    path: Path, table: Layout, head: str, pieces: Iterator[str]
) -> list[tuple[FloatArray, str | None]]:
    """Return the numbers of each channel, and why it has none."""
    rows = RowReader(path, table)
    # The table begins behind its heading.
    body = head.split("\n", table.first - 1)[-1]
    before = table.first - 1
    with tempfile.SpooledTemporaryFile(MUCH) as file:
        for piece in itertools.chain([body], pieces):
            file.write(rows.read(piece, before).tobytes())
            before += piece.count("\n")
        size = file.tell()
        file.seek(0)
        # The file has no name: it is deleted with the last array of its numbers.
        is_large = size > MUCH
        numbers = np.memmap(file, np.float64, "r") if is_large else np.frombuffer(file.read())
    numbers = numbers.reshape(-1, len(table.columns))
    return [
        (numbers[: rows.ends.get(column, len(numbers)), place], rows.flaws.get(column))
        for place, column in enumerate(table.columns)
    ]


class RowReader:
    """Makes numbers of the lines of a table, in one go where they are as they should be.

    Parameters
    ----------
    path : Path
        Of the file, for messages.
    table : Layout
        How they are written.
    """

    def __init__(self, path: Path, table: Layout) -> None:
        self._path = path
        self._table = table
        self._count = 0
        self.ends: dict[int, int] = {}  # numbers in the columns that end before the others
        self.flaws: dict[int, str] = {}  # why and where a column holds what is no number
        self._blanks: dict[int, int] = {}

    def read(self, piece: str, before: int) -> FloatArray:
        """Return the numbers of whole lines, with so many lines `before` them.

        Returns
        -------
        ndarray, shape (lines, columns)
            NaN where a column has ended or holds what is no number.

        Raises
        ------
        FileError
            If a line has more or fewer cells.
        """
        style, kinds = self._table.style, self._table.kinds
        if '"' in piece:
            piece = "\n".join(map(unquote, piece.split("\n")))
        plain = style.make_point(piece.strip("\n"))
        lines = plain.count("\n") + 1
        is_regular = not (self.ends or self.flaws) and all(
            kinds[cell] == NUMBER for cell in self._table.columns
        )
        if style.delimiter:
            is_regular &= plain.count(style.delimiter) == lines * (len(kinds) - 1)
        rows: FloatArray | None = None
        if is_regular and plain:
            with contextlib.suppress(ValueError):
                rows = _parse_numbers(plain, self._table)
        if rows is None or rows.shape != (lines, len(self._table.columns)):
            rows = self.read_lines(split_lines(piece, before))
        self._count += len(rows)
        return rows

    def read_lines(self, lines: Sequence[TextLine]) -> FloatArray:
        """Return the same line by line, with all that may be amiss."""
        style, kinds, columns = self._table.style, self._table.kinds, self._table.columns
        width, heading = max(columns) + 1, unquote(self._table.heading)
        rows = np.full((len(lines), len(columns)), np.nan)
        index = 0
        for number, text in lines:
            if text.startswith(COMMENT_MARKS) or text == heading:
                continue
            cells = style.split(text)
            if len(cells) < width or any(cells[len(kinds) :]):
                count = len(cells) - (len(cells) > 1 and not cells[-1])
                raise FileError(
                    f"{self._path}, line {number}: {count} columns, above there are {width}"
                )
            for place, column in enumerate(columns):
                rows[index, place] = self._read_cell(number, column, cells[column], index)
            index += 1
        return rows[:index]

    def _read_cell(self, line: int, column: int, cell: str, index: int) -> float:
        if self._table.kinds[column] == WORD:
            self.flaws.setdefault(column, _refuse_cell(line, cell))
            self.ends[column] = 0
            return math.nan
        if column in self.flaws:
            return math.nan
        if not cell:
            self.ends.setdefault(column, self._count + index)
            self._blanks.setdefault(column, line)
            return math.nan
        flaw: str | None = None
        if column in self.ends:
            flaw = f"line {self._blanks[column]}: column {column + 1} is blank, and goes on in"
            flaw += f" line {line}"
        try:
            value = float(self._table.style.make_point(cell))
        except ValueError:
            value, flaw = math.nan, flaw or _refuse_cell(line, cell)
        if flaw:
            self.flaws[column] = flaw
            self.ends.pop(column, None)
        return value


def _parse_numbers(text: str, table: Layout) -> FloatArray:
    """Return the columns of lines of numbers alone; raises `ValueError` if there is more."""
    delimiter, data = table.style.delimiter, BytesIO(text.encode())
    if delimiter and len(text) > PIECE // 16:  # worth its time
        with contextlib.suppress(ModuleNotFoundError):  # five times as fast, where it is there
            import pyarrow as pa
            from pyarrow import csv as pa_csv

            names = list(map(str, range(len(table.kinds))))
            found = pa_csv.read_csv(
                data,
                pa_csv.ReadOptions(use_threads=False, column_names=names),
                pa_csv.ParseOptions(delimiter=delimiter, quote_char=False),
                pa_csv.ConvertOptions(
                    include_columns=[names[column] for column in table.columns],
                    column_types=dict.fromkeys(names, pa.float64()),
                    null_values=[],
                ),
                pa.system_memory_pool(),
            )
            return np.stack([column.to_numpy() for column in found.columns], axis=1)
    used = table.columns if delimiter else None
    return np.loadtxt(data, delimiter=delimiter, comments=None, usecols=used, ndmin=2)


def _read_headings(
    above: Sequence[str], style: Style, kinds: str
) -> tuple[list[tuple[str, str]], dict[str, list[str]]]:
    """Return name and unit of each cell, empty where none is stated, and what stands beside."""
    width, used = len(kinds), len(kinds.rstrip(NOTHING))
    if listed := _read_listed(above, width):
        return listed, {}
    candidates = [cells for line in above if (cells := _split_heading(line, style, kinds))]
    if not candidates:
        return [("", "")] * width, {}
    last = candidates[-1]
    above_units = candidates[-2] if len(candidates) > 1 and _are_units(last[:used]) else []
    # Settings in as many cells are no names.
    has_units = above_units and not any(
        ":" in cell or (Style().is_number(cell) and not cell.isdecimal())
        for cell in above_units[:used]
    )
    names = above_units if has_units else last
    # Beside the names of all columns statements may stand, their values below them.
    reach = width if len(names) <= width else used
    headings = [_split_heading_cell(cell) for cell in names[:reach]]
    units = [cell.strip("()[] ") for cell in last]
    if has_units:
        headings = [(name, unit) for (name, _), unit in zip(headings, units, strict=False)]
    elif _are_units(last[:used]):
        pairs = zip(last[:reach], units, strict=False)
        headings = [(cell, unit if is_unit(unit) else "") for cell, unit in pairs]
    headings += [("", "")] * (width - len(headings))
    beside = zip(names[reach:], last[reach:], strict=False) if has_units else ()
    return headings, {name.lower(): [value] for name, value in beside if name}


def _read_listed(above: Sequence[str], width: int) -> list[tuple[str, str]]:
    """Return name and unit of each column from comments that list them; empty: none does.

    A comment has one column, as `# column 2: Force (N)`, or all names or units, as `# units: s N`.
    """
    numbered: dict[int, str] = {}
    rows: dict[str, list[str]] = {}
    for line in above:
        if not line.startswith(COMMENT_MARKS):
            continue
        text = line.strip(BLANKS_AND_MARKS)
        if match := LISTED_COLUMN.fullmatch(text):
            numbered[int(match[1])] = match[2]
        name, _, values = text.partition(":")
        cells = [cell.strip(' "') for cell in LISTED_CELL.split(values.strip())]
        if len(cells) == width:
            rows[name.strip().lower().rpartition(" ")[2].removesuffix("s")] = cells
    first = min(numbered, default=0)
    if first <= 1 and list(numbered) == list(range(first, first + width)):
        return [split_name(name) for name in numbered.values()]
    names = next((rows[key] for key in ("name", "column", "channel") if key in rows), None)
    if names is None:
        return []
    stated = [split_name(name) for name in names]
    units = rows.get("unit", [unit for _, unit in stated])
    return [(name, unit.strip("()[] ")) for (name, _), unit in zip(stated, units, strict=True)]


def _split_heading(line: str, style: Style, kinds: str) -> list[str] | None:
    """Return the cells of a line above the numbers; None: it is no line of headings."""
    text = line.lstrip(BLANKS_AND_MARKS) if line.startswith(COMMENT_MARKS) else line
    used = len(kinds.rstrip(NOTHING))
    if used > 1 and text.count('"') == 2:  # noqa: PLR2004 - a pair
        text = unquote(text)
    delimiters = dict.fromkeys((style.delimiter, ",", ";", "\t"))
    splits = [
        list(map(str.strip, _split_quoted(text, delimiter)))
        for delimiter in delimiters
        if delimiter is not None and (delimiter in text or used == 1)
    ]
    if style.delimiter is None:
        splits += [text.split(), LISTED_CELL.split(text.strip())]
    for cells in splits:
        if cells[0].lower() in (HORIZONTAL, VERTICAL) or (
            (is_step_name(cells[0]) or is_rate_name(cells[0]))
            and any(map(style.is_number, cells[1:]))
        ):
            return None
        is_long = len(cells) > len(kinds) and all(map(_is_beside, cells[used:]))
        is_indexed = used > 2 and not cells[0]  # noqa: PLR2004 - as pandas writes its index
        if (used <= len(cells) <= len(kinds) or is_long) and all(cells[is_indexed:used]):
            return cells
    return None


def _split_heading_cell(cell: str) -> tuple[str, str]:
    """Return name and unit of a heading; one that is a unit alone is that of times."""
    name, unit = split_name(cell)
    return name or (TIME if is_unit(unit) and not cell.startswith(("[", "(")) else ""), unit


def _is_beside(cell: str) -> bool:
    """Return whether a cell beside the headings states something, or is such a value."""
    is_name = is_step_name(cell) or cell.lower() in STARTS
    return not cell or "=" in cell or is_name or Style().is_number(cell)


def _are_units(cells: Sequence[str]) -> bool:
    """Return whether all are units, in brackets, or say that samples are counted."""
    ends = ("", "[]", "()")
    return all(
        cell[:1] + cell[-1:] in ends or is_unit(cell) or normalize_time_unit(cell) == SAMPLES
        for cell in cells
    )


def _collect_statements(above: Sequence[str], style: Style) -> dict[str, list[str]]:
    """Return the statements above the numbers, by names in small letters."""
    statements: dict[str, list[str]] = {}
    for line in above:
        if line.startswith(ORIGIN_MARK):
            statements[ORIGIN] = [line.removeprefix(ORIGIN_MARK)]
            continue
        text = line.lstrip(BLANKS_AND_MARKS)
        delimiter = style.delimiter or next((sign for sign in ";\t" if sign in text), ",")
        cells = Style(delimiter).split(text)
        _add_statement(statements, cells)
        for cell in cells:
            name, _, value = cell.partition("=" if "=" in cell else ":")
            _add_statement(statements, [name, value])
    return statements


def _add_statement(statements: dict[str, list[str]], cells: Sequence[str]) -> None:
    name, *values = [cell.strip() for cell in cells] or [""]
    if name and any(values):
        key = name if name in (RATE, START) else name.lower()
        if key in statements and (is_rate_name(key) or is_step_name(key)):
            key += " "  # it may state another rate than before
        statements.setdefault(key, [value for value in values if value])


def write_text(path: Path, measurement: Measurement) -> None:
    """Write channels as columns parted by commas, beside their time.

    Every number is written with the digits that bring it back bit by bit. TextLine breaks in names
    become blanks.

    Parameters
    ----------
    path : Path
        Of the new file.
    measurement : Measurement
        Its channels must have one sampling rate and start, and one point at least.

    Raises
    ------
    FileError
        If they do not.
    """
    channels = measurement.channels
    points = max(channel.values.size for channel in channels)
    rate, start = channels[0].sampling_rate, channels[0].start
    if len({(repr(channel.sampling_rate), channel.start) for channel in channels}) > 1:
        raise FileError(
            f"{measurement.path}: its channels have different rates or starts; columns of text"
            " share their time: choose another format, or one file for each"
        )
    if points == 0:
        raise FileError(f"{measurement.path}: its channels have no points: text cannot show that")
    columns = [channel.values.tolist() for channel in channels]
    headings = [_make_heading(channel.name, channel.unit) for channel in channels]
    origin = "; ".join(dict.fromkeys(channel.origin for channel in channels if channel.origin))
    with path.open("w", encoding="utf-8", newline="") as file:
        if origin:
            file.write(f"{ORIGIN_MARK}{origin}\n")
        if not math.isnan(rate):
            file.write(f"# {RATE}: {rate!r}\n# {START}: {start!r}\n")
            columns.insert(0, (start + np.arange(points) / rate).tolist())
            headings.insert(0, f"{TIME} [s]")
        headings = [f"'{name}" if name.startswith(FORMULA_MARKS) else name for name in headings]
        csv.writer(file, lineterminator="\n", quoting=csv.QUOTE_ALL).writerow(headings)
        rows = itertools.zip_longest(*columns, fillvalue="")
        csv.writer(file, lineterminator="\n").writerows(rows)


def _make_heading(name: str, unit: str) -> str:
    name = " ".join(name.split())
    is_odd = is_unit(name) or Style().is_number(name) or split_name(name)[0] != name
    return name if name and not (is_odd or unit) else f"{name} [{unit}]"
