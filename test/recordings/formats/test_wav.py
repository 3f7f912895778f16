"""Sound files, written by scipy and the standard library."""

import struct
import wave

import numpy as np
import pytest
from scipy.io import wavfile

from impact_rig.core.errors import FileError
from impact_rig.recordings.formats.registry import read_measurement

from .foreign import TRACE, describe, read_channels


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
