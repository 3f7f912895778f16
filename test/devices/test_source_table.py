"""What a rig file asks of its source: rate, record, trigger and channels."""

from dataclasses import replace

import pytest

from impact_rig.configuration.processes import SOURCE, format_source, parse_parameters
from impact_rig.configuration.rig_file import parse_rig_file
from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.given.errors import ParameterError
from impact_rig.devices.source_table import make_plan, make_source, override_source

RIG = """\
[hammer]
mass = "0.1 kg"
impact_speed = "30 cm/s"
[[sample]]
name = "oak"
mass = "80 g"
[source]
driver = "scpi"
sampling_rate = "2 MHz"
"""
HAMMER = '[source.hammer]\nchannel = 1\nsensitivity = "10 mV/g"\nfull_scale = "500 g"\n'
G = 9.80665


def plan_rig(text, *, mass=0.1):
    rig = parse_rig_file(RIG + text)
    setup = replace(rig.setup, hammer_mass=mass)
    return make_plan(rig.source, setup)


def test_rate_and_channels_are_as_written_and_the_rest_follows_from_the_analysis():
    plan = plan_rig(HAMMER + '[source.specimen]\nchannel = "ai1"\nsensitivity = "5 mV/g"\n')
    assert plan.sampling_rate == pytest.approx(2e6)
    assert plan.trigger_level == pytest.approx(0.03 * 500 * G)
    # The analysis keeps 0.2 ms of 2 ms before the pulse; half as much again is recorded.
    assert plan.pre_trigger == pytest.approx(0.3e-3)
    assert plan.record_duration == pytest.approx(2.1e-3)
    assert (plan.points, plan.pre_trigger_points) == (4200, 600)
    assert (plan.hammer.name, plan.specimen.name) == ("1", "ai1")
    assert plan.hammer.compute_scale() == pytest.approx(100 * G)
    assert plan.hammer.make_scale(1.0, 1.0, 1.0).full_scale == pytest.approx(100 * G)
    assert plan.hammer.make_scale(1.0, 20.0, 1.0).full_scale == pytest.approx(500 * G)


def test_what_is_written_goes_first():
    text = 'record_duration = "5 ms"\npre_trigger = "1 ms"\ntrigger_level = "50 m/s^2"\n' + HAMMER
    plan = plan_rig(text)
    assert plan.record_duration == pytest.approx(5e-3)
    assert plan.pre_trigger == pytest.approx(1e-3)
    assert plan.trigger_level == pytest.approx(50.0)
    assert plan.specimen is None


def test_a_force_is_that_on_the_hammers_mass():
    text = (
        'trigger_level = "20 N"\n[source.hammer]\nquantity = "force"\n'
        'sensitivity = "2 mV/N"\nfull_scale = "2 kN"\n'
    )
    plan = plan_rig(text, mass=0.25)
    assert plan.trigger_level == pytest.approx(80.0)
    assert plan.hammer.compute_scale() == pytest.approx(500 / 0.25)
    assert plan.hammer.make_scale(1.0, 1e9, 1.0).full_scale == pytest.approx(8000.0)


def test_keys_of_a_channel_that_no_sheet_has_are_the_drivers():
    plan = plan_rig(HAMMER + 'coupling = "AC"\n')
    assert dict(plan.hammer.options) == {"coupling": "AC"}
    with pytest.raises(ParameterError, match=r"line 14: \[source.hammer\] .*unknown key"):
        plan.hammer.options.check_keys("range")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", r"line 7: \[source\] has no \[source.hammer\]"),
        (HAMMER.replace("channel = 1", "channel = true"), "line 11: channel .*in quotes, or a"),
        ('pre_trigger = "3 ms"\nrecord_duration = "2 ms"\n' + HAMMER,
         "line 10: pre-trigger is 0.003: it must lie between 0 and 0.002"),
        ('trigger_level = "5 V"\n' + HAMMER, "line 10: .*sensitivity"),
        ('trigger_level = "-5 g"\n' + HAMMER, "line 10: trigger level .*above zero"),
        (HAMMER.replace('full_scale = "500 g"\n', ""), r"line 7: \[source\] lacks trigger_level"),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_is_named_with_its_line(text, told):
    with pytest.raises(ParameterError, match=told):
        plan_rig(text)


def test_settings_go_before_the_table_of_the_file():
    settings = parse_parameters(
        ("source.noise=0.002", "source.plant=dynamics", 'source.faults="weak_hit"')
    )
    table = parse_rig_file(RIG.replace("scpi", "virtual") + "seed = 9\nnoise = 0.5\n").source
    merged = override_source(table, format_source(settings[SOURCE]))
    assert dict(merged) == {
        "driver": "virtual", "sampling_rate": "2 MHz", "seed": 9, "noise": 0.002,
        "plant": "dynamics", "faults": "weak_hit",
    }  # fmt: skip
    _, plan = make_source(merged, parse_rig_file(RIG).setup)
    assert plan.sampling_rate == pytest.approx(2e6)


def test_settings_without_a_table_are_those_of_the_virtual_rig():
    empty = TomlTable({}, "[source]")
    assert dict(override_source(empty, "seed = 4")) == {"driver": "virtual", "seed": 4}
    assert override_source(empty, "") == {}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("seed: 4", "parameter source: this is not TOML"),
        ("hammer.channel = 2", "'hammer': sensors are described in the rig file only"),
    ],
)
def test_settings_that_cannot_be_meant_are_refused(text, words):
    with pytest.raises(ParameterError, match=words):
        override_source(parse_rig_file(RIG).source, text)


def test_a_wrong_setting_names_itself_and_no_line_of_the_file():
    table = parse_rig_file(RIG.replace("scpi", "virtual") + "seed = 9\n").source
    with pytest.raises(ParameterError, match=r"seed of \[source\] is -1: it must be"):
        make_source(override_source(table, "seed = -1"), parse_rig_file(RIG).setup)
