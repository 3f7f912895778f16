"""Message types: their text and hash, how two versions differ, and messages decoded by them.

A recording carries the text of each type, so that it can be decoded anywhere and in ten years.
Schemas come from strangers: their size and depth are limited.
"""

import json
import os
import re
import struct
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from itertools import zip_longest
from pathlib import Path
from typing import Any

from mcap.records import Schema
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.serde.cdr import generate_deserialize_cdr
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from impact_rig.core.given.errors import FileError
from impact_rig.recordings.records import ROS, Channel, Encoding, RawMessage

MAX_SCHEMA = 1 << 16
"""Longest schema [characters], our choice: seven times our longest one, and read within seconds
whatever is in it."""
MAX_PARTS = 10_000
"""Most messages and texts that one message may be made of by its schema, not counting lists [-],
our choice: rosbags writes a line of code for each."""
MAX_LISTED = 1 << 20
"""Longest message of a type with a list of messages or texts [byte], our choice: an item takes up
to a hundred times its bytes in memory. Our own ones are a hundredth of that; arrays of numbers,
as in blocks, are not limited."""
CACHED_DECODERS = 100
"""How many types are kept ready [-], our choice: making one takes 10 ms."""

Types = dict[str, tuple[Any, list[tuple[str, Any]]]]
"""Constants and fields by type, as rosbags describes them."""
_Decode = Callable[[bytes], Any]
_SCHEMA_ERRORS = (
    TypesysError, LookupError, SyntaxError, RecursionError, ValueError, TypeError,
    AttributeError, AssertionError, MemoryError,
)  # fmt: skip
"""Errors of rosbags on schemas that make no sense, beside its own one."""
DECODING_ERRORS = (
    SerdeError, LookupError, AssertionError, struct.error, ValueError, OverflowError,
    MemoryError, RecursionError,
)  # fmt: skip
"""Its errors on messages that do not fit."""


def decode_message(message: RawMessage) -> Any:
    """Return a message, decoded by the schema of its channel, with its fields as attributes.

    Every schema has its own store of types: a file may hold several versions of a type.

    Raises
    ------
    FileError
        If the schema cannot be understood or the message does not fit it.
    """
    channel = message.channel
    decode = _make_decoder(channel.type_name, channel.schema)
    if isinstance(decode, str):
        raise FileError(
            f"the schema of {channel.type_name} on {channel.topic} cannot be understood: {decode}"
        )
    try:
        return decode(message.data)
    except DECODING_ERRORS as error:
        raise FileError(
            f"a message on {channel.topic} does not fit its schema: {_describe_error(error)}"
        ) from None


def parse_schema(type_name: str, schema: str) -> Types:
    """Return the types that a schema describes.

    Raises
    ------
    FileError
        If it cannot be understood, or asks for more than `MAX_PARTS`.
    """
    if len(schema) > MAX_SCHEMA:
        raise FileError(f"it has {len(schema)} characters, {MAX_SCHEMA} are read at most")
    try:
        types: Types = get_types_from_msg(schema, type_name)
        parts = _count_parts(types, type_name, {})
    except KeyError as error:
        raise FileError(f"type {error} is not described") from None
    except _SCHEMA_ERRORS as error:
        raise FileError(_describe_error(error)) from None
    if parts > MAX_PARTS:
        raise FileError(f"a message has more than {MAX_PARTS} parts")
    return types


class _Reader:
    """Decoder of one type of a store."""

    def __init__(self, name: str, store: Typestore) -> None:
        self.cls, self.fields = store.types[name], store.fielddefs[name][1]
        self._store = store
        self.deserialize_cdr_le = generate_deserialize_cdr(self.fields, store, "le")

    @cached_property
    def deserialize_cdr_be(self) -> Any:
        """The same for messages of a big-endian computer, which hardly anyone has."""
        return generate_deserialize_cdr(self.fields, self._store, "be")


class _ReadingStore(Typestore):
    """Types that are decoded alone: rosbags makes sixteen more functions of each."""

    def get_msgdef(self, typename: str) -> Any:
        """Return the decoder of a type."""
        if typename not in self.cache:
            self.cache[typename] = _Reader(typename, self)  # type: ignore[assignment]
        return self.cache[typename]


@lru_cache(CACHED_DECODERS)
def _make_decoder(type_name: str, schema: str) -> _Decode | str:
    """Return a function that decodes messages, or why there is none."""
    store = _ReadingStore()
    try:
        types = parse_schema(type_name, schema)
        store.register(types)
        store.get_msgdef(type_name)
    except (FileError, *_SCHEMA_ERRORS) as error:
        return _describe_error(error)
    limit = MAX_LISTED if _has_lists(types) else None

    def decode(data: bytes) -> Any:
        if limit is not None and len(data) > limit:
            raise SerdeError(f"it has {len(data)} byte, {limit} are read at most")
        return store.deserialize_cdr(memoryview(data), type_name)

    return decode


def _count_parts(types: Types, name: str, known: dict[str, int]) -> int:
    """Return of how many messages and texts one of a type is made; too many if it holds itself."""
    if name not in known:
        known[name] = MAX_PARTS + 1
        total = 1
        for _, (kind, content) in types[name][1]:
            inner, length = content if kind in _ARRAYS else ((kind, content), 1)
            # A list takes its length from the message: it is counted once.
            times = length if kind == Nodetype.ARRAY else 1
            if inner[0] == Nodetype.NAME:
                total += times * _count_parts(types, inner[1], known)
            elif inner[1][0] == "string":
                total += times
        known[name] = min(total, MAX_PARTS + 1)
    return known[name]


def _has_lists(types: Types) -> bool:
    return any(
        kind == Nodetype.SEQUENCE
        and (content[0][0] == Nodetype.NAME or content[0][1][0] == "string")
        for _, fields in types.values()
        for _, (kind, content) in fields
    )


_ARRAYS = (Nodetype.ARRAY, Nodetype.SEQUENCE)


def _describe_error(error: BaseException) -> str:
    text = str(error).splitlines()[0] if str(error) else type(error).__name__
    return text if text.isprintable() else repr(text)


Decode = Callable[[RawMessage], Any]
"""Returns a message with its fields as attributes, or as a dict."""
PROTOBUF = "protobuf"


def _make_json_decoder(channel: Channel) -> Decode:
    def decode(message: RawMessage) -> Any:
        try:
            return json.loads(message.data)
        except (ValueError, RecursionError) as error:
            raise FileError(f"a message on {channel.topic} is no JSON: {error}") from None

    return decode


def _make_protobuf_decoder(channel: Channel) -> Decode:
    from mcap_protobuf.decoder import DecoderFactory

    content = channel.schema.encode(errors="surrogateescape")
    schema = Schema(id=1, data=content, encoding=PROTOBUF, name=channel.type_name)
    decode: Any = DecoderFactory().decoder_for(PROTOBUF, schema)
    return lambda message: decode(message.data)


DECODERS: dict[Encoding, Callable[[Channel], Decode]] = {
    ROS: lambda _: decode_message,
    ("json", "jsonschema"): _make_json_decoder,
    ("json", ""): _make_json_decoder,
    (PROTOBUF, PROTOBUF): _make_protobuf_decoder,
}
"""Makers of decoders by encoding."""


INTERFACES = {"impact_rig_msgs": Path(__file__).parents[1] / "interfaces"}
"""Folders with definitions in a package that pip has installed."""
SEPARATOR = "=" * 80
"""Line between two definitions of a `ros2msg` schema; readers look for exactly this."""

_TYPE_NAME = re.compile(r"([A-Za-z]\w*)/(?:msg/)?([A-Za-z]\w*)")


@dataclass(frozen=True)
class MessageDefinition:
    """The definition of a message type, as a recording keeps it."""

    type_name: str  # for example `std_msgs/msg/Header`
    text: str  # schema in the encoding `ros2msg`: the definition, then all it depends on
    type_hash: str = ""  # REP 2016; empty: not known


def find_message_definition(type_name: str) -> MessageDefinition:
    """Assemble the definition of a message type from the packages on `AMENT_PREFIX_PATH`.

    Parameters
    ----------
    type_name : str
        For example `impact_rig_msgs/msg/Impact`.

    Raises
    ------
    FileError
        If the name is no message type, or the type or one it depends on is not installed as
        `.msg`.
    """
    package, name = _split_type_name(type_name)
    full_name, types = f"{package}/msg/{name}", Types()
    text, store = _assemble(package, name, types), Typestore()
    store.register(types)
    return MessageDefinition(full_name, text, store.hash_rihs01(full_name))


def check_interfaces(channel: Channel, installed: MessageDefinition) -> None:
    """Refuse a topic that was recorded with another version of its type than the installed one.

    Raises
    ------
    FileError
        That names the first field that differs, or if a definition cannot be understood.
    """
    name = channel.type_name
    then, now = _list_fields(name, channel.schema), _list_fields(name, installed.text)
    for old, new in zip_longest(then, now, fillvalue="missing"):
        if old != new:
            raise FileError(
                f"{channel.topic} was recorded with another version of {name}: `{old}` in the"
                f" recording is `{new}` here"
            )


def _assemble(package: str, name: str, seen: Types) -> str:
    text, type_name = _read_definition(package, name), f"{package}/msg/{name}"
    parts = [text]
    seen |= (own := _parse_one(text, type_name))
    _, fields = own[type_name]
    inner = (content[0] if kind in _ARRAYS else (kind, content) for _, (kind, content) in fields)
    for other in sorted({_split_type_name(it) for kind, it in inner if kind == Nodetype.NAME}):
        if "/msg/".join(other) not in seen:
            title = f"MSG: {other[0]}/{other[1]}"
            parts.append(f"\n{SEPARATOR}\n{title}\n{_assemble(*other, seen)}")
    return "".join(parts)


@cache  # types share most of what they depend on
def _parse_one(text: str, type_name: str) -> Types:
    return get_types_from_msg(text, type_name)


def _split_type_name(type_name: str) -> tuple[str, str]:
    match = _TYPE_NAME.fullmatch(type_name)
    if match is None:
        raise FileError(f"{type_name!r} is no message type: it should look like pkg/msg/Name")
    return match[1], match[2]


def _read_definition(package: str, name: str) -> str:
    """Return a definition as installed; without ROS that of pip's package or of rosbags."""
    prefixes = [part for part in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if part]
    places = [Path(prefix, "share", package, "msg", f"{name}.msg") for prefix in prefixes]
    places.append(INTERFACES.get(package, Path()) / f"{name}.msg")
    for place in places:
        if place.is_file():
            return place.read_text("utf-8")
    shipped, type_name = get_typestore(Stores.ROS2_JAZZY), f"{package}/msg/{name}"
    if type_name in shipped.fielddefs:
        return shipped.generate_msgdef(type_name, ros_version=2)[0].partition(f"\n{SEPARATOR}")[0]
    raise FileError(
        f"message type {type_name} has no {name}.msg in any of the {len(prefixes)} folders of"
        f" AMENT_PREFIX_PATH: install or source the package {package}"
    )


def _make_store(type_name: str, text: str) -> Typestore:
    store = Typestore()
    try:
        store.register(parse_schema(type_name, text))
    except FileError as error:
        raise FileError(f"a definition of {type_name} cannot be understood: {error}") from None
    return store


def _list_fields(type_name: str, text: str) -> list[str]:
    """Return the fields of a message type and of all it depends on, line by line."""
    definition, _ = _make_store(type_name, text).generate_msgdef(type_name, ros_version=2)
    # Without constants: they are not sent.
    return [line for line in definition.splitlines() if "=" not in line.replace("<=", "")]
