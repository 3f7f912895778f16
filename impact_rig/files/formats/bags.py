"""Recordings of other ROS nodes (`.mcap`): every number of their messages is a channel."""

from array import array
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.given.errors import FileError
from impact_rig.core.given.records import RawArray
from impact_rig.files.formats.bounds import MEMORY, check_size
from impact_rig.files.measurement import NANOSECONDS, MeasuredChannel, Measurement
from impact_rig.files.times import LARGEST_TIME_ERROR, Clock, find_usual_step, read_clock
from impact_rig.recordings.message_numbers import LONGEST_LIST, find_stamp, list_numbers
from impact_rig.recordings.records import Channel, RawMessage
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.schemas import DECODERS
from impact_rig.recordings.source import is_foreign

LATE_MESSAGES, HALF = 200, 0.5
"""So many messages in a row may be late in a log, and this part of a step is a message that is
missing [-]. Our choice: queues of ROS are shorter."""


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
    topics: dict[int, _TopicNumbers] = {}
    size = 0
    for message in file.read_messages(lambda channel: channel.encoding in DECODERS):
        number = message.channel.id
        if number not in topics:
            topics[number] = _TopicNumbers(path, message.channel)
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


class _TopicNumbers:
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
        self._stamped.append(find_stamp(content))
        size = 0
        for name, value, unit in list_numbers(content):
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
