"""Columns of text are read however they were written, and refused by line when they cannot."""

import contextlib
import csv
import time

import numpy as np
import pytest

from impact_rig.core.given.errors import FileError
from impact_rig.files.formats import text
from impact_rig.files.formats.registry import read_measurement, write_measurement
from impact_rig.files.measurement import MeasuredChannel, Measurement

EXPECTED = [[0.0, 0.5, 1.0], [1.5, -2.25, 3e-3]]


def read_columns(path):
    return [channel.values.tolist() for channel in read_measurement(path).channels]


def read_names(path):
    return [(channel.name, channel.unit) for channel in read_measurement(path).channels]


@pytest.mark.parametrize(
    "content",
    [
        "0.0,1.5\n0.5,-2.25\n1.0,3e-3\n",
        "0.0, 1.5\r\n0.5, -2.25\r\n1.0, 3e-3",
        "time,hammer\n0,1.5\n0.5,-2.25\n1,3e-3\n",
        "Time;Hammer\n(s);(N)\n0;1,5\n0,5;-2,25\n1;3e-3\n",
        "0,0\t1,5\n0,5\t-2,25\n1,0\t0,003\n",
        "# time(s), \t \t hammer\n0.0 1.5\n0.5   -2.25\n1.0 .003\n",
        "% from elsewhere\n\n  0.0   1.5\n  0.5  -2.25\n\n  1.0   3E-3\n",
        "0,0 1,5\n0,5 -2,25\n1,0 0,003\n",
        "\ufeff0.0,1.5\n0.5,-2.25\n1.0,3e-3\n",
        '"a;1","b,2"\n"0.0","1.5"\n"0.5","-2.25"\n"1.0","3e-3"\n',
        "run 7\n\nchannels,2\n5,hammer\n0.0,1.5\n0.5,-2.25\n1.0,3e-3\n\x1a",
    ],
)
def test_text_of_many_styles_is_understood(tmp_path, content):
    path = tmp_path / "hit.csv"
    path.write_text(content, encoding="utf-8", newline="")
    assert read_columns(path) == EXPECTED


def test_the_files_that_are_drawn_are_read_as_is_said_beside_them(tmp_path):
    lines = [line for line in text.__doc__.splitlines() if line.startswith("    ")]
    rows = [line[4:].partition("   ")[0] + "\n" for line in lines]
    first, second = tmp_path / "first.csv", tmp_path / "second.csv"
    first.write_text("".join(rows[:6]))
    second.write_text("".join(rows[6:]))
    assert read_names(first) == [("Time", "s"), ("CH1", "V"), ("CH2", "N")]
    assert read_columns(first) == [[0.0, 0.001, 0.002], [0.02, 0.04, 0.05], [3.5]]
    assert read_columns(second) == [[-0.001, 0.0, 0.001, 0.002], [1.0, 2.0, 3.0, 3.0]]
    assert read_names(second)[-1] == ("column 2", "V")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_names_and_units_are_understood_in_any_encoding(tmp_path, encoding):
    path = tmp_path / "hit.txt"
    path.write_bytes("Zeit [s];Größe (m/s²)\n0,5;1\n".encode(encoding))
    assert read_columns(path) == [[0.5], [1.0]]
    assert read_names(path) == [("Zeit", "s"), ("Größe", "m/s^2")]


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("# time(s), \t \t acceleration(g)\n0 6.5\n", [("time", "s"), ("acceleration", "g")]),
        ("t;a b\n[s];[N]\n0;1\n", [("t", "s"), ("a b", "N")]),
        ("time,hammer (front) [N],\n0,1,\n", [("time", "s"), ("hammer (front)", "N")]),
        ("% Monday, rig 2\n% t a\n0 1\n", [("t", ""), ("a", "")]),
        ("only [V]\n5\n", [("only", "V")]),
    ],
)
def test_names_and_units_come_from_the_lines_above_the_numbers(tmp_path, content, expected):
    path = tmp_path / "hit.txt"
    path.write_text(content.replace("time,", "time [s],"), encoding="utf-8")
    assert read_names(path) == expected


def test_a_column_may_end_before_the_others_do(tmp_path):
    path = tmp_path / "hit.csv"
    path.write_text("t,a,b,none\n0,1,2,\n1,,3,\n2,,,\n")
    assert read_columns(path) == [[0.0, 1.0, 2.0], [1.0], [2.0, 3.0], []]


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("empty.csv", b"", "is empty"),
        ("names.csv", b"time,hammer\n", "holds no numbers"),
        ("short.csv", b"0,1\n1,2\n2\n", "line 3: 1 columns, above there are 2"),
        ("picture.csv", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "is no text"),
        ("wide.csv", b"\xff\xfe0", "is no text|holds no numbers|is no number"),
    ],
)
def test_what_cannot_be_read_is_named(tmp_path, name, content, told):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileError, match=f"{name}.*({told})"):
        read_measurement(tmp_path / name)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("0,1,2\n1,,2\n2,3,4", "line 2: column 2 is blank, and goes on in line 3"),
        ("0,1,2\n1,over,2\n2,3,4", "line 2: 'over' is no number"),
    ],
)
def test_a_column_with_what_is_no_number_does_no_harm_to_the_others(tmp_path, content, told):
    (tmp_path / "hit.csv").write_text(content)
    first, damaged, last = read_measurement(tmp_path / "hit.csv").channels
    assert damaged.flaw == told
    assert (first.values.tolist(), last.values.tolist()) == ([0.0, 1.0, 2.0], [2.0, 2.0, 4.0])
    assert (first.flaw, last.flaw) == (None, None)


@pytest.mark.parametrize("much", [1000, 1 << 20], ids=["in a file", "in memory"])
def test_a_file_of_many_pieces_is_the_same_as_its_parts(tmp_path, monkeypatch, much):
    monkeypatch.setattr(text, "PIECE", 1000)
    monkeypatch.setattr(text, "MUCH", much)
    rows = np.random.default_rng(1).normal(size=(500, 3))
    lines = [",".join(map(repr, row)) for row in rows.tolist()]
    lines[400:] = [line.rpartition(",")[0] + "," for line in lines[400:]]
    path = tmp_path / "long.csv"
    path.write_text("a [s],b [g],c\n" + "\n".join(lines))
    columns = read_columns(path)
    assert columns == [rows[:, 0].tolist(), rows[:, 1].tolist(), rows[:400, 2].tolist()]
    path.write_text("a,b,c\n" + "\n".join([*lines[:300], "1,2,x"]))
    flaws = [channel.flaw for channel in read_measurement(path).channels]
    assert flaws == [None, None, "line 302: 'x' is no number"]


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("heading.csv", "time," + "a (" * 70_000 + "\n" + "0,1\n1,2\n"),
        ("wide.csv", "\t".join(["1.5"] * 20_000) + "\n"),
        ("word.csv", "x" * 5_000_000),
    ],
)
def test_monstrous_lines_take_no_monstrous_time(tmp_path, name, content):
    """A heading of 200 kB took 87 s."""
    path = tmp_path / name
    path.write_text(content)
    begin = time.process_time()
    with contextlib.suppress(FileError):
        read_measurement(path)
    assert time.process_time() - begin < 10


def test_text_is_written_for_people_and_spreadsheets(tmp_path):
    path = tmp_path / "hit.csv"
    hammer = MeasuredChannel("hammer, front", np.array([0.1, 2.0]), 51200.0, "m/s^2", 0.5)
    specimen = MeasuredChannel("sample", np.array([7, -8, 9], np.int32), 51200.0, "", 0.5)
    write_measurement(path, Measurement(path, (hammer, specimen)))
    with path.open(newline="") as file:
        comments = [next(file), next(file)]
        rows = list(csv.reader(file))
    assert comments == ["# sampling rate [Hz]: 51200.0\n", "# start [s]: 0.5\n"]
    assert rows == [
        ["time [s]", "hammer, front [m/s^2]", "sample"],
        ["0.5", "0.1", "7"],
        [repr(0.5 + 1 / 51200), "2.0", "-8"],
        [repr(0.5 + 2 / 51200), "", "9"],
    ]


@pytest.mark.parametrize(
    ("channels", "told"),
    [
        ([("a", 1.0, 0.0, 3), ("b", 1.0, 0.5, 3)], "different rates or starts"),
        ([("a", 1.0, 0.0, 0)], "no points"),
    ],
)
def test_what_text_cannot_hold_is_refused_and_leaves_no_file(tmp_path, channels, told):
    path = tmp_path / "hit.csv"
    measurement = Measurement(
        path,
        tuple(MeasuredChannel(name, np.ones(n), rate, "", t0) for name, rate, t0, n in channels),
    )
    with pytest.raises(FileError, match=told):
        write_measurement(path, measurement)
    assert not list(tmp_path.glob("*hit*"))


@pytest.mark.parametrize("name", ["=SUM(A1:A9)", "+a", "-a", "@a", "'=a", "'quoted'"])
def test_names_that_spreadsheets_would_compute_are_quoted_and_come_back(tmp_path, name):
    channel = MeasuredChannel(name, np.array([1.0, 2.0]), 51_200.0, "N")
    path = tmp_path / "hit.csv"
    write_measurement(path, Measurement(path, (channel,)))
    with path.open(encoding="utf-8", newline="") as file:
        cells = [cell for row in csv.reader(file) for cell in row if not cell.startswith("#")]
    assert not [cell for cell in cells if cell[:1] in "=+@" or cell[:2] == "-a"]
    assert read_names(path) == [(name, "N")]
