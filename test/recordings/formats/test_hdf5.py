"""HDF5 files, written by h5py."""

import h5py
import numpy as np
import pytest

from impact_rig.core.errors import FileError
from impact_rig.recordings.formats.registry import read_measurement

from .foreign import RATE, TRACE, describe, read_channels


@pytest.mark.parametrize("suffix", [".h5", ".hdf5"])
def test_hdf5_files_are_read_with_what_their_groups_state(tmp_path, suffix):
    path = tmp_path / f"hit{suffix}"
    with h5py.File(path, "w") as file:
        group = file.create_group("hits/first")
        group.attrs["Sampling_Rate"] = RATE
        item = group.create_dataset("hammer", data=TRACE.astype(np.float32), compression="gzip")
        item.attrs["units"] = "N"
        own = group.create_dataset("slow", data=np.arange(9, dtype=">i2"))
        own.attrs.update({"dt": 4e-7, "t0": [0.5], "unit": b"g"})
        file["loop"] = group
        file["words"] = ["a", "b"]
        file["elsewhere"] = h5py.ExternalLink("other.h5", "/a")
        file["nowhere"] = h5py.SoftLink("/lost")
    channels = read_channels(path)
    assert list(channels) == ["hits/first/hammer", "hits/first/slow"]
    single = TRACE.astype(np.float32).astype(np.float64).tolist()
    assert describe(channels["hits/first/hammer"]) == (single, RATE, "N", 0.0)
    assert describe(channels["hits/first/slow"]) == (list(range(9)), 2.5e6, "g", 0.5)


def test_hdf5_that_promises_too_much_takes_no_memory(tmp_path):
    with h5py.File(tmp_path / "hit.h5", "w") as file:
        file.create_dataset("a", shape=(10**13,), dtype="f8", chunks=(1000,))
    with pytest.raises(FileError, match="10000000000000 numbers, the file has none"):
        read_measurement(tmp_path / "hit.h5")


def test_the_longest_of_three_axes_is_time_whichever_it_is(tmp_path):
    hits = np.arange(3 * 2 * 40).reshape(3, 2, 40)
    with h5py.File(tmp_path / "hit.h5", "w") as file:
        file["last"], file["first"] = hits, hits.transpose(2, 0, 1)
    channels = read_channels(tmp_path / "hit.h5")
    assert list(channels)[:6] == [
        "first 1 1",
        "first 1 2",
        "first 2 1",
        "first 2 2",
        "first 3 1",
        "first 3 2",
    ]
    for name in ("first 3 2", "last 3 2"):
        assert channels[name].values.tolist() == hits[2, 1].tolist()
