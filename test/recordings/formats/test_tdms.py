"""Files of LabVIEW's TDMS, written by npTDMS."""

import datetime as dt

import nptdms
import numpy as np
import pytest

from impact_rig.core.errors import FileError
from impact_rig.recordings.formats.registry import read_measurement

from .foreign import RATE, TRACE, describe, read_channels


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


def test_tdms_without_waveforms_has_the_rate_that_a_group_states(tmp_path):
    with nptdms.TdmsWriter(str(tmp_path / "hit.tdms")) as writer:
        group = nptdms.GroupObject("all", {"Sampling Rate": RATE})
        writer.write_segment([group, nptdms.ChannelObject("all", "a", TRACE)])
    assert describe(read_channels(tmp_path / "hit.tdms")["a"]) == (TRACE.tolist(), RATE, "", 0.0)


def test_a_segment_that_holds_no_whole_number_of_values_is_refused(tmp_path):
    path = tmp_path / "hit.tdms"
    write_tdms(path, ("all", [("a", TRACE)]))
    count = (1).to_bytes(4, "little") + (40).to_bytes(8, "little")
    data = path.read_bytes()
    assert data.count(count) == 1
    path.write_bytes(data.replace(count, count[:4] + (39).to_bytes(8, "little")))
    with pytest.raises(FileError, match=r"hit\.tdms is no sound .*multiple of the chunk size"):
        read_measurement(path)


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
