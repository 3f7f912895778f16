"""What is written opens in other tools; what is damaged ends in a sentence."""

import json
import sys

import h5py
import nptdms
import numpy as np
import pytest
import pyuff
import scipy.io
from pyarrow import parquet

from impact_rig.core.given.errors import FileError, RigError
from impact_rig.files.formats.registry import WRITABLE, read_measurement, write_measurement
from impact_rig.files.measurement import MeasuredChannel, Measurement

from .foreign import RATE, TRACE, describe


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

    table = parquet.read_table(paths[".parquet"])
    assert [table[name].to_pylist() for name in table.column_names] == expected
    assert table.schema.field("sample").metadata == {b"unit": b"m/s^2"}

    table = np.loadtxt(paths[".csv"], delimiter=",", skiprows=3)
    assert table[:, 1:].T.tolist() == expected
    assert table[:, 0] == pytest.approx(0.5 + np.arange(40) / RATE, rel=1e-15)


def try_to_read(path):
    """Return the channels of a file or its error, a sentence that names it."""
    try:
        found = read_measurement(path)
    except RigError as error:
        return error
    channels = [describe(channel) for channel in found.channels]
    return channels + list(found.remarks)


def is_sentence(error, path):
    return path.name in str(error) and "\n" not in str(error)


def test_a_file_that_is_cut_off_anywhere_is_refused_or_complete_or_says_so(written):
    data = written.read_bytes()
    whole = try_to_read(written)
    refused = 0
    for length in np.linspace(1, len(data) - 1, 25).astype(int):
        written.write_bytes(data[:length])
        read = try_to_read(written)
        if isinstance(read, FileError):
            assert is_sentence(read, written)
            refused += 1
        elif read[-1] == "the file is cut at its end: its channels end early":
            refused += 1
            pairs = zip(read[:-1], whole, strict=True)
            assert all(cut[0] == full[0][: len(cut[0])] for cut, full in pairs)
        else:
            assert read == whole[: len(read)]
    assert refused > 12


@pytest.mark.parametrize("suffix", [".csv", ".mat"])
def test_what_git_lfs_leaves_in_place_of_a_file_is_called_so(tmp_path, suffix):
    path = tmp_path / f"hit{suffix}"
    path.write_text(
        "version https://git-lfs.github.com/spec/v1\n"
        "oid sha256:4d7a214614ab2935c943f9e0ff69d22eadbb8f32b1258daaa5e2ca24d17e2393\nsize 12345\n"
    )
    with pytest.raises(FileError, match=rf"hit\{suffix} is what git-lfs leaves.*git lfs pull"):
        read_measurement(path)
