"""The driver `scpi`: what comes out of an instrument is what went in; options and contract."""

import time
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.configuration.rig_file import SENSOR_KEYS
from impact_rig.configuration.toml_table import parse_toml_table
from impact_rig.core.errors import DeviceError, ParameterError
from impact_rig.core.signals.detection import to_acceleration
from impact_rig.devices.drivers import COMMON_KEYS, SOURCES
from impact_rig.devices.protocols import AcquisitionPlan
from impact_rig.devices.scpi.source import ScpiSource, parse_address
from impact_rig.testing.contract import AccelerationSourceContract, SourceBench

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


def test_each_count_of_a_record_is_that_of_the_input_with_the_trigger_in_its_place(rig, profile):
    source, plan = profile()
    source.configure(plan)
    for _ in range(3):
        hit, blocks = take_record(rig, source)
        assert [block.hammer.output.size for block in blocks] == [5000]
        fed = rig.find_counts(hit, "hammer")
        shift = 750 - find_crossing(fed, LEVEL)
        for name in ("hammer", "specimen"):
            counts = np.concatenate([getattr(block, name).output for block in blocks])
            assert counts.dtype == np.int32
            np.testing.assert_array_equal(
                counts[shift:], rig.find_counts(hit, name)[: 5000 - shift]
            )


def test_nothing_of_the_record_before_stands_before_the_trigger(rig):
    source = rig.make_source()
    source.configure(rig.make_plan(pre_trigger=1e-3))
    for _ in range(3):
        source.arm()
        hit = rig.strike()
        counts = np.concatenate([block.hammer.output for block in read_record(source)])
        shift = 2500 - find_crossing(rig.find_counts(hit, "hammer"), LEVEL)
        # The quiet input, and not the pulse that the ring still holds.
        assert np.abs(counts[:shift]).max() < LEVEL


def test_a_hit_without_its_sample_has_the_hammer_alone(rig, profile):
    source, plan = profile(numbers={"hammer": "1"}, specimen=None)
    source.configure(plan)
    _, blocks = take_record(rig, source)
    assert sum(block.hammer.output.size for block in blocks) == 5000
    assert all(block.specimen.output.size == 0 for block in blocks)


def test_an_input_beyond_its_range_is_flagged_in_its_channel(rig, profile):
    source, plan = profile()
    source.configure(plan)
    source.arm()
    hit = rig.make_hit()
    rig.digitizer.feed(replace(hit, hammer=replace(hit.hammer, scale=3 * hit.hammer.scale)))
    blocks = read_record(source)
    assert [block.hammer.overloaded for block in blocks] == [True]
    assert not any(block.specimen.overloaded for block in blocks)
    assert blocks[0].hammer.output.max() == 2**13 - 1
    assert blocks[0].hammer.full_scale == pytest.approx(1.0 / 5e-4)


def test_the_falling_edge_triggers_where_it_is_asked_for(rig):
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


def test_a_sensor_that_looks_the_other_way_triggers_on_the_falling_voltage(rig):
    hit = rig.make_hit()
    hit = replace(hit, hammer=replace(hit.hammer, scale=-hit.hammer.scale))
    source = rig.make_source()
    source.configure(rig.make_plan(hammer_sensitivity=-5e-4))
    source.arm()
    assert rig.digitizer.feed(hit) is not None
    block = read_record(source)[0]
    assert to_acceleration(block.hammer, block.hammer.output).max() > 49.0


def test_the_wide_range_has_larger_counts(rig):
    source = rig.make_source()
    source.configure(rig.make_plan('[source.hammer]\nrange = "20 V"'))
    hit, blocks = take_record(rig, source)
    assert blocks[0].hammer.scale == pytest.approx(20 * blocks[0].specimen.scale * -0.5)
    found = max(to_acceleration(item.hammer, item.hammer.output).max() for item in blocks)
    assert found == pytest.approx(
        to_acceleration(hit.hammer, hit.hammer.output).max(), abs=blocks[0].hammer.scale
    )


@pytest.mark.parametrize(
    "points_format", ['format = "ascii"', 'format = "float32"', 'format = "int16"']
)
def test_points_may_come_as_volts_in_text_or_numbers_or_as_counts(rig, points_format):
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


def test_a_record_of_another_length_is_refused(rig):
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


def test_the_stamp_is_that_of_the_first_point(rig):
    source = rig.make_source()
    source.configure(rig.make_plan())
    before = time.time_ns()
    source.arm()
    rig.strike()
    blocks = read_record(source)
    # The trigger is known as well as the instrument is asked often, which a busy computer may
    # not do; the first point is 0.3 ms before it.
    assert before - 300_000 < blocks[0].stamp < time.time_ns() - 300_000


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('adress = "10.0.0.1"', r"line 2: .*'adress'.*did you mean 'address'"),
        ('address = "10.0.0.1:x"', "line 2: address is '10.0.0.1:x'.*192.168.1.20:5000"),
        ('address = "10.0.0.1:70000"', "line 2: address"),
        ('address = ""', "line 2: address"),
        ("address = 7", "line 2: address of .* a text"),
        ('profile = "keysight"\naddress = "a"', "line 2: profile.*red_pitaya, generic"),
        ('address = "a"\nboard = "125"', "line 3: board.*125-14, 125-10"),
        ('address = "a"\ntimeout = "1 m"', "line 3: timeout"),
        ('address = "a"\ntimeout = "1 h"', "line 3: timeout.*between 0.001 and 5"),
        ('address = "a"\nprofile = "generic"', "lacks arm"),
        ('address = "a"\nprofile = "generic"\narm = []', "line 4: arm .* a list of commands"),
        ('address = "a"\nprofile = "generic"\narm = [7]', "line 4: arm .* a list of commands"),
        ('address = "a"\nprofile = "generic"\narm = ["A\\nB"]', "line 4: arm"),
        (
            'address = "a"\nprofile = "generic"\narm = "I"\nfetch = "D?"\nstate = "A\\nB"',
            "line 6: state .*one line",
        ),
        ('address = "a"\nprofile = "generic"\nboard = "125-14"', "unknown key 'board'"),
    ],
)
def test_a_key_is_refused_by_its_line(rig, text, words):
    with pytest.raises(ParameterError, match=words):
        ScpiSource(rig.parse(text))


def test_the_address_may_leave_its_port_out_and_be_one_of_six(rig):
    assert parse_address("rp-f0a235.local", 5000) == ("rp-f0a235.local", 5000)
    assert parse_address("10.0.0.1:5025", 5000) == ("10.0.0.1", 5025)
    assert parse_address("[fe80::1]:5025", 5000) == ("fe80::1", 5025)
    assert parse_address("[::1]", 5000) == ("::1", 5000)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"sampling_rate": 2.4e6}, "2400000 Hz.*cannot do: near it are 2403846.15 Hz or 23584"),
        ({"sampling_rate": 3e8, "record_duration": 1e-5, "pre_trigger": 0.0},
         "300000000 Hz.*near it are 125000000 Hz$"),
        ({"sampling_rate": 12.5e6, "record_duration": 1e-4, "pre_trigger": 0.0},
         "near it are 15625000 Hz or 7812500 Hz"),
        ({"record_duration": 7e-3}, "17500 points is too long for the board, which holds 16384"),
        ({"trigger_level": 2000.0}, "trigger_level is 2000 m/s.2, which is 1 V at the input"),
        ({"numbers": {"hammer": "3"}}, "channel of .source.hammer. is 3: it must be one of 1, 2"),
        ({"numbers": {"hammer": ""}}, "channel of .source.hammer. is missing"),
        ({"numbers": {"hammer": "2", "specimen": "2"}}, "hammer and sample are both on channel 2"),
        ({"continuous": True}, "records of single hits: set mode to triggered"),
        ({"text": '[source.hammer]\nrange = "2 V"'}, 'line 3: range .* "1 V" or "20 V"'),
        ({"text": '[source.hammer]\ncoupling = "AC"'}, "line 3: coupling .*DC coupled"),
        ({"text": '[source.hammer]\nedge = "up"'}, "line 3: edge .*rising, falling"),
        ({"text": '[source.specimen]\nedge = "rising"'}, "line 3: .*unknown key 'edge'"),
    ],
)  # fmt: skip
def test_a_plan_that_the_board_cannot_do_is_refused(rig, changes, words):
    with pytest.raises(ParameterError, match=words):
        rig.make_source().configure(rig.make_plan(**changes))


GENERIC = (
    'profile = "generic"\narm = "INIT"\nstate = "S?"\ncomplete = "1"\nfetch = "D? {channel}"\n'
)


@pytest.mark.parametrize(
    ("text", "channel", "words"),
    [
        (
            'setup = ["LEV {height}"]',
            'range = "1 V"\nscale = "1 mV"',
            "line 8: .*{height}.*{level}",
        ),
        ("", 'scale = "1 mV"', "lacks range"),
        ("", 'range = "1 V"', "lacks scale"),
        ("", 'range = "1 V"\nscale = "1 mV"\nedge = "rising"', "line 5: .*unknown key 'edge'"),
        ("", 'range = "0 V"\nscale = "1 mV"', "line 3: range"),
    ],
)
def test_a_plan_that_lacks_what_a_generic_instrument_needs_is_refused(rig, text, channel, words):
    with pytest.raises(ParameterError, match=words):
        rig.make_source(GENERIC + text).configure(
            rig.make_plan(f"[source.hammer]\n{channel}", {"hammer": "1"})
        )


def test_the_example_of_any_other_instrument_is_taken_too(rig):
    lines = ScpiSource.example.partition("by its commands:\n")[2].splitlines()
    table = parse_toml_table("\n".join(line.removeprefix("# ") for line in lines))
    options = table.take_table("source")
    source = ScpiSource(options.without(*COMMON_KEYS[SOURCES]))
    channel = options.take_table("hammer").without("channel", *SENSOR_KEYS)
    plan = rig.make_plan(numbers={"hammer": "1"})
    program = source._profile.make_program(
        replace(plan, hammer=replace(plan.hammer, options=channel))
    )
    assert [setting.command for setting in program.settings] == [
        "*RST", "ACQ:RATE 2500000", "TRIG:LEV 0.0245"
    ]  # fmt: skip
    assert (program.hammer.commands, program.hammer.query) == (("WAV:SOUR C1",), "WAV:DATA?")


class ScpiBench(SourceBench):
    """An instrument whose cable can be pulled."""

    def __init__(self, rig) -> None:
        self._rig = rig

    def get_driver(self) -> type[ScpiSource]:
        return ScpiSource

    def unplug(self) -> None:
        self._rig.digitizer.unplug()

    def plug(self) -> None:
        self._rig.digitizer.plug()

    def make_source(self) -> ScpiSource:
        return self._rig.make_source()

    def make_plan(self, *, continuous: bool = False) -> AcquisitionPlan:
        return self._rig.make_plan(continuous=continuous, block_size=700)

    def strike(self, source: ScpiSource) -> None:
        self._rig.strike()


class TestScpiSource(AccelerationSourceContract):
    """The contract, on a peer that speaks SCPI."""

    @pytest.fixture
    def bench(self, rig) -> ScpiBench:
        return ScpiBench(rig)
