"""Two tiny programs that pass one message between two processes: `impact-rig doctor` runs them.

``python -m impact_rig.nodes.probe talk TOKEN`` publishes TOKEN until it is killed;
``python -m impact_rig.nodes.probe listen TOKEN`` ends once it has received it, and prints the name
of the middleware that brought it.
"""

import math
import sys

from rclpy.utilities import get_rmw_implementation_identifier
from std_msgs.msg import String

from impact_rig.nodes.client import RigClient
from impact_rig.nodes.interfaces import Topic, make_qos

TOPIC = Topic("impact_rig_probe", String, make_qos(1, latched=True))

if __name__ == "__main__":
    program, token = sys.argv[1:]
    received: list[str] = []
    with RigClient(f"impact_rig_probe_{program}") as client:
        if program == "talk":
            client.advertise(TOPIC).publish(String(data=token))
        else:
            client.listen(TOPIC, lambda message: received.append(message.value.data))
        client.spin_until(lambda: token in received, math.inf)
    print(get_rmw_implementation_identifier())
