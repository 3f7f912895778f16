"""What a campaign hears of hammer, accelerometers and recorder, and whether it may go on."""

from collections.abc import Callable
from dataclasses import dataclass

from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import AcquisitionState, HammerState, Impact, RecorderState

from impact_rig.nodes import interfaces
from impact_rig.nodes.peer import GONE, Peer
from impact_rig.nodes.rig_node import RigNode

WORD_TIMEOUT = 4.0
"""How long a node's state may take to come after its answer to a request [s], our choice: the two
travel apart, and what was lost on its way comes again with the next heartbeat, 3 s later at the
latest."""


@dataclass(frozen=True)
class Obstacle:
    """Why the next hit cannot begin now.

    Attributes
    ----------
    phase : int
        What the campaign does meanwhile: PAUSED or WAITING_FOR_HAMMER of
        `RunCampaign.Feedback`, or RUNNING while nothing is wrong.
    message : str
        In words, with what would end it.
    can_enable : bool
        Whether all that is missing is the enable, and not a person who took it.
    """

    phase: int
    message: str
    can_enable: bool = False


class RigWatch:
    """Listens to the states that a release depends on.

    Parameters
    ----------
    node : RigNode
        The campaign's.

    Attributes
    ----------
    hammer, acquisition : HammerState or AcquisitionState, or None
        As heard last; None: not heard of yet.
    """

    def __init__(self, node: RigNode) -> None:
        self.hammer: HammerState | None = None
        self.acquisition: AcquisitionState | None = None
        self._node = node
        self._losses = 0
        self._recorder: RecorderState | None = None
        self._recordings: set[str] = set()
        self._hammer_node = Peer(node, interfaces.HAMMER_STATE, self._take_hammer)
        self._accelerometer_node = Peer(node, interfaces.ACQUISITION_STATE, self._take_acquisition)
        self._recorder_node = Peer(node, interfaces.RECORDER_STATE, self._take_recorder)
        self._estimator_node: Peer | None = None

    @property
    def losses(self) -> int:
        """How often a node or device was lost, or the enable, since the start [-]."""
        peers = [self._hammer_node, self._accelerometer_node, self._recorder_node]
        if self._estimator_node is not None:
            peers.append(self._estimator_node)
        return self._losses + sum(peer.losses for peer in peers)

    def follow_estimator(self, take_verdict: Callable[[Impact], None]) -> None:
        """Listen to the estimator's verdicts, and miss it too when it is lost."""
        self._estimator_node = Peer(self._node, interfaces.IMPACT, take_verdict)

    def find_obstacle(self) -> Obstacle | None:
        """Return why the next hit cannot begin now, what is worst first; None: it can."""
        if loss := self._find_loss():
            return Obstacle(RunCampaign.Feedback.PAUSED, loss)
        return None if self.hammer is None else _find_hammer_obstacle(self.hammer)

    def is_lost_since(self, losses: int) -> bool:
        """Whether something is lost, or was since `losses` were counted."""
        return self.losses != losses or bool(self._find_loss())

    def has_gone(self) -> bool:
        """Whether the node of hammer or accelerometers, once heard, is not there any more."""
        return self._hammer_node.is_lost or self._accelerometer_node.is_lost

    def is_acquisition_lost(self) -> bool:
        """Whether the accelerometers say nothing more of what they were armed for."""
        state = self.acquisition
        return (
            state is None
            or state.state == AcquisitionState.FAULT
            or self._accelerometer_node.is_lost
        )

    def find_broken_way(self) -> str:
        """Return which node is lost of those that a verdict comes through; empty: none."""
        if self.is_acquisition_lost():
            return self._find_lost_device() or "the accelerometers say nothing"
        return self._find_lost_listener()

    def find_end_of_recording(self, recording: str) -> str:
        """Return why nothing more comes into a recording; empty: it goes on.

        A campaign does not outlive its recording: of hits that lie in two files, neither gives
        the campaign's results.

        Parameters
        ----------
        recording : str
            Its path on the recorder's host; empty: nothing is recorded.
        """
        recorder = self._recorder
        if not recording or recorder is None:
            return ""
        if self._recorder_node.has_left:
            return "the recorder has gone"
        if recording not in self._recordings:
            # The hammer has heard of it first: what was heard last here is of the one before.
            return ""
        if recorder.uri != recording:
            return f"the recorder has begun another recording, {recorder.uri}"
        if not (recorder.recording or recorder.waiting):
            return f"the recorder has stopped: {recorder.message}"
        return ""

    def _find_loss(self) -> str:
        """Return which node or device was there and is lost; empty: none."""
        return self._find_lost_device() or self._find_lost_listener()

    def _find_lost_device(self) -> str:
        for name, peer, message in (
            ("hammer", self._hammer_node, self.hammer),
            ("accelerometer", self._accelerometer_node, self.acquisition),
        ):
            if peer.is_lost:
                return f"the {name} node {GONE}"
            # The constant is the same of both.
            if message is not None and message.state == HammerState.FAULT:
                return f"the {name}'s device is lost: {message.message}"
        return ""

    def _find_lost_listener(self) -> str:
        if self._estimator_node is not None and self._estimator_node.is_lost:
            return f"the estimator {GONE}"
        # One that has left for good is missed by those alone whom it recorded.
        if self._recorder_node.is_lost and not self._recorder_node.has_left:
            return f"the recorder {GONE}"
        return ""

    def _take_hammer(self, message: HammerState) -> None:
        before, self.hammer = self.hammer, message
        is_new_fault = message.state == HammerState.FAULT and not (
            before is not None and before.state == HammerState.FAULT
        )
        self._losses += is_new_fault or bool(before and before.armed and not message.armed)

    def _take_acquisition(self, message: AcquisitionState) -> None:
        before, self.acquisition = self.acquisition, message
        self._losses += message.state == AcquisitionState.FAULT and not (
            before is not None and before.state == AcquisitionState.FAULT
        )

    def _take_recorder(self, message: RecorderState) -> None:
        self._recorder = message
        self._recordings.add(message.uri)


def _find_hammer_obstacle(hammer: HammerState) -> Obstacle | None:
    if hammer.disarmed_by == HammerState.EMERGENCY_STOP and not hammer.armed:
        return Obstacle(
            RunCampaign.Feedback.PAUSED,
            "emergency stop: to go on, call hammer/reset and then hammer/arm",
        )
    if hammer.state == HammerState.AWAY:
        return Obstacle(
            RunCampaign.Feedback.WAITING_FOR_HAMMER,
            "put the hammer back into its holder, then call hammer/confirm_held",
        )
    if hammer.state == HammerState.SWINGING:
        return Obstacle(RunCampaign.Feedback.RUNNING, "the hammer is on its way back")
    if hammer.armed:
        return None
    if hammer.disarmed_by == HammerState.LOSS:
        return Obstacle(
            RunCampaign.Feedback.PAUSED,
            f"the hammer was disarmed because something was lost ({hammer.message})",
            can_enable=True,
        )
    return Obstacle(
        RunCampaign.Feedback.PAUSED,
        f"the hammer is not armed ({hammer.message}): to go on, call hammer/arm",
    )
