"""A topic as a recording describes it."""

from typing import NamedTuple


class Channel(NamedTuple):
    """One topic of a file.

    Attributes
    ----------
    id : int
        Unique in the file.
    topic : str
        Full name.
    type_name : str
        For example `impact_rig_msgs/msg/Impact`.
    schema : str
        Definition of the type, as `ros2msg`.
    metadata : dict
        `offered_qos_profiles` and `topic_type_hash` for ROS 2.
    """

    id: int
    topic: str
    type_name: str
    schema: str
    metadata: dict[str, str]
