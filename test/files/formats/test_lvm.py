"""LabVIEW's files: every channel has its own length, rate, unit and start."""

import re
from pathlib import Path

import lvm_read
import numpy as np
import pytest

from impact_rig.core.given.errors import FileError
from impact_rig.files.formats.registry import read_measurement

REAL = Path(__file__).parents[2] / "data" / "repeat_shock" / "Test_001_shock.lvm"

HEADER = """\
LabVIEW Measurement\t
Writer_Version\t2
Separator\tTab
Decimal_Separator\t.
Multi_Headings\tNo
X_Columns\tOne
Time_Pref\tRelative
Date\t2023/05/05
Time\t13:39:50.5
***End_of_Header***\t
\t
"""
SEGMENT = """\
Channels\t2\t\t
Samples\t3\t3\t
Date\t2023/05/05\t2023/05/05\t
Time\t13:39:50.5\t13:39:50.75\t
Y_Unit_Label\tm/s²\tN\t
X_Dimension\tTime\tTime\t
X0\t0.0000000000000000E+0\t1.0000000000000000E-1\t
Delta_X\t1.953125E-5\t1.953125E-5\t
***End_of_Header***\t\t\t
X_Value\thammer\tforce\tComment
0.000000\t1.5\t-2.25
1.953125E-5\t0.5\t3E-3\tfirst hit
3.906250E-5\t-1.0\t4.000000
"""


def write(folder, text):
    path = folder / "hit.lvm"
    path.write_text(text, encoding="utf-8", newline="")
    return path


def nanoseconds(text):
    return int(np.datetime64(text, "ns").astype(np.int64))


def describe(path):
    return [
        (channel.name, channel.unit, channel.sampling_rate, channel.start, channel.values.tolist())
        for channel in read_measurement(path).channels
    ]


HAMMER = ("hammer", "m/s^2", 51200.0, 0.0, [1.5, 0.5, -1.0])
FORCE = ("force", "N", 51200.0, 0.35, [-2.25, 3e-3, 4.0])


def change(text, *pairs):
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    return text


def drop_times(text):
    """Return the text as LabVIEW writes it without a column of times."""
    head, _, table = text.partition("X_Value")
    lines = table.splitlines(keepends=True)
    rows = ["\t" + line.partition("\t")[2] for line in lines[1:]]
    return change(head, ("X_Columns\tOne", "X_Columns\tNo")) + "X_Value" + lines[0] + "".join(rows)


def drop_first_column(text):
    """Return the text without times, and without a heading or a separator in their place."""
    head, _, table = drop_times(text).partition("X_Value")
    return head + table.replace("\n\t", "\n").removeprefix("\t")


MULTI = (
    change(HEADER, ("X_Columns\tOne", "X_Columns\tMulti"))
    + "Channels\t2\t\t\t\nSamples\t3\t\t2\t\nY_Unit_Label\tm/s²\t\tN\t\n"
    + "Date\t2023/05/05\t\t2023/05/05\t\nTime\t13:39:50.5\t\t13:39:50.5\t\n"
    + "X0\t0.0\t\t0.35\t\nDelta_X\t1.953125E-5\t\t0.000250\t\n***End_of_Header***\t\t\t\t\n"
    + "X_Value\thammer\tX_Value\tforce\tComment\n"
    + "0.000000\t1.5\t0.350000\t-2.25\n"
    + "1.953125E-5\t0.5\t0.350250\t3E-3\n"
    + "3.906250E-5\t-1.0\t\t\n"
)


@pytest.mark.parametrize(
    "text",
    [
        HEADER + SEGMENT,
        (HEADER + SEGMENT).replace("\n", "\r\n"),
        change((HEADER + SEGMENT).replace("\t", ","), ("Separator,Tab", "Separator,Comma")),
        change(HEADER + SEGMENT, (".", ",")),
        change(HEADER + SEGMENT, ("Decimal_Separator\t.\n", "")),
        drop_times(HEADER + SEGMENT),
        change(drop_times(HEADER + SEGMENT), ("X_Value\t", "\t")),
        drop_first_column(HEADER + SEGMENT),
        change(HEADER, ("***End", "***Start_Special***\nChannels\t9\n***End_Special***\n***End"))
        + SEGMENT,
    ],
    ids=range(9),
)
def test_all_ways_to_write_the_same_are_understood(tmp_path, text):
    assert describe(write(tmp_path, text)) == [HAMMER, FORCE]


def test_every_channel_may_have_its_own_column_of_times(tmp_path):
    slow = ("force", "N", 4000.0, 0.35, [-2.25, 3e-3])
    assert describe(write(tmp_path, MULTI)) == [HAMMER, slow]


@pytest.mark.parametrize(
    "text",
    [
        change(HEADER, ("Multi_Headings\tNo", "Multi_Headings\tYes")) + SEGMENT + "\t\n" + SEGMENT,
        HEADER + SEGMENT + "\n" + HEADER + SEGMENT,
    ],
    ids=["of the segment", "of the file"],
)
def test_headers_may_be_written_again(tmp_path, text):
    again = [("hammer (segment 2)", *HAMMER[1:]), ("force (segment 2)", *FORCE[1:])]
    assert describe(write(tmp_path, text)) == [HAMMER, FORCE, *again]


def test_a_step_in_microseconds_is_made_better_by_the_last_time(tmp_path):
    points = 8192
    rows = "".join(f"{n / 8192:.6f}\t1.0\t2.0\n" for n in range(points))
    text = change(
        SEGMENT, ("1.953125E-5\t1.953125E-5", "0.000122\t0.000122"), ("\t3\t3", "\t8192\t8192")
    )
    path = write(tmp_path, HEADER + text.partition("0.000000\t1.5")[0] + rows)
    assert [channel.sampling_rate for channel in read_measurement(path).channels] == [8192.0] * 2


def test_date_and_time_of_the_header_are_taken_as_utc(tmp_path):
    hammer, force = read_measurement(write(tmp_path, HEADER + SEGMENT)).channels
    assert hammer.stamp == nanoseconds("2023-05-05T13:39:50.500")
    assert force.stamp == nanoseconds("2023-05-05T13:39:50.850")  # 0.25 s later, and its X0


def test_the_head_of_the_file_dates_channels_whose_own_does_not(tmp_path):
    bare = re.sub(r"(?m)^(Date|Time)\t.*\n", "", SEGMENT)
    channels = read_measurement(write(tmp_path, HEADER + bare)).channels
    assert [channel.start for channel in channels] == [0.0, 0.1]
    assert {channel.recorded_at for channel in channels} == {
        nanoseconds("2023-05-05T13:39:50.500")
    }


@pytest.mark.parametrize(
    ("old", "new"), [("2023/05/05", "1904/01/01"), ("2023/05/05", "today"), ("13:39:50.5", "noon")]
)
def test_a_date_that_cannot_be_is_none(tmp_path, old, new):
    path = write(tmp_path, change(HEADER + SEGMENT, (old, new), ("50.75", "50.5")))
    assert [channel.recorded_at for channel in read_measurement(path).channels] == [0, 0]


@pytest.mark.parametrize(
    ("pairs", "told"),
    [
        ([("LabVIEW Measurement", "LabVIEW")], "is no .lvm file"),
        ([("Separator\tTab", "Separator\tSpace")], "states the separator 'Space'"),
        ([("Channels\t2", "Channels\t3")], "states 3 channels in segment 1, its table has 2"),
        ([("Samples\t3\t3", "Samples\t9\t3")], "cut off: 'hammer' should have 9 points"),
        ([("Samples\t3\t3", "Samples\t3\t2")], "line 24: 'force' has more points than its header"),
        ([("0.5\t3E-3\tf", "0.5\t\tf")], "line 23: column 3 is blank, and goes on in line 24"),
        ([("Time\tTime", "Time\tFrequency")], "'force' runs over Frequency"),
        ([("Delta_X\t1.953125E-5", "Delta_X\tnone")], "states 'none': it should be a number"),
    ],
)
def test_what_contradicts_itself_is_named(tmp_path, pairs, told):
    path = write(tmp_path, change(HEADER + SEGMENT, *pairs))
    with pytest.raises(FileError, match=f"hit.lvm.*{told}"):
        read_measurement(path)


@pytest.mark.parametrize("lines", range(1, 22))
def test_a_file_that_is_cut_off_is_named(tmp_path, lines):
    text = "".join((HEADER + SEGMENT).splitlines(keepends=True)[:lines])
    with pytest.raises(FileError, match=r"hit\.lvm is cut off"):
        read_measurement(write(tmp_path, text))


def test_a_real_file_has_fast_and_slow_channels():
    channels = read_measurement(REAL).channels
    lines = REAL.read_text("utf-8").splitlines(keepends=True)
    table = lvm_read.read_lines(lines, separator=",")[0]["data"][:, 1:7].T
    for channel, column in zip(channels, table, strict=True):
        assert channel.values.tobytes() == column[~np.isnan(column)].tobytes()
    fast, slow = channels[:2], channels[2:]
    assert [(c.name, c.unit) for c in fast] == [(f"Acceleration_{n}", "m/s^2") for n in (0, 1)]
    assert {(c.sampling_rate, c.values.size, c.start) for c in fast} == {
        (51200.0, 1200, 4440 / 51200)
    }
    assert {c.recorded_at for c in channels} == {nanoseconds("2023-05-05T13:39:50.887019931")}
    assert {(c.sampling_rate, c.values.size) for c in slow} == {(1.0, 5)}
    assert [c.start for c in slow] == [pytest.approx(1.076191128, abs=1e-9)] * 4


def test_a_table_without_names_is_read_as_text(tmp_path):
    rows = SEGMENT.partition("Comment\n")[2].replace("\tfirst hit", "")
    channels = read_measurement(write(tmp_path, HEADER + rows)).channels
    assert [channel.values.tolist() for channel in channels[1:]] == [HAMMER[4], FORCE[4]]
