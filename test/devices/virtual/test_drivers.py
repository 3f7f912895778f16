"""The virtual rig as a source: the hits of its seed, triggered or in a stream."""

import time
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.configuration.toml_table import TomlTable, parse_toml_table
from impact_rig.core.given.errors import DeviceError, ParameterError
from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.devices.virtual.choices import Fault, Plant
from impact_rig.devices.virtual.drivers import VirtualSource, make_virtual_plan, read_virtual_rig
from impact_rig.devices.virtual.rig import (
    DigitizerSettings,
    FaultPlan,
    ScheduledFault,
    VirtualRig,
    VirtualRigSettings,
)

LABEL = HitLabel("steel small")
SETTINGS = VirtualRigSettings(seed=5)
NO_OPTIONS = TomlTable({}, "[source]")


def make_source(**options):
    source = VirtualSource(TomlTable({"seed": 5, **options}, "[source]"))
    source.take_setup(PAPER_SETUP)
    return source


def make_plan(*, continuous=False, block_size=700):
    plan = make_virtual_plan(NO_OPTIONS)
    return replace(plan, continuous=continuous, block_size=block_size, depth=1000)


def read_until(source, condition):
    blocks = []
    deadline = time.monotonic() + 20.0
    while not (blocks and condition(blocks)):
        assert time.monotonic() < deadline, "it never came"
        block = source.read(0.1)
        if block is not None:
            blocks.append(block)
    return blocks


def test_a_record_is_that_of_the_seed_and_comes_when_the_swing_is_over():
    source = make_source()
    source.configure(make_plan())
    source.arm()
    begin = time.monotonic()
    truth = source.strike(LABEL, 0.1)
    assert source.read(0.0) is None
    blocks = read_until(source, lambda got: got[-1].last)
    assert time.monotonic() - begin >= 0.1
    expected = VirtualRig(PAPER_SETUP, SETTINGS).strike(LABEL)
    assert truth.model == expected.model
    for channel in ("hammer", "specimen"):
        counts = np.concatenate([getattr(block, channel).output for block in blocks])
        np.testing.assert_array_equal(counts, getattr(expected, channel).output)
        assert getattr(blocks[0], channel).scale == getattr(expected, channel).scale


FULL = """
[source]
driver = "virtual"
plant = "published"
seed = 3
contact_time_scatter = 0.01
amplitude_scatter = 0.05
contact_exponent = 2.0
draw = true
restitution = 0.5
fault_probability = 0.25
faults = "overload, weak_hit"
scheduled_faults = "3:double_hit, steel small/1:overload"
sampling_rate = "1 MHz"
record_duration = "0.004 s"
pre_trigger = "0.0005 s"
hammer_full_scale = "1000 m/s^2"
specimen_full_scale = "2000 m/s^2"
noise = 0.002
bits = 16
"""


def test_all_that_a_rig_file_says_of_it_is_taken():
    table = parse_toml_table(FULL).take_table("source")
    assert read_virtual_rig(table) == VirtualRigSettings(
        plant=Plant.PUBLISHED,
        seed=3,
        contact_time_scatter=0.01,
        amplitude_scatter=0.05,
        contact_exponent=2.0,
        draws=True,
        restitution=0.5,
        digitizer=DigitizerSettings(1e6, 4e-3, 5e-4, 16, 1000.0, 2000.0, 0.002),
        faults=FaultPlan(
            0.25,
            (Fault.OVERLOAD, Fault.WEAK_HIT),
            (
                ScheduledFault(Fault.DOUBLE_HIT, 3),
                ScheduledFault(Fault.OVERLOAD, 1, "steel small"),
            ),
        ),
    )
    plan = make_virtual_plan(table)
    assert (plan.sampling_rate, plan.points) == (1e6, 4000)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('plant = "jelly"', r"plant of \[source\] is 'jelly': it must be one of published, "),
        ('scheduled_faults = "3"', "scheduled fault '3': write IMPACT:FAULT"),
        ('scheduled_faults = "0:overload"', "impact number of a fault is 0: it must lie between"),
        ('scheduled_faults = "3:quake"', "unknown fault 'quake': the virtual rig knows"),
    ],
)
def test_what_cannot_be_meant_is_refused_with_its_line(line, words):
    table = parse_toml_table(f'[source]\ndriver = "virtual"\n{line}\n').take_table("source")
    with pytest.raises(ParameterError, match=r"^line [23]: .*" + words):
        VirtualSource(table.without("driver"))


def test_a_hit_needs_a_set_up():
    source = VirtualSource(NO_OPTIONS)
    source.configure(make_plan())
    with pytest.raises(DeviceError, match="start the campaign node first"):
        source.check_sample("steel small")


def test_the_example_names_every_plant_and_fault():
    for name in (*Plant, *Fault):
        assert name.value in VirtualSource.example
