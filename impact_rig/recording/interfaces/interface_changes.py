"""Recordings of older interfaces: what differs, and their messages in today's form.

The schema is in the file. Where it only lacks fields, the message is decoded by it and filled up
with `ABSENT_FIELDS`, as the analysis of the file does; anything else is named and refused.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from impact_rig.core.errors import FileError
from impact_rig.recording.interfaces.absent_fields import ABSENT_FIELDS
from impact_rig.recording.interfaces.channel import Channel
from impact_rig.recording.interfaces.schema_decoder import SchemaDecoder, parse_schema


@dataclass(frozen=True)
class InterfaceChange:
    """One field that is not the same in a recording and in what is installed.

    Attributes
    ----------
    type_name : str
        Whose field it is, for example `impact_rig_msgs/msg/RigSetup`.
    field : str
        Its name.
    recorded, installed : str
        Its type in the recording and here; empty: it is not there.
    """

    type_name: str
    field: str
    recorded: str
    installed: str

    def __str__(self) -> str:
        """Return the difference in words."""
        what = f"field `{self.field}` of {self.type_name}"
        if not self.recorded:
            return f"{what} is not in the recording"
        if not self.installed:
            return f"{what} is in the recording and unknown here"
        return f"{what} is {self.recorded} in the recording and {self.installed} here"

    @property
    def can_be_filled(self) -> bool:
        """Whether something stands for the field where a recording lacks it."""
        return not self.recorded and self.field in ABSENT_FIELDS.get(self.type_name, {})


def find_interface_changes(
    type_name: str, recorded: str, installed: str
) -> tuple[InterfaceChange, ...]:
    """Return in which fields two definitions of a message type differ.

    Parameters
    ----------
    type_name : str
        For example `impact_rig_msgs/msg/RigSetup`.
    recorded, installed : str
        Schemas in the encoding `ros2msg`, with all they depend on.

    Raises
    ------
    FileError
        If one of them cannot be understood.
    """
    then, now = _read_types(type_name, recorded), _read_types(type_name, installed)
    changes = []
    # A type that only one side has stands behind a field that only this side has.
    for name in (name for name in now if name in then):
        old, new = dict(then[name][1]), dict(now[name][1])
        for field in {**new, **old}:
            kinds = [_describe(fields[field]) if field in fields else "" for fields in (old, new)]
            if kinds[0] != kinds[1]:
                changes.append(InterfaceChange(name, field, *kinds))
    return tuple(changes)


class InterfaceConverter:
    """Turns recorded messages of one topic into those of the installed interfaces.

    Parameters
    ----------
    channel : Channel
        The recorded topic.
    installed : str
        Definition of its type here.

    Attributes
    ----------
    filled : tuple of InterfaceChange
        What the recording lacks and is filled up.

    Raises
    ------
    FileError
        If the definitions differ in more than fields that something stands for.
    """

    def __init__(self, channel: Channel, installed: str) -> None:
        self.filled = find_interface_changes(channel.type_name, channel.schema, installed)
        refused = [change for change in self.filled if not change.can_be_filled]
        if refused:
            raise FileError(
                f"{channel.topic} was recorded with another version of {channel.type_name}:"
                f" {_join(refused)}"
            )
        self._channel = channel
        self._decoder = SchemaDecoder()
        self._store = Typestore()
        self._store.register(_read_types(channel.type_name, installed))

    def __str__(self) -> str:
        """Return in words what is filled up."""
        filled = ", ".join(
            f"{change.type_name.rpartition('/')[2]}.{change.field} ="
            f" {ABSENT_FIELDS[change.type_name][change.field]!r}"
            for change in self.filled
        )
        return (
            f"{self._channel.topic} was recorded with another version of"
            f" {self._channel.type_name}"
            + (f", which lacks fields; they are filled up: {filled}" if filled else "")
        )

    def convert(self, data: bytes) -> bytes:
        """Return a recorded message in today's form.

        Raises
        ------
        FileError
            If the message does not fit its schema.
        """
        name = self._channel.type_name
        message = self._fill(name, self._decoder.decode(self._channel, data))
        return bytes(self._store.serialize_cdr(message, name))

    def _fill(self, type_name: str, message: Any) -> Any:
        """Return a decoded message, or a part of one, with today's fields."""
        values = {}
        for field, kind in self._store.fielddefs[type_name][1]:
            if hasattr(message, field):
                values[field] = self._fill_value(kind, getattr(message, field))
            else:
                values[field] = self._make_value(kind, ABSENT_FIELDS[type_name][field])
        return self._store.types[type_name](**values)

    def _make_value(self, kind: Any, value: Any) -> Any:
        """Return what stands for an absent field as the store serialises it."""
        node, detail = kind
        if node == Nodetype.NAME:
            return self._store.types[detail](**value)
        return np.asarray(value) if isinstance(value, tuple) else value

    def _fill_value(self, kind: Any, value: Any) -> Any:
        node, detail = kind
        if node == Nodetype.NAME:
            return self._fill(detail, value)
        if node in (Nodetype.ARRAY, Nodetype.SEQUENCE) and detail[0][0] == Nodetype.NAME:
            return [self._fill(detail[0][1], item) for item in value]
        return value


def _read_types(type_name: str, text: str) -> Any:
    """Return constants and fields of a message type and of all it depends on, by their names."""
    try:
        return parse_schema(type_name, text)
    except FileError as error:
        raise FileError(f"a definition of {type_name} cannot be understood: {error}") from None


def _describe(kind: Any) -> str:
    """Return a field's type as a `.msg` file says it."""
    node, detail = kind
    if node == Nodetype.BASE:
        name, limit = detail
        return f"{name}<={limit}" if limit else str(name)
    if node == Nodetype.NAME:
        return str(detail)
    item, length = detail
    bound = f"<={length}" if node == Nodetype.SEQUENCE and length else length or ""
    return f"{_describe(item)}[{bound}]"


def _join(changes: Sequence[InterfaceChange]) -> str:
    return "; ".join(map(str, changes))
