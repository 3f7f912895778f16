"""How the rig is doing, as its nodes say it."""

from dataclasses import dataclass
from enum import IntEnum


class Level(IntEnum):
    """How well a node is; the numbers are those of `diagnostic_msgs/DiagnosticStatus`."""

    OK = 0
    WARNING = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class NodeHealth:
    """What one node said of itself last.

    Attributes
    ----------
    name : str
        Of the node.
    level : int
        A `Level`; any other number is taken for an error.
    message : str
        In one sentence.
    values : tuple of (str, str)
        Its figures by name, in its order: counts of gaps and missing points, rates, room left on
        the disk.
    """

    name: str
    level: int = Level.OK
    message: str = ""
    values: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Health:
    """What all nodes of a rig said last.

    Attributes
    ----------
    nodes : tuple of NodeHealth
        All of the rig. Of rates ("blocks per second"), of what went wrong ("gaps", "missing
        points", "views dropped", "impacts rejected") and of the "free space" the history is kept,
        by the name of the figure.
    stamp : int
        When, nanoseconds since the epoch.
    """

    nodes: tuple[NodeHealth, ...]
    stamp: int
