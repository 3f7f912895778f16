"""Files of MATLAB, written by scipy and, the new ones, by h5py."""

import io
import signal
import struct
import sys
import zlib

import h5py
import numpy as np
import pytest
import scipy.io
from terminal import run_program

from impact_rig.core.given.errors import FileError
from impact_rig.files.formats.registry import read_measurement

from .foreign import RATE, TRACE, describe, read_channels


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("version", ["5", "4"])
def test_matlab_files_are_read(tmp_path, compressed, version):
    path = tmp_path / "hit.mat"
    variables = {"hammer": TRACE, "both": np.array([TRACE, -TRACE]).T, "Fs": RATE, "note": "hi"}
    scipy.io.savemat(path, variables, format=version, do_compression=compressed)
    channels = read_channels(path)
    assert list(channels) == ["hammer", "both 1", "both 2"]
    assert describe(channels["both 2"]) == ((-TRACE).tolist(), RATE, "", 0.0)


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


def test_structs_and_cells_are_named_by_their_places(tmp_path):
    path = tmp_path / "tests.mat"
    cells = np.empty(2, dtype=object)
    cells[:] = [TRACE, 2 * TRACE]
    hits = [{"front": TRACE, "dt": 1 / RATE}, {"front": -TRACE, "dt": 0.5 / RATE}]
    scipy.io.savemat(path, {"run": {"hits": hits, "who": "B"}, "tests": cells, "Fs": 2 * RATE})
    channels = read_channels(path)
    assert {
        name: (channel.values[1], channel.sampling_rate) for name, channel in channels.items()
    } == {
        "run.hits(1).front": (TRACE[1], RATE),
        "run.hits(2).front": (-TRACE[1], 2 * RATE),
        "tests{1}": (TRACE[1], 2 * RATE),
        "tests{2}": (2 * TRACE[1], 2 * RATE),
    }


def test_exports_of_measuring_systems_are_read_as_their_programs_write_them(tmp_path):
    """Fields as others' readers use them: ITA-Toolbox for PULSE, vna viewers for SigLab."""
    path = tmp_path / "export.mat"
    pulse = {
        "File_Header": {"NumberOfChannels": "2", "SampleFrequency": "51200 "},
        "Channel_1_Data": TRACE, "Channel_1_Header": {"SignalName": "Hammer", "Unit": "N"},
        "Channel_2_Data": -TRACE, "Channel_2_Header": {"SignalName": "Beam", "Unit": "m/s^2"},
    }  # fmt: skip
    scipy.io.savemat(path, pulse)
    channels = read_channels(path)
    assert describe(channels["Channel_1.Data"]) == (TRACE.tolist(), RATE, "N", 0.0)
    assert describe(channels["Channel_2.Data"]) == ((-TRACE).tolist(), RATE, "m/s^2", 0.0)

    def signal(values, unit):
        return {
            "x_values": {
                "start_value": 0.0, "increment": 1 / RATE, "number_of_values": 40.0,
                "quantity": {"label": "s"},
            },
            "y_values": {"values": values, "quantity": {"label": unit}},
            "function_record": {"name": "Time"},
        }  # fmt: skip

    scipy.io.savemat(path, {"Signal_0": signal(TRACE, "N"), "Signal_1": signal(-TRACE, "g")})
    channels = read_channels(path)
    assert describe(channels["Signal_0.y_values.values"]) == (TRACE.tolist(), RATE, "N", 0.0)
    assert describe(channels["Signal_1.y_values.values"])[1:] == (RATE, "g", 0.0)

    measured = [{"tdmeas": TRACE, "eu_val": 2.0}, {"tdmeas": -TRACE, "eu_val": 3.0}]
    times = -0.001 + np.arange(40) / RATE
    scipy.io.savemat(path, {"SLm": {"tdxvec": times, "scmeas": measured, "navg": 1.0}})
    channels = read_channels(path)
    assert list(channels) == ["SLm.scmeas(1).tdmeas", "SLm.scmeas(2).tdmeas"]
    assert describe(channels["SLm.scmeas(2).tdmeas"]) == ((-TRACE).tolist(), RATE, "V", -0.001)

    times = np.arange(40) / RATE
    dewesoft = {"Data1_AI_1": TRACE, "Data1_time_AI_1": times, "Data1_AI_2": -TRACE}
    scipy.io.savemat(path, dewesoft)
    channels = read_channels(path)
    assert list(channels) == ["Data1_AI_1", "Data1_AI_2"]
    assert channels["Data1_AI_2"].sampling_rate == RATE

    # PicoScope, as its User's Guide has it under "Binary formats".
    scope = {"Tstart": -1e-4, "Tinterval": 1 / RATE, "Length": 40.0, "A": TRACE, "B": -TRACE}
    scipy.io.savemat(path, scope)
    rates = {name: channel.sampling_rate for name, channel in read_channels(path).items()}
    assert rates == {"A": RATE, "B": RATE}


@pytest.mark.parametrize(
    "variables", [{"a": "words"}, {"a": TRACE + 1j}, {"a": np.zeros((2, 2, 2, 2))}]
)
def test_matlab_files_without_vectors_are_named(tmp_path, variables):
    scipy.io.savemat(tmp_path / "hit.mat", variables)
    with pytest.raises(FileError, match=r"hit\.mat has no vector of real numbers"):
        read_measurement(tmp_path / "hit.mat")


def test_a_file_that_crashes_the_library_is_refused_without_noise_and_the_next_one_read(tmp_path):
    good, bad = tmp_path / "good.mat", tmp_path / "bad.mat"
    scipy.io.savemat(good, {"hammer": TRACE, "Fs": RATE})
    content = good.read_bytes()
    doubles, unknown = (struct.pack("<II", kind, 8 * TRACE.size) for kind in (9, 10))
    assert content.count(doubles) == 1
    bad.write_bytes(content.replace(doubles, unknown))
    with pytest.raises(FileError, match=r"bad\.mat is no sound \.mat file: it crashes"):
        read_measurement(bad)
    assert list(read_channels(good)) == ["hammer"]
    script = (
        "import sys; from pathlib import Path;"
        "from impact_rig.files.formats.registry import read_measurement;"
        "read_measurement(Path(sys.argv[1]))"
    )
    done = run_program([sys.executable, "-X", "faulthandler", "-c", script, bad])
    assert "it crashes the library" in done.stderr
    assert "Segmentation fault" not in done.stderr
    assert "Fatal Python error" not in done.stderr


KILLED = """
import os, signal, sys
from pathlib import Path
from impact_rig.files.formats.registry import read_measurement
if __name__ == "__main__":
    read_measurement(Path(sys.argv[1]))
    os.kill(os.getpid(), signal.SIGKILL)
"""


def test_the_process_that_reads_ends_with_the_one_it_reads_for(tmp_path):
    scipy.io.savemat(tmp_path / "hit.mat", {"hammer": TRACE, "Fs": RATE})
    (tmp_path / "script.py").write_text(KILLED)
    command = [sys.executable, tmp_path / "script.py", tmp_path / "hit.mat"]
    # The pipe is at its end when both are gone, else the time limit is.
    done = run_program(command)
    assert done.returncode == -signal.SIGKILL, done.stderr


def make_opaque(name, kind):
    """Return a variable of a class of MATLAB's own, a `datetime` say: it has no shape."""
    parts = [struct.pack("<IIII", 6, 8, 17, 0)]
    parts += [
        struct.pack("<II", 1, len(word)) + word.ljust(-(-len(word) // 8) * 8, b"\0")
        for word in (name, b"MCOS", kind)
    ]
    numbers = io.BytesIO()
    scipy.io.savemat(numbers, {"x": np.array([0xDD000000, 2, 1, 1], np.uint32)})
    content = b"".join(parts) + numbers.getvalue()[128:]
    return struct.pack("<II", 14, len(content)) + content


@pytest.mark.parametrize("compressed", [False, True])
def test_variables_that_only_matlab_knows_are_passed_over(tmp_path, compressed):
    path = tmp_path / "hit.mat"
    scipy.io.savemat(path, {"hammer": TRACE, "Fs": RATE}, do_compression=compressed)
    data = path.read_bytes()
    opaque = make_opaque(b"recorded", b"datetime")
    if compressed:
        packed = zlib.compress(opaque)
        opaque = struct.pack("<II", 15, len(packed)) + packed
    path.write_bytes(data[:128] + opaque + data[128:])
    assert describe(read_channels(path)["hammer"]) == (TRACE.tolist(), RATE, "", 0.0)
