"""A client of the hammer node: what a person may want of it, from the command line."""

from dataclasses import dataclass

from impact_rig_msgs.msg import HammerState
from std_srvs.srv import Trigger

from impact_rig.core.errors import DeviceError
from impact_rig.nodes import interfaces
from impact_rig.nodes.rig_client import RigClient

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


class HammerClient(RigClient):
    """Asks the hammer of a rig that is up; use it in a ``with`` statement.

    Parameters
    ----------
    namespace : str
        Of the rig.
    timeout : float
        How long the node may take to be found, and then to answer [s].
    """

    def __init__(self, namespace: str, timeout: float) -> None:
        super().__init__("hammer_client", namespace)
        self._timeout = timeout

    def ask(self, action: str) -> str:
        """Ask for something of `SERVICES`; return what was done.

        Raises
        ------
        DeviceError
            If it was refused, or nobody answers.
        """
        response = self.call(Trigger, SERVICES[action], Trigger.Request(), self._timeout)
        if not response.success:
            raise DeviceError(f"refused: {response.message}")
        return str(response.message)

    def read(self) -> HammerReport:
        """Return what the hammer does; raises `DeviceError` if it does not say it."""
        heard: list[HammerState] = []
        self.listen(interfaces.HAMMER_STATE, heard.append)
        if not self.spin_until(lambda: bool(heard), self._timeout):
            raise DeviceError(
                f"no hammer says what it does within {self._timeout:g} s: start a rig with"
                " `impact-rig up`, and check ROS_DOMAIN_ID and the namespace on both sides"
            )
        state = heard[-1]
        return HammerReport(PLACES[state.state], state.armed, state.message, state.holder)
