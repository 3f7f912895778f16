"""Columns of numbers are read however they were written, and refused by line when they cannot."""

from pathlib import Path

import numpy as np
import pytest

from impact_rig.core.errors import FileError
from impact_rig.recording.tables import read_table

EXPECTED = [[0.0, 0.5, 1.0], [1.5, -2.25, 3e-3]]


@pytest.mark.parametrize(
    "text",
    [
        "0.0,1.5\n0.5,-2.25\n1.0,3e-3\n",
        "0.0, 1.5\r\n0.5, -2.25\r\n1.0, 3e-3",
        "time,hammer\n0,1.5\n0.5,-2.25\n1,3e-3\n",
        "Time;Hammer\n(s);(N)\n0;1,5\n0,5;-2,25\n1;3e-3\n",
        "0.0;1.5\n0.5;-2.25\n1.0;0.003\n",
        "0,0\t1,5\n0,5\t-2,25\n1,0\t0,003\n",
        "# time(s), \t \t hammer\n0.0 1.5\n0.5   -2.25\n1.0 .003\n",
        "% from elsewhere\n\n  0.0   1.5\n  0.5  -2.25\n\n  1.0   3E-3\n",
        "0,0 1,5\n0,5 -2,25\n1,0 0,003\n",
        "0.0,1.5,\n0.5,-2.25,\n1.0,3e-3,\n",
        "\ufeff0.0,1.5\n0.5,-2.25\n1.0,3e-3\n",
    ],
)
def test_text_of_many_styles_is_understood(tmp_path, text):
    path = tmp_path / "hit.csv"
    path.write_text(text, encoding="utf-8", newline="")
    assert read_table(path).tolist() == EXPECTED


def test_names_in_another_encoding_do_no_harm(tmp_path):
    path = tmp_path / "hit.txt"
    path.write_bytes("Zeit;Größe [m/s²]\n0,5;1\n".encode("latin-1"))
    assert read_table(path).tolist() == [[0.5], [1.0]]


def test_one_column_is_a_table_too(tmp_path):
    path = tmp_path / "hit.dat"
    path.write_text("1.5\n-2\n")
    assert read_table(path).tolist() == [[1.5, -2.0]]


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.int16])
def test_arrays_come_with_columns_first(tmp_path, kind):
    table = np.arange(60).reshape(3, 20).astype(kind)
    np.save(tmp_path / "rows.npy", table)
    np.save(tmp_path / "columns.npy", table.T)
    np.save(tmp_path / "fortran.npy", np.asfortranarray(table))
    np.save(tmp_path / "single.npy", table[0])
    for name in ("rows", "columns", "fortran"):
        read = read_table(tmp_path / f"{name}.npy")
        assert read.dtype == np.float64
        assert np.array_equal(read, table)
    assert np.array_equal(read_table(tmp_path / "single.npy"), table[:1])


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("empty.csv", b"", "holds no numbers"),
        ("words.csv", b"nothing\nto see\n", "holds no numbers"),
        ("short.csv", b"0,1\n1,2\n2\n", "line 3: 1 columns, above there are 2"),
        ("hole.csv", b"t,a\n0,1\n1,\n", "line 3: 1 columns"),
        ("hole.csv", b"0,1,2\n1,,2\n", "line 2: '' is no number"),
        ("word.csv", b"# x\n0 1\n1 over\n", "line 3: 'over' is no number"),
        ("empty.npy", b"", "no sound .npy file"),
        ("text.npy", b"0,1\n1,2\n", "no sound .npy file"),
        ("cut.npy", b"\x93NUMPY\x01\x00v\x00{'descr': '<f8'", "no sound .npy file"),
        ("many.npz", b"PK", "archive"),
        ("labview.lvm", b"LabVIEW", "unknown here"),
        ("trace", b"1", "no suffix"),
    ],
)
def test_what_cannot_be_read_is_named(tmp_path, name, content, told):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileError, match=f"{name}.*{told}"):
        read_table(tmp_path / name)


@pytest.mark.parametrize(
    ("array", "told"),
    [
        (np.zeros((2, 2, 20)), r"shape \(2, 2, 20\)"),
        (np.zeros((0, 20)), r"shape \(0, 20\)"),
        (np.array(1.0), r"shape \(\)"),
        (np.zeros(20, dtype=complex), "holds complex128"),
        (np.array(["a"] * 20), "holds <U1"),
        (np.array([{}] * 20), "no sound .npy file"),
    ],
)
def test_arrays_that_are_no_traces_are_named(tmp_path, array, told):
    path = tmp_path / "array.npy"
    np.save(path, array, allow_pickle=True)
    with pytest.raises(FileError, match=rf"array\.npy.*{told}"):
        read_table(path)


def test_a_header_that_promises_too_much_takes_no_memory(tmp_path):
    path = tmp_path / "cut.npy"
    np.save(path, np.zeros(1000))
    path.write_bytes(path.read_bytes().replace(b"(1000,)", b"(9999999999999,)")[:300])
    with pytest.raises(FileError, match=r"cut\.npy is no sound"):
        read_table(path)


@pytest.mark.parametrize("name", ["lost.csv", "lost.npy"])
def test_a_file_that_is_not_there_is_named(tmp_path, name):
    with pytest.raises(FileError, match=f"there is no file .*{name}"):
        read_table(tmp_path / name)


def test_a_folder_is_named(tmp_path):
    folder = Path(tmp_path / "folder.csv")
    folder.mkdir()
    with pytest.raises(FileError, match=r"folder\.csv cannot be read"):
        read_table(folder)
