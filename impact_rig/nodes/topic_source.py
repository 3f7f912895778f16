"""Any node that publishes samples as the rig's accelerometer: the driver `topic`."""

import math
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from itertools import starmap
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.core.given.errors import DeviceError, ParameterError, RigError
from impact_rig.core.given.sensors import VOLTAGES, compute_scale, normalize_unit
from impact_rig.devices.message_clock import STAMP_ERROR, MessageClock
from impact_rig.devices.protocols import AcquisitionPlan, ChannelScale, FoundDevice, SourceChannel
from impact_rig.devices.streaming import StreamedSource
from impact_rig.nodes.listener import DISCOVERY_TIME, Listener
from impact_rig.recordings.message_numbers import find_stamp, make_reader

BLOCK_TIME = 0.01
"""Duration of points that are passed on together [s], our choice: a message often has one."""


@dataclass(eq=False)
class _Input:
    """A topic, and what is read out of its messages."""

    topic: str
    # The channels, by the names of their numbers.
    channels: dict[str, SourceChannel] = field(default_factory=dict)
    # By the first message: what reads each channel's points, and what they mean.
    readers: list[Callable[[Any], NDArray[Any]]] = field(default_factory=list)
    scales: list[ChannelScale] = field(default_factory=list)
    sequence: int | None = None  # of the newest message, as its publisher counts
    # Without a partner yet: time of the first point [ns], messages lost before, points by channel.
    waiting: deque[tuple[int, int, list[NDArray[Any]]]] = field(default_factory=deque)

    def learn(self, message: Any) -> None:
        """Find the channels in a message; raises `ParameterError` if they or units are missing."""
        for name, channel in self.channels.items():
            with channel.options.locating("channel"):
                read, unit = make_reader(message, name)
            self.readers.append(read)
            self.scales.append(_make_scale(channel, unit))

    def read(self, message: Any) -> list[NDArray[Any]]:
        """Return the points of each channel; raises `DeviceError` if there are none."""
        try:
            points = [read(message) for read in self.readers]
        except (AttributeError, IndexError, TypeError, ValueError):
            raise DeviceError(
                f"a message on {self.topic} has other fields than the first"
            ) from None
        if len({values.size for values in points} | {0}) != 2:  # noqa: PLR2004 - 0 and another
            sizes = " and ".join(str(values.size) for values in points)
            raise DeviceError(f"a message on {self.topic} holds {sizes} points")
        return points

    def count_lost(self, sequence: int | None) -> int:
        """Return how many messages are missing before one that its publisher has numbered."""
        before, self.sequence = self.sequence, sequence
        if sequence is None or before is None:
            return 0
        if sequence <= before:
            raise DeviceError(f"the node that publishes on {self.topic} was restarted")
        return sequence - before - 1


class TopicSource(StreamedSource):
    """Takes samples out of other nodes' messages, and cuts the hits out of them.

    The samples of a message are taken at its stamp, and evenly from there to the next. Messages of
    two topics belong together when their stamps agree.
    """

    description: ClassVar[str] = "another node: sensor_msgs/Imu, geometry_msgs/Wrench, arrays …"
    example: ClassVar[str] = """\
[source]
driver = "topic"
sampling_rate = "4 kHz"      # as the stamps say
record_duration = "50 ms"
trigger_level = "5 m/s^2"
# ignore_stamps = true       # there are none, or uneven ones: points come evenly, at this rate
# simulated = true           # the other node computes its numbers

[source.hammer]
channel = "/hammer/accel.accel.linear.x"        # topic.field, topic.field[index], as of files

[source.specimen]
channel = "/body/samples.data[0]"               # the same topic, or one with the same stamps
unit = "m/s^2"               # or g, N, V …: where the type of the message does not say it
"""

    patience: ClassVar[float] = DISCOVERY_TIME  # [s], in which other nodes are looked for

    def __init__(self, options: TomlTable) -> None:
        super().__init__()
        options.check_keys("ignore_stamps", "simulated")
        self._is_stamped = not options.take_boolean("ignore_stamps")
        self.is_simulated = options.take_boolean("simulated")
        self._inputs: list[_Input] = []
        self._message_clock = MessageClock(1.0, is_stamped=self._is_stamped)
        # Points that wait to be enough for a block, and how many are missing before them.
        self._points: list[NDArray[Any]] = []
        self._lost = 0
        self._listener: Listener | None = None
        self._fault: RigError | None = None  # what is wrong with the messages

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return the topics of other nodes that may hold samples."""
        with closing(Listener()) as listener:
            time.sleep(cls.patience)
            found = listener.list_topics()
        return tuple(starmap(FoundDevice, found.items()))

    def open_device(self, plan: AcquisitionPlan) -> None:
        """Listen, and learn from the first messages what they hold and how fast they come.

        Raises
        ------
        DeviceError
            If not just one node publishes on a topic, or its messages do not come or are wrong.
        ParameterError
            If the messages have no such number, or its unit is not known.
        """
        self._inputs = _make_inputs(plan.channels)
        if len(self._inputs) > 1 and not self._is_stamped:
            raise ParameterError(
                "ignore_stamps is true, and the channels are on two topics: only stamps tell which"
                " messages belong together; publish both in one message"
            )
        self.name = "topic " + ", ".join(item.topic for item in self._inputs)
        self.sampling_rate, self._fault = plan.sampling_rate, None
        self._points, self._lost = [], 0
        self._message_clock = MessageClock(plan.sampling_rate, is_stamped=self._is_stamped)
        self._listener = Listener(patience=self.patience)
        for item in self._inputs:
            self._listener.subscribe(item.topic, partial(self._take_message, item))
        with self.changed:
            self._last_time = time.monotonic()  # only now a message may be late
            while not self.count and self._fault is None:
                self._wait(time.monotonic() + self.longest_silence)
            if self._fault is not None:
                raise self._fault

    def close(self) -> None:
        """Listen no more."""
        listener, self._listener = self._listener, None
        if listener is not None:
            listener.close()

    # Called in the listener's thread.

    def _take_message(self, item: _Input, message: Any, info: Mapping[str, Any]) -> None:
        """Read a message, and take what has its partner of the other topic."""
        try:
            if not item.readers:
                item.learn(message)
                self.scales = tuple(scale for each in self._inputs for scale in each.scales)
            stamp = find_stamp(message) if self._is_stamped else int(info["source_timestamp"])
            if not stamp:
                raise ParameterError(
                    f"the messages on {item.topic} have no stamp: write ignore_stamps = true, if"
                    " their points are even; then sampling_rate alone counts"
                )
            lost = item.count_lost(info.get("publication_sequence_number"))
            item.waiting.append((stamp, lost, item.read(message)))
            self._take_partners()
        except RigError as error:
            # Messages of several nodes look like all sorts of faults.
            count = self._listener.count_publishers(item.topic) if self._listener else 1
            several = DeviceError(f"{count} nodes publish on {item.topic}: one must")
            with self.changed:  # the first is the cause of those that follow
                self._fault = self._fault or (several if count > 1 else error)
            self.end(str(self._fault))

    def _take_partners(self) -> None:
        """Take messages of all topics whose stamps agree."""
        queues = [item.waiting for item in self._inputs]
        error = STAMP_ERROR * 1e9 / self.sampling_rate
        while all(queues):
            first = min(queues, key=lambda queue: queue[0][0])
            if max(queue[0][0] for queue in queues) - first[0][0] > error:
                first.popleft()  # its partner is lost, which the next stamps tell
                continue
            heads = [queue.popleft() for queue in queues]
            stamp, lost, _ = heads[0]
            values = [column for _, _, points in heads for column in points]
            size = values[0].size
            if any(column.size != size for column in values):
                raise DeviceError(
                    f"{self.name}: messages of one stamp hold different numbers of points"
                )
            is_known = self._message_clock.is_known
            lost_points = self._message_clock.take(stamp, size, lost)
            self._last_time = time.monotonic()
            if is_known:
                self._collect(np.column_stack(values), lost_points)

    def _collect(self, points: NDArray[Any], lost: int) -> None:
        """Take points, shape (n, channels), with those before them once there are enough."""
        if lost:
            self._pass_on()
            self._lost = lost
        self._points.append(points)
        if sum(map(len, self._points)) >= BLOCK_TIME * self.sampling_rate:
            self._pass_on()

    def _pass_on(self) -> None:
        points, lost = self._points, self._lost
        self._points, self._lost = [], 0
        if points:
            block = np.concatenate(points)
            duration = round(len(block) / self.sampling_rate * 1e9)
            self.take(block, time.time_ns() - duration, lost)


def _make_inputs(channels: Sequence[SourceChannel]) -> list[_Input]:
    """Return the topics of some channels, the hammer's first."""
    inputs: dict[str, _Input] = {}
    for channel in channels:
        channel.options.check_keys("unit")
        topic, _, name = channel.name.partition(".")
        if not topic.startswith("/") or not name:
            raise channel.options.make_error(
                "channel",
                f"channel of {channel.options.place} is {channel.name!r}: it must be a whole topic"
                " and a number in its messages, as in /accel.accel.linear.x",
            )
        inputs.setdefault(topic, _Input(topic)).channels[name] = channel
    return list(inputs.values())


def _make_scale(channel: SourceChannel, stated: str) -> ChannelScale:
    """Return the scale of numbers in a unit; for volts, by the sensor."""
    options = channel.options
    unit = normalize_unit(options.take_text("unit", stated, "m/s^2"))
    if not unit:
        raise options.make_error(
            "unit",
            f"{options.place} has no unit, and the messages state none: give one, for example"
            ' unit = "m/s^2"',
        )
    with options.locating("unit"):
        if unit in VOLTAGES:
            scale = VOLTAGES[unit] * channel.compute_scale()
        else:
            scale = compute_scale(unit, channel.moving_mass)
    full_scale = channel.sensor.compute_full_scale(channel.moving_mass)
    return ChannelScale(scale, full_scale, full_scale / abs(scale) if full_scale else math.inf)
