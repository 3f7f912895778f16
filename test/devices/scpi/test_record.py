"""What comes out of an instrument that speaks SCPI is what went in."""

import time
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.errors import DeviceError
from impact_rig.core.signals.pulse_search import to_acceleration

LEVEL = 49.0 * 5e-4 * 2**13
"""The trigger's, in counts."""


def read_record(source):
    blocks = []
    while not (blocks and blocks[-1].last):
        block = source.read(5.0)
        assert block is not None
        blocks.append(block)
    return blocks


def take_record(rig, source):
    source.arm()
    # As a swing does, and long enough for the whole ring to be written.
    time.sleep(0.01)
    hit = rig.strike()
    return hit, read_record(source)


def find_crossing(counts: np.ndarray, level: float) -> int:
    return int(np.argmax(counts >= level))


def test_each_count_of_a_record_is_that_of_the_input_with_the_trigger_in_its_place(
    rig, profile
) -> None:
    source, plan = profile()
    source.configure(plan)
    for _ in range(3):
        hit, blocks = take_record(rig, source)
        assert [block.hammer.output.size for block in blocks] == [1000] * 5
        fed = rig.find_counts(hit, "hammer")
        shift = 750 - find_crossing(fed, LEVEL)
        for name in ("hammer", "specimen"):
            counts = np.concatenate([getattr(block, name).output for block in blocks])
            assert counts.dtype == np.int32
            np.testing.assert_array_equal(
                counts[shift:], rig.find_counts(hit, name)[: 5000 - shift]
            )
    source.close()


def test_accelerations_are_those_of_the_hit_whatever_the_sign_of_the_sensitivity(
    rig, profile
) -> None:
    source, plan = profile()
    source.configure(plan)
    hit, blocks = take_record(rig, source)
    shift = 750 - find_crossing(rig.find_counts(hit, "hammer"), LEVEL)
    for name in ("hammer", "specimen"):
        channel = getattr(hit, name)
        found = np.concatenate(
            [
                to_acceleration(getattr(block, name), getattr(block, name).output)
                for block in blocks
            ]
        )
        np.testing.assert_allclose(
            found[shift:], to_acceleration(channel, channel.output)[: 5000 - shift], atol=1e-9
        )
    source.close()


def test_nothing_of_the_record_before_stands_before_the_trigger(rig) -> None:
    source = rig.make_source()
    source.configure(rig.make_plan(pre_trigger=1e-3))
    for _ in range(3):
        source.arm()
        hit = rig.strike()
        counts = np.concatenate([block.hammer.output for block in read_record(source)])
        shift = 2500 - find_crossing(rig.find_counts(hit, "hammer"), LEVEL)
        # The quiet input, and not the pulse that the ring still holds.
        assert np.abs(counts[:shift]).max() < LEVEL
    source.close()


def test_a_hit_without_its_sample_has_the_hammer_alone(rig, profile) -> None:
    source, plan = profile(numbers={"hammer": "1"}, specimen=None)
    source.configure(plan)
    _, blocks = take_record(rig, source)
    assert sum(block.hammer.output.size for block in blocks) == 5000
    assert all(block.specimen.output.size == 0 for block in blocks)
    source.close()


def test_an_input_beyond_its_range_is_flagged_in_its_block_and_channel(rig, profile) -> None:
    source, plan = profile()
    source.configure(plan)
    source.arm()
    hit = rig.make_hit()
    rig.digitizer.feed(replace(hit, hammer=replace(hit.hammer, scale=3 * hit.hammer.scale)))
    blocks = read_record(source)
    assert [block.hammer.overloaded for block in blocks] == [True, True, *[False] * 3]
    assert not any(block.specimen.overloaded for block in blocks)
    assert blocks[0].hammer.output.max() == 2**13 - 1
    assert blocks[0].hammer.full_scale == pytest.approx(1.0 / 5e-4)
    source.close()


def test_the_falling_edge_triggers_where_it_is_asked_for(rig) -> None:
    hit = rig.make_hit()
    hit = replace(hit, hammer=replace(hit.hammer, scale=-hit.hammer.scale))
    source = rig.make_source()
    source.configure(rig.make_plan())
    source.arm()
    assert rig.digitizer.feed(hit) is None
    assert source.read(0.05) is None
    source.configure(rig.make_plan('[source.hammer]\nedge = "falling"'))
    source.arm()
    assert rig.digitizer.feed(hit) is not None
    counts = np.concatenate([block.hammer.output for block in read_record(source)])
    assert counts[749] > -LEVEL >= counts[750]
    source.close()


def test_a_sensor_that_looks_the_other_way_triggers_on_the_falling_voltage(rig) -> None:
    hit = rig.make_hit()
    hit = replace(hit, hammer=replace(hit.hammer, scale=-hit.hammer.scale))
    source = rig.make_source()
    source.configure(rig.make_plan(hammer_sensitivity=-5e-4))
    source.arm()
    assert rig.digitizer.feed(hit) is not None
    block = read_record(source)[0]
    assert to_acceleration(block.hammer, block.hammer.output).max() > 49.0
    source.close()


def test_the_wide_range_has_larger_counts(rig) -> None:
    source = rig.make_source()
    source.configure(rig.make_plan('[source.hammer]\nrange = "20 V"'))
    hit, blocks = take_record(rig, source)
    assert blocks[0].hammer.scale == pytest.approx(20 * blocks[0].specimen.scale * -0.5)
    found = max(to_acceleration(item.hammer, item.hammer.output).max() for item in blocks)
    assert found == pytest.approx(
        to_acceleration(hit.hammer, hit.hammer.output).max(), abs=blocks[0].hammer.scale
    )
    source.close()


@pytest.mark.parametrize(
    "points_format", ['format = "ascii"', 'format = "float32"', 'format = "int16"']
)
def test_points_may_come_as_volts_in_text_or_numbers_or_as_counts(rig, points_format) -> None:
    is_counts = "int16" in points_format
    setup = (
        'setup = ["ACQ:RST", "ACQ:DEC:FACTOR 50", "ACQ:TRIG:LEV {level}", "ACQ:TRIG:DLY -3942",'
        f' "ACQ:DATA:FORMAT {"ASCII" if "ascii" in points_format else "BIN"}",'
        f' "ACQ:DATA:UNITS {"RAW" if is_counts else "VOLTS"}"]\n'
    )
    rest = (
        'profile = "generic"\narm = ["ACQ:START", "ACQ:TRIG CH1_PE"]\nstate = "ACQ:TRIG:FILL?"\n'
        'complete = "1"\nfetch = "ACQ:SOUR{channel}:DATA:LATEST:N? {points}"\n'
    )
    channel = 'range = "1 V"\n' + ('scale = "0.1220703125 mV"' if is_counts else "")
    source = rig.make_source(setup + rest + points_format)
    source.configure(rig.make_plan(f"[source.hammer]\n{channel}", {"hammer": "1"}, specimen=None))
    hit, blocks = take_record(rig, source)
    shift = 750 - find_crossing(rig.find_counts(hit, "hammer"), LEVEL)
    found = np.concatenate([to_acceleration(item.hammer, item.hammer.output) for item in blocks])
    # Seven digits of a float of 32 bits, and nine of text.
    np.testing.assert_allclose(
        found[shift:], to_acceleration(hit.hammer, hit.hammer.output)[: 5000 - shift], atol=2e-4
    )
    assert blocks[0].hammer.output.dtype == (np.int32 if is_counts else np.float64)
    source.close()


def test_a_record_of_another_length_is_refused(rig) -> None:
    text = (
        'profile = "generic"\nsetup = "ACQ:DATA:FORMAT BIN"\narm = ["ACQ:START", "ACQ:TRIG NOW"]\n'
        'state = "ACQ:TRIG:FILL?"\ncomplete = "1"\nfetch = "ACQ:SOUR1:DATA:LATEST:N? 4999"\n'
        'format = "float32"'
    )
    source = rig.make_source(text)
    source.configure(
        rig.make_plan('[source.hammer]\nrange = "1 V"', {"hammer": "1"}, specimen=None)
    )
    source.arm()
    with pytest.raises(DeviceError, match="with 4999 points: the record has 5000"):
        source.read(5.0)
    source.close()


def test_the_stamp_is_that_of_the_first_point(rig) -> None:
    source = rig.make_source()
    source.configure(rig.make_plan())
    before = time.time_ns()
    source.arm()
    rig.strike()
    blocks = read_record(source)
    # The trigger is known as well as the instrument is asked often, which a busy computer may
    # not do; the first point is 0.3 ms before it.
    assert before - 300_000 < blocks[0].stamp < time.time_ns() - 300_000
    assert [block.stamp - blocks[0].stamp for block in blocks] == [400_000 * i for i in range(5)]
    source.close()
