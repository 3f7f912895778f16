"""The input monitor: what a running source shows, and what that suggests."""

import math

import numpy as np
import pytest

from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.records import Block, ChannelBlock
from impact_rig.status.levels import (
    InputLevel,
    InputLevels,
    LevelMeter,
    suggest_range,
    suggest_trigger_level,
)

SCALE, OFFSET, NOISE = 0.5, 3.0, 2.0  # [m/s^2]


def make_block(peak=0.0, seed=0, overloaded=False):
    """Return 1 ms of noise about an offset in which a pulse of 0.1 ms may stand."""
    counts = np.random.default_rng(seed).normal(0.0, NOISE / SCALE, (2, 2500))
    counts[:, 1000:1250] += peak / SCALE
    hammer, specimen = (
        ChannelBlock(row, SCALE, OFFSET, 2000.0, overloaded)
        for row in np.rint(counts).astype(np.int32)
    )
    return Block(0, 2.5e6, hammer, specimen)


def test_zero_and_noise_are_those_of_quiet_and_the_peak_that_of_a_hit():
    meter = LevelMeter()
    for seed in range(20):
        meter.add(make_block(600.0 if seed == 7 else 0.0, seed))
    hammer, specimen = meter.read().channels
    assert hammer.zero == pytest.approx(OFFSET, abs=SCALE)
    assert hammer.noise == pytest.approx(NOISE, rel=0.05)
    assert hammer.peak == pytest.approx(600.0, abs=5.0 * NOISE)
    assert hammer.has_hit
    assert (hammer.full_scale, hammer.overloaded) == (2000.0, False)
    assert specimen != hammer
    # They are read once.
    assert meter.read() == InputLevels()


def test_noise_is_no_hit_and_one_block_at_the_rail_is_told():
    meter = LevelMeter()
    for seed in range(4):
        meter.add(make_block(seed=seed, overloaded=seed == 2))
    level = meter.read().channels[0]
    assert not level.has_hit
    assert level.overloaded


def test_a_channel_that_is_not_measured_has_no_level():
    block = make_block()
    meter = LevelMeter()
    meter.add(Block(0, 2.5e6, block.hammer, ChannelBlock(np.empty(0, np.int32), 1.0, 0.0, 0.0)))
    meter.add(block.cut(0, 0))
    assert len(meter.read().channels) == 1


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_point_that_is_not_finite_ends_no_stream(value):
    output = np.full(100, 2.0)
    output[50] = value
    meter, channel = LevelMeter(), ChannelBlock(output, 1.0, 0.0, 0.0)
    meter.add(Block(0, 1000.0, channel, channel))
    assert meter.read() == InputLevels()


@pytest.mark.parametrize(
    ("peak", "full_scale"), [(612.0, 1300.0), (95.0, 190.0), (0.031, 0.062), (4999.0, 10_000.0)]
)
def test_a_range_is_twice_the_peak_in_two_digits(peak, full_scale):
    assert suggest_range(peak) == pytest.approx(full_scale)


def test_a_trigger_level_is_above_noise_and_below_every_hit():
    assert suggest_trigger_level(600.0, 2.0) == 60.0
    assert suggest_trigger_level(600.0, 20.0) == 200.0
    assert math.isnan(suggest_trigger_level(600.0, 40.0))
    assert not InputLevel(noise=1.0, peak=5.5).has_hit


@pytest.mark.parametrize("name", ["noise", "peak", "full_scale"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0])
def test_a_level_that_cannot_be_shown_is_refused(name, value):
    with pytest.raises(ParameterError, match=f"{name} is .*: it must be a finite number"):
        InputLevel(**{name: value})
