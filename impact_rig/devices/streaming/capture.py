"""A running recording of a device, which keeps the newest points."""

import threading
import time

from impact_rig.core.errors import DeviceError
from impact_rig.devices.streaming.sample_store import CountArray, SampleStore

LONGEST_SILENCE = 2.0
"""After so long without a point the device is lost [s], our choice: these devices deliver every
few hundredths of a second."""


class StreamCapture:
    """Takes points in one thread, and hands them out in another.

    A driver's subclass runs the device from when it is made until `close`.

    Parameters
    ----------
    name : str
        What messages call the device: "sound device USB Audio".
    sampling_rate : float
        [Hz]
    capacity : int
        Points to keep at least.

    Attributes
    ----------
    changed : Condition
        Guards all else; notified when points have come or the device has gone.
    store : SampleStore
        The points.
    """

    def __init__(self, name: str, sampling_rate: float, capacity: int) -> None:
        self.name = name
        self.sampling_rate = sampling_rate
        self.changed = threading.Condition()
        self.store = SampleStore(capacity)
        self._end = ""
        self._last_time = time.monotonic()
        self._anchor = (0, time.time_ns())

    def close(self) -> None:
        """Let the device go; never raises."""

    def take(self, counts: CountArray, stamp: int, lost: int = 0) -> None:
        """Take the next points, shape (n, channels), which nobody changes any more.

        Parameters
        ----------
        counts : ndarray of int32
            As the device gives them.
        stamp : int
            When the first of them was taken [ns since the epoch].
        lost : int
            Points that are missing before them.
        """
        with self.changed:
            self.store.skip(lost)
            self._anchor = (self.store.end, stamp)
            self.store.append(counts)
            self._last_time = time.monotonic()
            self.changed.notify_all()

    def end(self, reason: str) -> None:
        """Note that no more will come, and why."""
        with self.changed:
            self._end = self._end or reason
            self.changed.notify_all()

    def wait_for_points(self, count: int) -> None:
        """Wait until so many points have come; raises as `wait`."""
        with self.changed:
            while self.store.end < count:
                self.wait(time.monotonic() + LONGEST_SILENCE)

    def wait(self, deadline: float) -> None:
        """Wait for points until a time of `time.monotonic`; `changed` held; raises as `check`."""
        self.check()
        # The silence is noticed by waking up in vain.
        self.changed.wait(max(min(deadline - time.monotonic(), LONGEST_SILENCE), 0.0))

    def check(self) -> None:
        """See that the device delivers; `changed` is held.

        Raises
        ------
        DeviceError
            If the device has gone, or is silent.
        """
        if self._end:
            raise DeviceError(f"{self.name} is gone: {self._end}")
        silent = time.monotonic() - self._last_time
        if silent > LONGEST_SILENCE:
            raise DeviceError(
                f"{self.name} is silent: it has delivered nothing for {silent:.1f} s"
            )

    def find_stamp(self, place: int) -> int:
        """Return when a point was taken [ns since the epoch]; `changed` is held."""
        known, stamp = self._anchor
        return stamp + round((place - known) / self.sampling_rate * 1e9)
