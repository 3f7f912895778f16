"""How the accelerometers stream: the parameters that hold for every source."""

from impact_rig.configuration.processes import CONTINUOUS
from impact_rig.nodes import interfaces
from impact_rig.nodes.rig_node import RigNode

TRIGGERED = "triggered"
MODES = (TRIGGERED, CONTINUOUS)
"""Each hit's record, as a trigger cuts it out; or all that comes, in which the estimator finds the
impacts."""


def declare_stream(node: RigNode) -> None:
    """Declare mode, blocks, and what an arming waits for."""
    node.declare(
        "mode", TRIGGERED,
        f"{TRIGGERED}: blocks of each hit, on `acceleration`; {CONTINUOUS}: blocks of all that"
        " comes, on `acceleration/stream`, in which the estimator finds the impacts",
    )  # fmt: skip
    node.declare("block_size", 1000, "points per block of a hit [-]", low=1, high=10_000_000)
    node.declare(
        "stream_block_size", 25_000, "points per block of the running stream [-]",
        low=1, high=10_000_000,
    )  # fmt: skip
    node.declare(
        "stream_depth", interfaces.STREAM_DEPTH,
        "blocks of the running stream that may wait before the oldest are lost [-]",
        low=1, high=100_000,
    )  # fmt: skip
    node.declare(
        "required_subscribers", "estimator, recorder",
        "nodes of this namespace, by commas, that must be connected to `acceleration` before"
        " a release",
    )  # fmt: skip
    node.declare(
        "trigger_timeout", 0.5,
        "how long after the latest contact a trigger may come, and how long the rest of a record"
        " may take from block to block [s]", low=0.0, high=60.0,
    )  # fmt: skip
