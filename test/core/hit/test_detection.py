"""Impacts in a stream of blocks: found once, cut out whole, gaps named and never bridged.

Gaps in a stream of blocks: found, named, never bridged; and no hit vanishes in one.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impact_rig.core.given.records import Block, ChannelBlock, HitLabel, Record
from impact_rig.core.given.setup import AnalysisSettings
from impact_rig.core.hit.detection import ImpactDetector, find_pulse_start, find_quietest

from ..blocks import detect, make_blocks, make_counts

# At the 1 MHz of these streams: 200 points of pre-trigger, 2000 of record.
SETTINGS = AnalysisSettings()
BEFORE, LENGTH = 200, 2000
NOTHING = ChannelBlock(np.empty(0), 1.0, 0.0, 0.0)


def describe(record: Record) -> tuple[object, ...]:
    """Return everything a record holds, to the last bit."""
    traces = (record.hammer.acceleration.tobytes(), record.specimen.acceleration.tobytes())
    return record.label, record.stamp, record.pulse_index, record.triggered, record.flaws, *traces


def test_one_impact_is_cut_out_with_its_pre_trigger():
    hammer = make_counts([(1000, 900.0)], 5000, noise=0.0, offset=0.0)
    specimen = make_counts([(1010, 400.0)], 5000, noise=0.0, offset=0.0)
    (record,) = detect(make_blocks(hammer, specimen, [500]))
    # 3 % of full scale is 61.44 counts: reached where 900 sin^2 is.
    pulse = 1000 + int(np.ceil(np.arcsin(np.sqrt(61.44 / 900)) * 200 / np.pi))
    assert record.pulse_index == BEFORE
    window = slice(pulse - BEFORE, pulse - BEFORE + LENGTH)
    scale = 2000.0 / 2048
    np.testing.assert_array_equal(record.hammer.acceleration, scale * hammer[window])
    np.testing.assert_array_equal(record.specimen.acceleration, -scale * specimen[window])
    assert (record.hammer.full_scale, record.hammer.resolution) == (2000.0, scale)
    assert record.stamp == 1_000 + (pulse - BEFORE) * 1_000
    assert record.flaws == ()


@pytest.mark.parametrize("seed", range(5))
def test_noise_that_often_reaches_the_level_starts_no_hit(seed):
    # A standard deviation of half the level of 61 counts: 2000 points hold some ninety above it.
    hammer = make_counts([(2000, 900.0)], 6000, noise=30.0, seed=seed)
    specimen = make_counts([(2000, 400.0)], 6000, noise=30.0, seed=seed + 100)
    (record,) = detect(make_blocks(hammer, specimen, [500]))
    first = 2000 - (record.stamp - 1_000) // 1_000
    # 900 sin^2 stands above six times the noise from point 30 on; noise comes atop, either way.
    assert BEFORE - 60 < first < BEFORE


@pytest.mark.parametrize("full_scale", [2000.0, 0.0])
def test_an_arming_without_a_pulse_gives_one_record_without_one(full_scale):
    hammer = make_counts([], 5000)
    (record,) = detect(make_blocks(hammer, hammer, [900], full_scale=full_scale))
    assert record.pulse_index is None
    assert record.hammer.acceleration.size == 5000


def make_whole(values, full_scale=0.0) -> Block:
    hammer = ChannelBlock(values, 1.0, 0.0, full_scale)
    return Block(0, 1e6, hammer, NOTHING, HitLabel("s"), last=True)


class TestPulseStart:
    """Traces that were recorded as a whole, from a file."""

    @pytest.mark.parametrize(
        ("begin", "width", "ringing"),
        [(500, 2000, 0.0), (160, 2800, 0.0), (500, 200, 80.0), (0, 200, 0.0), (0, 2000, 0.0)],
        ids=["half", "most", "rings to the end", "from the first point", "half, from the first"],
    )
    def test_is_found_however_long_pulse_and_ringing_are(self, begin, width, ringing):
        """Each is 300 times the noise; what begins at once leaves no baseline before it."""
        since = np.arange(3000) - begin + (begin == 0) * width / 4
        values = 7.0 + np.random.default_rng(1).standard_normal(3000)
        values += np.where(since > 0, ringing * np.sin(0.05 * np.pi * since), 0.0)
        inside = (since > 0) & (since < width)
        values += np.where(inside, 300.0 * np.sin(np.pi * since / width) ** 2, 0.0)
        block = make_whole(values)
        start = find_pulse_start(block, SETTINGS)
        assert begin <= start <= begin + 0.12 * width
        found = replace(SETTINGS, pre_trigger=max(start, 1) / 1e6, record_duration=3e-3)
        (record,) = ImpactDetector(found).feed(block)
        assert record.pulse_index == start

    @pytest.mark.parametrize("full_scale", [2000.0, 0.0])
    @pytest.mark.parametrize("values", [[], [5.0] * 100, [0.0, np.nan, 900.0, 0.0]])
    def test_is_nowhere_in_nothing(self, values, full_scale):
        assert find_pulse_start(make_whole(np.array(values), full_scale), SETTINGS) is None


def remove(blocks: list[Block], first: int, last: int) -> list[Block]:
    """Take away the blocks between two points of the stream; the last block ends it still."""
    kept = [b for b in blocks if not first <= b.first_sample < last]
    return [*kept[:-1], replace(kept[-1], last=True)]


IMPACT = 6000


@given(start=st.integers(1, 1200), count=st.integers(1, 80))
@settings(max_examples=25)
def test_a_gap_in_the_window_is_named_and_one_outside_changes_no_bit(start, count):
    hammer = make_counts([(IMPACT, 900.0)], 12_000)
    blocks = make_blocks(hammer, hammer, [10])
    (intact,) = detect(blocks)
    low, high = 10 * start, min(10 * (start + count), 11_990)
    first = (intact.stamp - 1_000) // 1_000
    records = detect(remove(blocks, low, high)) if high > low else [intact]
    if high > low and low < first + LENGTH and high > first:
        assert records
        assert all(record.flaws for record in records)
        assert f"{high - low} points missing at point {low}" in records[0].flaws
    else:
        assert [describe(record) for record in records] == [describe(intact)]


def test_a_change_of_calibration_is_not_bridged():
    hammer = make_counts([(300, 900.0)], 5000)
    first, *blocks = make_blocks(hammer, hammer, [500])
    changed = [replace(b, hammer=replace(b.hammer, scale=0.5)) for b in blocks]
    (record,) = detect([first, *changed])
    assert record.flaws == ("sampling rate, channels or calibration changed at point 500",)
    assert record.hammer.output.size < LENGTH


def test_a_hit_whose_arming_breaks_off_does_not_vanish():
    hammer = make_counts([(1000, 900.0)], 5000)
    broken = make_blocks(hammer, hammer, [500], label=HitLabel("steel", record=1))[:4]
    whole = make_blocks(hammer, hammer, [500], label=HitLabel("steel", record=2))
    first, second = detect([*broken, *whole])
    assert (first.label.record, second.label.record) == (1, 2)
    assert first.flaws == ("the stream breaks off at point 2000",)
    assert second.flaws == ()


def test_counts_over_all_of_32_bits_are_not_taken_for_quiet():
    loud = np.array([-(2**31), 2**31 - 1] * 4, dtype=np.int32)
    quiet = np.array([0, 100] * 4, dtype=np.int32)
    np.testing.assert_array_equal(find_quietest(np.concatenate((loud, quiet)), 8), quiet)
