"""A recording is played into a node of yours: python replay_into_own_node.py session.mcap."""

import subprocess
import sys
from contextlib import closing

from impact_rig.nodes.interfaces import ACCELERATION
from impact_rig.nodes.listener import BackgroundNode
from impact_rig.testing import use_own_domain


def hear(block):
    """Print which hit a block of both accelerations belongs to."""
    print(block.sample, block.impact, block.last)


with use_own_domain() as domain, closing(BackgroundNode("mine", domain)) as mine:
    mine.node.create_subscription(ACCELERATION.type, ACCELERATION.name, hear, ACCELERATION.qos)
    # As `impact-rig replay` does, but not before this node listens.
    given = (
        f"file:={sys.argv[1]}",
        "rate:=20.0",
        "required_subscribers:=mine",
        "exit_when_done:=true",
    )
    words = [word for parameter in given for word in ("-p", parameter)]
    subprocess.run(
        [sys.executable, "-m", "impact_rig.nodes", "replayer", "--ros-args", *words], check=True
    )
