"""A schema is somebody else's text: what it describes is decoded, what it asks for is limited."""

import numpy as np
import pytest
from mcap_ros2._dynamic import serialize_dynamic

from impact_rig.core.errors import FileError
from impact_rig.recording.interfaces.channel import Channel
from impact_rig.recording.interfaces.schema_decoder import MAX_LISTED, MAX_SCHEMA, SchemaDecoder

NAME = "test_msgs/msg/Test"
RULE = "\n" + "=" * 80 + "\n"
EMPTY = b"\0\1\0\0"


def decode(schema: str, data: bytes = EMPTY + bytes(64), name: str = NAME):
    return SchemaDecoder().decode(Channel(1, "/test", name, schema, {}), data)


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
    decoder = SchemaDecoder()
    old, new = (Channel(1, "/test", NAME, text, {}) for text in ("uint8 a\n", "uint8 b\n"))
    assert decoder.decode(old, EMPTY + b"\1").a == 1
    assert decoder.decode(new, EMPTY + b"\2").b == 2
    assert decoder.decode(old, EMPTY + b"\3").a == 3


def doubling(depth: int) -> str:
    types = (f"MSG: t/A{i}\nA{i + 1} a\nA{i + 1} b\n" for i in range(depth))
    return RULE.join(["t/A0 a\n", *types, f"MSG: t/A{depth}\nuint8 x\n"])


@pytest.mark.parametrize(
    ("schema", "told"),
    [
        ("Test again\n", "more than 10000 parts"),
        (f"A a{RULE}MSG: test_msgs/A\nTest t\n", "more than 10000 parts"),
        (doubling(30), "more than 10000 parts"),
        ("string[1000000000] texts\n", "more than 10000 parts"),
        ("#" * MAX_SCHEMA + "\n", f"has {MAX_SCHEMA + 1} characters"),
        ("other_msgs/Lost x\n", "'other_msgs/msg/Lost' is not described"),
        ("int32 A=" + "9" * 5000 + "\n", "Exceeds the limit"),
        ("uint8 a\nuint8 a\n", "conflicting"),
        ("what is this", "'test_msgs/msg/what' is not described"),
        ("??? x\n", "Could not parse"),
        ("uint8 a; import os\n", "Could not parse"),
    ],
    ids=range(11),
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
        ("uint32 a\n", EMPTY + b"\1"),
        ("uint8 a\n", EMPTY + bytes(64)),
        ("uint32[] a\n", EMPTY + length(0xFFFFFFFF)),
        ("string a\n", EMPTY + length(0xFFFFFFFF)),
        ("string a\n", EMPTY + length(3) + b"\xff\xfe\0"),
        ("string[] a\n", EMPTY + length(0xFFFFFFFF)),
        (f"A[] a{RULE}MSG: test_msgs/A\n", EMPTY + length(0xFFFFFFFF)),
        ("float64[1000000000] a\n", EMPTY + bytes(64)),
        ("float64[100000000000000000000000] a\n", EMPTY + bytes(64)),
        ("float64[-5] a\n", EMPTY + bytes(64)),
    ],
    ids=range(11),
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
