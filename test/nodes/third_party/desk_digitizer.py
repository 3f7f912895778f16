"""A driver of another package: a digitizer on a desk, in this process."""

import threading
from collections import deque

from impact_rig.core.given.errors import DeviceError
from impact_rig.core.given.records import Block
from impact_rig.devices.protocols import Acquisition, FoundDevice


class Desk:
    """The device: plugged in or not, with blocks that wait to be read."""

    def __init__(self):
        self.calls = []
        self.reads = 0
        self.trouble = None
        self._is_plugged = True
        self._blocks = deque()
        self._changed = threading.Condition()

    def deliver(self, *blocks):
        with self._changed:
            self._blocks.extend(blocks)
            self._changed.notify_all()

    def unplug(self):
        with self._changed:
            self._is_plugged = False
            self._changed.notify_all()

    def plug(self):
        with self._changed:
            self._is_plugged = True
            self._blocks.clear()

    def fail(self, error):
        """Let the next read raise something."""
        with self._changed:
            self.trouble = error
            self._changed.notify_all()

    def check(self):
        trouble, self.trouble = self.trouble, None
        if trouble is not None:
            raise trouble
        if not self._is_plugged:
            raise DeviceError("the digitizer on the desk is gone: plug it in")

    def read(self, timeout):
        with self._changed:
            self.reads += 1
            self._changed.wait_for(
                lambda: self._blocks or self.trouble or not self._is_plugged, timeout
            )
            self.check()
            return self._blocks.popleft() if self._blocks else None


DESK = Desk()


class DeskSource:
    description = "a digitizer on a desk"
    example = '[source]\ndriver = "desk"\nserial = 7\n'

    def __init__(self, options):
        options.check_keys("serial")
        self._serial = options.take_whole("serial", 1, 9, 1)

    @classmethod
    def find_devices(cls):
        return (FoundDevice("desk"),)

    def configure(self, plan):
        DESK.check()
        DESK.calls.append("configure")
        DESK.plan = plan
        return Acquisition(f"desk digitizer {self._serial}", plan.sampling_rate)

    def arm(self):
        DESK.check()
        DESK.calls.append("arm")

    def read(self, timeout) -> Block | None:
        return DESK.read(timeout)

    def disarm(self):
        DESK.check()
        DESK.calls.append("disarm")

    def check(self):
        DESK.check()

    def close(self):
        DESK.calls.append("close")
