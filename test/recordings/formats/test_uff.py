"""Universal files, written by pyuff."""

import numpy as np
import pytest
import pyuff

from impact_rig.core.errors import FileError
from impact_rig.recordings.formats.registry import read_measurement

from .foreign import RATE, TRACE, make_function, read_channels


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


def test_single_numbers_with_the_highest_byte_first_are_read(tmp_path):
    """As workstations wrote data set 58b."""
    path = tmp_path / "hit.uff"
    pyuff.UFF(str(path)).write_sets([make_function()])
    data = path.read_bytes()
    line = next(line for line in data.split(b"\n") if line.lstrip().startswith(b"58b"))
    fields = b"    58b     2     2          11         160" + b" " * 36
    # Ordinate data type 2: single precision.
    assert b"         4        40" in data
    data = data.replace(line, fields).replace(b"         4        40", b"         2        40")
    values = TRACE.astype("<f8").tobytes()
    assert values in data
    path.write_bytes(data.replace(values, TRACE.astype(">f4").tobytes()))
    (channel,) = read_channels(path).values()
    assert channel.values.tolist() == TRACE.astype(np.float32).astype(float).tolist()
