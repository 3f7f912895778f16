"""Files of Apache Parquet, written by pyarrow."""

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from impact_rig.core.errors import FileError
from impact_rig.recordings.formats.measurement import MeasuredChannel, Measurement
from impact_rig.recordings.formats.registry import read_measurement, write_measurement

from .foreign import RATE, TRACE, describe, read_channels


def test_columns_of_numbers_are_channels_and_one_of_times_their_clock(tmp_path):
    force = pa.field("force", pa.float32(), metadata={"unit": "N"})
    schema = pa.schema([("time", pa.float64()), force, ("who", pa.string())])
    columns = [np.arange(40) / RATE, TRACE.astype(np.float32), ["B"] * 40]
    parquet.write_table(pa.table(columns, schema=schema), tmp_path / "hit.parquet")
    ((name, channel),) = read_channels(tmp_path / "hit.parquet").items()
    single = TRACE.astype(np.float32).astype(np.float64).tolist()
    assert (name, describe(channel)) == ("force", (single, RATE, "N", 0.0))


def test_other_programs_find_the_columns_and_their_units(tmp_path):
    channels = (MeasuredChannel("a", TRACE, RATE, "N"), MeasuredChannel("b", -TRACE[:9], RATE))
    write_measurement(tmp_path / "new.parquet", Measurement(tmp_path / "x", channels))
    table = parquet.read_table(tmp_path / "new.parquet")
    assert table.column_names == ["a", "b"]
    assert table["b"].to_pylist() == (-TRACE[:9]).tolist() + [None] * 31
    assert table.schema.field("a").metadata == {b"unit": b"N"}


def test_numbers_that_changed_on_the_disk_are_noticed(tmp_path):
    path = tmp_path / "hit.parquet"
    channel = MeasuredChannel("a", np.random.default_rng(1).normal(size=4000), RATE, "N")
    write_measurement(path, Measurement(path, (channel,)))
    assert read_channels(path)["a"].values.tolist() == channel.values.tolist()
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(FileError, match=r"hit\.parquet is no sound \.parquet file: .*checksum"):
        read_measurement(path)
