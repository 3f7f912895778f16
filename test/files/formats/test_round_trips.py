"""What is written comes back: every number bit by bit, with its name, unit, rate and start."""

import math
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from impact_rig.core.given.errors import FileError
from impact_rig.files.formats import hdf5
from impact_rig.files.formats.registry import WRITABLE, read_measurement, write_measurement
from impact_rig.files.measurement import MeasuredChannel, Measurement

TEXT = st.text(st.characters(exclude_categories=["C", "Zl", "Zp"]), max_size=12).map(str.strip)
NAMES = TEXT.filter(lambda name: name and name != "NONE" and name == " ".join(name.split()))
UNITS = st.sampled_from(["", "m/s^2", "g", "N", "V", "mV", "µm", "Pa·s"])
RATES = st.floats(1e-3, 1e9)
STARTS = st.floats(-1e6, 1e6)
DATES = st.one_of(st.just(0), st.integers(10**18, 2 * 10**18))
VALUES = st.one_of(
    hnp.arrays(np.float64, st.integers(1, 30), elements=st.floats()),
    hnp.arrays(np.int32, st.integers(2, 30)),  # MATLAB knows no vector of one
)


@st.composite
def measurements(draw):
    """Draw channels that share their time, since columns of text do."""
    rate, start = draw(RATES), draw(STARTS)
    channels = draw(st.lists(st.tuples(NAMES, VALUES, UNITS, DATES), min_size=1, max_size=4))
    return [
        MeasuredChannel(name, values, rate, unit, start, date)
        for name, values, unit, date in channels
    ]


def write_and_read(path, channels):
    path.unlink(missing_ok=True)
    write_measurement(path, Measurement(path, tuple(channels)))
    return read_measurement(path).channels


def describe(channel):
    return channel.name, channel.unit, repr(channel.sampling_rate), channel.start


def list_bits(values):
    """Return the bits of numbers as float64; one NaN is like any other."""
    numbers = values.astype(np.float64)
    numbers[np.isnan(numbers)] = np.nan
    return numbers.tobytes()


@pytest.mark.parametrize("suffix", WRITABLE)
@given(channels=measurements())
@settings(
    max_examples=15,
    deadline=None,
    suppress_health_check=[
        HealthCheck.function_scoped_fixture,
        HealthCheck.too_slow,
        HealthCheck.filter_too_much,
    ],
)
def test_all_comes_back_as_it_was(tmp_path, suffix, channels):
    if suffix == ".uff":
        assume(all(np.isfinite(channel.values).all() for channel in channels))
    read = write_and_read(tmp_path / f"all{suffix}", channels)
    assert [describe(channel) for channel in read] == [describe(channel) for channel in channels]
    for channel, original in zip(read, channels, strict=True):
        assert list_bits(channel.values) == list_bits(original.values)
        if suffix not in {".csv", ".uff"}:  # they know neither counts nor dates
            assert channel.values.dtype == original.values.dtype
            assert channel.recorded_at == original.recorded_at


ODD_NAMES = [
    "aluminium large/3.1 hammer", "a/b", "a", "A", "a", "/", ".", "..", "1st", "time", "fs",
    "channels", "it's", 'the "best"', "a,b;c", "#1", "5", "nan", "x [y]", "für µ", "end", "_x",
    "a" * 60, "a" * 60 + "b",
]  # fmt: skip


@pytest.mark.parametrize("suffix", WRITABLE)
def test_hundreds_of_channels_odd_names_and_names_that_occur_twice_are_kept(tmp_path, suffix):
    names = [*ODD_NAMES, *(f"hit {number}" for number in range(300, 0, -1))]
    channels = [MeasuredChannel(name, np.arange(2.0), 10.0, "V") for name in names]
    read = write_and_read(tmp_path / f"odd{suffix}", channels)
    assert [channel.name for channel in read] == names
    bare = [MeasuredChannel(name, np.arange(2.0), 10.0) for name in ODD_NAMES]
    read = write_and_read(tmp_path / f"odd{suffix}", bare)
    assert [describe(channel) for channel in read] == [describe(channel) for channel in bare]


@pytest.mark.parametrize("suffix", [".tdms", ".mat", ".h5", ".uff", ".parquet"])
def test_channels_may_differ_in_length_rate_and_start(tmp_path, suffix):
    channels = [
        MeasuredChannel("long", np.arange(50.0), 51200.0, "g", 0.5),
        MeasuredChannel("none", np.empty(0), 51200.0, "g"),
        MeasuredChannel("slow", np.arange(1.0), 1 / 3, "N", -1.0),
    ]
    read = write_and_read(tmp_path / f"mixed{suffix}", channels)
    assert list(map(describe, read)) == list(map(describe, channels))
    assert [channel.values.tolist() for channel in read] == [
        channel.values.tolist() for channel in channels
    ]


@pytest.mark.parametrize("suffix", [".tdms", ".mat", ".h5", ".csv", ".parquet"])
def test_a_rate_that_is_not_known_stays_unknown(tmp_path, suffix):
    channels = [MeasuredChannel(name, np.arange(3.0)) for name in ("time", "a")]
    read = write_and_read(tmp_path / f"a{suffix}", channels)
    assert [channel.name for channel in read] == ["time", "a"]
    assert all(math.isnan(channel.sampling_rate) for channel in read)


@pytest.mark.parametrize(
    ("channel", "told"),
    [
        (MeasuredChannel("a", np.ones(3)), "'a' has no sampling rate"),
        (MeasuredChannel("a", np.array([1.0, np.nan]), 1.0), "'a' has points that are no finite"),
        (MeasuredChannel("a" * 81, np.ones(3), 1.0), "has 80 letters for the name"),
        (MeasuredChannel("a", np.ones(3), 1.0, "m" * 21), "and 20 for the unit"),
    ],
)
def test_what_a_universal_file_cannot_hold_is_refused_and_leaves_no_file(tmp_path, channel, told):
    path = tmp_path / "a.uff"
    with pytest.raises(FileError, match=told):
        write_measurement(path, Measurement(tmp_path / "source", (channel,)))
    assert not list(tmp_path.glob("*.uff*"))


def test_a_format_that_cannot_be_written_is_named(tmp_path):
    measurement = Measurement(tmp_path, (MeasuredChannel("a", np.ones(3), 1.0),))
    with pytest.raises(FileError, match=r"a\.wav is of a kind unknown here \(\.wav\): .* \.uff"):
        write_measurement(tmp_path / "a.wav", measurement)


def test_on_a_full_disk_no_hdf5_file_is_begun(tmp_path, monkeypatch):
    """The library would end this process by a crash."""
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=hdf5.ROOM + 100))
    channel = MeasuredChannel("force", np.zeros(1000), 1e6)
    with pytest.raises(FileError, match=r"hit.h5 cannot be written: No space left on device"):
        write_measurement(tmp_path / "hit.h5", Measurement(tmp_path, (channel,)))
    assert not [*tmp_path.iterdir()]
