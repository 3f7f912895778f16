"""The running stream of continuous mode, published block by block as the clock says."""

import time
from typing import Any

from impact_rig_msgs.msg import StreamBlock

from impact_rig.core.signals.record import NOT_ARMED, HitLabel
from impact_rig.devices.virtual.block_clock import BlockClock
from impact_rig.devices.virtual.rig import VirtualHit, VirtualRigSettings
from impact_rig.devices.virtual.stream import VirtualStream
from impact_rig.nodes.rig_node import RigNode
from impact_rig.nodes.stream_messages import place_stream_block, stream_block_to_msg

SHORTEST_TURN = 5e-3
"""Least time from one look at the clock to the next [s], our choice: of shorter blocks several are
sent at a time, since each look costs as much as sending a block."""


class RunningStream:
    """Publishes what the digitizer delivers, armed or not, until it is stopped.

    Parameters
    ----------
    node : RigNode
        The accelerometers'.
    publisher : Publisher
        Of `StreamBlock`.
    settings : VirtualRigSettings
        Digitizer and seed are used.
    block_size : int
        Points per block.
    depth : int
        Blocks that the digitizer's buffer holds.

    Attributes
    ----------
    label : HitLabel
        The arming under way.
    sent : int
        Blocks published.
    """

    def __init__(
        self,
        node: RigNode,
        publisher: Any,
        settings: VirtualRigSettings,
        block_size: int,
        depth: int,
    ) -> None:
        digitizer = settings.digitizer
        self.label = NOT_ARMED
        self.sent = 0
        self._node = node
        self._publisher = publisher
        self._digitizer = digitizer
        self._stream = VirtualStream(digitizer, block_size, settings.seed)
        # Most blocks are noise, and ready to be sent: only their place in the stream is new.
        self._noise = [
            stream_block_to_msg(hammer, specimen, digitizer.sampling_rate)
            for hammer, specimen in self._stream.noise
        ]
        self._ending: HitLabel | None = None
        self._period = block_size / digitizer.sampling_rate
        self._start_stamp = node.get_clock().now().nanoseconds
        self._clock = BlockClock(self._period, depth, time.monotonic())
        self._told = (self._clock.find_time(0), 0)
        self._timer = node.create_timer(max(self._period, SHORTEST_TURN), self._send_due)

    @property
    def dropped(self) -> int:
        """Blocks that the buffer has lost."""
        return self._clock.dropped

    def stop(self) -> None:
        """Send no more."""
        self._node.destroy_timer(self._timer)

    def lay(self, hit: VirtualHit, delay: float) -> None:
        """Let a hit's contact be seen `delay` seconds from now."""
        contact = time.monotonic() + delay - self._clock.find_time(0)
        point = round((contact - self._digitizer.pre_trigger) * self._digitizer.sampling_rate)
        unsent = self._clock.next_block * self._stream.block_size
        self._stream.lay(hit, max(point, unsent))

    def end_arming(self) -> None:
        """Let the next block say that it is the last one of the arming under way."""
        self._ending, self.label = self.label, NOT_ARMED

    def describe(self) -> dict[str, Any]:
        """Return the flow since this was asked last, by names for the diagnostics."""
        now, sent = time.monotonic(), self.sent
        before, sent_before = self._told
        self._told = now, sent
        points = (sent - sent_before) * self._stream.block_size
        return {
            "blocks sent": sent,
            "blocks dropped": self._clock.dropped,
            "points per second": round(points / max(now - before, 1e-9)),
            "delay [s]": round(self._clock.delay, 4),
        }

    def _send_due(self) -> None:
        for number in self._clock.fetch(time.monotonic()):
            if self._stream.has_hit(number) and self._stream.is_lost(number):
                continue
            self._publisher.publish(self._make_message(number))
            self.sent += 1

    def _make_message(self, number: int) -> StreamBlock:
        message = self._noise[number % len(self._noise)]
        if self._stream.has_hit(number):
            hammer, specimen = self._stream.read(number)
            message = stream_block_to_msg(hammer, specimen, self._digitizer.sampling_rate)
        begun = self._start_stamp + round(number * self._period * 1e9)
        first_sample = number * self._stream.block_size
        ending, self._ending = self._ending, None
        place_stream_block(
            message, first_sample, begun, ending or self.label, last=ending is not None
        )
        return message
