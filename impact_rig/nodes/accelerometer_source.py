"""The source of the accelerometer node, and the thread that reads it and publishes its blocks."""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from queue import Empty, SimpleQueue
from typing import Any

from impact_rig_msgs.msg import AccelerationBlock, StreamBlock

from impact_rig.configuration.rig_checks import require_rig
from impact_rig.configuration.rig_file import load_rig_file
from impact_rig.core.given.errors import DeviceError, ParameterError, RigError
from impact_rig.core.given.records import (
    DISARMED,
    MEASURED,
    NOT_ARMED,
    SIMULATED,
    UNSTATED,
    Block,
    HitLabel,
    Origin,
)
from impact_rig.devices.protocols import (
    NOT_MEASURED,
    AccelerationSource,
    Acquisition,
    AcquisitionPlan,
    HammerlessSource,
)
from impact_rig.devices.source_table import make_source, override_source
from impact_rig.nodes.device_node import DeviceNode
from impact_rig.nodes.identity import Membership
from impact_rig.nodes.interfaces import STREAM_DEPTH
from impact_rig.nodes.messages import block_to_msg
from impact_rig.recordings.hits import BlockCount
from impact_rig.recordings.messages import fill_block
from impact_rig.status.levels import LevelMeter


@dataclass(frozen=True)
class OpenSource:
    """A configured source, the plan it was given, and the acquisition it made of it."""

    source: AccelerationSource
    plan: AcquisitionPlan
    acquisition: Acquisition

    @cached_property  # the question goes through the protocol's methods
    def hammerless(self) -> HammerlessSource | None:
        """The source, if it computes its hits and needs to know when a hammer would strike."""
        return self.source if isinstance(self.source, HammerlessSource) else None

    @property
    def origin(self) -> Origin:
        """Origin of blocks without one: where no hammer strikes, nothing was measured."""
        is_simulated = self.acquisition.is_simulated or self.hammerless is not None
        return Origin(SIMULATED if is_simulated else MEASURED, self.acquisition.identity)


def open_source(node: DeviceNode, *, continuous: bool) -> OpenSource:
    """Open the source of the node's rig file; without one, the virtual rig.

    Raises
    ------
    RigError
        If the rig file cannot be read, or the device cannot do what it says.
    ModuleNotFoundError
        If the vendor's library is missing.
    """
    path = node.get_value("rig_file")
    file = load_rig_file(path)
    try:
        table = override_source(file.source, node.get_value("source"))
        for warning in require_rig(replace(file, source=table, path=None)):
            node.warn_once(warning)
        source, plan = make_source(
            table,
            file.setup,
            continuous=continuous,
            block_size=node.get_value("stream_block_size") if continuous else BLOCK_SIZE,
            depth=STREAM_DEPTH,
        )
        try:
            return OpenSource(source, plan, source.configure(plan))
        except BaseException:
            source.close()
            raise
    except ParameterError as error:
        if path and error.line:
            raise ParameterError(f"rig file {path}: {error}") from None
        raise


@dataclass(eq=False)
class Arming:
    """A hit that the source waits for; the executor writes it, the source thread sets `armed`."""

    label: HitLabel
    armed: threading.Event = field(default_factory=threading.Event)
    is_released: bool = False
    latest_contact: float = math.inf  # [s], by the monotonic clock, after which no hit comes

    def release(self, longest_wait: float) -> None:
        """Note that the hammer was released; its hit comes within so many seconds, or never."""
        # In this order: a thread that reads the deadline reads that it was released, too.
        self.is_released = True
        self.latest_contact = time.monotonic() + longest_wait


BLOCK_SIZE = 1000
"""Points per block of a hit [-]."""
COMPLETE = "record complete"


class SourceThread:
    """Reads a source and publishes its blocks, with the label of the arming under way.

    In triggered mode they are `AccelerationBlock` messages of one record for each arming, in
    continuous mode `StreamBlock` messages all the time, in which the estimator finds the hits.
    The record of each release is ended, so that one verdict follows: one that breaks off gets an
    empty last block behind the missing points, one of which nothing came an empty block without
    a trigger; if the hammer was disarmed before its contact, that says so. A stream ends with an
    empty block of no arming.

    Parameters
    ----------
    opened : OpenSource
        The source; in continuous mode armed.
    publisher : Publisher or None
        Of the messages; None: of a running stream only the levels are wanted.
    membership : Membership
        The campaign of the messages.
    patience : float
        How long a record that has begun may take from block to block [s].
    check_period : float
        How often an idle source is checked [s].
    on_ended : callable
        Called in this thread with an arming that has ended by itself, and why.
    on_failed : callable
        Called in this thread, as its end, with the error when the device is lost.
    """

    def __init__(
        self,
        opened: OpenSource,
        publisher: Any,
        membership: Membership,
        *,
        patience: float,
        check_period: float,
        on_ended: Callable[[Arming, str], None],
        on_failed: Callable[[RigError], None],
    ) -> None:
        self.flow = BlockCount(expected=0)  # of what was published
        self.levels = LevelMeter()  # of a running stream
        self._source, self._plan = opened.source, opened.plan
        self._publisher = publisher
        self._membership = membership
        self._patience = patience
        self._check_period = check_period
        self._on_ended = on_ended
        self._on_failed = on_failed
        rate, self._origin = opened.acquisition.sampling_rate, opened.origin
        self._record_points = round(rate * opened.plan.record_duration)
        self._arming: Arming | None = None
        self._has_begun = False  # the record of the arming has a block
        self._next_due = math.inf
        # An empty block has the calibration of the block before it; the first has none.
        self._newest = Block(0, rate, NOT_MEASURED, NOT_MEASURED)
        self._stream_message = StreamBlock()  # of all blocks: each is sent before the next
        self._orders: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="source", daemon=True)

    # Called in the executor.

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def stop(self) -> bool:
        """Disarm the source, and end; return whether the driver has returned."""
        self._orders.put(None)
        self._thread.join(3.0)  # launch kills a node 10 s after Ctrl-C
        return not self._thread.is_alive()

    def arm(self, arming: Arming) -> None:
        """Let the source wait for a hit."""
        self._orders.put(lambda: self._arm(arming))

    def end(self, arming: Arming, *, is_judged: bool = False) -> None:
        """End an arming, unless it has ended; a hit that is judged needs no end of its record."""
        self._orders.put(lambda: self._end(arming, is_judged=is_judged))

    def withdraw(self, arming: Arming, why: str) -> None:
        """End an arming whose hammer was disarmed, unless its contact has come."""
        self._orders.put(lambda: self._withdraw(arming, why))

    # Called in the thread.

    def _run(self) -> None:
        try:
            while self._follow_orders():
                if not self._is_idle:
                    self._read()
            self._finish()
            self._source.disarm()
        except RigError as error:
            self._finish()
            self._on_failed(error)
        except Exception as error:  # noqa: BLE001 - a driver's mistake must be reported
            self._finish()
            text = f"the source's driver failed: {type(error).__name__}: {error}"
            self._on_failed(DeviceError(text))

    @property
    def _is_idle(self) -> bool:
        """Whether there is nothing to read."""
        return self._arming is None and not self._plan.continuous

    def _follow_orders(self) -> bool:
        """Follow the orders, and wait for one while there is nothing to read; False: end."""
        while True:
            try:
                order = self._orders.get(block=self._is_idle, timeout=self._check_period)
            except Empty:
                if not self._is_idle:
                    return True
                self._source.check()
                continue
            if order is None:
                return False
            order()

    def _arm(self, arming: Arming) -> None:
        if not self._plan.continuous:
            self._source.arm()
            self.flow.expected = 0
        self._arming, self._has_begun = arming, False
        arming.armed.set()

    def _withdraw(self, arming: Arming, why: str) -> None:
        if self._arming is arming and not self._has_begun:
            self._end(arming, disarmed=f"{DISARMED}: {why}" if why else DISARMED)
            self._on_ended(arming, DISARMED)

    def _end(self, arming: Arming, *, is_judged: bool = False, disarmed: str = "") -> None:
        if self._arming is arming:
            if not self._plan.continuous:
                self._source.disarm()
            self._end_record(is_judged=is_judged, disarmed=disarmed)

    def _read(self) -> None:
        deadline = self._compute_deadline()
        # The longest wait is the longest delay of an order.
        block = self._source.read(min(max(deadline - time.monotonic(), 0.0), 0.05))
        if block is not None:
            self._has_begun = not self._plan.continuous
            self._publish(block)
            self._next_due = time.monotonic() + self._patience
        arming = self._arming
        if arming is None:
            return
        if block is not None and block.last and not self._plan.continuous:
            self._arming, self._has_begun = None, False
            early = f"{COMPLETE}: something struck the hammer before it was released"
            self._on_ended(arming, COMPLETE if arming.is_released else early)
        elif time.monotonic() >= self._compute_deadline():
            why = "the record breaks off" if self._has_begun else "no impact came in time"
            self._end(arming)
            self._on_ended(arming, why)

    def _compute_deadline(self) -> float:
        """Return until when the arming under way waits for the next block [s]."""
        if self._arming is None:
            return math.inf
        return self._next_due if self._has_begun else self._arming.latest_contact

    def _end_record(self, *, is_judged: bool = False, disarmed: str = "") -> None:
        """End the record of the arming under way, if there is one or a verdict is awaited."""
        is_released = self._arming is not None and self._arming.is_released
        if self._has_begun or (is_released and not is_judged):
            points = self._record_points if self._has_begun else 0
            self._publish_end(points, disarmed=disarmed)
        self._arming, self._has_begun = None, False

    def _finish(self) -> None:
        """End the record under way, and a stream that has begun."""
        self._end_record()
        if self._plan.continuous and self.flow.blocks:
            self._publish_end()

    def _publish(self, block: Block) -> None:
        """Publish a block, in pieces if it is too long."""
        if self._plan.continuous:
            self.levels.add(block)
        if self._publisher is None:
            return
        for piece in self._complete(block).split(self._plan.block_size):
            self._publisher.publish(self._make_message(piece))
            self.flow.add(piece.first_sample, piece.hammer.output.size)
        self._newest = block

    def _publish_end(self, points: int = 0, *, disarmed: str = "") -> None:
        """Publish an empty last block, behind all points of the record if that has so many."""
        first_sample = max(points, self.flow.expected or 0)
        empty = replace(
            self._newest.cut(0, 0),
            first_sample=first_sample,
            last=True,
            stamp=0,
            disarmed=disarmed,
        )
        self._publisher.publish(self._make_message(self._complete(empty)))

    def _complete(self, block: Block) -> Block:
        """Return a block with the label of the arming under way, a time and an origin."""
        duration = block.hammer.output.size / block.sampling_rate
        return replace(
            block,
            label=self._arming.label if self._arming else NOT_ARMED,
            stamp=block.stamp or time.time_ns() - round(1e9 * duration),
            origin=self._origin if block.origin == UNSTATED else block.origin,
            triggered=self._has_begun,
        )

    def _make_message(self, block: Block) -> AccelerationBlock | StreamBlock:
        identity = self._membership.identity
        if not self._plan.continuous:
            return block_to_msg(block, identity)
        fill_block(identity.fill(self._stream_message), block)
        return self._stream_message
