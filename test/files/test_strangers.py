"""Small files as other people's loggers write them: the right contact time, or what to give.

Each holds a half-sine of 1 ms and 100 N after 10 ms at 51.2 kHz, whose contact time by the paper's
method is 4/3 ms, and beside it the decay of a body that was struck.
"""

import datetime as dt
import io
import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pytest
from nptdms import ChannelObject, TdmsWriter
from pyarrow import parquet
from pyuff import UFF
from scipy.io import savemat

from impact_rig.analysis.analyze import judge
from impact_rig.analysis.measured_files import MeasuredFiles, make_series
from impact_rig.configuration.units import parse_quantity
from impact_rig.files.import_file import MeasurementOptions

from .formats.foreign import make_function

RATE, COUNT = 51200.0, 4096
RIGHT = 1333.3
TIME = np.arange(COUNT) / RATE
NOISE = np.random.default_rng(1).normal(0.0, 0.01, COUNT)
INSIDE = (TIME >= 10e-3) & (TIME <= 11e-3)
FORCE = np.where(INSIDE, 100.0 * np.sin(np.pi * (TIME - 10e-3) / 1e-3), 0.0) + NOISE
LATE = TIME - 10e-3
MOVED = np.where(LATE > 0, 20.0 * np.exp(-60 * LATE) * np.sin(800 * np.pi * LATE), 0.0)
MOVED = MOVED + NOISE[::-1] / 10


def read(path: Path, **given: Any) -> tuple[list[float], str]:
    """Return the contact time of each hit [µs], and the line on which channel is what."""
    found = MeasuredFiles([path], make_series(MeasurementOptions(cutoff=0.0, **given)))
    if found.errors:
        raise ValueError(found.errors[0])
    (taken,) = found.taken
    return [
        1e6 * hit.contact_time for _, _, hits in judge(found.events()) for _, hit in hits
    ], taken


def write_tdms(path: Path, *channels: tuple[str, str, np.ndarray], **stated: Any) -> None:
    with TdmsWriter(str(path)) as writer:
        objects = [
            ChannelObject(*(name.split("/") if "/" in name else ("g", name)), values, {
                "wf_increment": 1.0 / RATE, "unit_string": unit, **stated
            })
            for name, unit, values in channels
        ]  # fmt: skip
        writer.write_segment(objects)


def write_arrays(path: Path, arrays: dict[str, Any]) -> None:
    if path.suffix == ".mat":
        savemat(path, arrays)
    elif path.suffix == ".npz":
        np.savez(path, **arrays)
    else:
        with h5py.File(path, "w") as file:
            for name, values in arrays.items():
                file[name] = values


def test_of_four_channels_the_hammer_s_is_found_and_the_sample_s_left_open(tmp_path):
    path, accelerations = tmp_path / "hit.tdms", [(f"acc{n}", "g", MOVED) for n in (1, 2, 3)]
    write_tdms(path, *accelerations[:2], ("hammer", "N", FORCE), accelerations[2])
    (found,), taken = read(path)
    assert found == pytest.approx(RIGHT, rel=1e-3)
    assert taken.startswith("hammer 'hammer' [")
    assert "open: 'acc1', 'acc2', 'acc3' (--sample-channel)" in taken
    _, taken = read(path, sample_channel="acc2")
    assert ", sample 'acc2' [" in taken


def test_a_group_for_each_hit_makes_as_many_hits(tmp_path):
    channels = [
        channel
        for number in range(3)
        for channel in ((f"hit{number}/acc", "g", MOVED), (f"hit{number}/hammer", "N", FORCE))
    ]
    write_tdms(tmp_path / "hit.tdms", *channels)
    found, taken = read(tmp_path / "hit.tdms")
    assert found == pytest.approx(3 * [RIGHT], rel=1e-3)
    assert taken == "hammer 'hit0/hammer' [N], sample 'hit0/acc' [g] (and 2 hits alike)"
    write_tdms(tmp_path / "two.tdms", ("raw/hammer", "N", FORCE), ("filtered/hammer", "N", FORCE))
    with pytest.raises(ValueError, match="neither names nor units say which of its 2 channels"):
        read(tmp_path / "two.tdms")


@pytest.mark.parametrize(
    ("arrays", "taken"),
    [
        ({"t": TIME, "f": FORCE, "a": MOVED}, "hammer 'f' [unit not stated], sample 'a'"),
        ({"F": FORCE, "a": MOVED, "Fs": RATE}, "hammer 'F' [unit not stated], sample 'a'"),
        ({"f": FORCE, "fs": RATE}, "hammer 'f' [unit not stated], no channel of the sample"),
        ({"t": TIME, "a_g": MOVED, "force_N": FORCE}, "hammer 'force_N' [N], sample 'a_g' [g]"),
        ({"time": TIME, "sample": MOVED, "x": FORCE}, "hammer 'x' [unit not stated], sample 'sam"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("suffix", [".mat", ".h5", ".npz"])
def test_names_say_what_arrays_are_whatever_their_order(tmp_path, suffix, arrays, taken):
    path = tmp_path / f"hit{suffix}"
    write_arrays(path, arrays)
    (found,), told = read(path)
    assert found == pytest.approx(RIGHT, rel=1e-3)
    assert told.startswith(taken)


def test_an_axis_of_frequencies_is_one_that_rises_evenly(tmp_path):
    np.savez(tmp_path / "hit.npz", f=np.arange(float(COUNT)), X=FORCE)
    with pytest.raises(ValueError, match="its axis is 'f': it is a spectrum"):
        read(tmp_path / "hit.npz")
    np.savez(tmp_path / "both.npz", t=TIME, hammer=FORCE, f=np.arange(900.0), X=FORCE[:900])
    assert read(tmp_path / "both.npz")[0] == pytest.approx([RIGHT], rel=1e-3)


@pytest.mark.parametrize("suffix", [".mat", ".h5", ".npz", ".tdms", ".uff"])
def test_a_rate_of_one_is_counted_points_in_every_format(tmp_path, suffix):
    path = tmp_path / f"hit{suffix}"
    if suffix == ".tdms":
        write_tdms(path, ("hammer", "N", FORCE), wf_increment=1.0)
    elif suffix == ".uff":
        UFF(str(path)).write_sets([make_function(data=FORCE, x=np.arange(float(COUNT)),
                                                 abscissa_axis_units_lab="s")])  # fmt: skip
    else:
        write_arrays(path, {"hammer": FORCE, "fs": 1.0})
    with pytest.raises(ValueError, match=r"in what unit its times are.*give --rate"):
        read(path)
    assert read(path, rate=RATE)[0] == pytest.approx([RIGHT], rel=1e-3)


def write_text(path: Path, heading: str, *columns: Any, sign: str = ",") -> None:
    rows = zip(*columns, strict=True)
    path.write_text(heading + "\n" + "".join(f"{sign.join(map(str, row))}\n" for row in rows))


LOST = slice(529, 544)


@pytest.mark.parametrize("digits", [12, 5])
@pytest.mark.parametrize("lost", [LOST, slice(529, 530), slice(3000, 3010)])
def test_no_rate_bridges_points_that_are_missing(tmp_path, digits, lost):
    path = tmp_path / "hit.csv"
    times = np.delete(np.round(TIME, digits), lost).tolist()
    write_text(path, "time (s),Force (N)", times, np.delete(FORCE, lost).tolist())
    for given in ({}, {"rate": RATE}):
        with pytest.raises(ValueError, match=f"points are missing.* at point {lost.start - 1},"):
            read(path, **given)


UNEVEN = {
    "rounded": np.round(TIME, 5),
    "much rounded": np.round(TIME, 4),
    "since the epoch": np.round(1.7e9 + TIME, 6),
    "float32, summed up": np.cumsum(np.full(COUNT, 1 / RATE, np.float32), dtype=np.float32),
    "a clock that was set": TIME - 0.4 / RATE * (np.arange(COUNT) > 2999),
    "one late stamp": TIME + 0.9 / RATE * (np.arange(COUNT) == 700),
}


@pytest.mark.parametrize("times", UNEVEN.values(), ids=UNEVEN)
def test_uneven_times_without_a_gap_are_refused_with_the_rate_that_mends_them(tmp_path, times):
    path = tmp_path / "hit.csv"
    write_text(path, "time (s),Force (N)", times.tolist(), FORCE.tolist())
    with pytest.raises(ValueError, match=r"give --rate, about 5\.1\de\+04 Hz"):
        read(path)
    assert read(path, rate=RATE)[0] == pytest.approx([RIGHT], rel=1e-3)
    assert MeasuredFiles([path], make_series(MeasurementOptions(rate=RATE))).warnings[0] == (
        "its times are uneven or rounded: --rate goes before them"
    )


def test_values_may_come_before_times_and_an_index_before_both(tmp_path):
    write_text(tmp_path / "hit.csv", "", FORCE.tolist(), (TIME - 1e-3).tolist())
    assert read(tmp_path / "hit.csv")[0] == pytest.approx([RIGHT], rel=1e-3)
    columns = range(COUNT), TIME.tolist(), FORCE.tolist()
    write_text(tmp_path / "index.csv", ",time,force (N)", *columns)
    (found,), taken = read(tmp_path / "index.csv")
    assert found == pytest.approx(RIGHT, rel=1e-3)
    assert taken.startswith("hammer 'force' [N]")


def test_stamps_of_pandas_are_times(tmp_path):
    stamps = 1_750_000_000_000_000_000 + np.round(1e9 * TIME).astype(np.int64)
    table = {"force (N)": FORCE, "acc (g)": MOVED, "when": stamps.astype("datetime64[ns]")}
    parquet.write_table(pa.table(table), tmp_path / "hit.parquet")
    (found,), taken = read(tmp_path / "hit.parquet")
    assert found == pytest.approx(RIGHT, rel=1e-3)
    assert taken == "hammer 'force (N)' [N], sample 'acc (g)' [g]"
    (hit,) = MeasuredFiles([tmp_path / "hit.parquet"], make_series(MeasurementOptions())).hits
    assert hit.block.stamp == stamps[0]


def test_stamps_in_words_need_a_rate(tmp_path):
    begin = dt.datetime(2026, 11, 25, 12, tzinfo=dt.UTC)
    stamps = [(begin + dt.timedelta(seconds=time)).isoformat() for time in TIME]
    write_text(tmp_path / "hit.csv", "Timestamp,Force (N)", stamps, FORCE.tolist())
    with pytest.raises(ValueError, match=r"its 'Timestamp' is not numeric.*give --rate"):
        read(tmp_path / "hit.csv")
    assert read(tmp_path / "hit.csv", rate=RATE)[0] == pytest.approx([RIGHT], rel=1e-3)
    files = MeasuredFiles([tmp_path / "hit.csv"], make_series(MeasurementOptions(rate=RATE)))
    assert files.warnings[0].endswith("not numeric: whether points are missing is not seen")


def test_a_count_that_skips_points_is_a_gap(tmp_path):
    counted = np.delete(np.arange(COUNT), LOST).tolist()
    write_text(tmp_path / "hit.csv", "Sample,Force (N)", counted, np.delete(FORCE, LOST).tolist())
    with pytest.raises(ValueError, match="'Sample' skips points behind point 528"):
        read(tmp_path / "hit.csv", rate=RATE)


@pytest.mark.parametrize(
    "stated",
    [
        "Sampling Frequency (Hz),51200",
        "Sample rate: 51.2 kS/s",
        "# sampling_rate_kHz = 51.2",
        "Abtastrate;51.2 kHz",
        "Sample Interval,19.53125 us",
        "dt (ms),0.01953125",
    ],
)
def test_a_rate_may_be_stated_in_any_words_and_units(tmp_path, stated):
    write_text(tmp_path / "hit.txt", f"{stated}\nForce (N)", FORCE.tolist())
    assert read(tmp_path / "hit.txt")[0] == pytest.approx([RIGHT], rel=1e-3)


@pytest.mark.parametrize(
    ("stated", "told"),
    [
        ("Rate: 51200 Hz\ndt,1e-5 s", "51200 Hz by 'rate' and 100000 Hz by 'dt'"),
        ("dt,1e-5 s\nRate: 51200 Hz", "51200 Hz by 'rate' and 100000 Hz by 'dt'"),
        ("fs = 51.2 kHz\nfs = 25.6 kHz", "51200 Hz by 'fs' and 25600 Hz by 'fs'"),
        ("fs = 51.2 kHz\nfs = 51200 Hz\nSample Interval,0.0195 ms", ""),  # as rounded
        ("fs = 51.2 kHz\ndt,0.0195", ""),  # in what unit is not stated
    ],
)
def test_a_file_that_states_two_rates_is_refused_until_one_is_given(tmp_path, stated, told):
    path = tmp_path / "hit.txt"
    write_text(path, f"{stated}\nForce (N)", FORCE.tolist())
    if told:
        with pytest.raises(ValueError, match=f"two sampling rates, {told}: give --rate"):
            read(path)
    assert read(path, rate=RATE * bool(told) or None)[0] == pytest.approx([RIGHT], rel=1e-3)


def test_the_step_of_a_waveform_may_be_in_any_unit_of_time(tmp_path):
    path = tmp_path / "hit.tdms"
    write_tdms(path, ("hammer", "N", FORCE), wf_increment=1e3 / RATE, wf_xunit_string="ms")
    assert read(path)[0] == pytest.approx([RIGHT], rel=1e-3)
    write_tdms(path, ("hammer", "N", FORCE), wf_xunit_string="Hz")
    with pytest.raises(ValueError, match="the steps of 'hammer' are in 'Hz', no unit of time"):
        read(path)
    assert read(path, rate=RATE)[0] == pytest.approx([RIGHT], rel=1e-3)


@pytest.mark.parametrize(
    "stated",
    [
        {"sampling_rate": RATE / 1e3, "sampling_rate_unit": "kHz"},
        {"fs": RATE, "fs_unit": "Hz"},
        {"dt": 1e3 / RATE, "dt_unit": "ms"},
    ],
)
def test_an_attribute_may_say_the_unit_of_a_rate(tmp_path, stated):
    with h5py.File(tmp_path / "hit.h5", "w") as file:
        file["hammer"] = FORCE
        file["hammer"].attrs.update(stated)
    assert read(tmp_path / "hit.h5")[0] == pytest.approx([RIGHT], rel=1e-3)


@pytest.mark.parametrize(
    ("heading", "advice"),
    [
        ("time (s),acc1 (g),acc2 (g),acc3 (g)", "'acc1'"),
        ("time (s),response (g),x (V),temp (C)", "'x'"),
        ("time (s),x (V),F1 (N),F2 (N)", "'F1'"),
        ("time (s),x,x,x", "'2'"),
    ],
)
def test_what_is_asked_for_the_hammer_s_channel_can_be_it(tmp_path, heading, advice):
    columns = [FORCE.tolist(), MOVED.tolist(), FORCE.tolist()]
    write_text(tmp_path / "hit.csv", heading, TIME.tolist(), *columns)
    with pytest.raises(ValueError, match=f"give --hammer-channel {advice}"):
        read(tmp_path / "hit.csv")


@pytest.mark.parametrize("text", ["51.2kS/s", "51.2 kSa/s", "0.0512 MS/s", "51200 S/s"])
def test_samples_per_second_are_hertz_on_the_command_line_too(text):
    assert parse_quantity("--rate", text, "Hz", "25.6 kHz") == pytest.approx(RATE)


def test_what_stands_beside_the_hammer_s_channel_does_it_no_harm(tmp_path):
    temperature = [21.3 if number % 10 == 0 else "" for number in range(COUNT)]
    columns = TIME.tolist(), FORCE.tolist(), temperature
    write_text(tmp_path / "hit.csv", "timestamps,force,temp", *columns)
    assert read(tmp_path / "hit.csv")[0] == pytest.approx([RIGHT], rel=1e-3)
    damaged = ["" if number == 9 else value for number, value in enumerate(FORCE.tolist())]
    write_text(tmp_path / "hole.csv", "time,force,acc", TIME.tolist(), damaged, MOVED.tolist())
    with pytest.raises(ValueError, match="line 11: column 2 is blank, and goes on in line 12"):
        read(tmp_path / "hole.csv")


def test_a_minus_of_typesetters_and_a_channel_beyond_its_range(tmp_path):
    text = io.StringIO()
    np.savetxt(text, np.stack([1e6 * TIME, FORCE / 1e3]).T, "%.8f", delimiter=",")
    minus = text.getvalue().replace("-", "\N{MINUS SIGN}")
    (tmp_path / "hit.csv").write_text(f"Zeit (µs),Kraft (kN)\n{minus}")
    (found,), taken = read(tmp_path / "hit.csv")
    assert (found, taken[:19]) == (pytest.approx(RIGHT, rel=1e-3), "hammer 'Kraft' [kN]")
    beyond = ["∞" if abs(value) > 50 else value for value in FORCE.tolist()]
    write_text(tmp_path / "far.csv", "Time,Channel A\n(s),(V)\n", TIME.tolist(), beyond)
    with pytest.raises(ValueError, match=r"hammer is inf at point .* choose a larger one"):
        read(tmp_path / "far.csv")


def test_padding_before_the_signal_is_left_out(tmp_path):
    times = np.arange(3000 + COUNT) / RATE
    padded = np.concatenate([np.zeros(3000), FORCE + 5.0])
    write_text(tmp_path / "hit.csv", "time (s),Force (N)", times.tolist(), padded.tolist())
    assert read(tmp_path / "hit.csv")[0] == pytest.approx([RIGHT], rel=1e-3)
    files = MeasuredFiles([tmp_path / "hit.csv"], make_series(MeasurementOptions()))
    assert files.warnings[0].startswith("the first 3000 points have one value")
    assert files.hits[0].block.origin.place == "'Force', points 3000 to 7095"
    # A channel that is quiet, bit by bit, keeps its baseline.
    quiet = np.where(INSIDE, FORCE, 0.0)
    write_text(tmp_path / "quiet.csv", "time (s),Force (N)", TIME.tolist(), quiet.tolist())
    (hit,) = MeasuredFiles([tmp_path / "quiet.csv"], make_series(MeasurementOptions())).hits
    assert hit.block.hammer.output.size == COUNT


def test_a_list_of_channels_in_json_is_read(tmp_path):
    channels = [
        {"name": "acc", "data": MOVED.tolist(), "fs": RATE, "unit_str": "g"},
        {"name": "hammer", "data": FORCE.tolist(), "fs": RATE, "unit_str": "N"},
    ]
    path = tmp_path / "hit.json"
    path.write_text(json.dumps(channels))
    (found,), taken = read(path)
    assert (found, taken) == (
        pytest.approx(RIGHT, rel=1e-3),
        "hammer 'hammer' [N], sample 'acc' [g]",
    )
    path.write_text('[{"data": "text"}]')
    with pytest.raises(ValueError, match="has no vector of real numbers"):
        read(path)


def test_a_dead_channel_of_the_sample_is_no_crash(tmp_path):
    np.savez(tmp_path / "hit.npz", hammer=FORCE, sample=np.zeros(COUNT), fs=RATE)
    given = {"hammer_mass": 0.5, "sample_mass": 1.0, "hammer_unit": "m/s^2"}
    (found,), _ = read(tmp_path / "hit.npz", **given)
    assert found == pytest.approx(RIGHT, rel=1e-3) or np.isnan(found)


def test_channels_of_other_dates_are_no_pair(tmp_path):
    begin = np.datetime64("2026-11-25T12:00:00")
    with TdmsWriter(str(tmp_path / "hit.tdms")) as writer:
        for name, unit, values, late in (("hammer", "N", FORCE, 0), ("acc", "g", MOVED, 2)):
            stated = {
                "wf_increment": 1.0 / RATE,
                "unit_string": unit,
                "wf_start_time": begin + np.timedelta64(late, "s"),
            }
            writer.write_segment([ChannelObject("g", name, values, stated)])
    with pytest.raises(ValueError, match="'hammer' and 'acc' start 2 s apart"):
        read(tmp_path / "hit.tdms")


def test_a_file_of_labview_is_one_by_its_first_words(tmp_path):
    heading = (
        "LabVIEW Measurement\t\nSeparator\tTab\nX_Columns\tOne\n***End_of_Header***\t\n\t\n"
        "Channels\t1\nSamples\t4096\nY_Unit_Label\tNewton\nX_Dimension\tTime\nX0\t0\n"
        f"Delta_X\t{1 / RATE}\n***End_of_Header***\t\nX_Value\tImpact hammer\tComment"
    )
    write_text(tmp_path / "hit.dat", heading, TIME.tolist(), FORCE.tolist(), sign="\t")
    (found,), taken = read(tmp_path / "hit.dat")
    assert (found, taken[:26]) == (pytest.approx(RIGHT, rel=1e-3), "hammer 'Impact hammer' [N]")


def test_a_tdms_file_that_is_cut_says_so(tmp_path):
    path = tmp_path / "hit.tdms"
    for _ in range(2):
        with TdmsWriter(str(path), mode="a" if path.exists() else "w") as writer:
            stated = {"wf_increment": 1.0 / RATE, "unit_string": "N"}
            writer.write_segment([ChannelObject("g", "hammer", FORCE, stated)])
    path.write_bytes(path.read_bytes()[: -8 * 4000])
    files = MeasuredFiles([path], make_series(MeasurementOptions()))
    assert files.hits[0].block.hammer.output.size == COUNT + 96
    assert "the file is cut at its end: its channels end early" in files.warnings
