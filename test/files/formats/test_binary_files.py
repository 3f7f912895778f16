"""TDMS, universal files, HDF5, sound and Parquet, each written by another library."""

import struct
import wave

import h5py
import nptdms
import numpy as np
import pyarrow as pa
import pytest
import pyuff
from pyarrow import parquet
from scipy.io import wavfile

from impact_rig.core.given.errors import FileError
from impact_rig.files.formats.registry import read_measurement, write_measurement
from impact_rig.files.measurement import MeasuredChannel, Measurement

from .foreign import RATE, TRACE, describe, make_function, read_channels


def write_tdms(path, *groups, **properties):
    with nptdms.TdmsWriter(str(path)) as writer:
        for group, names in groups:
            writer.write_segment(
                [nptdms.ChannelObject(group, name, values, properties) for name, values in names]
            )


def test_tdms_waveforms_are_read(tmp_path):
    path = tmp_path / "hit.tdms"
    write_tdms(
        path,
        ("front", [("hammer", TRACE), ("words", np.array(["a", "b"]))]),
        ("back", [("counts", np.arange(5, dtype=np.int16))]),
        wf_increment=1 / RATE,
        wf_start_offset=0.5,
        unit_string="m/s²",
    )
    channels = read_channels(path)
    assert list(channels) == ["front/hammer", "back/counts"]
    assert describe(channels["front/hammer"]) == (TRACE.tolist(), RATE, "m/s^2", 0.5)
    assert channels["back/counts"].values.dtype == np.int32


def test_tdms_without_waveforms_has_the_rate_of_its_times_of_its_group_or_none(tmp_path):
    path = tmp_path / "hit.tdms"
    write_tdms(path, ("all", [("Time", np.arange(40) / RATE), ("a", TRACE)]))
    assert describe(read_channels(path)["a"]) == (TRACE.tolist(), RATE, "", 0.0)
    path = tmp_path / "bare.tdms"
    write_tdms(path, ("all", [("a", TRACE)]))
    assert np.isnan(read_channels(path)["a"].sampling_rate)
    with nptdms.TdmsWriter(str(path)) as writer:
        group = nptdms.GroupObject("all", {"Sampling Rate": RATE})
        writer.write_segment([group, nptdms.ChannelObject("all", "a", TRACE)])
    assert read_channels(path)["a"].sampling_rate == RATE


def test_a_segment_that_holds_no_whole_number_of_values_is_refused(tmp_path, capfd):
    path = tmp_path / "hit.tdms"
    write_tdms(path, ("all", [("a", TRACE)]))
    count = (1).to_bytes(4, "little") + (40).to_bytes(8, "little")
    data = path.read_bytes()
    assert data.count(count) == 1
    path.write_bytes(data.replace(count, count[:4] + (39).to_bytes(8, "little")))
    with pytest.raises(FileError, match=r"hit\.tdms is no sound .*multiple of the chunk size"):
        read_measurement(path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("start_time", "recorded_at"),
    [
        (np.datetime64("2023-05-05T13:39:50.887019"), 1_683_293_990_887_019_000),
        (np.datetime64("1904-01-01T00:00:00"), 0),
        ("2023-05-05", 0),
    ],
)
def test_tdms_waveforms_state_when_they_were_recorded(tmp_path, start_time, recorded_at):
    path = tmp_path / "hit.tdms"
    names = [("a", TRACE), ("clock", np.full(40, np.datetime64("2023-05-05T00:00:00", "us")))]
    words = {"wf_start_time": start_time, "wf_increment": 1 / RATE, "wf_start_offset": 0.5}
    write_tdms(path, ("all", names), **words)
    ((name, channel),) = read_channels(path).items()
    assert (name, channel.recorded_at) == ("a", recorded_at)
    assert channel.stamp == (recorded_at and recorded_at + 500_000_000)


@pytest.mark.parametrize("suffix", [".uff", ".unv", ".58"])
@pytest.mark.parametrize("binary", [0, 1])
@pytest.mark.parametrize("spacing", [0, 1])
def test_universal_files_are_read(tmp_path, suffix, binary, spacing):
    path = tmp_path / f"hit{suffix}"
    function = make_function(binary=binary, abscissa_spacing=spacing)
    if not spacing:  # in the header and in text, times have six digits
        function["x"] = np.arange(40) * 2e-5
    pyuff.UFF(str(path)).write_sets([function, make_function(id1="NONE")])
    first, second = read_measurement(path).channels
    assert first.values == pytest.approx(TRACE, rel=0 if binary else 1e-11)
    assert (first.name, first.unit) == ("hammer", "g")
    assert (first.sampling_rate, first.start) == ((RATE, 0.25) if spacing else (50000.0, 0.0))
    assert (second.name, second.sampling_rate) == ("channel 2", RATE)


@pytest.mark.parametrize(
    ("function", "told"),
    [
        (make_function(func_type=4), "it has a frequency response"),
        (make_function(data=TRACE + 1j), "it has complex numbers"),
        (make_function(abscissa_axis_units_lab="Hz"), "it has a spectrum, whose axis is in Hz"),
    ],
)
def test_universal_files_of_something_else_say_what_they_hold(tmp_path, function, told):
    path = tmp_path / "frf.uff"
    pyuff.UFF(str(path)).write_sets([function])
    with pytest.raises(FileError, match=rf"frf\.uff holds no trace over time .*: {told}"):
        read_measurement(path)


def test_other_data_sets_beside_a_trace_are_left_out(tmp_path):
    path = tmp_path / "hit.uff"
    nodes = pyuff.prepare_15([1], [0], [0], [11], [0.0], [0.0], [0.0])
    pyuff.UFF(str(path)).write_sets([nodes, make_function(func_type=4), make_function()])
    assert list(read_channels(path)) == ["hammer"]


@pytest.mark.parametrize(("stated", "told"), [(50, "is cut off"), (30, "contradicts itself")])
def test_universal_files_that_state_another_length_are_refused(tmp_path, stated, told):
    path = tmp_path / "hit.uff"
    pyuff.UFF(str(path)).write_sets([make_function()])
    data = path.read_bytes()
    assert data.count(b"        40") == 1
    path.write_bytes(data.replace(b"        40", b"%10d" % stated))
    with pytest.raises(FileError, match=rf"hit\.uff {told}: 'hammer' should have {stated} points"):
        read_measurement(path)


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
    assert list(channels)[:6] == [f"first {hit} {row}" for hit in (1, 2, 3) for row in (1, 2)]
    for name in ("first 3 2", "last 3 2"):
        assert channels[name].values.tolist() == hits[2, 1].tolist()


@pytest.mark.parametrize("kind", [np.uint8, np.int16, np.int32, np.float32, np.float64])
def test_sound_files_are_read(tmp_path, kind):
    table = (100 * (1 + np.array([TRACE, TRACE**2]))).astype(kind)
    wavfile.write(tmp_path / "two.wav", 44100, table.T)
    wavfile.write(tmp_path / "one.wav", 44100, table[0])
    channels = read_channels(tmp_path / "two.wav")
    assert list(channels) == ["channel 1", "channel 2"]
    for channel, values in zip(channels.values(), table, strict=True):
        assert describe(channel) == (values.tolist(), 44100.0, "", 0.0)
    assert describe(read_channels(tmp_path / "one.wav")["channel 1"])[0] == table[0].tolist()


def test_sound_of_24_bits_comes_as_its_counts(tmp_path):
    counts = [0, 1, -1, 2**23 - 1, -(2**23)]
    with wave.open(str(tmp_path / "hit.wav"), "wb") as file:
        file.setparams((1, 3, 96000, 0, "NONE", ""))
        file.writeframes(b"".join(struct.pack("<i", count)[:3] for count in counts))
    (channel,) = read_channels(tmp_path / "hit.wav").values()
    assert describe(channel) == (counts, 96000.0, "", 0.0)
    assert channel.values.dtype == np.int32


def test_a_sound_header_that_promises_too_much_takes_no_memory(tmp_path):
    path = tmp_path / "hit.wav"
    wavfile.write(path, 44100, TRACE)
    data = path.read_bytes()
    at = data.index(b"data") + 4
    path.write_bytes(data[:at] + struct.pack("<I", 2**32 - 16) + data[at + 4 :])
    with pytest.raises(FileError, match=r"hit\.wav is cut off: it should have 4294967280 bytes"):
        read_measurement(path)


def test_columns_of_numbers_are_channels_and_one_of_times_their_clock(tmp_path):
    force = pa.field("force", pa.float32(), metadata={"unit": "N"})
    schema = pa.schema([("time", pa.float64()), force, ("who", pa.string())])
    columns = [np.arange(40) / RATE, TRACE.astype(np.float32), ["B"] * 40]
    parquet.write_table(pa.table(columns, schema=schema), tmp_path / "hit.parquet")
    ((name, channel),) = read_channels(tmp_path / "hit.parquet").items()
    single = TRACE.astype(np.float32).astype(np.float64).tolist()
    assert (name, describe(channel)) == ("force", (single, RATE, "N", 0.0))


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
