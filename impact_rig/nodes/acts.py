"""What a person asks for belongs to what that person saw: what is too old does nothing.

A node that acts publishes its state twice a second, with a number that grows with each change of
what a person is shown. An act carries the number that the person saw, and a deadline counted from
that state's own stamp: the node compares both with its own, so that no two clocks need to agree.
"""

import getpass
import math
import socket
import time
from collections.abc import Callable, Mapping
from typing import Any

from impact_rig.nodes import interfaces
from impact_rig.recordings.fields import NANOSECONDS, stamp_from_msg
from impact_rig.status.states import CampaignStatus, HammerStatus

BEAT = 0.5
"""How often a state is published again [s]."""
REACTION = 2.0
"""How old the newest state may be, from which an act was made, when it arrives [s]."""


CATCHING_UP = interfaces.LEASE + 0.5
"""After so long what was published during a standstill has come, and leases of dead nodes are over
[s]."""


class Standstill:
    """Notices that this process was stopped, or the computer asleep."""

    def __init__(self) -> None:
        self._last_seen, self._is_caught_up_at = math.inf, 0.0

    def look(self) -> str | None:
        """Return for how long it stood still since the last look; None: for less than a lease."""
        now = _read_clock()
        pause, self._last_seen = now - self._last_seen, now
        if pause <= interfaces.LEASE:
            return None
        self._is_caught_up_at = now + CATCHING_UP
        return f"stood still for {pause:.1f} s"

    @property
    def is_catching_up(self) -> bool:
        """Whether messages from a standstill may still come."""
        return _read_clock() < self._is_caught_up_at


def _read_clock() -> float:
    """Return a time that cannot be set, and that goes on while the computer sleeps [s]."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)


class NumberedState:
    """The state of a node on its topic: counts what is told, and refuses acts by an older one."""

    def __init__(
        self,
        clock: Callable[[], int],  # by which the state is stamped [ns]
        send: Callable[..., None],  # publishes a stamped state with some fields changed
        # Returns what a person is told by the fields of a state.
        tell: Callable[[Mapping[str, Any]], Any] = dict,
    ) -> None:
        self.number = 0
        self._clock, self._send, self._tell = clock, send, tell
        self._fields: dict[str, Any] = {}
        self._told: Any = None

    def count(self, fields: Mapping[str, Any]) -> int:
        """Take changed fields; return the state's number with them."""
        self._fields.update(fields)
        told = self._tell(self._fields)
        if told != self._told:
            self._told = told
            self.number += 1
        return self.number

    def publish(self, **fields: Any) -> None:
        """Publish the state with some fields changed."""
        self._send(**fields, number=self.count(fields))

    def renew(self) -> None:
        """Refuse what was asked for up to now: what the person saw may be old."""
        self.number += 1
        if self._fields:
            self._send(number=self.number)

    def refuse(self, act: Any) -> str | None:
        """Return why an act is too old; None: it is not."""
        if act.seen and act.seen != self.number:
            return "not done: what was shown has changed since; look, then do it again"
        deadline, now = stamp_from_msg(act.deadline), self._clock()
        if deadline and now > deadline:
            late = (now - deadline) / NANOSECONDS
            return f"not done: it came {late:.1f} s too late; look, then do it again"
        return None


def fill_act(
    request: Any, state: CampaignStatus | HammerStatus, by: str, within: float = REACTION
) -> Any:
    """Fill a request with the state that a person saw, its deadline and who asks; return it."""
    deadline = state.stamp + round(within * NANOSECONDS)
    request.deadline.sec, request.deadline.nanosec = divmod(deadline, NANOSECONDS)
    request.seen, request.by = state.number, by
    return request


def describe_caller() -> str:
    """Return who runs this program, and where."""
    try:
        user = getpass.getuser()
    except (KeyError, OSError):  # a container's user without a name
        user = "somebody"
    return f"{user} at the command line of {socket.gethostname()}"
