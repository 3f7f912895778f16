"""Messages taken from their queue without the executor: those that nobody waits for, or many.

The way through the executor costs many times what taking a message does, and a process that wakes
with every message takes the processor from those that somebody waits for.
"""

from collections.abc import Mapping
from typing import Any

from rclpy.callback_groups import CallbackGroup

TAKING_PERIOD = 0.05
"""How often what nobody waits for is taken [s], our choice: nobody sees it, and queues hold many
times as much."""


class UnhurriedGroup(CallbackGroup):
    """Holds subscriptions that no executor waits for."""

    def can_execute(self, _: Any) -> bool:
        """Keep an executor from waiting."""
        return False


def take_message(subscription: Any, *, raw: bool = False) -> tuple[Any, Mapping[str, Any]] | None:
    """Return the next message that waits, serialised if `raw`, and what is known of it, if any."""
    with subscription.handle:
        taken: tuple[Any, Mapping[str, Any]] | None = subscription.handle.take_message(
            subscription.msg_type, raw
        )
    return taken
