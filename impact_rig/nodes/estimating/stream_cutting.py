"""Impacts of a running stream, published as if a trigger had cut them out; flow and loss told."""

import math
import time
from typing import Any

from impact_rig_msgs.msg import StreamBlock

from impact_rig.core.errors import RigError
from impact_rig.core.setup.settings import AnalysisSettings
from impact_rig.core.signals.stream_cutter import StreamCutter, StreamFlow
from impact_rig.nodes import interfaces
from impact_rig.nodes.messages import block_to_msg
from impact_rig.nodes.rig_node import DIAGNOSTIC_PERIOD, RigNode
from impact_rig.recording.interfaces.messages import stream_block_from_msg

WARNING_TIME = 10 * DIAGNOSTIC_PERIOD
"""How long a loss is warned of [s], our choice: long enough to be seen."""
STANDSTILL = 2.0
"""How much later than due the next block may come before it is warned of [s], our choice: longer
than a computer does something else that holds the rate."""


class StreamCutting:
    """Cuts impacts out of `StreamBlock` messages, and publishes them as `AccelerationBlock`.

    The stream is fed in one thread; settings and questions come from any.

    The publisher is made when the first block comes: where there is no stream, the accelerometers
    publish the impacts.

    Parameters
    ----------
    node : RigNode
        The estimator.
    """

    def __init__(self, node: RigNode) -> None:
        self._node = node
        self._settings: AnalysisSettings | None = None
        self._used: AnalysisSettings | None = None
        self._cutter: StreamCutter | None = None
        self._publisher: Any = None
        self._told = (time.monotonic(), 0)
        self._missing = 0
        self._problem = ""
        self._lost = 0
        self._lost_at = 0.0
        self._due = math.inf

    def use_settings(self, settings: AnalysisSettings) -> None:
        """Cut by other settings from the next block on, if they are others."""
        self._settings = settings

    def feed(self, message: StreamBlock) -> None:
        """Take the next block of the stream, and publish the impact that it completes.

        Raises
        ------
        RigError
            If the stream cannot be searched; not again for the same reason, since the next block
            comes at once.
        """
        try:
            self._feed(message)
        except RigError as error:
            problem, self._problem = self._problem, str(error)
            if problem != self._problem:
                raise

    def _feed(self, message: StreamBlock) -> None:
        if self._publisher is None:
            self._publisher = self._node.advertise(interfaces.ACCELERATION)
        settings, cutter = self._settings, self._cutter
        if settings is None:
            return
        if cutter is None or settings != self._used:
            cutter = self._cutter = StreamCutter(settings)
            self._used, self._missing = settings, 0
        block = stream_block_from_msg(message)
        duration = block.hammer.output.size / block.sampling_rate
        self._due = math.inf if block.ends_stream else time.monotonic() + duration
        for cut in cutter.feed(block):
            self._publisher.publish(block_to_msg(cut))
        missing = cutter.flow.missing_points
        if missing > self._missing:
            if time.monotonic() - self._lost_at > WARNING_TIME:
                self._lost = 0
            self._lost += missing - self._missing
            self._lost_at, self._missing = time.monotonic(), missing

    def describe(self) -> dict[str, Any]:
        """Return the flow, the rate since this was asked last, by names for the diagnostics."""
        if self._publisher is None:
            return {}
        flow = self._cutter.flow if self._cutter else StreamFlow()
        now = time.monotonic()
        (before, points), self._told = self._told, (now, flow.points)
        rate = max(flow.points - points, 0) / max(now - before, 1e-9)
        return {
            "stream blocks": flow.blocks,
            "stream gaps": flow.gaps,
            "stream points missing": flow.missing_points,
            "stream points per second": round(rate),
            "impacts while not armed": flow.other_impacts,
        }

    def find_warning(self) -> str:
        """Return that the stream stands still, or what has been lost of late; empty: neither."""
        late = time.monotonic() - self._due
        if late > STANDSTILL and self._node.count_publishers(interfaces.STREAM.name):
            return (
                f"the stream stands still: its next block is due since {late:.0f} s; this computer"
                " does not hold its rate, or its network does not"
            )
        if not self._lost or time.monotonic() - self._lost_at > WARNING_TIME:
            return ""
        return (
            f"{self._lost} points of the stream were lost: this computer does not hold its rate;"
            " hits that lack points are rejected"
        )
