"""Spreadsheets, written by openpyxl."""

from datetime import datetime

import numpy as np
import openpyxl
import pytest
from files.formats.foreign import RATE, TRACE, describe, read_channels

from impact_rig.core.given.errors import FileError
from impact_rig.files.formats.registry import read_measurement


def write_book(path, **sheets):
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


VALUES = [round(float(value), 12) for value in TRACE]  # openpyxl writes 16 digits at most
ROWS = [[at / RATE, value] for at, value in enumerate(VALUES)]


def test_names_and_units_stand_above_the_numbers_which_keep_all_digits(tmp_path):
    channels = read_channels(
        write_book(tmp_path / "hit.xlsx", hit=[["Time (s)", "Force (N)"], *ROWS])
    )
    assert describe(channels["Force"])[::2] == (VALUES, "N")
    assert channels["Time"].values.tolist() == (np.arange(40) / RATE).tolist()


def test_notes_dates_and_blank_rows_may_stand_above(tmp_path):
    above = [["bench 3"], ["taken", datetime(2026, 3, 1, 12, 30)], [], ["t", "hammer"], ["s", "g"]]
    channels = read_channels(write_book(tmp_path / "hit.xlsx", hit=[*above, *ROWS]))
    assert (channels["hammer"].values.tolist(), channels["hammer"].unit) == (VALUES, "g")


def test_a_stated_rate_stands_for_times(tmp_path):
    rows = [["sampling rate", RATE], ["hammer [g]", "sample [g]"], *([v, -v] for v in VALUES)]
    channels = read_channels(write_book(tmp_path / "hit.xlsx", hit=rows))
    assert channels["hammer"].sampling_rate == RATE


def test_the_largest_sheet_is_read_and_named(tmp_path):
    path = write_book(tmp_path / "hit.xlsx", notes=[["bench", 3.0]], data=[["t", "force"], *ROWS])
    measurement = read_measurement(path)
    assert [channel.name for channel in measurement.channels] == ["t", "force"]
    assert measurement.remarks == ("sheet 'data' is read, the largest of 2",)


def test_a_cell_that_is_no_number_is_named_by_its_row(tmp_path):
    rows = [["t", "force"], *ROWS]
    rows[30] = [rows[30][0], "overload"]
    path = write_book(tmp_path / "hit.xlsx", hit=rows)
    assert "line 31: 'overload' is no number" in read_channels(path)["force"].flaw


@pytest.mark.parametrize("content", [b"PK\x03\x04 no book", b"words"])
def test_what_is_no_workbook_is_refused(tmp_path, content):
    path = tmp_path / "hit.xlsx"
    path.write_bytes(content)
    with pytest.raises(FileError, match=r"hit\.xlsx is no sound \.xlsx file"):
        read_measurement(path)


def test_a_workbook_without_numbers_is_refused(tmp_path):
    with pytest.raises(FileError, match=r"hit\.xlsx holds no numbers"):
        read_measurement(write_book(tmp_path / "hit.xlsx", notes=[["bench", "three"]]))
