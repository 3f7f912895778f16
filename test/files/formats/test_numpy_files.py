"""Arrays that numpy saved are read; nothing is unpickled, and no claim takes memory."""

import numpy as np
import pytest

from impact_rig.core.given.errors import FileError
from impact_rig.files.formats.registry import read_measurement

from .foreign import read_channels


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.int16, np.uint32, ">f8"])
def test_arrays_come_with_columns_first(tmp_path, kind):
    table = np.arange(60).reshape(3, 20).astype(kind)
    np.save(tmp_path / "rows.npy", table)
    np.save(tmp_path / "columns.npy", table.T)
    np.save(tmp_path / "fortran.npy", np.asfortranarray(table))
    np.save(tmp_path / "single.npy", table[0])
    for name in ("rows", "columns", "fortran"):
        channels = read_channels(tmp_path / f"{name}.npy")
        assert list(channels) == ["column 1", "column 2", "column 3"]
        assert np.array_equal([channel.values for channel in channels.values()], table)
    (single,) = read_channels(tmp_path / "single.npy").values()
    assert np.array_equal(single.values, table[0])
    assert np.isnan(single.sampling_rate)


def test_whole_numbers_that_float64_cannot_hold_are_refused(tmp_path):
    np.save(tmp_path / "hit.npy", np.array([2**53 + 1, 0]))
    with pytest.raises(FileError, match=r"hit\.npy, column 1 .* beyond 2\^53"):
        read_measurement(tmp_path / "hit.npy")


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_an_archive_gives_its_arrays_by_name_and_its_time_as_their_rate(tmp_path, save):
    time = 0.25 + np.arange(50) / 51200
    save(
        tmp_path / "hit.npz",
        time=time,
        hammer=np.sin(time),
        both=np.array([time, -time]),
        slow=np.arange(5.0),
        operator=np.array("Ada"),
    )
    channels = read_channels(tmp_path / "hit.npz")
    assert list(channels) == ["hammer", "both 1", "both 2", "slow"]
    assert channels["hammer"].values.tobytes() == np.sin(time).tobytes()
    assert [c.sampling_rate for c in channels.values()][:3] == [51200.0] * 3
    assert channels["both 2"].start == 0.25
    assert np.isnan(channels["slow"].sampling_rate)


@pytest.mark.parametrize(
    ("stated", "rate"),
    [({"Fs": 44100}, 44100.0), ({"sampling_rate": [2.5e6]}, 2.5e6), ({"dt": 4e-7}, 2.5e6)],
)
def test_a_number_in_the_archive_may_state_the_rate(tmp_path, stated, rate):
    np.savez(tmp_path / "hit.npz", hammer=np.zeros(20), **stated)
    assert read_channels(tmp_path / "hit.npz")["hammer"].sampling_rate == rate


@pytest.mark.parametrize(
    ("array", "told"),
    [
        (np.zeros((2, 2, 2, 20)), r"\(float64, \(2, 2, 2, 20\)\)"),
        (np.array(1.0), r"\(float64, \(\)\)"),
        (np.zeros(20, dtype=complex), "complex128"),
        (np.zeros(20, dtype=np.longdouble), "float64 at most"),
    ],
)
def test_arrays_that_are_no_traces_are_named(tmp_path, array, told):
    np.save(tmp_path / "array.npy", array)
    with pytest.raises(FileError, match=rf"array\.npy.*{told}"):
        read_measurement(tmp_path / "array.npy")


class Trap:
    """Ends the test if it is ever unpickled."""

    def __reduce__(self):
        return pytest.fail, ("unpickled",)


def test_nothing_is_unpickled(tmp_path):
    np.save(tmp_path / "trap.npy", np.array([Trap()], dtype=object), allow_pickle=True)
    np.savez(tmp_path / "trap.npz", hammer=np.array([Trap()], dtype=object))
    for name in ("trap.npy", "trap.npz"):
        with pytest.raises(
            FileError, match=rf"{name} (is no sound|cannot be read: it asks for more memory)"
        ):
            read_measurement(tmp_path / name)


GIANT = b"\x93NUMPY\1\0v\0{'descr':'<f8','fortran_order':False,'shape':(9999999999999,)}"
"""It promises 80 TB."""


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("empty.npy", b"", "is empty"),
        ("giant.npy", GIANT.ljust(128) + bytes(200), r"no sound \.npy"),
        ("bad.npz", b"PK\x03\x04", r"no sound \.npz"),
        ("lost.wave", b"1", r"unknown here \(\.wave\)"),
        ("trace", b"1", "no suffix"),
    ],
)
def test_what_cannot_be_read_is_named(tmp_path, name, content, told):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileError, match=f"{name}.*{told}"):
        read_measurement(tmp_path / name)


def test_a_file_that_is_not_there_and_a_folder_are_named(tmp_path):
    with pytest.raises(FileError, match=r"there is no file .*lost\.csv"):
        read_measurement(tmp_path / "lost.csv")
    folder = tmp_path / "folder.csv"
    folder.mkdir()
    with pytest.raises(FileError, match=r"folder\.csv cannot be read"):
        read_measurement(folder)
