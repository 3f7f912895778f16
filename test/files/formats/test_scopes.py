"""Files that oscilloscopes saved, and one that Tektronix's own library wrote."""

from pathlib import Path

import numpy as np
import pytest
from files.formats.foreign import read_channels

from impact_rig.core.given.errors import FileError
from impact_rig.files.formats.registry import read_measurement

SCOPES = Path(__file__).parents[2] / "data" / "scopes"


def test_tektronix():
    """The numbers that tm_data_types had to write, in four bytes each."""
    at = np.arange(1000)
    counts = np.round(20_000 * np.sin(np.pi * (at - 300) / 200) * ((at > 300) & (at < 500)))
    (channel,) = read_measurement(SCOPES / "tektronix.wfm").channels
    np.testing.assert_allclose(channel.values, counts * 40e-6, rtol=1e-7)
    assert (channel.name, channel.sampling_rate) == ("CH 1", 2.5e6)
    assert channel.start == pytest.approx(-1e-4)


def test_lecroy():
    """As lecroyparser 1.4.2, by another author, reads it."""
    (channel,) = read_measurement(SCOPES / "lecroy.trc").channels
    np.testing.assert_allclose(channel.values[:3], [-0.02395904, 0.00803965, -0.02395904], 1e-5)
    assert (channel.values.size, channel.sampling_rate) == (502, 1e9)
    assert (channel.values.min(), channel.values.max()) == pytest.approx((-1.3359065, 2.5039399))
    assert channel.start == pytest.approx(-1.20745007e-07)


def test_segments_of_lecroy_are_channels_of_their_own():
    """Numbers of its second segment as lecroyparser reads them, which joins all."""
    channels = read_channels(SCOPES / "lecroy_sequence.trc")
    assert len(channels) == 20
    second = channels["CH 2 segment 2"].values
    np.testing.assert_allclose(second[:3], [0.00803965, -0.05595779, 0.0720371], 1e-5)
    assert second.size == 502


@pytest.mark.parametrize(
    ("name", "channel", "rate", "size"),
    [("agilent.bin", "CH 1", 976_562.5, 1953), ("rigol.bin", "CH 4", 200e3, 1000)],
)
def test_those_that_keep_volts_are_read_bit_by_bit(name, channel, rate, size):
    """Agilent and Rigol write volts in four bytes, those of the last channel at the end."""
    stored = np.frombuffer((SCOPES / name).read_bytes()[-4 * size :], "<f4")
    read = read_channels(SCOPES / name)[channel]
    assert read.values.tolist() == stored.tolist()
    assert (read.sampling_rate, read.unit) == (rate, "V")


def test_siglent():
    """A probe's test signal of 3.0 V, by the name that its author gave it."""
    (channel,) = read_measurement(SCOPES / "siglent.bin").channels
    assert np.ptp(channel.values) == pytest.approx(3.0, rel=0.02)
    assert (channel.unit, channel.sampling_rate) == ("V", 10e3)


def test_a_unit_that_the_library_assumes_is_not_stated():
    for name in ("tektronix.wfm", "lecroy.trc"):
        assert read_measurement(SCOPES / name).channels[0].unit == ""


def test_what_no_oscilloscope_wrote_is_refused_with_another_way(tmp_path):
    path = tmp_path / "catman.bin"
    path.write_bytes(bytes(range(256)))
    with pytest.raises(FileError, match=r"catman\.bin is no sound \.bin file: Unrecognised"):
        read_measurement(path)
