"""The virtual rig as a source: the hits of its seed, triggered or in a stream."""

import time
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.configuration.toml_table import TomlTable, parse_toml_table
from impact_rig.core.errors import DeviceError, ParameterError
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.setup.sensors import Sensor
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.acceleration_source import SimulatedSource, SourceChannel
from impact_rig.devices.virtual.choices import Fault
from impact_rig.devices.virtual.digitizer import DigitizerSettings
from impact_rig.devices.virtual.faults import FaultPlan, ScheduledFault
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.devices.virtual.source import VirtualSource, make_virtual_plan

LABEL = HitLabel("steel small")
SETTINGS = VirtualRigSettings(seed=5)
NO_OPTIONS = TomlTable({}, "[source]")


def make_source(settings=SETTINGS):
    source = VirtualSource(NO_OPTIONS, settings)
    source.take_setup(PAPER_SETUP)
    return source


def make_plan(*, continuous=False, block_size=700):
    return make_virtual_plan(
        DigitizerSettings(), continuous=continuous, block_size=block_size, depth=1000
    )


def read_until(source, condition):
    blocks = []
    deadline = time.monotonic() + 20.0
    while not (blocks and condition(blocks)):
        assert time.monotonic() < deadline, "it never came"
        block = source.read(0.1)
        if block is not None:
            blocks.append(block)
    return blocks


def test_it_is_told_when_the_hammer_strikes():
    assert isinstance(make_source(), SimulatedSource)


def test_a_record_is_that_of_the_seed():
    source = make_source()
    source.configure(make_plan())
    source.arm()
    truth = source.strike(LABEL, 0.0)
    blocks = read_until(source, lambda got: got[-1].last)
    expected = VirtualRig(PAPER_SETUP, SETTINGS).strike(LABEL)
    assert truth.model == expected.model
    for channel in ("hammer", "specimen"):
        counts = np.concatenate([getattr(block, channel).output for block in blocks])
        np.testing.assert_array_equal(counts, getattr(expected, channel).output)
        assert getattr(blocks[0], channel).scale == getattr(expected, channel).scale


def test_a_record_comes_when_the_swing_is_over():
    source = make_source()
    source.configure(make_plan())
    source.arm()
    begin = time.monotonic()
    source.strike(LABEL, 0.1)
    assert source.read(0.0) is None
    read_until(source, lambda got: got[-1].last)
    assert time.monotonic() - begin >= 0.1


def test_the_same_hit_lies_in_a_stream():
    source = make_source()
    source.configure(make_plan(continuous=True, block_size=25_000))
    source.arm()
    source.strike(LABEL, 0.02)
    # And one block more, since the hit may go on in it.
    blocks = read_until(source, lambda got: any(np.ptp(b.hammer.output) > 200 for b in got[:-1]))
    counts = np.concatenate([block.hammer.output for block in blocks])
    expected = VirtualRig(PAPER_SETUP, SETTINGS).strike(LABEL).hammer.output
    peak, wanted = int(np.argmax(np.abs(counts))), int(np.argmax(np.abs(expected)))
    np.testing.assert_array_equal(counts[peak - wanted : peak + 500], expected[: wanted + 500])


def test_a_missed_trigger_gives_nothing():
    faults = FaultPlan(scheduled=(ScheduledFault(Fault.MISSED_TRIGGER, impact=1),))
    source = make_source(replace(SETTINGS, faults=faults))
    source.configure(make_plan())
    source.arm()
    assert source.strike(LABEL, 0.0).faults == (Fault.MISSED_TRIGGER,)
    assert source.read(0.05) is None


def test_what_a_plan_says_of_the_digitizer_goes_before_its_own_settings():
    plan = replace(
        make_plan(),
        sampling_rate=1e6,
        record_duration=1e-3,
        hammer=SourceChannel("1", Sensor("hammer", unit="g", full_scale=100.0)),
        specimen=None,
    )
    source = make_source()
    assert source.configure(plan).sampling_rate == 1e6
    source.arm()
    source.strike(LABEL, 0.0)
    blocks = read_until(source, lambda got: got[-1].last)
    assert sum(block.hammer.output.size for block in blocks) == 1000
    assert blocks[0].hammer.full_scale == pytest.approx(980.665)
    assert all(block.specimen.output.size == 0 for block in blocks)


def test_keys_that_it_does_not_know_are_refused_with_their_line():
    table = parse_toml_table('[source]\ndriver = "virtual"\nsampling_rate = "1 MHz"\n')
    with pytest.raises(ParameterError, match=r"line 3: .*'sampling_rate'.* said in \[virtual\]"):
        VirtualSource(table.take_table("source").without("driver"))


def test_a_hit_needs_a_set_up():
    source = VirtualSource(NO_OPTIONS)
    source.configure(make_plan())
    with pytest.raises(DeviceError, match="start the campaign node first"):
        source.check_sample("steel small")
