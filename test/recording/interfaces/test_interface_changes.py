"""Recordings of older interfaces become today's, or are refused with the difference named."""

import math

import numpy as np
import pytest

from impact_rig.core.errors import FileError
from impact_rig.recording.interfaces.channel import Channel
from impact_rig.recording.interfaces.interface_changes import (
    InterfaceConverter,
    find_interface_changes,
)
from impact_rig.recording.interfaces.message_definitions import find_message_definition
from impact_rig.recording.interfaces.messages import block_from_msg, setup_from_msg
from impact_rig.recording.interfaces.schema_decoder import SchemaDecoder
from impact_rig.recording.reading.mcap_reader import BLOCK_TYPE, SETUP_TYPE

from ..conftest import CdrEncoder, block_fields, setup_fields

ADDED_TO_SETUP = (
    "hammer_mass_uncertainty", "hammer_stiffness", "accelerometer_mass_uncertainty",
    "clock_uncertainty", "mass_uncertainty", "maximum_peak", "keep_hits",
)  # fmt: skip


def drop_fields(text, *names):
    """Return a schema without the lines of some fields."""
    return "\n".join(
        line
        for line in text.splitlines()
        if not any(line.partition("#")[0].split()[1:] == [name] for name in names)
    )


def make_channel(type_name, schema):
    return Channel(1, "/rig/topic", type_name, schema, {})


def encode(type_name, fields, *dropped, install):
    """Serialise by an older definition; return its schema and the bytes."""
    package, _, name = type_name.split("/")
    today = find_message_definition(type_name).text
    for part in (name, "Sample", "AnalysisSettings", "Channel"):
        text = find_message_definition(f"{package}/msg/{part}").text.split("=" * 80)[0]
        install(package, part, drop_fields(text, *dropped))
    old = find_message_definition(type_name).text
    return today, old, CdrEncoder().encode(type_name, fields)


def test_an_old_set_up_is_filled_up_as_the_analysis_does(install):
    today, old, data = encode(SETUP_TYPE, setup_fields(), *ADDED_TO_SETUP, install=install)
    channel = make_channel(SETUP_TYPE, old)
    converter = InterfaceConverter(channel, today)
    assert {change.field for change in converter.filled} == set(ADDED_TO_SETUP)
    assert "AnalysisSettings.maximum_peak = 1.0" in str(converter)
    converted = SchemaDecoder().decode(make_channel(SETUP_TYPE, today), converter.convert(data))
    assert math.isnan(converted.hammer_stiffness)
    assert [sample.mass_uncertainty for sample in converted.samples] == [0.0, 0.0]
    analyzed = setup_from_msg(SchemaDecoder().decode(channel, data))
    assert repr(setup_from_msg(converted)) == repr(analyzed)


def test_an_old_block_keeps_every_count(install):
    today, old, data = encode(BLOCK_TYPE, block_fields(7), "values", install=install)
    channel = make_channel(BLOCK_TYPE, old)
    converted = InterfaceConverter(channel, today).convert(data)
    block = block_from_msg(SchemaDecoder().decode(make_channel(BLOCK_TYPE, today), converted))
    assert block.label.record == 7
    np.testing.assert_array_equal(block.hammer.output, np.arange(100) + 7)
    np.testing.assert_array_equal(block.specimen.output, -np.arange(100) - 7)


@pytest.mark.parametrize("name", ["Impact", "SampleEstimate", "HammerEstimate", "ModelComparison"])
def test_what_an_old_recording_found_names_no_set_up(install, name):
    kind = f"impact_rig_msgs/msg/{name}"
    today = find_message_definition(kind).text
    install("impact_rig_msgs", name, drop_fields(today.split("=" * 80)[0], "setup_stamp"))
    old = find_message_definition(kind).text
    data = CdrEncoder().encode(kind, {"sample": "steel small"})
    converter = InterfaceConverter(make_channel(kind, old), today)
    assert [change.field for change in converter.filled] == ["setup_stamp"]
    found = SchemaDecoder().decode(make_channel(kind, today), converter.convert(data))
    assert (found.setup_stamp.sec, found.setup_stamp.nanosec) == (0, 0)


def test_fields_in_another_order_are_put_in_order():
    old = "string name\nfloat64[] values\n"
    channel = make_channel("a_msgs/msg/A", old)
    data = bytes.fromhex("00010000 03000000 61620000 01000000 00000000 000000000000f03f")
    decoded = SchemaDecoder().decode(channel, data)
    assert (decoded.name, list(decoded.values)) == ("ab", [1.0])
    today = "float64[] values\nstring name\n"
    converter = InterfaceConverter(channel, today)
    assert converter.filled == ()
    again = SchemaDecoder().decode(make_channel("a_msgs/msg/A", today), converter.convert(data))
    assert (again.name, list(again.values)) == ("ab", [1.0])


def test_comments_and_constants_are_no_difference():
    assert find_interface_changes("a/msg/A", "uint8 x # [V]\n", "uint8 ONE=1\nuint8 x\n") == ()


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("float32 x", "float64 x", "field `x` of a/msg/A is float32 in the recording and float64"),
        ("float64 x", "float64[] x", "float64 in the recording and float64[] here"),
        ("float64[3] x", "float64[<=3] x", "is float64[3] in the recording and float64[<=3] here"),
        ("float64 x\nstring y", "float64 x", "field `y` of a/msg/A is in the recording and"),
        ("float64 x", "float64 x\nstring y", "field `y` of a/msg/A is not in the recording"),
        ("B b\n===\nMSG: a/B\nint8 n", "B b\n===\nMSG: a/B\nint16 n", "`n` of a/msg/B is int8"),
        ("B b\n===\nMSG: a/B\nint8 n", "int8 b", "field `b` of a/msg/A is a/msg/B in the"),
    ],
)  # fmt: skip
def test_what_nothing_can_stand_for_is_named(old, new, told):
    old, new = (text.replace("===", "=" * 80) for text in (old, new))
    with pytest.raises(FileError) as error:
        InterfaceConverter(make_channel("a/msg/A", old), new)
    assert told in str(error.value)
    assert "/rig/topic was recorded with another version of a/msg/A" in str(error.value)


def test_a_definition_that_is_none_is_refused():
    with pytest.raises(FileError, match="a definition of a/msg/A cannot be understood"):
        find_interface_changes("a/msg/A", "[] 3 = nothing", "uint8 x")
