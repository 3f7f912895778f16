"""Conversion of one field of a message after the other, its times and ids; no array is loaded.

Only attributes are read and set, of messages of rclpy or of a file reader.
"""

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from enum import IntEnum
from functools import cache
from typing import Any, TypeVar, get_args, get_origin

from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.quantity import CODES, list_fields, read_code

_T = TypeVar("_T")

NANOSECONDS = 1_000_000_000
NO_ID = bytes(16)
"""Id of no campaign."""
RENAMED = {"BudgetLine": "UncertaintyContribution"}
"""Records in lists whose messages have other names."""
PLAIN = (float, int, str, bool)
"""Kinds of values that messages have too."""
MessageMaker = Callable[[str], Any]
"""Returns a message of the rig, by the name of its type."""
NO_LISTS: MessageMaker = dict[str, Any]().__getitem__
"""Maker for records without lists of records."""


def stamp_from_msg(stamp: Any) -> int:
    """Return a `builtin_interfaces/Time` as nanoseconds since the epoch."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def fill_message(message: Any, record: Any, make: MessageMaker = NO_LISTS) -> Any:
    """Put a record into a message, which may have more fields, and return the message.

    Parameters
    ----------
    message : object
        With the record's fields as attributes.
    make : callable
        Makes the messages of the records in its lists.
    """
    for field in list_fields(type(record)):
        value = getattr(record, field.name)
        if field.description.is_inline:
            fill_message(message, value, make)
        elif _is_record(field.hint):
            fill_message(getattr(message, field.name), value, make)
        else:
            setattr(message, field.name, _value_to_message(field.hint, value, make))
    return message


def _value_to_message(hint: Any, value: Any, make: MessageMaker) -> Any:
    if hint in PLAIN:
        return hint(value)
    if kind := _find_kind_of_items(hint):
        return [_value_to_message(kind, item, make) for item in value]
    if hint in CODES:
        return value.value
    if _is_record(hint):
        name = type(value).__name__
        return fill_message(make(RENAMED.get(name, name)), value, make)
    return hint(value)


_is_record = cache(is_dataclass)  # which a message asks of each of its fields


@cache
def _find_kind_of_items(hint: Any) -> Any:
    """Return the type of a tuple's items; None: it is no tuple."""
    return get_args(hint)[0] if get_origin(hint) is tuple else None


def from_message(kind: type[_T], message: Any, **known: Any) -> _T:
    """Return the record that a message holds, from any decoder.

    Parameters
    ----------
    known : dict
        Fields that are not in the message as the record has them.

    Raises
    ------
    RigError
        If a value cannot be meant.
    """
    record = kind(
        **{
            field.name: from_message(field.hint, message)
            if field.description.is_inline
            else _value_from_message(field.hint, getattr(message, field.name))
            for field in list_fields(kind)
            # What an older recording lacks has the default that says so.
            if field.name not in known
            and (hasattr(message, field.name) or field.name not in _list_unrecorded(kind))
        },
        **known,
    )
    check_numbers(record)
    return record


def _find_unrecorded(kind: Any) -> frozenset[str]:
    """Return the fields whose default means "not recorded": empty, 0 or NaN."""
    return frozenset(
        item.name
        for item in fields(kind)
        if item.default in ("", (), 0.0) or item.default != item.default
    )


_list_unrecorded: Callable[[Any], frozenset[str]] = cache(_find_unrecorded)


def check_numbers(record: Any) -> None:
    """Raise `ParameterError` that names the first number of a record that cannot be meant."""
    for field in list_fields(type(record)):
        problem = field.description.explain(getattr(record, field.name))
        if problem is not None:
            raise ParameterError(f"{field.name} {problem}")


def _value_from_message(hint: Any, value: Any) -> Any:
    if hint in PLAIN:
        return hint(value)
    if kind := _find_kind_of_items(hint):
        return tuple(_value_from_message(kind, item) for item in value)
    if hint in CODES:
        return read_code(hint, value)
    return hint(value) if issubclass(hint, IntEnum) else from_message(hint, value)


def set_stamp(message: Any, nanoseconds: int) -> None:
    """Stamp a message with nanoseconds since the epoch."""
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(nanoseconds, NANOSECONDS)
