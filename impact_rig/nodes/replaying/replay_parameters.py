"""The parameters of the replayer."""

from impact_rig.nodes.rig_node import RigNode

SELECTIONS = ("inputs", "all")
"""Which topics may be asked for."""


def declare_parameters(node: RigNode) -> None:
    """Declare them all, with their defaults."""
    node.declare(
        "file", "",
        "path of the recording: an .mcap file, a folder as rosbag2 writes it, or a run's",
    )  # fmt: skip
    node.declare(
        "rate", 1.0,
        "speed, part of the original's [-]; 0: as fast as the subscribers take it; may be"
        " changed at any time",
        low=0.0, high=1000.0,
    )  # fmt: skip
    node.declare(
        "topics", "inputs",
        "inputs: set-up, blocks, releases and virtual impacts, for a fresh estimator; all:"
        " everything that was recorded",
    )  # fmt: skip
    node.declare("samples", [""], "replay only the hits of these samples, and `hits`")
    node.declare(
        "hits", [""],
        "replay only these hits, and those of `samples`: by record number, SAMPLE/IMPACT or"
        " SAMPLE/IMPACT.ATTEMPT",
    )  # fmt: skip
    node.declare(
        "start", 0.0, "from here, since the recording's start [s]; what is latched before it"
        " comes first", low=0.0, high=1e9,
    )  # fmt: skip
    node.declare(
        "end", 0.0, "up to here, since the recording's start [s]; 0: to its end",
        low=0.0, high=1e9,
    )  # fmt: skip
    node.declare("loop", 1, "how often [-]; 0: without end", low=0, high=1_000_000)
    node.declare("start_paused", False, "wait to be resumed, or for steps")
    node.declare(
        "publish_clock", 0.0,
        "how often /clock is published [Hz], beside once with each message, for nodes that"
        " use simulated time; 0: not at all",
        low=0.0, high=10_000.0,
    )  # fmt: skip
    node.declare(
        "required_subscribers", "estimator",
        "nodes of this namespace, by commas, that must be connected before the start",
    )  # fmt: skip
    node.declare("recorded_namespace", "", "of the rig in the recording; empty: found there")
    node.declare("exit_when_done", False, "end the process at the end of the recording")
