"""Spreadsheets of Excel and LibreOffice, by calamine: a sheet is read like text."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import date, time
from pathlib import Path
from typing import Any

from impact_rig.files.formats.text import PIECE, read_table
from impact_rig.files.measurement import Measurement

ROWS = PIECE // 100
"""Rows that become one piece of text [-]: about as much as of a file of text."""


def read_sheets(path: Path) -> Measurement:
    """Read the largest sheet of a workbook, with names, units and statements above its numbers.

    Raises
    ------
    FileError
        If the file is no workbook, or the sheet is not of numbers in columns.
    """
    from python_calamine import CalamineWorkbook

    with CalamineWorkbook.from_path(path) as book:
        sheets = [book.get_sheet_by_name(name) for name in book.sheet_names]
    largest = max(sheets, key=lambda sheet: sheet.total_height * sheet.total_width)
    measurement = read_table(path, _make_text(largest.to_python(skip_empty_area=False)))
    if len(sheets) == 1:
        return measurement
    remark = f"sheet {largest.name!r} is read, the largest of {len(sheets)}"
    return replace(measurement, remarks=(*measurement.remarks, remark))


def _make_text(rows: Sequence[Sequence[Any]]) -> Iterator[str]:
    """Yield rows as lines, their cells parted by tabs: a number has all its digits."""
    for first in range(0, len(rows), ROWS):
        lines = ("\t".join(map(_write_cell, row)) for row in rows[first : first + ROWS])
        yield "".join(f"{line}\n" for line in lines)


def _write_cell(cell: Any) -> str:
    if isinstance(cell, (date, time)):
        return cell.isoformat()
    return " ".join(str(cell).split())
