"""Text of a message type with all it depends on, from the installed interface packages.

A recording carries these texts, so that it can be decoded anywhere and in ten years.
"""

import json
import os
import re
from dataclasses import dataclass
from pathlib import Path

from impact_rig.core.errors import FileError

SEPARATOR = "=" * 80
"""Line between two definitions of a `ros2msg` schema; readers look for exactly this."""

PRIMITIVES = frozenset(
    {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}
    | {"bool", "byte", "char", "float32", "float64", "string", "wstring"}
)
"""Field types that need no definition of their own."""

_TYPE_NAME = re.compile(r"([A-Za-z]\w*)/(?:msg/)?([A-Za-z]\w*)")
_FIELD_TYPE = re.compile(r"[ \t]*([A-Za-z][\w/]*)(?:<=\d+)?(?:\[[^\]]*\])?[ \t]+[A-Za-z]")


@dataclass(frozen=True)
class MessageDefinition:
    """What a file must say of a message type.

    Attributes
    ----------
    type_name : str
        In full, for example `std_msgs/msg/Header`.
    text : str
        Schema in the encoding `ros2msg`: the definition, then all it depends on.
    type_hash : str
        As ROS 2 computes it (REP 2016); empty: not installed with the package.
    """

    type_name: str
    text: str
    type_hash: str = ""


def find_message_definition(type_name: str) -> MessageDefinition:
    """Assemble the definition of a message type from the packages on `AMENT_PREFIX_PATH`.

    Parameters
    ----------
    type_name : str
        For example `impact_rig_msgs/msg/Impact`.

    Returns
    -------
    MessageDefinition

    Raises
    ------
    FileError
        If the name is no message type, or the type or one it depends on is not installed as
        `.msg`.
    """
    package, name = _split_type_name(type_name)
    seen = {(package, name)}
    text = _assemble(package, name, seen)
    return MessageDefinition(f"{package}/msg/{name}", text, _find_type_hash(package, name))


def is_same_definition(text: str, other: str) -> bool:
    """Tell whether two schemas describe the same bytes: comments and blanks do not count."""
    return _list_fields(text) == _list_fields(other)


def _list_fields(text: str) -> dict[str, list[str]]:
    """Return the lines of each definition in a schema, by its title; the first has none."""
    fields: dict[str, list[str]] = {"": []}
    title = ""
    for line in text.splitlines():
        if line.startswith("MSG:"):
            title = "/".join(part for part in line[4:].strip().split("/") if part != "msg")
            fields[title] = []
        elif line.strip() != SEPARATOR and (content := line.partition("#")[0].split()):
            fields[title].append(" ".join(content))
    return fields


def _assemble(package: str, name: str, seen: set[tuple[str, str]]) -> str:
    text = _find_share_file(package, name, ".msg").read_text(encoding="utf-8")
    parts = [text]
    for dependency in _find_dependencies(text, package):
        if dependency not in seen:
            seen.add(dependency)
            title = f"MSG: {dependency[0]}/{dependency[1]}"
            parts.append(f"\n{SEPARATOR}\n{title}\n{_assemble(*dependency, seen)}")
    return "".join(parts)


def _find_dependencies(text: str, package: str) -> list[tuple[str, str]]:
    found = set()
    for line in text.splitlines():
        field = _FIELD_TYPE.match(line.partition("#")[0])
        if field is None or field[1] in PRIMITIVES:
            continue
        found.add(_split_type_name(field[1] if "/" in field[1] else f"{package}/{field[1]}"))
    return sorted(found)


def _split_type_name(type_name: str) -> tuple[str, str]:
    match = _TYPE_NAME.fullmatch(type_name)
    if match is None:
        raise FileError(f"{type_name!r} is no message type: it should look like pkg/msg/Name")
    return match[1], match[2]


def _find_share_file(package: str, name: str, suffix: str) -> Path:
    prefixes = [part for part in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if part]
    for prefix in prefixes:
        path = Path(prefix, "share", package, "msg", name + suffix)
        if path.is_file():
            return path
    raise FileError(
        f"message type {package}/msg/{name} has no {name}{suffix} in any of the"
        f" {len(prefixes)} folders of AMENT_PREFIX_PATH: install or source the package {package}"
    )


def _find_type_hash(package: str, name: str) -> str:
    try:
        content = json.loads(_find_share_file(package, name, ".json").read_text(encoding="utf-8"))
        hashes = {item["type_name"]: item["hash_string"] for item in content["type_hashes"]}
        return str(hashes.get(f"{package}/msg/{name}", ""))
    except (FileError, OSError, ValueError, KeyError, TypeError):
        return ""
