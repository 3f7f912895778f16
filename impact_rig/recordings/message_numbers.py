"""The numbers in a message of any ROS node, by the names that files and rig files use."""

from array import array
from collections.abc import Callable, Iterator, Mapping
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.given.errors import ParameterError
from impact_rig.recordings.fields import NANOSECONDS

LONGEST_LIST = 36
"""Longest array whose numbers are channels side by side [-]: the largest matrix of ROS's own
messages, a covariance of 6 x 6. A longer one holds points that follow each other."""
LARGEST_WHOLE = 2**53
"""Largest whole number up to which float64 is exact."""
UNITS = {
    ("sensor_msgs/msg/Imu", "linear_acceleration"): "m/s^2",
    ("sensor_msgs/msg/Imu", "angular_velocity"): "rad/s",
    ("geometry_msgs/msg/Accel", "linear"): "m/s^2",
    ("geometry_msgs/msg/Accel", "angular"): "rad/s^2",
    ("geometry_msgs/msg/Wrench", "force"): "N",
    ("geometry_msgs/msg/Wrench", "torque"): "Nm",
}
"""Units that the definitions of ROS's own messages state, by type and field (REP 103)."""
STAMPS = ("stamp", "timestamp")
"""Fields that hold when a message was taken."""
SECONDS, PARTS = ("sec", "seconds"), ("nanosec", "nsec", "nanos")
"""Fields of a time in messages of ROS, Foxglove and Google."""


def list_numbers(
    message: Any, place: str = "", unit: str = ""
) -> Iterator[tuple[str, NDArray[Any], str]]:
    """Yield name, value and unit of all numbers and arrays of numbers in a message.

    Texts, switches, bytes (of pictures), times and lists of messages are no channels.
    """
    kind = _get_type_name(message)
    for field, value in _get_fields(message).items():
        name, stated = place + field, UNITS.get((kind, field), unit)
        if _get_fields(value):
            if field != "header" and _read_time(value) is None:
                yield from list_numbers(value, f"{name}.", stated)
            continue
        numbers = _make_array(value)
        if numbers is None:
            continue
        columns = _split_layout(message, numbers) if kind.endswith("MultiArray") else [numbers]
        for number, column in enumerate(columns):
            yield name + (f"[{number}]" if len(columns) > 1 else ""), column, stated


def make_reader(message: Any, name: str) -> tuple[Callable[[Any], NDArray[Any]], str]:
    """Return a function that reads a number out of messages like this one, and its unit by ROS.

    Parameters
    ----------
    name : str
        ``linear_acceleration.x``, or ``data[3]`` of a short array; ``data`` of a long one, and
        ``data[1]`` of one with a layout of two axes, are points that follow each other.

    Raises
    ------
    ParameterError
        If these messages have no such number.
    """
    known: dict[str, tuple[bool, str]] = {}
    for field, values, unit in list_numbers(message):
        is_list = values.ndim > 0 and values.size <= LONGEST_LIST
        places = [f"{field}[{index}]" for index in range(values.size)] if is_list else [field]
        known |= dict.fromkeys(places, (is_list, unit))
    if name not in known:
        there = ", ".join(known) or "none"
        raise ParameterError(f"{_get_type_name(message)} has no number {name!r}: it has {there}")
    is_list, unit = known[name]
    path, _, index = name.rstrip("]").partition("[")
    owner, place = path.rpartition(".")[0], int(index or 0)

    def read(message: Any) -> NDArray[Any]:
        values = np.atleast_1d(np.asarray(attrgetter(path)(message), np.float64))
        if is_list:
            return values[place : place + 1]
        if not index:
            return values
        return _split_layout(attrgetter(owner)(message) if owner else message, values)[place]

    return read, unit


def _get_type_name(message: Any) -> str:
    """Return the type of a message, as ROS writes it; empty: it is not of ROS."""
    if hasattr(message, "get_fields_and_field_types"):  # of rclpy
        return f"{type(message).__module__.partition('.')[0]}/msg/{type(message).__name__}"
    return str(getattr(message, "__msgtype__", ""))


def _make_array(value: Any) -> NDArray[Any] | None:
    """Return numbers as an array of at most one axis; None: the value is something else."""
    if isinstance(value, (str, bytes, bool)):
        return None
    try:
        array_ = np.asarray(
            value if isinstance(value, (np.ndarray, array, int, float)) else list(value)
        )
    except (TypeError, ValueError, OverflowError):
        return None
    is_number = array_.dtype.kind in "iuf" and array_.ndim <= 1
    is_bytes = array_.dtype.itemsize == 1 and array_.ndim == 1
    if not is_number or is_bytes:
        return None
    if array_.dtype.kind in "iu" and np.abs(array_).max(initial=0) > LARGEST_WHOLE:
        return None  # a clock or an id
    return array_


def _split_layout(message: Any, numbers: NDArray[Any]) -> list[NDArray[Any]]:
    """Return the columns of an array of `std_msgs` with two axes, of which the longest is time."""
    sizes = [dimension.size for dimension in message.layout.dim]
    if len(sizes) != 2 or np.prod(sizes) != numbers.size or max(sizes) <= LONGEST_LIST:  # noqa: PLR2004
        return [numbers]
    table = numbers.reshape(sizes)
    return list(table if sizes[0] < sizes[1] else table.T)


def find_stamp(message: Any) -> int:
    """Return when a message was taken, as it states [ns]; 0: it does not."""
    fields = _get_fields(message)
    fields = _get_fields(fields.get("header")) or fields
    return next((_read_time(fields[name]) or 0 for name in STAMPS if name in fields), 0)


def _read_time(value: Any) -> int | None:
    """Return a time in seconds and nanoseconds [ns]; None: the value is something else."""
    numbers = list(_get_fields(value).items())
    if len(numbers) != 2 or numbers[0][0] not in SECONDS or numbers[1][0] not in PARTS:  # noqa: PLR2004
        return None
    return int(numbers[0][1]) * NANOSECONDS + int(numbers[1][1])


def _get_fields(value: Any) -> Mapping[str, Any]:
    """Return the fields of a message by their names; empty: the value is none."""
    if isinstance(value, (dict, float, np.ndarray)):  # most are numbers
        return value if isinstance(value, dict) else {}
    if hasattr(value, "get_fields_and_field_types"):  # of rclpy
        return {name: getattr(value, name) for name in value.get_fields_and_field_types()}
    if hasattr(value, "__msgtype__"):
        return {name: inner for name, inner in vars(value).items() if name != "__msgtype__"}
    if hasattr(value, "DESCRIPTOR"):  # of protobuf, where a message may hold one of its own type
        return {
            field.name: getattr(value, field.name)
            for field in value.DESCRIPTOR.fields
            if not field.has_presence or value.HasField(field.name)
        }
    return {}
