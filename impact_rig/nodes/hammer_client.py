"""A client of the hammer node: what a person may want of it, from the command line."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Self

import rclpy
from impact_rig_msgs.msg import HammerState
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import Trigger

from impact_rig.core.errors import DeviceError
from impact_rig.nodes import interfaces

SERVICES = {
    "arm": interfaces.ARM_HAMMER,
    "disarm": interfaces.DISARM_HAMMER,
    "stop": interfaces.EMERGENCY_STOP,
    "reset": interfaces.RESET_HAMMER,
    "confirm": interfaces.CONFIRM_HELD,
}
"""What can be asked for, and by which service."""
PLACES = {
    HammerState.HELD: "held",
    HammerState.SWINGING: "swinging",
    HammerState.FAULT: "lost",
    HammerState.AWAY: "away",
}


@dataclass(frozen=True)
class HammerReport:
    """What the hammer node said last.

    Attributes
    ----------
    place : str
        Of `PLACES`.
    is_armed : bool
        The operator's enable is given.
    message : str
        Why, in words.
    holder : str
        What holds it; empty: nothing has yet.
    """

    place: str
    is_armed: bool
    message: str
    holder: str


class HammerClient:
    """Asks the hammer of a rig that is up; use it in a ``with`` statement.

    Parameters
    ----------
    namespace : str
        Of the rig.
    timeout : float
        How long the node may take to be found, and then to answer [s].
    """

    def __init__(self, namespace: str, timeout: float) -> None:
        self._timeout = timeout
        self._context = rclpy.Context()
        rclpy.init(context=self._context, args=[])
        self._node = Node("hammer_client", namespace=namespace or None, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)

    def __enter__(self) -> Self:
        """Return the client."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave ROS."""
        self._executor.shutdown(timeout_sec=1.0)
        self._node.destroy_node()
        self._context.try_shutdown()

    def ask(self, action: str) -> str:
        """Ask for something of `SERVICES`; return what was done.

        Raises
        ------
        DeviceError
            If it was refused, or nobody answers.
        """
        client = self._node.create_client(Trigger, SERVICES[action])
        self._wait(client.service_is_ready)
        answer = client.call_async(Trigger.Request())
        self._wait(answer.done)
        response: Any = answer.result()
        if not response.success:
            raise DeviceError(f"refused: {response.message}")
        return str(response.message)

    def read(self) -> HammerReport:
        """Return what the hammer does; raises `DeviceError` if it does not say it."""
        heard: list[HammerState] = []
        topic = interfaces.HAMMER_STATE
        self._node.create_subscription(topic.type, topic.name, heard.append, topic.qos)
        self._wait(lambda: bool(heard))
        state = heard[-1]
        return HammerReport(PLACES[state.state], state.armed, state.message, state.holder)

    def _wait(self, condition: Callable[[], bool]) -> None:
        deadline = time.monotonic() + self._timeout
        while not condition():
            left = deadline - time.monotonic()
            if left <= 0.0:
                raise DeviceError(
                    f"no hammer answers in namespace {self._node.get_namespace()!r} within"
                    f" {self._timeout:g} s: start a rig with `impact-rig up`, and check"
                    " ROS_DOMAIN_ID and the namespace on both sides"
                )
            self._executor.spin_once(timeout_sec=min(left, 0.1))
