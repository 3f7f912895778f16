"""Names, types and QoS of everything the rig's nodes say to each other: the one place.

All names are relative, so that a rig can be put into a namespace and remapped.
"""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from impact_rig_msgs import msg
from rclpy.duration import Duration
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)
from std_msgs.msg import Header, String

from impact_rig.recordings.fields import from_message

RESULT_DEPTH = 256
"""How many results are kept for who comes late [messages]: two of the paper's campaigns."""
STREAM_DEPTH = 500
"""How much of a running stream may wait before the oldest is lost [messages]: 5 s in blocks of
10 ms, for which a node may do something else. Only what waits takes memory, at the paper's rate
20 MB each second."""

LEASE = 2.0
"""After what time without a sign of life a node counts as silent [s]: an operator who
pulls a plug wants to see the enable go. The middleware gives one every two thirds of it, by a
separate thread, also while the node is busy."""


def make_qos(depth: int, *, latched: bool) -> QoSProfile:
    """Return the QoS of a topic on which nothing may be lost."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


SERVICES = make_qos(1000, latched=False)
"""Of the rig's services: by default of ROS 2 the eleventh request that waits drops the first."""


def keep(message: Any) -> Any:
    """Return a message unchanged: all its values are possible."""
    return message


def _by(module: str, name: str) -> Callable[[Any], Any]:
    """Return a conversion of messages, or the record that they hold, out of a module.

    It is imported when the first message comes: who stops the hammer waits for none of it.
    """

    def convert(message: Any) -> Any:
        found = getattr(import_module(f"impact_rig.{module}"), name)
        return from_message(found, message) if isinstance(found, type) else found(message)

    return convert


@dataclass(frozen=True)
class Topic:
    """A topic of the rig."""

    name: str  # relative to the rig's namespace
    type: Any  # message class
    qos: QoSProfile  # of publisher and subscribers alike
    # Returns what a message says, as one of our types; a RigError, ValueError or OverflowError
    # says why it cannot be meant.
    convert: Callable[[Any], Any] = keep
    owners: tuple[str, ...] = ()  # of these nodes one alone speaks on it; empty: anybody may

    @property
    def type_name(self) -> str:
        """The name of the message type, for example `std_msgs/msg/String`."""
        return f"{self.type.__module__.split('.')[0]}/msg/{self.type.__name__}"

    @property
    def leased_qos(self) -> QoSProfile:
        """The QoS of the rig's own publishers, and of subscribers that watch their liveliness."""
        if not self.owners:
            return self.qos
        leased = copy(self.qos)
        leased.liveliness = LivelinessPolicy.AUTOMATIC
        leased.liveliness_lease_duration = Duration(seconds=LEASE)
        return leased

    @property
    def unread(self) -> "Topic":
        """The topic without its conversion, for nodes that only pass messages on."""
        return replace(self, convert=keep)

    def deepen(self, depth: int) -> "Topic":
        """Return the topic with a subscriber's queue of at least so many messages."""
        qos = copy(self.qos)
        qos.depth = max(qos.depth, depth)
        return replace(self, qos=qos)


REPLAYS = ("replayer", "replay_client")
"""The nodes that publish what was recorded."""
_inward = partial(_by, "nodes.messages")
_finding = partial(_by, "nodes.result_messages")
_recorded = partial(_by, "recordings.messages")
_state = partial(_by, "status.states")
_BLOCK = _recorded("block_from_msg")
_RESULT = make_qos(RESULT_DEPTH, latched=True)
_LATEST = make_qos(1, latched=True)
_TRACES = make_qos(64, latched=True)
_PASSING = make_qos(10, latched=False)
_CAMPAIGN, _HAMMER, _RECORDER = ("campaign",), ("hammer",), ("recorder",)
_SOURCE, _ESTIMATOR = ("accelerometer",), ("estimator",)

SETUP = Topic("setup", msg.RigSetup, _LATEST, _recorded("setup_from_msg"), _CAMPAIGN)
ACCELERATION = Topic(
    "acceleration",
    msg.AccelerationBlock,
    make_qos(200, latched=False),
    _BLOCK,
    (*_SOURCE, *_ESTIMATOR),
)
RELEASE = Topic("release", msg.HammerRelease, _RESULT, _inward("check_release"), _HAMMER)
VIRTUAL_IMPACT = Topic(
    "virtual_impact", msg.VirtualImpact, _RESULT, _recorded("truth_from_msg"), _SOURCE
)
IMPACT = Topic("impact", msg.Impact, _RESULT, _finding("hit_results_from_msg"), _ESTIMATOR)
OVERRULE = Topic(
    "overrule", msg.Overrule, _RESULT, _recorded("overrule_from_msg"), (*_ESTIMATOR, *REPLAYS)
)
"""Persons' verdicts on hits; the newest of a hit counts. In a replay persons may decide, too."""
OVERRULE_STORED = Topic("overrule/stored", Header, _PASSING, owners=_RECORDER)
"""The overrule of this stamp is on the recorder's disk."""
IMPACT_TRACE = Topic(
    "impact/trace", msg.ImpactTrace, _TRACES, _finding("judged_traces_from_msg"), _ESTIMATOR
)
"""Traces as judged, 60 kB each, while somebody listens."""
ESTIMATE = Topic(
    "estimate",
    msg.SampleEstimate,
    _RESULT,
    _by("core.estimates.sample", "SampleEstimate"),
    _ESTIMATOR,
)
HAMMER_ESTIMATE = Topic(
    "hammer_estimate",
    msg.HammerEstimate,
    _LATEST,
    _by("core.estimates.paper_method", "HammerEstimate"),
    _ESTIMATOR,
)
COMPARISON = Topic(
    "comparison", msg.ModelComparison, _TRACES, _finding("traces_from_msg"), _ESTIMATOR
)
"""Measured and model traces, 80 kB each."""
HAMMER_STATE = Topic("hammer/state", msg.HammerState, _LATEST, _inward("hammer_from_msg"), _HAMMER)
ACQUISITION_STATE = Topic(
    "accelerometer/state", msg.AcquisitionState, _LATEST, _state("AcquisitionStatus"), _SOURCE
)
INPUT_LEVELS = Topic(
    "accelerometer/levels", msg.InputLevels, _PASSING, _by("status.levels", "InputLevels"), _SOURCE
)
"""Levels of the input monitor, and of a running stream."""
RECORDER_STATE = Topic(
    "recorder/state", msg.RecorderState, _LATEST, _state("RecorderStatus"), _RECORDER
)
CAMPAIGN_STATE = Topic(
    "campaign/state", msg.CampaignState, _LATEST, _inward("campaign_from_msg"), _CAMPAIGN
)
RECORD_STORED = Topic("recorder/stored", msg.RecordStored, _RESULT, owners=_RECORDER)
"""A record is on the recorder's disk. The stamp is that of its last block in the file."""
NOTE = Topic("note", String, _PASSING)
"""Notes of an operator while the rig runs."""
PAGE_ACT = Topic("page/act", String, _PASSING)
"""What a person asked for at the page, done or refused, and who."""

RECORDED_TOPICS = tuple(item for item in [*vars().values()] if isinstance(item, Topic))
"""Every topic above; what else the rig's nodes publish is recorded as it is discovered."""
STREAM = Topic(
    "acceleration/stream", msg.StreamBlock, make_qos(STREAM_DEPTH, latched=False), _BLOCK, _SOURCE
)
"""The running stream of continuous mode; the impacts in it come as `ACCELERATION`."""
DIAGNOSTICS = Topic(
    "/diagnostics", DiagnosticArray, QoSProfile(depth=64), _inward("health_from_msg")
)
"""Health of every node, once a second: one topic for all namespaces, as everywhere in ROS 2."""
REPLAYER_STATE = Topic("replayer/state", msg.ReplayerState, _LATEST)
COMPUTED_TOPICS = (IMPACT_TRACE, COMPARISON)
"""Those that are large and that a replay computes from the others: recorded where it is asked."""
OWNED_TOPICS = tuple(topic for topic in (*RECORDED_TOPICS, STREAM) if topic.owners)
"""Those on which one node alone speaks; another that takes its place is the owner."""


def make_join_name(node: str) -> str:
    """Return the service by which a campaign asks a node to take part in it."""
    return f"{node}/join"


ARM_ACCELEROMETER = "accelerometer/arm"
DISARM_ACCELEROMETER = "accelerometer/disarm"
MONITOR_INPUT = "accelerometer/monitor"
"""Shows the levels of the inputs while no campaign runs."""
ARM_HAMMER = "hammer/arm"
DISARM_HAMMER = "hammer/disarm"
SET_ARMED = "hammer/set_armed"
"""A campaign's: while hands are near the hammer it is disarmed."""
RELEASE_HAMMER = "hammer/release"
SET_ANGLE = "hammer/set_angle"
CONFIRM_HELD = "hammer/confirm_held"
"""A person has put the hammer back into its holder."""
EMERGENCY_STOP = "hammer/emergency_stop"
RESET_HAMMER = "hammer/reset"
"""Ends an emergency stop; after it the hammer must be armed again."""
HAMMER_ACTS = {
    "arm": ARM_HAMMER,
    "disarm": DISARM_HAMMER,
    "stop": EMERGENCY_STOP,
    "reset": RESET_HAMMER,
    "confirm": CONFIRM_HELD,
}
"""Acts of a person on the hammer, with their services."""
LATE_ACTS = ("arm", "reset", "confirm")
"""Those that do nothing when they come late; the others keep the hammer where it is."""
CONFIRM_SAMPLE = "campaign/confirm_sample"
GET_RESULTS = "estimator/get_results"
OVERRULE_HIT = "estimator/overrule"
PAUSE_CAMPAIGN = "campaign/pause"
"""The campaign stands, and the hammer is disarmed."""
RESUME_CAMPAIGN = "campaign/resume"
"""The person who calls it arms the hammer."""
RUN_CAMPAIGN = "campaign/run"
PAUSE_REPLAYER = "replayer/pause"
RESUME_REPLAYER = "replayer/resume"
