"""Keys of a rig file: what cannot be meant is refused by its line, with what would be right."""

from dataclasses import replace

import pytest

from impact_rig.configuration.sensor_table import SENSOR_KEYS
from impact_rig.configuration.toml_table import parse_toml_table
from impact_rig.core.errors import ParameterError
from impact_rig.devices.drivers import COMMON_KEYS, SOURCES
from impact_rig.devices.scpi.connection import parse_address
from impact_rig.devices.scpi.source import ScpiSource


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
def test_a_key_is_refused_by_its_line(rig, text: str, words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        ScpiSource(rig.parse(text))


def test_the_address_may_leave_its_port_out_and_be_one_of_six(rig) -> None:
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
def test_a_plan_that_the_board_cannot_do_is_refused(rig, changes, words: str) -> None:
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
def test_a_plan_that_lacks_what_a_generic_instrument_needs_is_refused(
    rig, text: str, channel: str, words: str
) -> None:
    with pytest.raises(ParameterError, match=words):
        rig.make_source(GENERIC + text).configure(
            rig.make_plan(f"[source.hammer]\n{channel}", {"hammer": "1"})
        )


def test_the_example_of_any_other_instrument_is_taken_too(rig) -> None:
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
