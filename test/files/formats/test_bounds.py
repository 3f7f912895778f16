"""A small file that unpacks to more than memory holds is refused by its heading."""

import tracemalloc
import zipfile

import numpy as np
import pytest

from impact_rig.core.given.errors import FileError
from impact_rig.files.formats.registry import read_measurement

POINTS = 42_000_000
"""336 MB as double precision, a little more than any small file may unpack to."""


def write_npz(path):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for number in range(12):
            with archive.open(f"{number}.npy", "w") as file:
                np.lib.format.write_array(file, np.zeros(POINTS // 12))


def write_mat(path):
    from scipy.io import savemat

    savemat(
        path, {f"x{number}": np.zeros(POINTS // 12) for number in range(12)}, do_compression=True
    )


def write_h5(path):
    import h5py

    with h5py.File(path, "w") as file:
        item = file.create_dataset("x", (POINTS,), "f8", chunks=(1 << 20,), compression="gzip")
        item[:10] = 1.0


def write_parquet(path):
    import pyarrow as pa
    from pyarrow import parquet

    column = pa.chunked_array([np.zeros(POINTS // 12)] * 12)
    parquet.write_table(pa.table({"x": column}), path)


@pytest.mark.parametrize("write", [write_npz, write_mat, write_h5, write_parquet])
def test_what_would_fill_the_memory_is_refused_before_it_is_allocated(tmp_path, write):
    path = tmp_path / f"bomb.{write.__name__.removeprefix('write_')}"
    write(path)
    assert path.stat().st_size < 8_000_000
    tracemalloc.start()
    try:
        with pytest.raises(FileError, match=r"bomb\..* cannot be read: it asks for more memory"):
            read_measurement(path)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 50_000_000
