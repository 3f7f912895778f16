"""Schemas carry every type they depend on, as other tools expect it."""

import os
from itertools import pairwise
from pathlib import Path

import pytest

from impact_rig.core.errors import FileError
from impact_rig.recording.interfaces.message_definitions import (
    find_message_definition,
    is_same_definition,
)

SEPARATOR = "=" * 80


def list_parts(text: str) -> list[str]:
    """Return the names of the types appended to a schema."""
    lines = text.splitlines()
    return [after for line, after in pairwise(lines) if line == SEPARATOR]


def test_a_type_without_dependencies_is_its_own_text():
    assert find_message_definition("builtin_interfaces/msg/Time").text == (
        "int32 sec\n\nuint32 nanosec\n"
    )


def test_all_dependencies_are_appended_once_each():
    definition = find_message_definition("impact_rig_msgs/msg/AccelerationBlock")
    assert definition.type_name == "impact_rig_msgs/msg/AccelerationBlock"
    assert definition.text.startswith("# A contiguous stretch")
    assert list_parts(definition.text) == [
        "MSG: impact_rig_msgs/Channel",
        "MSG: std_msgs/Header",
        "MSG: builtin_interfaces/Time",
    ]


def test_the_short_form_of_a_name_is_understood():
    assert find_message_definition("std_msgs/Header") == find_message_definition(
        "std_msgs/msg/Header"
    )


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


def test_other_libraries_parse_every_definition_of_the_rig():
    from mcap_ros2._dynamic import generate_dynamic
    from rosbags.typesys import get_types_from_msg

    messages = Path(__file__).parents[3] / "msg_config" / "msg"
    for path in messages.glob("*.msg"):
        name = f"impact_rig_msgs/msg/{path.stem}"
        text = find_message_definition(name).text
        assert name in get_types_from_msg(text, name)
        assert name in generate_dynamic(name, text)


def test_the_type_hash_stands_in_the_json_beside_the_definition(install):
    assert find_message_definition("std_msgs/msg/String").type_hash == ""
    prefix = os.environ["AMENT_PREFIX_PATH"].split(os.pathsep)[0]
    install("demo_msgs", "Text", "string data\n")
    (Path(prefix) / "share/demo_msgs/msg/Text.json").write_text(
        '{"type_hashes": [{"type_name": "demo_msgs/msg/Text", "hash_string": "RIHS01_ab"}]}'
    )
    assert find_message_definition("demo_msgs/msg/Text").type_hash == "RIHS01_ab"


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("nowhere_msgs/msg/Thing", "nowhere_msgs"),
        ("std_msgs/msg/Missing", "Missing.msg"),
        ("no type", "pkg/msg/Name"),
        ("demo/srv/Service", "pkg/msg/Name"),
        ("../../etc/msg/passwd", "pkg/msg/Name"),
    ],
)
def test_what_is_not_installed_is_named(name, told):
    with pytest.raises(FileError, match=told):
        find_message_definition(name)


def test_a_missing_dependency_is_named(install):
    install("demo_msgs", "Broken", "gone_msgs/Lost field\n")
    with pytest.raises(FileError, match="gone_msgs/msg/Lost"):
        find_message_definition("demo_msgs/msg/Broken")


@pytest.mark.parametrize(
    ("other", "same"),
    [
        ("# Said differently.\nInner  a # [m]\n\n=80=\nMSG: demo/msg/Inner\nbool b\n", True),
        ("Inner a\n=80=\nMSG: demo/Inner\nint32 b\n", False),
        ("Inner a\nbool c\n=80=\nMSG: demo/Inner\nbool b\n", False),
        ("Inner renamed\n=80=\nMSG: demo/Inner\nbool b\n", False),
        ("", False),
    ],
)
def test_definitions_are_the_same_when_their_bytes_are(other, same):
    text = "Inner a\n=80=\nMSG: demo/Inner\nbool b\n"
    texts = [item.replace("=80=", SEPARATOR) for item in (text, other)]
    assert is_same_definition(*texts) is same
