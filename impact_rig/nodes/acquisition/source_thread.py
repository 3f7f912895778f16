"""The thread that owns a source while the accelerometers are active: it arms, reads, publishes."""

import math
import threading
import time
from collections.abc import Callable
from queue import Empty, SimpleQueue

from impact_rig.core.errors import DeviceError, RigError
from impact_rig.devices.acceleration_source import AccelerationSource, AcquiredBlock
from impact_rig.nodes.acquisition.arming import Arming
from impact_rig.nodes.acquisition.block_output import BlockOutput

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
        self._on_armed(arming)

    def _end(self, arming: Arming) -> None:
        if self._arming is arming:
            self._finish(is_awaited=False)

    def _read(self) -> None:
        deadline = self._find_deadline()
        block = self._source.read(min(max(deadline - time.monotonic(), 0.0), LONGEST_READ))
        if block is not None:
            if block.last and self._arming is not None:
                # Before the verdict on it can lead to the next arming.
                self._arming.is_read = True
            self._output.publish(block)
            if not self._is_continuous:
                self._follow_record(block)
        arming = self._arming
        if arming is not None and time.monotonic() >= self._find_deadline():
            arming.is_read = True
            self._finish(is_awaited=True)
            self._on_ended(arming, BROKEN_OFF if self._has_begun else NOTHING_CAME)

    def _follow_record(self, block: AcquiredBlock) -> None:
        self._has_begun = True
        self._next_due = time.monotonic() + self._patience
        arming = self._arming
        if block.last and arming is not None:
            self._arming = None
            self._on_ended(arming, COMPLETE if arming.is_released else UNASKED)

    def _find_deadline(self) -> float:
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
