"""The source that the accelerometer node reads, in which thread, and what is published of it."""

import math
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from queue import Empty, SimpleQueue
from typing import Any

from impact_rig_msgs.msg import AccelerationBlock, StreamBlock

from impact_rig.configuration.rig_file import list_rig_warnings, load_rig_file
from impact_rig.core.errors import DeviceError, FileError, RigError
from impact_rig.core.records import (
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
from impact_rig.nodes.messages import block_to_msg, fill_block
from impact_rig.nodes.rig_node import RateMeter

NANO = 1e-9


@dataclass(frozen=True)
class OpenSource:
    """A configured source.

    Attributes
    ----------
    source : AccelerationSource
        Of whichever driver.
    plan : AcquisitionPlan
        What it was asked to do.
    acquisition : Acquisition
        What it is, and does.
    """

    source: AccelerationSource
    plan: AcquisitionPlan
    acquisition: Acquisition

    @property
    def hammerless(self) -> HammerlessSource | None:
        """The source, if it must be told when a hammer would strike."""
        return self.source if isinstance(self.source, HammerlessSource) else None

    @property
    def origin(self) -> Origin:
        """Of blocks that state none: where no hammer strikes, nothing was measured."""
        is_simulated = self.acquisition.is_simulated or self.hammerless is not None
        return Origin(SIMULATED if is_simulated else MEASURED, self.acquisition.identity)

    def make_output(self, publisher: Any, membership: Membership) -> "BlockOutput":
        """Return what publishes its blocks, as of a campaign."""
        return (RunningStream if self.plan.continuous else HitBlocks)(publisher, self, membership)


def open_source(node: DeviceNode, *, continuous: bool) -> OpenSource:
    """Open the source of the node's rig file; without one, the virtual rig.

    Parameters
    ----------
    node : DeviceNode
        The accelerometers', whose parameters describe the stream.
    continuous : bool
        Without a trigger.

    Raises
    ------
    RigError
        If the rig file cannot be read or meant, or the device does not do what it says.
    ModuleNotFoundError
        If the vendor's library is missing.
    """
    path = node.get_value("rig_file")
    file = load_rig_file(path)
    for warning in list_rig_warnings(file.setup):
        node.get_logger().warning(warning)
    try:
        source, plan = make_source(
            override_source(file.source, node.get_value("source")),
            file.setup,
            continuous=continuous,
            block_size=node.get_value("stream_block_size" if continuous else "block_size"),
            depth=node.get_value("stream_depth"),
        )
        try:
            return OpenSource(source, plan, source.configure(plan))
        except BaseException:
            source.close()
            raise
    except RigError as error:
        if path and str(error).startswith("line "):
            raise FileError(f"rig file {path}: {error}") from None
        raise


@dataclass
class Flow:
    """What has been published, counted.

    Attributes
    ----------
    blocks, points : int
        Published, points per channel.
    missing_points : int
        That the source has lost on their way, per channel.
    overloads : int
        Blocks in which the source says that a channel was driven beyond its range.
    delay : float
        From the last point of the newest block to its being published [s], as far as the source
        knows when it was taken.
    """

    blocks: int = 0
    points: int = 0
    missing_points: int = 0
    overloads: int = 0
    delay: float = 0.0


class BlockOutput(ABC):
    """Publishes a source's blocks, cut to size, as messages with the label of their arming.

    Called in one thread at a time; the flow may be read in any.

    Parameters
    ----------
    publisher : Publisher
        Of the messages.
    opened : OpenSource
        Whose blocks they are.
    membership : Membership
        The campaign that they belong to.
    """

    def __init__(self, publisher: Any, opened: OpenSource, membership: Membership) -> None:
        self.flow = Flow()
        self._membership = membership
        self._publisher = publisher
        self._block_size = opened.plan.block_size
        self._label = NOT_ARMED
        self._next_sample = 0
        # What comes before anything has come is calibrated as nothing.
        rate, self._origin = opened.acquisition.sampling_rate, opened.origin
        self._newest = Block(0, rate, NOT_MEASURED, NOT_MEASURED)
        self._rate = RateMeter()
        self._told_loss = 0

    @abstractmethod
    def begin(self, label: HitLabel) -> None:
        """Let what follows belong to an arming."""

    @abstractmethod
    def end(self, *, is_awaited: bool) -> bool:
        """End the arming under way, and its record; do nothing if there is none.

        Parameters
        ----------
        is_awaited : bool
            The hammer has been let go: a verdict must come, even if nothing has come so far.

        Returns
        -------
        bool
            Whether something was published that a verdict follows.
        """

    @abstractmethod
    def make_message(self, block: Block) -> Any:
        """Return the message of a block of the arming under way."""

    @abstractmethod
    def finish(self) -> None:
        """Say that the source will deliver no more; no arming is under way."""

    def restart(self) -> None:
        """Expect points to count from 0 again."""
        self._next_sample = 0

    def publish(self, block: Block) -> None:
        """Publish a block, in pieces if it is too long."""
        flow, size = self.flow, block.hammer.output.size
        for piece in self._complete(block).split(self._block_size):
            self._publisher.publish(self.make_message(piece))
            flow.blocks += 1
        flow.points += size
        flow.missing_points += max(block.first_sample - self._next_sample, 0)
        flow.overloads += block.hammer.overloaded or block.specimen.overloaded
        if block.stamp:
            age = NANO * (time.time_ns() - block.stamp)
            flow.delay = max(age - size / block.sampling_rate, 0.0)
        self._next_sample = block.first_sample + size
        self._newest = block

    def publish_end(self, first_sample: int) -> None:
        """Publish an empty last block of the arming under way."""
        empty = replace(self._newest.cut(0, 0), first_sample=first_sample, last=True, stamp=0)
        self._publisher.publish(self.make_message(self._complete(empty)))

    def describe_warning(self) -> str:
        """Return what has been lost since this was asked last; empty: nothing."""
        lost = self.flow.missing_points - self._told_loss
        self._told_loss += lost
        if not lost:
            return ""
        return f"{lost} points of the source were lost: this computer does not hold its rate"

    def describe(self) -> dict[str, Any]:
        """Return the flow, the rate since this was asked last, by names for the diagnostics."""
        flow = self.flow
        return {
            "blocks sent": flow.blocks,
            "points lost": flow.missing_points,
            "points per second": round(self._rate.measure(flow.points)),
            "delay [s]": round(flow.delay, 4),
            "overloads": flow.overloads,
        }

    def _complete(self, block: Block) -> Block:
        """Return a block with the label of the arming under way, a time and an origin."""
        duration = block.hammer.output.size / block.sampling_rate
        stamp = block.stamp or time.time_ns() - round(duration / NANO)
        origin = self._origin if block.origin == UNSTATED else block.origin
        return replace(block, label=self._label, stamp=stamp, origin=origin)


class HitBlocks(BlockOutput):
    """Publishes `AccelerationBlock`.

    However an arming ends, its record is whole or closed, so that exactly one verdict follows. A
    record that breaks off gets an empty last block behind the points that are missing, which the
    estimator sees as a gap; one that nobody waits for any more ends where it is. One of which
    nothing has come gets an empty block without a trigger, but only if the hammer has been let
    go: of an arming that ends before that nothing is published, and there is no verdict.
    """

    def __init__(self, publisher: Any, opened: OpenSource, membership: Membership) -> None:
        super().__init__(publisher, opened, membership)
        rate = opened.acquisition.sampling_rate
        self._record_points = round(rate * opened.plan.record_duration)
        self._has_begun = False

    def begin(self, label: HitLabel) -> None:
        """Let what follows be the record of an arming."""
        self.restart()
        self._label, self._has_begun = label, False

    def end(self, *, is_awaited: bool) -> bool:
        """Close the record, if there is one or somebody waits for it; return whether it was."""
        if self._label is NOT_ARMED:
            return False
        has_begun = self._has_begun
        if has_begun:
            behind_loss = max(self._record_points, self._next_sample)
            self.publish_end(behind_loss if is_awaited else self._next_sample)
        elif is_awaited:
            self.publish_end(0)
        self._label, self._has_begun = NOT_ARMED, False
        return has_begun or is_awaited

    def finish(self) -> None:
        """Say nothing: each record has said where it ends."""

    def publish(self, block: Block) -> None:
        """Publish a block of the record; its last one ends the arming."""
        self._has_begun = True
        super().publish(block)
        if block.last:
            self._label, self._has_begun = NOT_ARMED, False

    def make_message(self, block: Block) -> AccelerationBlock:
        """Return the message of a block."""
        return block_to_msg(replace(block, triggered=self._has_begun), self._membership.identity)


class RunningStream(BlockOutput):
    """Publishes `StreamBlock`, armed or not; each has the label of the arming under way.

    The estimator finds the hit. An arming that ends without one, though the hammer has been let
    go, is ended by an empty block that says so, upon which the estimator rejects what has not
    come: exactly one verdict. The stream is ended by one of no arming, upon which the estimator
    rejects the hit that is cut off.
    """

    def __init__(self, publisher: Any, opened: OpenSource, membership: Membership) -> None:
        super().__init__(publisher, opened, membership)
        # The same for all blocks, since it is sent before the next one comes.
        self._message = StreamBlock()

    def begin(self, label: HitLabel) -> None:
        """Let the next blocks carry the label of an arming."""
        self._label = label

    def end(self, *, is_awaited: bool) -> bool:
        """Let the next blocks belong to no arming; if a verdict is awaited, say that it ends."""
        is_told = is_awaited and self._label is not NOT_ARMED
        if is_told:
            self.publish_end(self._next_sample)
        self._label = NOT_ARMED
        return is_told

    def finish(self) -> None:
        """Say that the stream ends, if it has begun.

        Of a hit that is cut off there is no more to wait for.
        """
        if self.flow.blocks:
            self._label = NOT_ARMED
            self.publish_end(self._next_sample)

    def make_message(self, block: Block) -> StreamBlock:
        """Return the message of a block."""
        fill_block(self._message, block, self._membership.identity)
        return self._message


@dataclass(eq=False)
class Arming:
    """What executor and source thread know of an arming; each field is written by one of them.

    Attributes
    ----------
    label : HitLabel
        Which hit it is for.
    armed : Event
        The source is armed (source thread).
    is_armed : bool
        That has been told (executor).
    is_over : bool
        It has ended, however (executor).
    is_released : bool
        The hammer has been let go (executor).
    is_read : bool
        Its record is complete, or nothing came in time, which is about to be told (source thread).
    latest_contact : float
        When the hit must have come, by the monotonic clock [s]; infinite: it waits for ever
        (executor).
    """

    label: HitLabel
    armed: threading.Event = field(default_factory=threading.Event)
    is_armed: bool = False
    is_over: bool = False
    is_released: bool = False
    is_read: bool = False
    latest_contact: float = math.inf

    def release(self, longest_wait: float) -> None:
        """Note that the hammer has been let go; the hit comes within so many seconds, or never."""
        # In this order: who sees the deadline knows of the release.
        self.is_released = True
        self.latest_contact = time.monotonic() + longest_wait

    def is_for(self, label: HitLabel) -> bool:
        """Return whether the same was asked for, and may still be answered with this arming."""
        is_same = self.label == replace(label, record=self.label.record)
        return is_same and not self.is_released and not self.is_over


LONGEST_READ = 0.05
"""How long one look for a block may take [s], our choice: so soon is something else begun."""
STOP_TIMEOUT = 10.0
"""How long a driver may take to come back from whatever it does [s], our choice: longer than any
time-out of a driver."""
CHECK_PERIOD = 1.0
"""How often a source of which nothing is read is asked whether it is there [s], our choice: as
often as the diagnostics tell it."""
COMPLETE = "record complete"
UNASKED = "record complete: something struck the hammer before it was let go"
NOTHING_CAME = "no impact came in time"
BROKEN_OFF = "the record breaks off"


class SourceThread:
    """Reads a source and publishes what comes, so that no block waits for anything else.

    What it has to say is said by callables that are called in this thread: they hand it over.

    Parameters
    ----------
    source : AccelerationSource
        Configured; in continuous mode armed.
    output : BlockOutput
        Where blocks go.
    is_continuous : bool
        The source streams all the time.
    patience : float
        How long a record that has begun may take from block to block [s].
    on_armed : callable
        Called with an arming when the source is armed for it.
    on_ended : callable
        Called with an arming that has ended by itself, and why.
    on_failed : callable
        Called with the error when the device is lost. The thread then ends, and leaves it to who
        is told to end the arming under way at the output.
    """

    def __init__(
        self,
        source: AccelerationSource,
        output: BlockOutput,
        *,
        is_continuous: bool,
        patience: float,
        on_armed: Callable[[Arming], None],
        on_ended: Callable[[Arming, str], None],
        on_failed: Callable[[RigError], None],
    ) -> None:
        self._source = source
        self._output = output
        self._is_continuous = is_continuous
        self._patience = patience
        self._on_armed = on_armed
        self._on_ended = on_ended
        self._on_failed = on_failed
        self._arming: Arming | None = None
        self._has_begun = False
        self._next_due = math.inf
        self._orders: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="source", daemon=True)

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def stop(self) -> bool:
        """Disarm the source, and end; return whether the driver has come back from what it did."""
        self._orders.put(None)
        self._thread.join(STOP_TIMEOUT)
        return not self._thread.is_alive()

    def arm(self, arming: Arming) -> None:
        """Let the source wait for a hit."""
        self._orders.put(lambda: self._arm(arming))

    def end(self, arming: Arming) -> None:
        """End an arming for which nobody waits, unless it has ended."""
        self._orders.put(lambda: self._end(arming))

    def _run(self) -> None:
        try:
            while self._obey():
                if not self._is_idle:
                    self._read()
            self._output.end(is_awaited=False)
            self._output.finish()
            self._source.disarm()
        except RigError as error:
            self._on_failed(error)
        except Exception as error:  # noqa: BLE001 - a driver's mistake must not go unheard
            text = f"the source's driver failed: {type(error).__name__}: {error}"
            self._on_failed(DeviceError(text))

    @property
    def _is_idle(self) -> bool:
        """Whether there is nothing to read."""
        return self._arming is None and not self._is_continuous

    def _obey(self) -> bool:
        """Do what was ordered, and wait for it while there is nothing to read; False: end."""
        while True:
            try:
                order = self._orders.get(block=self._is_idle, timeout=CHECK_PERIOD)
            except Empty:
                if not self._is_idle:
                    return True
                self._source.check()
                continue
            if order is None:
                return False
            order()

    def _arm(self, arming: Arming) -> None:
        if arming.is_over:
            return
        if not self._is_continuous:
            self._source.arm()
        self._output.begin(arming.label)
        self._arming, self._has_begun = arming, False
        arming.armed.set()
        self._on_armed(arming)

    def _end(self, arming: Arming) -> None:
        if self._arming is arming:
            self._finish(is_awaited=False)

    def _read(self) -> None:
        deadline = self._compute_deadline()
        block = self._source.read(min(max(deadline - time.monotonic(), 0.0), LONGEST_READ))
        if block is not None:
            if block.last and self._arming is not None:
                # Before the verdict on it can lead to the next arming.
                self._arming.is_read = True
            self._output.publish(block)
            if not self._is_continuous:
                self._follow_record(block)
        arming = self._arming
        if arming is not None and time.monotonic() >= self._compute_deadline():
            arming.is_read = True
            self._finish(is_awaited=True)
            self._on_ended(arming, BROKEN_OFF if self._has_begun else NOTHING_CAME)

    def _follow_record(self, block: Block) -> None:
        self._has_begun = True
        self._next_due = time.monotonic() + self._patience
        arming = self._arming
        if block.last and arming is not None:
            self._arming = None
            self._on_ended(arming, COMPLETE if arming.is_released else UNASKED)

    def _compute_deadline(self) -> float:
        """Return until when the arming under way waits for what comes next [s]."""
        if self._arming is None:
            return math.inf
        return self._next_due if self._has_begun else self._arming.latest_contact

    def _finish(self, *, is_awaited: bool) -> None:
        """End the arming under way."""
        if not self._is_continuous:
            self._source.disarm()
        self._output.end(is_awaited=is_awaited)
        self._arming = None
