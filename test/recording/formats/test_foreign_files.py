"""Files that other tools wrote are read, and what is written here opens in other tools."""

import datetime as dt
import json
import struct
import sys
import wave

import h5py
import nptdms
import numpy as np
import pytest
import pyuff
import scipy.io
from scipy.io import wavfile

from impact_rig.core.errors import FileError, RigError
from impact_rig.recording.formats.measurement import MeasuredChannel, Measurement
from impact_rig.recording.formats.registry import (
    READABLE,
    WRITABLE,
    read_measurement,
    write_measurement,
)

RATE = 51200.0
TRACE = np.sin(np.arange(40) / 3) / 3


def read_channels(path):
    return {channel.name: channel for channel in read_measurement(path).channels}


def describe(channel):
    return channel.values.tolist(), channel.sampling_rate, channel.unit, channel.start


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


def test_tdms_without_waveforms_has_the_rate_of_its_times_or_none(tmp_path):
    path = tmp_path / "hit.tdms"
    write_tdms(path, ("all", [("Time", np.arange(40) / RATE), ("a", TRACE)]))
    assert describe(read_channels(path)["a"]) == (TRACE.tolist(), RATE, "", 0.0)
    path = tmp_path / "bare.tdms"
    write_tdms(path, ("all", [("a", TRACE)]))
    assert np.isnan(read_channels(path)["a"].sampling_rate)


@pytest.mark.parametrize(
    ("start_time", "recorded_at"),
    [
        (np.datetime64("2023-05-05T13:39:50.887019"), 1_683_293_990_887_019_000),
        (dt.datetime(2023, 5, 5, 13, 39, 50), 1_683_293_990_000_000_000),
        (np.datetime64("1904-01-01T00:00:00"), 0),
        (np.datetime64("2150-01-01T00:00:00"), 0),
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


def test_a_scaled_tdms_channel_comes_in_its_unit(tmp_path):
    path = tmp_path / "hit.tdms"
    scale = {
        "NI_Number_Of_Scales": 1, "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 0.25, "NI_Scale[0]_Linear_Y_Intercept": 1.0,
        "NI_Scaling_Status": "unscaled",
    }  # fmt: skip
    write_tdms(path, ("all", [("a", np.array([0, 4, -4], np.int16))]), **scale)
    assert read_channels(path)["a"].values.tolist() == [1.0, 2.0, 0.0]


def test_tdms_without_numbers_is_named(tmp_path):
    write_tdms(tmp_path / "words.tdms", ("all", [("a", np.array(["b", "c"]))]))
    with pytest.raises(FileError, match=r"words\.tdms has no vector of real numbers"):
        read_measurement(tmp_path / "words.tdms")


def make_function(**changes):
    function = {
        "type": 58, "func_type": 1, "rsp_node": 3, "rsp_dir": 3, "ref_node": 1, "ref_dir": -3,
        "id1": "hammer", "x": 0.25 + np.arange(40) / RATE, "data": TRACE, "binary": 1,
        "abscissa_spacing": 1, "orddenom_spec_data_type": 0, "ordinate_axis_units_lab": "g",
    }  # fmt: skip
    return function | changes


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
        (make_function(func_type=9), "it has a power spectral density"),
        (make_function(data=TRACE + 1j), "it has complex numbers"),
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


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("version", ["5", "4"])
def test_matlab_files_are_read(tmp_path, compressed, version):
    path = tmp_path / "hit.mat"
    variables = {"hammer": TRACE, "both": np.array([TRACE, -TRACE]).T, "Fs": RATE, "note": "hi"}
    scipy.io.savemat(path, variables, format=version, do_compression=compressed)
    channels = read_channels(path)
    assert list(channels) == ["hammer", "both 1", "both 2"]
    assert describe(channels["both 2"]) == ((-TRACE).tolist(), RATE, "", 0.0)


def test_a_variable_of_times_gives_the_rate(tmp_path):
    path = tmp_path / "hit.mat"
    scipy.io.savemat(path, {"t": 1.0 + np.arange(40) / RATE, "a": np.arange(40, dtype=np.int16)})
    assert describe(read_channels(path)["a"]) == (list(range(40)), RATE, "", 1.0)
    assert read_channels(path)["a"].values.dtype == np.int32


def write_new_matlab(path, arrays):
    """Write as MATLAB 7.3 does: HDF5 behind 512 bytes of words, words as numbers."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, (kind, values) in arrays.items():
            file.create_dataset(name, data=values).attrs["MATLAB_class"] = np.bytes_(kind)
        file.create_group("#refs#").create_dataset("a", data=TRACE)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM")


def test_new_matlab_files_are_read(tmp_path):
    path = tmp_path / "hit.mat"
    words = np.frombuffer("operator".encode("utf-16-le"), np.uint16)
    arrays = {
        "hammer": ("double", TRACE[np.newaxis]),
        "Fs": ("double", [[RATE]]),
        "note": ("char", words[:, np.newaxis]),
    }
    write_new_matlab(path, arrays)
    channels = read_channels(path)
    assert list(channels) == ["hammer"]
    assert describe(channels["hammer"]) == (TRACE.tolist(), RATE, "", 0.0)


@pytest.mark.parametrize(
    "variables",
    [
        {},
        {"a": "words"},
        {"a": 5.0},
        {"a": TRACE + 1j},
        {"a": {"b": TRACE}},
        {"a": np.zeros((2, 2, 2))},
    ],
)
def test_matlab_files_without_vectors_are_named(tmp_path, variables):
    scipy.io.savemat(tmp_path / "hit.mat", variables)
    with pytest.raises(FileError, match=r"hit\.mat has no vector of real numbers"):
        read_measurement(tmp_path / "hit.mat")


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


@pytest.mark.parametrize(("unit", "scale"), [("", 1.0), ("s", 1.0), ("ms", 1e3), ("us", 1e6)])
def test_times_count_in_their_unit(tmp_path, unit, scale):
    with h5py.File(tmp_path / "hit.h5", "w") as file:
        file["time"] = scale * (0.5 + np.arange(40) / RATE)
        file["time"].attrs["unit"] = unit
        file["a"] = TRACE
    pyuff.UFF(str(tmp_path / "hit.uff")).write_sets(
        [
            make_function(
                x=scale * (0.5 + np.arange(40) / RATE), abscissa_axis_units_lab=unit or "NONE"
            )
        ]
    )
    for name in ("hit.h5", "hit.uff"):
        (channel,) = read_measurement(tmp_path / name).channels
        assert channel.sampling_rate == RATE
        assert channel.start == pytest.approx(0.5, rel=1e-12)


def test_hdf5_that_promises_too_much_takes_no_memory(tmp_path):
    with h5py.File(tmp_path / "hit.h5", "w") as file:
        file.create_dataset("a", shape=(10**13,), dtype="f8", chunks=(1000,))
    with pytest.raises(FileError, match=r"hit\.h5 is cut off or damaged: a should have 8000"):
        read_measurement(tmp_path / "hit.h5")


def test_hdf5_of_more_axes_is_named(tmp_path):
    with h5py.File(tmp_path / "hit.h5", "w") as file:
        file["a"] = np.zeros((2, 3, 4))
    with pytest.raises(FileError, match=r"hit\.h5 has no vector of real numbers"):
        read_measurement(tmp_path / "hit.h5")


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


@pytest.mark.parametrize(
    ("suffix", "library"), [(".tdms", "nptdms"), (".uff", "pyuff"), (".h5", "h5py")]
)
def test_a_missing_library_is_named_whether_a_file_is_read_or_written(
    tmp_path, monkeypatch, suffix, library
):
    monkeypatch.setitem(sys.modules, library, None)
    path = tmp_path / f"hit{suffix}"
    path.write_bytes(b"\0" * 600)
    with pytest.raises(ModuleNotFoundError) as caught:
        read_measurement(path)
    assert caught.value.name == library
    with pytest.raises(ModuleNotFoundError):
        write_measurement(tmp_path / f"new{suffix}", Measurement(path, CHANNELS))
    assert not list(tmp_path.glob("*new*"))


CHANNELS = (
    MeasuredChannel("front/hammer", TRACE, RATE, "N", 0.5),
    MeasuredChannel("sample", TRACE**2, RATE, "m/s^2", 0.5, 1_683_293_990_887_019_931),
)


@pytest.fixture(params=[suffix for suffix in WRITABLE if suffix != ".csv"])
def written(request, tmp_path):
    path = tmp_path / f"hit{request.param}"
    write_measurement(path, Measurement(path, CHANNELS))
    return path


def test_the_plain_libraries_find_what_was_written(tmp_path):
    paths = {suffix: tmp_path / f"hit{suffix}" for suffix in WRITABLE}
    for path in paths.values():
        write_measurement(path, Measurement(path, CHANNELS))
    expected = [TRACE.tolist(), (TRACE**2).tolist()]

    sets = pyuff.UFF(str(paths[".uff"])).read_sets()
    assert [function["data"].tolist() for function in sets] == expected
    assert [function["id1"] for function in sets] == ["front/hammer", "sample"]
    assert [function["ordinate_axis_units_lab"] for function in sets] == ["N", "m/s^2"]
    assert sets[0]["x"][:2] == pytest.approx([0.5, 0.5 + 1 / RATE], rel=1e-5)

    (group,) = nptdms.TdmsFile.read(paths[".tdms"]).groups()
    assert [channel[:].tolist() for channel in group.channels()] == expected
    times = group["front/hammer"].time_track()
    assert times == pytest.approx(0.5 + np.arange(40) / RATE, rel=1e-15)
    assert group["sample"].properties["unit_string"] == "m/s^2"
    date = group["sample"].properties["wf_start_time"]
    assert str(date) == "2023-05-05T13:39:50.887019"
    assert "wf_start_time" not in group["front/hammer"].properties

    variables = scipy.io.loadmat(paths[".mat"], simplify_cells=True)
    assert variables["front_hammer"].tolist() == expected[0]
    table = json.loads(variables["channels"])
    assert [row["name"] for row in table] == ["front/hammer", "sample"]
    assert [row["sampling_rate"] for row in table] == [RATE, RATE]
    assert [row["recorded_at"] for row in table] == [None, 1_683_293_990_887_019_931]

    with h5py.File(paths[".h5"]) as file:
        assert [file[name][:].tolist() for name in file] == expected
        assert dict(file["sample"].attrs) == {
            "name": "sample", "sampling_rate": RATE, "unit": "m/s^2", "start": 0.5,
            "recorded_at": 1_683_293_990_887_019_931,
        }  # fmt: skip
        assert "recorded_at" not in file["front_hammer"].attrs

    table = np.loadtxt(paths[".csv"], delimiter=",", skiprows=3)
    assert table[:, 1:].T.tolist() == expected
    assert table[:, 0] == pytest.approx(0.5 + np.arange(40) / RATE, rel=1e-15)


def try_to_read(path):
    """Return the channels of a file or its error, a sentence that names it."""
    try:
        return [describe(channel) for channel in read_measurement(path).channels]
    except RigError as error:
        return error


def is_sentence(error, path):
    return path.name in str(error) and "\n" not in str(error)


def test_a_file_that_is_cut_off_anywhere_is_refused_or_complete(written):
    data = written.read_bytes()
    whole = try_to_read(written)
    refused = 0
    for length in np.linspace(1, len(data) - 1, 60).astype(int):
        written.write_bytes(data[:length])
        read = try_to_read(written)
        if isinstance(read, FileError):
            assert is_sentence(read, written)
            refused += 1
        else:
            assert read == whole[: len(read)]
    assert refused > 30


@pytest.mark.parametrize("suffix", READABLE)
@pytest.mark.parametrize("seed", range(4))
def test_noise_is_refused_in_a_sentence(tmp_path, suffix, seed):
    path = tmp_path / f"noise{suffix}"
    path.write_bytes(np.random.default_rng(seed).bytes(3000))
    with pytest.raises(FileError, match=f"noise{suffix}") as caught:
        read_measurement(path)
    assert "\n" not in str(caught.value)


# Not HDF5: its library does not return from every damaged file.
@pytest.mark.parametrize("written", [".mat", ".tdms", ".uff"], indirect=True)
def test_damaged_bytes_end_in_a_sentence_or_in_channels(written):
    data = bytearray(written.read_bytes())
    generator = np.random.default_rng(5)
    refused = 0
    for _ in range(60):
        damaged = data.copy()
        for position in generator.integers(0, min(len(data), 1500), 3):
            damaged[position] = generator.integers(256)
        written.write_bytes(damaged)
        read = try_to_read(written)
        if isinstance(read, RigError):
            assert is_sentence(read, written)
            refused += 1
    assert refused > 5
