"""Programs that talk to a rig's nodes without being one of them; the one for the hammer.

It imports no physics: an emergency stop from the command line does not wait for that.
"""

import contextlib
import signal
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, Self

import rclpy
from impact_rig_msgs.srv import Act
from rclpy.node import Node
from rclpy.parameter import Parameter

from impact_rig.core.given.errors import DeviceError
from impact_rig.nodes import interfaces
from impact_rig.nodes.acts import REACTION, describe_caller, fill_act
from impact_rig.nodes.discovery import offer_profile
from impact_rig.nodes.executor import make_executor
from impact_rig.nodes.intake import Intake, Received
from impact_rig.status.states import HammerStatus

RESEND_PERIOD = 1.0
"""How soon an unanswered request is sent again [s]: the rig takes it as the same one."""
START_ONE = (
    "start one with `impact-rig up`, and check ROS_DOMAIN_ID and the namespace on both sides"
)


class RigClient:
    """Talks to a rig that is up, here or on another host; use it in a ``with`` statement.

    Nothing happens behind its back: messages are taken while one of its methods waits.
    """

    def __init__(self, name: str, namespace: str = "") -> None:
        with contextlib.ExitStack() as making:
            # Ctrl-C within the middleware's libraries would crash them: it waits until they are
            # ready.
            making.enter_context(hold_interrupts())
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
                    parameter_overrides=[Parameter("start_type_description_service", value=False)],
                )
            self._intake = Intake(self._node)
            self.listen = self._intake.subscribe  # by the same way in as the rig's nodes
            self._executor = make_executor(self._context)
            self._executor.add_node(self._node)
            self._making = making.pop_all()

    def __enter__(self) -> Self:
        """Return the client."""
        try:
            self._making.close()
        except KeyboardInterrupt:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        """Leave ROS."""
        with hold_interrupts():
            self.leave()

    def leave(self) -> None:
        """Close all that there is of ROS."""
        self._executor.shutdown(timeout_sec=1.0)
        self._node.destroy_node()
        self._context.try_shutdown()

    def advertise(self, topic: interfaces.Topic) -> Any:
        """Create a publisher of what is replayed on a topic."""
        return self._node.create_publisher(topic.type, topic.name, topic.leased_qos)

    def spin_until(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Take messages until a condition is true; return whether it came true in time [s].

        Ctrl-C ends it with `KeyboardInterrupt`, between two messages.
        """
        deadline = time.monotonic() + timeout
        with hold_interrupts() as interrupts:
            while not condition():
                left = deadline - time.monotonic()
                if left <= 0.0 or interrupts:
                    return False
                # Some conditions send no event.
                self._executor.spin_once(timeout_sec=min(left, 0.02))
        return True

    def call(self, kind: Any, name: str, request: Any, timeout: float) -> Any:
        """Call a service of the rig and return its answer.

        Raises `DeviceError` if no node offers it within `timeout` [s], or no answer comes.
        """
        client = self._node.create_client(kind, name)
        try:
            if not self.spin_until(client.service_is_ready, timeout):
                raise DeviceError(
                    f"no rig offers {client.srv_name} within {timeout:g} s: {START_ONE}"
                )
            asked = []
            deadline = time.monotonic() + timeout
            while (left := deadline - time.monotonic()) > 0.0:
                # A server that has not met this client's reader yet drops its answer.
                asked.append(client.call_async(request))
                self.spin_until(lambda: any(it.done() for it in asked), min(left, RESEND_PERIOD))
                for future in asked:
                    if future.done():
                        return future.result()
            raise DeviceError(f"{client.srv_name} did not answer within {timeout:g} s")
        finally:
            self._node.destroy_client(client)


@contextlib.contextmanager
def hold_interrupts() -> Iterator[list[int]]:
    """Hold back the signals that raise `KeyboardInterrupt`, and raise it at the end.

    Raised within a message that the executor takes, it would come out as a `TypeError`.
    """
    came: list[int] = []
    held = []
    if threading.current_thread() is threading.main_thread():
        signals = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
        held = [n for n in signals if signal.getsignal(n) is signal.default_int_handler]
    for number in held:
        signal.signal(number, lambda number, _: came.append(number))
    try:
        yield came
    finally:
        for number in held:
            signal.signal(number, signal.default_int_handler)
    if came:
        raise KeyboardInterrupt


class HammerClient(RigClient):
    """Asks the hammer of a rig that is up; use it in a ``with`` statement.

    It has `timeout` [s] to be found, and then to answer.
    """

    def __init__(self, namespace: str, timeout: float) -> None:
        super().__init__("hammer_client", namespace)
        self._timeout = timeout

    def ask(self, action: str, within: float = REACTION) -> str:
        """Ask for something of `interfaces.HAMMER_ACTS`; return what was done.

        What may lead to a swing is refused by the hammer when it comes later than `within` [s].

        Raises
        ------
        DeviceError
            If it was refused, or no answer comes.
        """
        request = Act.Request(by=describe_caller())
        if action in interfaces.LATE_ACTS:
            fill_act(request, self.find_state(), request.by, within)
        response = self.call(Act, interfaces.HAMMER_ACTS[action], request, self._timeout)
        if not response.success:
            raise DeviceError(f"refused: {response.message}")
        return str(response.message)

    def find_state(self) -> HammerStatus:
        """Return the hammer's newest state; raises `DeviceError` if it publishes none."""
        states: list[Received[HammerStatus]] = []
        self.listen(interfaces.HAMMER_STATE, states.append)
        if not self.spin_until(lambda: bool(states), self._timeout):
            raise DeviceError(
                f"no hammer publishes its state within {self._timeout:g} s: {START_ONE}"
            )
        return states[-1].value

    def describe(self) -> str:
        """Return in words what the hammer does."""
        state = self.find_state()
        text = f"{state.state.name.lower()}, {'armed' if state.armed else 'not armed'}"
        why = "" if state.message == text else f" ({state.message})"
        return f"{text}{why}; holder: {state.holder or 'none'}"
