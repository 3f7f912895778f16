"""Recordings of other ROS nodes (`.mcap`): every number of their messages is a channel."""

from array import array
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.errors import FileError
from impact_rig.core.records import RawArray
from impact_rig.files.formats.bounds import MEMORY, check_size
from impact_rig.files.measurement import NANOSECONDS, MeasuredChannel, Measurement
from impact_rig.files.times import LARGEST_TIME_ERROR, Clock, find_usual_step, read_clock
from impact_rig.recordings.encodings import DECODERS
from impact_rig.recordings.records import Channel, RawMessage
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.source import is_foreign

LONGEST_LIST = 36
"""Longest array whose numbers are channels side by side [-]: the largest matrix of ROS's own
messages, a covariance of 6 x 6. A longer one holds points that follow each other."""
LATE_MESSAGES, HALF = 200, 0.5
"""So many messages in a row may be late in a log, and this part of a step is a message that is
missing [-]. Our choice: queues of ROS are shorter."""
LARGEST_WHOLE = 2**53
"""Of whole numbers that float64 keeps exactly."""
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
"""Of a time in messages of ROS, Foxglove and Google."""


def read_bag(path: Path) -> Measurement:
    """Read the messages of other nodes.

    A channel is `topic.field`, or `topic.field[index]` for a short array whose numbers are side by
    side. Its times are the stamps of the headers; where there is none, those of the log. The
    numbers of a long array are points that follow each other, from its message's stamp to the
    next. What never changes is left out, as covariances are, if something else changes.

    Raises
    ------
    FileError
        If the file is damaged, a rig's own, or no message in it holds a number that can be read.
    """
    file = Scan(path, encodings=DECODERS)
    if not is_foreign(file):
        raise FileError(
            f"{path} is a recording of a rig, with set-up and hits: `impact-rig analyze` takes it"
        )
    topics: dict[int, _Topic] = {}
    size = 0
    for message in file.read_messages(lambda channel: channel.encoding in DECODERS):
        number = message.channel.id
        if number not in topics:
            topics[number] = _Topic(path, message.channel)
        size += topics[number].add(message)
        if 2 * size > MEMORY:  # they are copied once
            check_size(path, 2 * size)
    first = min((int(topic.choose_stamps().min()) for topic in topics.values()), default=0)
    channels: list[MeasuredChannel] = []
    for number in list(topics):
        channels += topics.pop(number).make_channels(first)
    if not channels:
        held = {f"{it.topic} ({it.type_name}, {it.encoding[0]})" for it in file.read_channels()}
        raise FileError(
            f"{path} holds no message with a number that can be read: it holds"
            f" {', '.join(sorted(held))}"
        )
    changing = [channel for channel in channels if np.ptp(channel.values) != 0.0]
    remarks = tuple(
        f"topic {it.topic} is in {it.encoding[0]!r}, which is not read: it is left out"
        for it in file.read_channels()
        if it.encoding not in DECODERS
    )
    return Measurement(path, tuple(changing or channels), remarks=remarks)


class _Topic:
    """The numbers of one topic's messages, field by field."""

    def __init__(self, path: Path, channel: Channel) -> None:
        self._path, self._name = path, channel.topic
        self._decode = DECODERS[channel.encoding](channel)
        self._logged = array("q")  # log times [ns]
        self._stamped = array("q")  # header stamps [ns]; 0: there is none
        self._fields: dict[str, _Field] = {}

    def add(self, message: RawMessage) -> int:
        """Take a message; return how many bytes its numbers have."""
        try:
            content = self._decode(message)
        except FileError as error:  # it knows the topic
            raise FileError(f"{self._path}: {error}") from None
        self._logged.append(message.log_time)
        self._stamped.append(_find_stamp(content))
        size = 0
        for name, value, unit in _list_numbers(content):
            if name not in self._fields:
                self._fields[name] = _Field(unit, is_array=value.ndim > 0)
            self._fields[name].add(value)
            size += 8 * value.size
        return size

    def choose_stamps(self) -> NDArray[np.int64]:
        """Return when the messages were taken [ns], or logged where one states no time."""
        return np.array(self._stamped if all(self._stamped) else self._logged, dtype=np.int64)

    def make_channels(self, first: int) -> Iterator[MeasuredChannel]:
        """Yield a channel for each number that every message has.

        Parameters
        ----------
        first : int
            When the channels' time is 0 [ns].
        """
        stamps = self.choose_stamps()
        order = np.argsort(stamps, kind="stable")
        start = int(stamps[order[0]])
        seconds = (stamps[order] - start) / NANOSECONDS
        for name, field in self._fields.items():
            if len(field.sizes) != stamps.size:
                continue
            sizes = np.asarray(field.sizes)[order]
            for place, values in field.split(order):
                points = sizes if field.is_run else np.ones_like(sizes)
                clock = self._read_clock(seconds, points)
                yield MeasuredChannel(
                    f"{self._name}.{name}{place}",
                    values,
                    clock.rate,
                    field.unit,
                    start=(start - first) / NANOSECONDS,
                    recorded_at=first,
                    time_flaw=clock.flaw,
                    has_gap=clock.has_gap,
                )

    def _read_clock(self, seconds: NDArray[np.float64], points: NDArray[Any]) -> Clock:
        """Return the rate of points [Hz] by the times of messages, or why it is not sound."""
        if seconds.size == 1 or np.ptp(points):
            return Clock()
        times = seconds / points[0]
        clock = read_clock(self._path, "time", times, "s")
        step = find_usual_step(times)
        is_log = not all(self._stamped)
        is_late = is_log and clock.flaw and step > 0 and not _misses_messages(times, step)
        # The points of a message are taken for even, so its time must be as even as theirs.
        error = np.abs(seconds - np.linspace(0.0, seconds[-1], seconds.size)).max()
        if is_late or (not clock.flaw and error > LARGEST_TIME_ERROR * step):
            steps = np.diff(seconds)
            flaw = (
                f"{self._path}: messages come {steps.min():.3g} to {steps.max():.3g} s after each"
                f" other. If their points are evenly spaced, give --rate, about {1 / step:.4g} Hz"
            )
            clock = Clock(1.0 / step, "s", flaw)
        whose = "the log" if is_log else "their headers"
        told = f"{clock.flaw} (messages on {self._name}, by the times of {whose})"
        return replace(clock, flaw=told) if clock.flaw else clock


def _misses_messages(times: NDArray[np.float64], step: float) -> bool:
    """Return whether messages are missing from a log: all after a place are late, without end.

    Messages that were only late are followed by some that were not.
    """
    late = times / step - np.arange(times.size)
    length = min(LATE_MESSAGES, times.size // 2)
    least = np.lib.stride_tricks.sliding_window_view(late, length).min(axis=1)
    return bool(np.abs(least[length:] - least[:-length]).max(initial=0.0) >= HALF)


class _Field:
    """The numbers of one field of all messages, one after the other."""

    def __init__(self, unit: str, *, is_array: bool) -> None:
        self.unit = unit
        self.is_array = is_array
        self.sizes = array("q")  # how many each message has
        self._numbers = array("d")

    def add(self, value: NDArray[Any]) -> None:
        self.sizes.append(value.size)
        self._numbers.frombytes(value.astype(np.float64).tobytes())

    @property
    def is_run(self) -> bool:
        """Whether the numbers of a message follow each other in time."""
        return max(self.sizes) > LONGEST_LIST

    def split(self, order: NDArray[np.intp]) -> Iterator[tuple[str, RawArray]]:
        """Yield each channel with its index, its points in the order of the messages."""
        numbers, sizes = np.asarray(self._numbers), np.asarray(self.sizes)
        begins = np.cumsum(sizes) - sizes
        if not self.is_run:
            for index in range(sizes.min()):
                yield f"[{index}]" if self.is_array else "", numbers[begins[order] + index]
        elif np.all(np.diff(order) == 1):
            yield "", numbers
        else:
            pieces = [numbers[begins[of] : begins[of] + sizes[of]] for of in order]
            yield "", np.concatenate(pieces)


def _list_numbers(
    message: Any, place: str = "", unit: str = ""
) -> Iterator[tuple[str, NDArray[Any], str]]:
    """Yield name, value and unit of all numbers and arrays of numbers in a message.

    Texts, switches, bytes (of pictures), times and lists of messages are no channels.
    """
    kind = getattr(message, "__msgtype__", "")
    for field, value in _get_fields(message).items():
        name, stated = place + field, UNITS.get((kind, field), unit)
        if _get_fields(value):
            if field != "header" and _read_time(value) is None:
                yield from _list_numbers(value, f"{name}.", stated)
            continue
        numbers = _make_array(value)
        if numbers is None:
            continue
        columns = _split_layout(message, numbers) if kind.endswith("MultiArray") else [numbers]
        for number, column in enumerate(columns):
            yield name + (f"[{number}]" if len(columns) > 1 else ""), column, stated


def _make_array(value: Any) -> NDArray[Any] | None:
    """Return numbers as an array of at most one axis; None: the value is something else."""
    if isinstance(value, (str, bytes, bool)):
        return None
    try:
        array_ = np.asarray(value if isinstance(value, (np.ndarray, int, float)) else list(value))
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


def _find_stamp(message: Any) -> int:
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
    if hasattr(value, "__msgtype__"):
        return {name: inner for name, inner in vars(value).items() if name != "__msgtype__"}
    if hasattr(value, "DESCRIPTOR"):  # of protobuf, where a message may hold one of its own type
        return {
            field.name: getattr(value, field.name)
            for field in value.DESCRIPTOR.fields
            if not field.has_presence or value.HasField(field.name)
        }
    return {}
