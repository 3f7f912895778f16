"""A program that talks to a rig's nodes without being one of them."""

import time
from collections.abc import Callable
from typing import Any, Self

import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile

from impact_rig.core.errors import DeviceError
from impact_rig.nodes import interfaces
from impact_rig.nodes.discovery import offer_profile
from impact_rig.nodes.node_executor import make_executor

LOOK_PERIOD = 0.1
"""How often something that sends no event is looked at [s]."""


class RigClient:
    """Talks to a rig that is up, here or on another host; use it in a ``with`` statement.

    Nothing happens behind its back: messages are taken while one of its methods waits.

    Parameters
    ----------
    name : str
        Of its node.
    namespace : str
        Of the rig.
    """

    def __init__(self, name: str, namespace: str = "") -> None:
        self._context = rclpy.Context()
        with offer_profile():
            rclpy.init(context=self._context, args=[])
            # A guest, of whom no parameter is asked: the less there is to tell of, the sooner.
            self._node = Node(
                name,
                namespace=namespace or None,
                context=self._context,
                enable_rosout=False,
                start_parameter_services=False,
            )
        self._executor = make_executor(context=self._context)
        self._executor.add_node(self._node)

    def __enter__(self) -> Self:
        """Return the client."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave ROS."""
        self._executor.shutdown(timeout_sec=1.0)
        self._node.destroy_node()
        self._context.try_shutdown()

    def listen(
        self,
        topic: interfaces.Topic,
        callback: Callable[[Any], None],
        qos: QoSProfile | None = None,
    ) -> None:
        """Subscribe to one of the rig's topics, with its own quality unless there is another."""
        self._node.create_subscription(topic.type, topic.name, callback, qos or topic.qos)

    def spin_until(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Take messages until a condition is true; return whether it came true in time [s]."""
        deadline = time.monotonic() + timeout
        while not condition():
            left = deadline - time.monotonic()
            if left <= 0.0:
                return False
            self._executor.spin_once(timeout_sec=min(left, LOOK_PERIOD))
        return True

    def call(self, kind: Any, name: str, request: Any, timeout: float) -> Any:
        """Call a service of the rig and return its answer.

        Parameters
        ----------
        kind : type
            Of the service.
        name : str
            Of the service.
        request : message
            What is asked.
        timeout : float
            [s]

        Raises
        ------
        DeviceError
            If nobody offers it, or no answer comes.
        """
        client = self._node.create_client(kind, name)
        try:
            if not self.spin_until(client.service_is_ready, timeout):
                raise DeviceError(
                    f"no rig offers {client.srv_name} within {timeout:g} s: start one with"
                    " `impact-rig up`, and check ROS_DOMAIN_ID and the namespace on both sides"
                )
            future = client.call_async(request)
            if not self.spin_until(future.done, timeout):
                raise DeviceError(f"{client.srv_name} did not answer within {timeout:g} s")
            return future.result()
        finally:
            self._node.destroy_client(client)
