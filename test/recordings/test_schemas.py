"""A schema is foreign text: what it describes is decoded, what it asks for is limited."""

from itertools import pairwise

import numpy as np
import pytest
from mcap_ros2._dynamic import serialize_dynamic

from impact_rig.core.given.errors import FileError
from impact_rig.recordings import schemas
from impact_rig.recordings.records import Channel, RawMessage
from impact_rig.recordings.schemas import (
    MAX_LISTED,
    MAX_SCHEMA,
    SEPARATOR,
    MessageDefinition,
    check_interfaces,
    decode_message,
    find_message_definition,
)

from .conftest import OUR_MESSAGES

NAME = "test_msgs/msg/Test"
RULE = f"\n{SEPARATOR}\n"
EMPTY = b"\0\1\0\0"


def decode(schema: str, data: bytes = EMPTY + bytes(64), name: str = NAME):
    channel = Channel(1, "/test", name, schema, {})
    return decode_message(RawMessage(channel, 0, 0, 0, data))


def length(size: int) -> bytes:
    return size.to_bytes(4, "little")


def test_a_message_is_decoded_as_another_library_wrote_it():
    schema = f"int32[] counts\nstring text\nInner[] inner{RULE}MSG: test_msgs/Inner\nfloat64 x\n"
    inner = [{"x": 0.5}, {"x": -1.5}]
    fields = {"counts": [1, -2, 3], "text": "τ", "inner": inner}
    message = decode(schema, serialize_dynamic(NAME, schema)[NAME](fields))
    assert np.array_equal(message.counts, [1, -2, 3])
    assert message.counts.dtype == np.int32
    assert (message.text, [item.x for item in message.inner]) == ("τ", [0.5, -1.5])


def test_two_versions_of_a_type_are_decoded_each_by_its_own():
    assert decode("uint8 a\n", EMPTY + b"\1").a == 1
    assert decode("uint8 b\n", EMPTY + b"\2").b == 2
    assert decode("uint8 a\n", EMPTY + b"\3").a == 3


def doubling(depth: int) -> str:
    types = (f"MSG: t/A{i}\nA{i + 1} a\nA{i + 1} b\n" for i in range(depth))
    return RULE.join(["t/A0 a\n", *types, f"MSG: t/A{depth}\nuint8 x\n"])


@pytest.mark.parametrize(
    ("schema", "told"),
    [
        ("Test again\n", "more than 10000 parts"),
        (doubling(30), "more than 10000 parts"),
        ("string[1000000000] texts\n", "more than 10000 parts"),
        ("#" * MAX_SCHEMA + "\n", f"has {MAX_SCHEMA + 1} characters"),
        ("other_msgs/Lost x\n", "'other_msgs/msg/Lost' is not described"),
        ("int32 A=" + "9" * 5000 + "\n", "Exceeds the limit"),
        ("??? x\n", "Could not parse"),
    ],
    ids=range(7),
)
def test_a_schema_that_makes_no_sense_is_named(schema, told):
    with pytest.raises(FileError, match=rf"schema of {NAME} on /test cannot be understood: .*"):
        decode(schema)
    with pytest.raises(FileError, match=told) as caught:
        decode(schema)  # it is named again, not only once
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("schema", "data"),
    [
        ("uint8 a\n", b""),
        ("uint8 a\n", EMPTY + bytes(64)),
        ("uint32[] a\n", EMPTY + length(0xFFFFFFFF)),
        (f"A[] a{RULE}MSG: test_msgs/A\n", EMPTY + length(0xFFFFFFFF)),
        ("float64[1000000000] a\n", EMPTY + bytes(64)),
    ],
    ids=range(5),
)
def test_a_message_that_does_not_fit_is_named(schema, data):
    with pytest.raises(FileError, match=r"on /test does not fit its schema: .") as caught:
        decode(schema, data)
    assert str(caught.value).isprintable()


def test_numbers_may_be_many_but_messages_in_a_list_not():
    """A list of a million messages of one byte would take a hundred megabytes."""
    size = 2 * MAX_LISTED
    numbers = decode("uint8[] a\n", EMPTY + length(size) + bytes(size))
    assert numbers.a.size == size
    schema = f"A[] a{RULE}MSG: test_msgs/A\nbool x\n"
    with pytest.raises(FileError, match=f"it has {size + 8} byte, {MAX_LISTED} are read at most"):
        decode(schema, EMPTY + length(size) + bytes(size))
    assert len(decode(schema, EMPTY + length(1000) + bytes(1000)).a) == 1000


def list_parts(text: str) -> list[str]:
    """Return the names of the types appended to a schema."""
    lines = text.splitlines()
    return [after for line, after in pairwise(lines) if line == SEPARATOR]


def test_all_dependencies_are_appended_once_each():
    definition = find_message_definition("impact_rig_msgs/msg/AccelerationBlock")
    assert definition.type_name == "impact_rig_msgs/msg/AccelerationBlock"
    assert definition.text.startswith("# A contiguous stretch")
    assert list_parts(definition.text) == [
        "MSG: impact_rig_msgs/Channel",
        "MSG: impact_rig_msgs/Origin",
        "MSG: std_msgs/Header",
        "MSG: builtin_interfaces/Time",
        "MSG: unique_identifier_msgs/UUID",
    ]


def test_arrays_bounds_constants_and_comments_are_told_from_types(install):
    install("demo_msgs", "Inner", "bool flag\n")
    install(
        "demo_msgs",
        "Outer",
        "# NotAType here\n"
        "uint8 LIMIT=3 # Neither Here\n"
        "Inner[] many # std_msgs/Nothing more\n"
        "\tInner[<=4] few\n"
        "string<=10 name\n"
        "string<=10[<=3] names\n"
        "float64[3] point\n"
        "std_msgs/String text\n",
    )
    text = find_message_definition("demo_msgs/msg/Outer").text
    assert list_parts(text) == ["MSG: demo_msgs/Inner", "MSG: std_msgs/String"]


def test_the_type_hash_is_that_of_ros():
    found = find_message_definition("std_msgs/msg/String").type_hash
    assert found == "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"


def test_without_ros_definitions_come_with_the_rig_and_rosbags(monkeypatch):
    with_ros = find_message_definition("impact_rig_msgs/msg/AccelerationBlock")
    monkeypatch.delenv("AMENT_PREFIX_PATH")
    monkeypatch.setitem(schemas.INTERFACES, "impact_rig_msgs", OUR_MESSAGES)
    assert find_message_definition(with_ros.type_name).type_hash == with_ros.type_hash


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("nowhere_msgs/msg/Thing", "nowhere_msgs"),
        ("no type", "pkg/msg/Name"),
        ("../../etc/msg/passwd", "pkg/msg/Name"),
    ],
)
def test_what_is_not_installed_is_named(name, told):
    with pytest.raises(FileError, match=told):
        find_message_definition(name)


def check(old: str, new: str) -> None:
    channel = Channel(1, "/rig/topic", "a/msg/A", old, {})
    check_interfaces(channel, MessageDefinition("a/msg/A", new))


def test_comments_and_constants_are_no_difference():
    old, new = "uint8 x # [V]\n", "uint8 ONE=1\nuint8 x\n"
    check(old, new)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("float32 x", "float64 x", "`float32 x` in the recording is `float64 x` here"),
        ("int8 x\nint8 y", "int8 y\nint8 x", "`int8 x` in the recording is `int8 y` here"),
        ("float64 x\nstring y", "float64 x", "`string y` in the recording is `missing` here"),
        ("B b\n===\nMSG: a/B\nint8 n", "B b\n===\nMSG: a/B\nint16 n", "`int8 n` in the rec"),
        ("B b\n===\nMSG: a/B\nint8 n", "int8 b", "`a/B b` in the recording is `int8 b` here"),
    ],
)  # fmt: skip
def test_the_first_difference_is_named(old, new, told):
    old, new = (text.replace("===", SEPARATOR) for text in (old, new))
    with pytest.raises(FileError) as error:
        check(old, new)
    assert told in str(error.value)
    assert "/rig/topic was recorded with another version of a/msg/A" in str(error.value)
