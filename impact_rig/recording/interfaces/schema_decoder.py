"""Decodes CDR messages by the schemas that stand beside them in a recording.

A schema is code that somebody else wrote: what it can ask for is limited.
"""

import struct
from collections.abc import Callable
from functools import lru_cache
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import TypesysError, get_types_from_msg
from rosbags.typesys.store import Typestore

from impact_rig.core.errors import FileError
from impact_rig.recording.interfaces.channel import Channel

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
"""What rosbags raises on schemas that make no sense, beside its own error."""
_MESSAGE_ERRORS = (
    SerdeError, LookupError, AssertionError, struct.error, ValueError, OverflowError,
    MemoryError, RecursionError,
)  # fmt: skip
"""What it raises on messages that do not fit."""


class SchemaDecoder:
    """Keeps one decoder for each channel it has met.

    Every schema has a store of types of its own, so that a file whose topics were recorded with
    different versions of a type is decoded right.
    """

    def __init__(self) -> None:
        self._decoders: dict[tuple[str, str], _Decode] = {}

    def decode(self, channel: Channel, data: bytes) -> Any:
        """Return a message as an object with its fields as attributes.

        Parameters
        ----------
        channel : Channel
            Whose schema describes the message.
        data : bytes
            The serialised message.

        Raises
        ------
        FileError
            If the schema cannot be understood or the message does not fit it.
        """
        key = (channel.type_name, channel.schema)
        decode = self._decoders.get(key)
        if decode is None:
            made = _make_decoder(*key)
            if isinstance(made, str):
                raise FileError(
                    f"the schema of {channel.type_name} on {channel.topic} cannot be understood:"
                    f" {made}"
                )
            decode = self._decoders[key] = made
        try:
            return decode(data)
        except _MESSAGE_ERRORS as error:
            raise FileError(
                f"a message on {channel.topic} does not fit its schema: {_describe(error)}"
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
        raise FileError(_describe(error)) from None
    if parts > MAX_PARTS:
        raise FileError(f"a message has more than {MAX_PARTS} parts")
    return types


@lru_cache(CACHED_DECODERS)
def _make_decoder(type_name: str, schema: str) -> _Decode | str:
    """Return a function that decodes messages, or why there is none."""
    store = Typestore()
    try:
        types = parse_schema(type_name, schema)
        store.register(types)
        store.get_msgdef(type_name)
    except FileError as error:
        return str(error)
    except _SCHEMA_ERRORS as error:
        return _describe(error)
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


def _describe(error: BaseException) -> str:
    text = str(error).splitlines()[0] if str(error) else type(error).__name__
    return text if text.isprintable() else repr(text)
