"""Watches the hammer of a rig, and gives it back after each emergency stop; a process of its own.

Prints what the hammer says of itself as a line of JSON as soon as it comes. So a campaign that a
stop has made to pause goes on.
"""

import json

from impact_rig_msgs.msg import HammerState

from impact_rig.nodes import interfaces
from impact_rig.nodes.hammer_client import HammerClient

TIMEOUT = 20.0
"""How long the hammer may take to answer [s]."""
NANO = 1e-9


def main() -> None:
    """Watch until the process is ended."""
    with HammerClient("", TIMEOUT) as client:
        stops: list[HammerState] = []

        def tell(state: HammerState) -> None:
            is_stop = not state.armed and state.disarmed_by == HammerState.EMERGENCY_STOP
            stamp = state.header.stamp
            line = {
                "time": stamp.sec + NANO * stamp.nanosec,
                "released": state.armed and state.state == HammerState.SWINGING,
                "stopped": is_stop,
            }
            print(json.dumps(line), flush=True)
            if is_stop:
                stops.append(state)

        client.listen(interfaces.HAMMER_STATE, tell)
        while True:
            if client.spin_until(lambda: bool(stops), TIMEOUT):
                stops.clear()
                client.ask("reset")
                client.ask("arm")


if __name__ == "__main__":
    main()
