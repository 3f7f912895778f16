"""Measured files become a recording that other people's readers take for one of ROS 2."""

import hashlib
import json
import math
import re
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile

from impact_rig.core.given.errors import ParameterError, SignalError
from impact_rig.core.given.records import Block, HitLabel
from impact_rig.core.given.sensors import Sensitivity
from impact_rig.core.given.setup import AnalysisSettings, RigSetup, Sample, SampleSet
from impact_rig.core.hit.detection import ImpactDetector
from impact_rig.files.channels import map_channels
from impact_rig.files.importing import check_series, choose_window, read_hits, write_imported
from impact_rig.files.measurement import MeasuredChannel, Measurement
from impact_rig.files.plan import ChannelPlan, ChannelUse
from impact_rig.recordings.records import MetadataRecord, RawMessage
from impact_rig.recordings.run import Run
from impact_rig.recordings.scan import Scan

COUNT = 40
NAN = math.nan
TIME = 0.25 + np.arange(COUNT) * 4e-7
GAPPED = np.delete(0.25 + np.arange(COUNT + 1) * 4e-7, 20)
HAMMER = np.sin(np.arange(COUNT))
SPECIMEN = np.cos(np.arange(COUNT))
LONG = np.arange(5000) * 4e-7
COUNTS = np.arange(COUNT, dtype=np.int32)


def columns(*values, **fields):
    """Return a measurement whose file states nothing but numbers."""
    return Measurement(
        Path("hit.x"),
        tuple(
            MeasuredChannel(f"column {number}", np.array(column), **fields)
            for number, column in enumerate(values, 1)
        ),
    )


def channel(name, values=HAMMER, rate=25_600.0, unit="m/s^2", start=0.0):
    return MeasuredChannel(name, values, rate, unit, start)


def stated(*channels):
    return Measurement(Path("hit.x"), channels)


def plan(**fields):
    return ChannelPlan(**fields)


def map_one(*args, **options):
    (found,) = map_channels(*args, **options)
    return found


def read_one(*args):
    (hit,) = read_hits(*args)
    return hit


@pytest.mark.parametrize(
    ("file", "given", "names"),
    [
        (columns(TIME, HAMMER, SPECIMEN), {}, ("column 2", "column 3")),
        (columns(HAMMER, SPECIMEN), {"sampling_rate": 1e6}, ("column 1", "column 2")),
        (
            columns(SPECIMEN, HAMMER * np.nan, TIME, TIME, HAMMER),
            {"columns": ("specimen", "skip", "time", "skip", "hammer")},
            ("column 5", "column 1"),
        ),
        (
            columns(TIME, SPECIMEN, HAMMER, HAMMER),
            {"hammer": ChannelUse("column 3"), "specimen": ChannelUse("2")},
            ("column 3", "column 2"),
        ),
        (stated(channel("a"), channel("b")), {"hammer": ChannelUse("b")}, ("b",)),
    ],
)
def test_hammer_and_sample_are_found_by_place_role_name_or_number(file, given, names):
    found = map_one(file, plan(**given))
    assert found.names == names
    values = {channel.name: channel.values for channel in file.channels}
    for block, name in zip((found.block.hammer, found.block.specimen), names, strict=False):
        assert np.array_equal(block.output, values[name])
    assert found.block.specimen.output.size == (HAMMER.size if len(names) > 1 else 0)


def test_where_files_state_rates_the_first_two_channels_are_hammer_and_sample():
    slow = channel("temperature", np.zeros(5), 1.0, "degC")
    file = stated(channel("force", unit="N"), channel("response", SPECIMEN, unit="g"), slow)
    found = map_one(file, plan(), hammer_mass=0.5)
    assert found.names == ("force", "response")
    assert (found.block.hammer.scale, found.block.specimen.scale) == (2.0, 9.80665)
    told = "left out for their units: 'temperature' [degC]"
    assert (found.remarks, found.unit) == ((told,), "N")


def test_volts_without_a_sensitivity_stay_volts_and_forces_without_a_mass_forces():
    volts = map_one(stated(channel("a", unit="mV")), plan(), needs_scale=False)
    assert (volts.has_scale, volts.unit) == (False, "V")
    assert volts.block.hammer.scale == pytest.approx(1e-3)
    force = map_one(stated(channel("a", unit="lbf")), plan(), needs_scale=False)
    assert (force.has_scale, force.unit) == (False, "N")
    with pytest.raises(SignalError, match=r'mV needs a sensitivity.*sensitivity = "\?" under'):
        map_one(stated(channel("a", unit="mV")), plan(), needs_scale=True)


def test_what_is_no_acceleration_is_read_as_it_is():
    file = stated(channel("a", unit="Pa"), channel("b", unit="um/m"))
    found = map_one(file, plan())
    assert (found.has_scale, found.unit, found.block.hammer.scale) == (False, "Pa", 1.0)
    assert found.block.hammer.output.tolist() == HAMMER.tolist()
    assert (found.names, found.block.specimen.output.size) == (("a",), 0)
    assert found.remarks == (
        "the hammer's channel is read as it is: Pa",
        "the sample's channel is in um/m, no acceleration: it is left out",
    )
    with pytest.raises(SignalError, match="'a' is in Pa, no unit of acceleration"):
        map_one(file, plan(), needs_scale=True)


def test_one_question_asks_for_all_that_is_missing():
    file = columns(HAMMER, SPECIMEN, HAMMER, SPECIMEN)
    with pytest.raises(SignalError) as caught:
        map_channels(file, plan(), needs_scale=True)
    for told in (
        "hit.x: neither names nor units say which of its 4 channels is the hammer's",
        'columns = ["hammer", "specimen", "skip", "skip"]',
        'channel = "?" under [hammer]',
        'sampling_rate = "?"',
        'unit = "?" under [hammer]',
        "impact-rig import --template FILE",
    ):
        assert told in str(caught.value)
    answered = plan(
        columns=("hammer", "specimen", "skip", "skip"),
        sampling_rate=1e6,
        hammer=ChannelUse(unit="g"),
    )
    assert map_one(file, answered, needs_scale=True).block.sampling_rate == 1e6


@pytest.mark.parametrize(
    ("values", "told"),
    [
        (1e150 * HAMMER, r"hammer is -?1e\+150 at point \d+: no instrument shows more than 1e.12"),
        (HAMMER + np.where(np.arange(COUNT) == 7, 1e30, 0.0), "hammer is 1e.30 at point 7"),
        (1e-150 * HAMMER, "no instrument has such a dynamic range"),
    ],
)
def test_what_no_instrument_shows_is_refused_by_name(values, told):
    with pytest.raises(SignalError, match=told):
        map_one(stated(channel("a", values)), plan())


@pytest.mark.parametrize(
    ("times", "fields"),
    [(LONG, {"unit": "s"}), (1e3 * LONG, {"unit": "ms"}), (np.round(LONG, 6), {"unit": "s"})],
    ids=["seconds", "milliseconds", "rounded"],
)
def test_a_given_rate_that_contradicts_the_times_is_refused_with_both(times, fields):
    wave = np.sin(np.arange(LONG.size))
    file = stated(MeasuredChannel("t", times, **fields), MeasuredChannel("a", wave))
    with pytest.raises(ParameterError, match=r"at 2\.\d*e\+06 Hz, as it states, not at 1e\+06 Hz"):
        map_one(file, plan(sampling_rate=1e6))
    near = plan(sampling_rate=2.51e6)
    assert map_one(file, near).block.sampling_rate == near.sampling_rate


def test_a_given_rate_is_held_against_times_in_any_unit_where_none_is_stated():
    file = columns(1e3 * TIME, HAMMER)
    assert map_one(file, plan(sampling_rate=2.5e6)).block.sampling_rate == 2.5e6
    with pytest.raises(ParameterError, match=r"not at 1e\+06 Hz"):
        map_one(file, plan(sampling_rate=1e6))
    counted = columns(np.arange(float(COUNT)), HAMMER)
    assert map_one(counted, plan(sampling_rate=1e6)).block.sampling_rate == 1e6


def test_a_channel_in_kg_is_a_thousand_g_and_says_so():
    found = map_one(stated(channel("a", unit="kg")), plan())
    assert found.block.hammer.scale == pytest.approx(9806.65)
    assert found.remarks == (
        "the hammer's channel is taken for thousands of g; a force in kilograms is kgf",
    )


def test_counts_stay_counts_beside_their_calibration():
    use = ChannelUse(sensitivity=Sensitivity(0.01, "g"), full_scale=5.0, full_scale_unit="V")
    found = map_one(stated(channel("a", COUNTS[::-1], unit="mV")), plan(hammer=use))
    assert found.block.hammer.output.dtype == np.int32
    # 10 mV/g: one millivolt is 0.1 g; 5 V are 500 g.
    assert found.block.hammer.scale == pytest.approx(0.980665, rel=1e-12)
    assert found.block.hammer.full_scale == pytest.approx(500 * 9.80665, rel=1e-12)


def test_a_force_hammers_voltage_becomes_acceleration_by_its_mass():
    use = ChannelUse(sensitivity=Sensitivity(-0.002, "N"))
    found = map_one(stated(channel("a", unit="V")), plan(hammer=use), hammer_mass=0.5)
    assert found.block.hammer.scale == pytest.approx(-1000.0, rel=1e-12)


def with_times(name, times=TIME, **fields):
    """Return a column of times and a trace."""
    return stated(MeasuredChannel(name, times, **fields), MeasuredChannel("a", HAMMER))


@pytest.mark.parametrize(
    ("file", "given", "told"),
    [
        (columns(TIME[:5], HAMMER[:5]), {}, "5 points in 'column 2': a trace needs at least 16"),
        (columns(HAMMER), {}, "has no time and states no rate: give its sampling rate"),
        (
            columns(TIME, HAMMER),
            {"columns": ("time", "hammer", "specimen")},
            "2 columns, but 3 roles are given",
        ),
        (columns(TIME, np.where(COUNTS == 7, np.nan, HAMMER)), {}, "hammer is nan at point 7"),
        (columns(GAPPED, HAMMER), {}, "missing.*8e-07 s at point 19"),
        (columns(TIME), {}, "no values beside its times 'column 1'"),
        (with_times("time", HAMMER), {}, "does not grow.*is this the time column"),
        (stated(MeasuredChannel("t", TIME, unit="V"), channel("a", rate=NAN)), {}, "are in 'V'"),
        (stated(channel("a"), channel("b", HAMMER[:20])), {}, "'a' and 'b' have 40 and 20 points"),
        (stated(channel("a"), channel("b", rate=1e3)), {}, "sampled at 25600 Hz and 1000 Hz"),
        (stated(channel("a"), channel("b", start=0.1)), {}, "start 0.1 s apart"),
        (stated(channel("a")), {"hammer": ChannelUse("c")}, "no channel 'c': it has 1 'a'"),
        (stated(channel("a"), channel("a")), {"hammer": ChannelUse("a")}, "2 channels 'a'"),
        (with_times("Frequency", unit="Hz"), {}, "it is a spectrum"),
        (with_times("samples", 1e6 * TIME), {}, "'samples' counts samples: give their rate"),
    ],
)  # fmt: skip
def test_what_is_no_trace_is_named(file, given, told):
    with pytest.raises(SignalError, match=rf"hit\.x.*{told}"):
        map_one(file, ChannelPlan(**given))


@pytest.mark.parametrize(
    ("file", "given", "told"),
    [
        (stated(channel("a")), {"hammer": ChannelUse(unit="g")}, "in m/s.2, as the file states"),
        (stated(channel("a")), {"sampling_rate": 1e3}, "sampled at 25600 Hz, as it states"),
        (
            stated(channel("a"), channel("b", unit="N")),
            {"hammer": ChannelUse("a"), "specimen": ChannelUse("b")},
            "'b' is a force",
        ),
        (
            stated(channel("a")),
            {"hammer": ChannelUse("a"), "specimen": ChannelUse("1")},
            "are the same channel",
        ),
        (
            stated(channel("a")),
            {"hammer": ChannelUse(sensitivity=Sensitivity(0.1, "g"))},
            "as the file states, not in V",
        ),
    ],
)
def test_what_the_user_contradicts_or_leaves_open_is_named(file, given, told):
    with pytest.raises(ParameterError, match=rf"hit\.x.*{told}"):
        map_one(file, ChannelPlan(**given), math.nan)


REAL_HITS = sorted((Path(__file__).parents[1] / "data" / "pyfrf_hammer").glob("*.npy"))
SETTINGS = AnalysisSettings(cutoff_frequency=0.0)
PLAN = ChannelPlan(hammer=ChannelUse(unit="N"), specimen=ChannelUse(unit="g"))


def read_all(paths):
    return [
        read_one(path, HitLabel("beam", number, number), PLAN, 0.5)
        for number, path in enumerate(paths, 1)
    ]


def make_setup(hits):
    return RigSetup(
        SampleSet((Sample("beam", math.nan),), ""), 0.5, 0.1, choose_window(SETTINGS, hits)
    )


@pytest.fixture
def imported(tmp_path):
    """Return a recording of the real hits."""
    hits = read_all(REAL_HITS)
    write_imported(tmp_path / "hits.mcap", make_setup(hits), hits)
    return tmp_path / "hits.mcap"


def test_every_number_of_the_files_comes_back_with_its_calibration(imported):
    events = list(Run(imported).events())
    blocks = [event for event in events if isinstance(event, Block)]
    assert isinstance(events[0], RigSetup)
    for number, path in enumerate(REAL_HITS, 1):
        _, force, acceleration = np.load(path)
        parts = [block for block in blocks if block.label == HitLabel("beam", number, number)]
        assert np.concatenate([part.hammer.output for part in parts]).tobytes() == force.tobytes()
        specimen = np.concatenate([part.specimen.output for part in parts])
        assert specimen.tobytes() == acceleration.tobytes()
        assert (parts[0].hammer.scale, parts[0].specimen.scale) == (2.0, 9.80665)
        assert [part.last for part in parts] == [False] * (len(parts) - 1) + [True]


def test_long_files_are_split_into_blocks_that_join_without_a_gap(tmp_path):
    counts = np.random.default_rng(1).integers(-500, 500, 25_000, np.int32)
    np.save(tmp_path / "long.npy", counts)
    plan = ChannelPlan(hammer=ChannelUse(unit="g"), sampling_rate=1e6)
    hit = read_one(tmp_path / "long.npy", HitLabel("beam"), plan)
    write_imported(tmp_path / "long.mcap", make_setup([hit]), [hit])
    _, *blocks = Run(tmp_path / "long.mcap").events()
    assert [block.first_sample for block in blocks] == [0, 10_000, 20_000]
    assert {block.hammer.output.dtype for block in blocks} == {np.dtype(np.int32)}
    assert np.array_equal(np.concatenate([block.hammer.output for block in blocks]), counts)
    assert [block.stamp - blocks[0].stamp for block in blocks] == [0, 10_000_000, 20_000_000]


def test_the_recording_tells_which_files_it_was_made_of(imported):
    found = Scan(imported).read()
    records = {item.name: item.fields for item in found if isinstance(item, MetadataRecord)}
    assert records["impact_rig"]["software_version"]
    for number, path in enumerate(REAL_HITS, 1):
        assert json.loads(records["impact_rig/import"][str(number)]) == {
            "file": path.name,
            "sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
            "channels": ["column 2", "column 3"],
        }


def test_the_same_files_make_the_same_recording(imported, tmp_path):
    hits = read_all(REAL_HITS)
    write_imported(tmp_path / "again.mcap", make_setup(hits), hits)
    assert (tmp_path / "again.mcap").read_bytes() == imported.read_bytes()


@pytest.mark.parametrize("place", [3, 500, 990])
def test_the_whole_file_is_the_record_wherever_its_pulse_lies(tmp_path, place):
    pulse = np.zeros(1000)
    pulse[place : place + 5] = (20.0, 60.0, 100.0, 60.0, 20.0)
    np.save(tmp_path / "hit.npy", pulse + 0.01 * np.random.default_rng(1).normal(size=1000))
    plan = ChannelPlan(sampling_rate=1e6)
    hit = read_one(tmp_path / "hit.npy", HitLabel("beam"), plan)
    early = read_one(REAL_HITS[0], HitLabel("beam", 2), ChannelPlan())
    settings = choose_window(SETTINGS, [hit, early])
    (record,) = ImpactDetector(settings).feed(hit.block)
    assert record.hammer.acceleration.size == 1000
    assert record.pulse_index == pytest.approx(place, abs=1)


FIRST = 1_683_293_990_000_000_000
"""The fifth of May 2023, 13:39:50 UTC."""
SECOND = 1_000_000_000
LENGTH = SECOND // 100
"""Of a hit in the files below [ns]."""


@pytest.mark.parametrize(
    ("stated", "expected"),
    [
        ([0, 0], [SECOND, 2 * SECOND + LENGTH]),
        ([FIRST, FIRST + 3600 * SECOND], [FIRST, FIRST + 3600 * SECOND]),
        ([FIRST, FIRST], [FIRST, FIRST + LENGTH + SECOND]),
        ([FIRST, 0, FIRST + 5 * SECOND], [FIRST, FIRST + LENGTH + SECOND, FIRST + 5 * SECOND]),
        ([0, FIRST], [FIRST, FIRST + LENGTH + SECOND]),
    ],
)
def test_a_hit_was_when_its_file_says_unless_times_would_not_grow(tmp_path, stated, expected):
    np.save(tmp_path / "hit.npy", np.random.default_rng(1).normal(size=10_000))
    hit = read_one(tmp_path / "hit.npy", HitLabel("beam"), ChannelPlan(sampling_rate=1e6))
    hits = [
        replace(hit, block=replace(hit.block, label=HitLabel("beam", n, n), stamp=stamp))
        for n, stamp in enumerate(stated, 1)
    ]
    write_imported(tmp_path / "hits.mcap", make_setup(hits), hits)
    _, *blocks = Run(tmp_path / "hits.mcap").events()
    assert [block.stamp for block in blocks] == expected
    items = list(Scan(tmp_path / "hits.mcap").read())
    log_times = [item.log_time for item in items if isinstance(item, RawMessage)]
    assert log_times == [expected[0], *(stamp + LENGTH for stamp in expected)]
    origins = next(item.fields for item in items if getattr(item, "name", "").endswith("import"))
    told = [json.loads(origins[str(number)]).get("recorded_at", 0) for number in (1, 2)]
    assert told == stated[:2]


def test_hits_that_cannot_be_averaged_are_named():
    (first,) = read_all(REAL_HITS[:1])
    fast = replace(first, block=replace(first.block, sampling_rate=2e6))
    no_specimen = replace(first.block.specimen, output=np.empty(0))
    alone = replace(first, block=replace(first.block, specimen=no_specimen))
    check_series([], first)
    check_series([first], first)
    with pytest.raises(SignalError, match="hammer and specimen at 2000 kHz: all hits"):
        check_series([first], fast)
    with pytest.raises(SignalError, match=r"\.npy has hammer at"):
        check_series([first], alone)


def test_several_hammers_are_several_hits_each_with_its_sample():
    file = columns(TIME, HAMMER, SPECIMEN, 2 * HAMMER, 3 * SPECIMEN)
    roles = ("time", "hammer", "specimen", "hammer", "specimen")
    first, second = map_channels(file, plan(columns=roles))
    assert np.array_equal(second.block.hammer.output, 2 * HAMMER)
    assert np.array_equal(second.block.specimen.output, 3 * SPECIMEN)
    assert first.block.sampling_rate == second.block.sampling_rate


def test_channels_are_named_by_a_pattern_too():
    names = ("run(1).front", "run(1).back", "run(2).front", "run(2).back")
    file = stated(*(channel(name, HAMMER + number) for number, name in enumerate(names)))
    named = plan(hammer=ChannelUse("run(*).front"), specimen=ChannelUse("run(*).back"))
    found = map_channels(file, named)
    assert [hit.names for hit in found] == [names[:2], names[2:]]
    odd = plan(hammer=ChannelUse("run(*).front"), specimen=ChannelUse("run(2).back"))
    with pytest.raises(ParameterError, match=r"'run\(\*\)\.front' are 2 channels"):
        map_channels(file, odd)


@pytest.fixture
def many_hits(tmp_path):
    """Return a sound file with seven hits, where they begin, and its counts."""
    rate, generator = 48_000, np.random.default_rng(3)
    places = 4800 + 14_400 * np.arange(7) + generator.integers(0, 500, 7)
    signal = generator.normal(0.0, 1.0, 110_000)
    for place, height in zip(places, generator.uniform(8000, 12_000, 7), strict=True):
        signal[place : place + 48] += height * np.sin(np.pi * np.arange(48) / 48) ** 2
    wavfile.write(tmp_path / "many.wav", rate, signal.astype(np.int16))
    return tmp_path / "many.wav", places, signal.astype(np.int16)


def test_a_long_record_is_cut_into_its_hits_bit_by_bit(many_hits):
    path, places, signal = many_hits
    window = AnalysisSettings(pre_trigger=2e-3, record_duration=20e-3)
    hits = read_hits(path, HitLabel("beam", 5, 5), plan(), window=window)
    assert [hit.block.label.record for hit in hits] == list(range(5, 12))
    for hit, place in zip(hits, places, strict=True):
        first, last = map(int, re.findall(r"points (\d+) to (\d+)", hit.block.origin.place)[0])
        assert 96 <= place - first <= 2 * 96 + 16
        assert hit.block.hammer.output.tolist() == signal[first : last + 1].tolist()
        assert hit.block.hammer.full_scale == 0.0


def test_cue_points_of_a_sound_file_say_where_hits_are(many_hits):
    path, places, signal = many_hits
    cues = [place + 200 for place in places[1:4]]
    entries = b"".join(struct.pack("<II4sIII", n, c, b"data", 0, 0, c) for n, c in enumerate(cues))
    with path.open("ab") as file:
        file.write(struct.pack("<4sII", b"cue ", 4 + len(entries), len(cues)) + entries)
    hits = read_hits(path, HitLabel("beam"), plan())
    assert len(hits) == 3
    for hit, place in zip(hits, places[1:4], strict=True):
        first, last = map(int, re.findall(r"points (\d+) to (\d+)", hit.block.origin.place)[0])
        assert first < place < last < first + 4800
        assert hit.block.hammer.output.tolist() == signal[first : last + 1].tolist()
    window = AnalysisSettings(pre_trigger=2e-3, record_duration=20e-3)
    cut = read_hits(path, HitLabel("beam"), plan(), window=window)
    assert len(cut) == 3
    assert all(960 <= hit.block.hammer.output.size <= 960 + 96 for hit in cut)
