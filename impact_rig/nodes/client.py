"""Programs that talk to a rig's nodes without being one of them: for the hammer, for campaigns."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, Self, TypeAlias

import rclpy
from action_msgs.msg import GoalStatus
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import (
    AcquisitionState,
    HammerRelease,
    HammerState,
    RecorderState,
    RigSetup,
    VirtualImpact,
)
from impact_rig_msgs.srv import ConfirmSample, GetResults
from rcl_interfaces.msg import Log
from rclpy.action import ActionClient
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from std_msgs.msg import String
from std_srvs.srv import Trigger

from impact_rig.core.errors import DeviceError, FileError, RigError
from impact_rig.core.paper_method import HammerEstimate
from impact_rig.core.sample import SampleEstimate
from impact_rig.core.speed_exponents import SpeedExponents
from impact_rig.nodes import interfaces, result_messages
from impact_rig.nodes.discovery import offer_profile
from impact_rig.nodes.executor import make_executor
from impact_rig.nodes.guarded_hammer import HammerPlace
from impact_rig.recordings.messages import SETUP_TYPE, setup_from_msg
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.source import find_recordings
from impact_rig.results.campaign import Results
from impact_rig.results.wire import from_message

START_ONE = (
    "start one with `impact-rig up`, and check ROS_DOMAIN_ID and the namespace on both sides"
)
LOOK_PERIOD = 0.1
"""How often something that sends no event is looked at [s]."""
TRUTH_TIMEOUT = 2.0
"""How long the virtual rig may take to tell its faults of rejected hits after the last one [s]."""


class RigClient:
    """Talks to a rig that is up, here or on another host; use it in a ``with`` statement.

    Nothing happens behind its back: messages are taken while one of its methods waits.

    Parameters
    ----------
    name : str
        Of its node.
    namespace : str
        Of the rig.
    """

    def __init__(self, name: str, namespace: str = "") -> None:
        self._context = rclpy.Context()
        with offer_profile():
            rclpy.init(context=self._context, args=[])
            # A guest, of whom no parameter is asked: the less there is to tell of, the sooner.
            self._node = Node(
                name,
                namespace=namespace or None,
                context=self._context,
                enable_rosout=False,
                start_parameter_services=False,
            )
        self._executor = make_executor(self._context)
        self._executor.add_node(self._node)
        self._faults: dict[int, tuple[str, ...]] = {}

    def __enter__(self) -> Self:
        """Return the client."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave ROS."""
        self._executor.shutdown(timeout_sec=1.0)
        self._node.destroy_node()
        self._context.try_shutdown()

    def listen(
        self,
        topic: interfaces.Topic,
        callback: Callable[[Any], None],
        qos: QoSProfile | None = None,
        on_liveliness: Callable[[Any], None] | None = None,
    ) -> None:
        """Subscribe to one of the rig's topics."""
        self._node.create_subscription(
            topic.type,
            topic.name,
            callback,
            qos or (topic.leased_qos if on_liveliness else topic.qos),
            event_callbacks=SubscriptionEventCallbacks(
                liveliness=on_liveliness, use_default_callbacks=False
            ),
        )

    def collect(
        self, result: RunCampaign.Result | GetResults.Response, *, has_truths: bool
    ) -> Results | None:
        """Return what came back over ROS as the results that leave the rig; None: of no set-up.

        Parameters
        ----------
        result : RunCampaign.Result or GetResults.Response
            What was found.
        has_truths : bool
            Whether the virtual rig tells its faults of each hit, for which to wait a little.
        """
        hits = sorted([*result.accepted, *result.rejected], key=lambda hit: hit.record)
        if has_truths:
            self.spin_until(lambda: all(hit.record in self._faults for hit in hits), TRUTH_TIMEOUT)
        if not result.setup.samples:
            return None
        return Results(
            setup=setup_from_msg(result.setup),
            hammer=from_message(HammerEstimate, result.hammer),
            samples=tuple(from_message(SampleEstimate, each) for each in result.samples),
            hits=tuple(
                result_messages.hit_results_from_msg(hit, self._faults.get(hit.record, ()))
                for hit in hits
            ),
            speed_exponents=tuple(
                from_message(SpeedExponents, each) for each in result.speed_exponents
            ),
        )

    def keep_truth(self, message: VirtualImpact) -> None:
        """Take what the virtual rig did on purpose."""
        self._faults[message.record] = tuple(message.faults)

    def spin_until(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Take messages until a condition is true; return whether it came true in time [s]."""
        deadline = time.monotonic() + timeout
        while not condition():
            left = deadline - time.monotonic()
            if left <= 0.0:
                return False
            self._executor.spin_once(timeout_sec=min(left, LOOK_PERIOD))
        return True

    def call(self, kind: Any, name: str, request: Any, timeout: float) -> Any:
        """Call a service of the rig and return its answer.

        Parameters
        ----------
        kind : type
            Of the service.
        name : str
            Of the service.
        request : message
            What is asked.
        timeout : float
            [s]

        Raises
        ------
        DeviceError
            If no node offers it, or no answer comes.
        """
        client = self._node.create_client(kind, name)
        try:
            if not self.spin_until(client.service_is_ready, timeout):
                raise DeviceError(
                    f"no rig offers {client.srv_name} within {timeout:g} s: {START_ONE}"
                )
            future = client.call_async(request)
            if not self.spin_until(future.done, timeout):
                raise DeviceError(f"{client.srv_name} did not answer within {timeout:g} s")
            return future.result()
        finally:
            self._node.destroy_client(client)


SERVICES = {
    "arm": interfaces.ARM_HAMMER,
    "disarm": interfaces.DISARM_HAMMER,
    "stop": interfaces.EMERGENCY_STOP,
    "reset": interfaces.RESET_HAMMER,
    "confirm": interfaces.CONFIRM_HELD,
}
"""What can be asked for, and by which service."""


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
            If it was refused, or no answer comes.
        """
        response = self.call(Trigger, SERVICES[action], Trigger.Request(), self._timeout)
        if not response.success:
            raise DeviceError(f"refused: {response.message}")
        return str(response.message)

    def describe(self) -> str:
        """Return in words what the hammer does; raises `DeviceError` if it publishes no state."""
        states: list[HammerState] = []
        self.listen(interfaces.HAMMER_STATE, states.append)
        if not self.spin_until(lambda: bool(states), self._timeout):
            raise DeviceError(
                f"no hammer publishes its state within {self._timeout:g} s: {START_ONE}"
            )
        state = states[-1]
        text = (
            f"{HammerPlace(state.state).name.lower()}, {'armed' if state.armed else 'not armed'}"
        )
        why = "" if state.message == text else f" ({state.message})"
        return f"{text}{why}; holder: {state.holder or 'none'}"


CANCEL_TIMEOUT = 5.0
"""How long a cancelled campaign may take to end [s]."""
RESEND_PERIOD = 3.0
"""How soon an unanswered goal is sent again [s], our choice."""
GONE_TIMEOUT = 60.0
"""How long the campaign node may give no sign of life before its client gives up [s]."""
LOOK_TIMEOUT = 5.0
"""How long the recorder may take to publish where it records, and a log to arrive [s]."""
SERVICE_TIMEOUT = 20.0
"""How long the rig may take to answer what a person has done [s], our choice."""
NEW_ONES = QoSProfile(
    depth=interfaces.RELEASE.qos.depth,
    reliability=interfaces.RELEASE.qos.reliability,
    durability=DurabilityPolicy.VOLATILE,
)
"""Earlier releases are not received."""


CampaignGoal: TypeAlias = RunCampaign.Goal
"""As the definition of the action has it."""


@dataclass(frozen=True)
class CampaignOutcome:
    """The end of a campaign."""

    success: bool  # every sample has its hits
    message: str  # why not
    results: Results | None  # up to the end; None: the rig never published its set-up
    recording: str  # path on the recorder's host; empty: nothing was recorded


class Operator(Protocol):
    """Who sees what a campaign does, and has a hand in it."""

    def follow(self, feedback: Any) -> None:
        """See one feedback of the campaign action."""
        ...

    def mount(self, sample: str) -> None:
        """Mount a sample; return when it is."""
        ...

    def put_back(self, refusal: str) -> None:
        """Put the hammer back into its holder; return when it is there.

        Parameters
        ----------
        refusal : str
            Why it did not count as held after the last time; empty: this is the first.
        """
        ...

    def let_go(self, sample: str, patience: float) -> None:
        """Release the hammer by hand, within so many seconds."""
        ...


class CampaignClient(RigClient):
    """Runs campaigns on a rig that is up; use it in a ``with`` statement.

    Parameters
    ----------
    namespace : str
        Of the rig.
    check : callable
        Called while waiting; may raise, when waiting has become pointless.
    """

    def __init__(self, namespace: str = "", check: Callable[[], None] = lambda: None) -> None:
        super().__init__("campaign_client", namespace)
        self._check = check
        self._acquisition: AcquisitionState | None = None
        self._goal: Any = None
        self._result = Future()
        self._gone_since = math.inf
        self._recording = ""
        self._operator: Operator | None = None
        self._feedback = RunCampaign.Feedback()
        self._duties: list[Callable[[Operator], None]] = []
        self.listen(interfaces.VIRTUAL_IMPACT, self.keep_truth)
        self.listen(interfaces.SETUP, lambda _: None, on_liveliness=self._on_liveliness)
        self.listen(interfaces.RECORDER_STATE, self._on_recorder_state)
        self.listen(interfaces.ACQUISITION_STATE, self._on_acquisition_state)
        self.listen(interfaces.RELEASE, self._on_release, NEW_ONES)
        note = interfaces.NOTE
        self._note = self._node.create_publisher(note.type, note.name, note.qos)
        self._action = ActionClient(self._node, RunCampaign, interfaces.RUN_CAMPAIGN)

    def __exit__(self, *_: object) -> None:
        """Leave ROS."""
        self._action.destroy()
        super().__exit__()

    def wait_for_rig(self, timeout: float) -> None:
        """Wait so many seconds until campaign node and accelerometers answer.

        Raises
        ------
        DeviceError
            If the rig does not appear in time.
        """

        def is_ready() -> bool:
            self._check()
            return self._action.server_is_ready() and self._acquisition is not None

        if not self.spin_until(is_ready, timeout):
            raise DeviceError(
                f"no rig answers in namespace {self._node.get_namespace()!r} within"
                f" {timeout:g} s: {START_ONE}"
            )

    def wait_for_listeners(self, count: int, timeout: float) -> bool:
        """Wait until `count` nodes listen to the accelerometers; return whether they do."""
        return self.spin_until(
            lambda: self._node.count_subscribers(interfaces.ACCELERATION.name) >= count, timeout
        )

    def publish_note(self, text: str, timeout: float) -> None:
        """Publish a remark for the recording.

        Raises
        ------
        DeviceError
            If no recorder listens within `timeout` seconds.
        """
        if not self.spin_until(lambda: self._note.get_subscription_count() > 0, timeout):
            raise DeviceError(
                "no recorder listens to the notes: start it, or the campaign without notes"
            )
        self._note.publish(String(data=text))

    @property
    def is_hammerless(self) -> bool:
        """Whether no hammer strikes anything: hits are computed."""
        return self._acquisition is not None and self._acquisition.hammerless

    def run(self, goal: CampaignGoal, operator: Operator) -> CampaignOutcome:
        """Run a campaign to its end; the operator sees it, and does what is asked of a person.

        Raises
        ------
        DeviceError
            If the rig goes away.
        RigError
            If the goal is rejected.
        """
        self._operator, self._gone_since = operator, math.inf
        self._duties.clear()
        self._goal = self._send_goal(goal)
        self._result = self._goal.get_result_async()
        while not self._result.done():
            if time.monotonic() - self._gone_since > GONE_TIMEOUT:
                raise DeviceError("the campaign node has gone")
            if self._duties:
                self._duties.pop(0)(operator)
            elif not self.spin_until(lambda: self._result.done() or bool(self._duties), 1.0):
                self._check_rig()
        answer = self._result.result()
        self._goal = self._operator = None
        if answer.status == GoalStatus.STATUS_UNKNOWN:
            raise DeviceError(
                "the campaign node was started again, and does not know the campaign"
            )
        return CampaignOutcome(
            success=answer.result.success and answer.status == GoalStatus.STATUS_SUCCEEDED,
            message=answer.result.message,
            results=self.collect(answer.result, has_truths=self.is_hammerless),
            recording=answer.result.recording,
        )

    def _send_goal(self, goal: CampaignGoal) -> Any:
        """Send the goal until it is answered.

        A server that has not met this client's reader yet drops both answer and goal.
        """
        pending: list[Future] = []
        while not any(future.done() for future in pending):
            self._check_rig()
            pending.append(self._action.send_goal_async(goal, self._on_feedback))
            self.spin_until(lambda: any(future.done() for future in pending), RESEND_PERIOD)
        handle = next(future.result() for future in pending if future.done())
        if not handle.accepted:
            raise RigError(interfaces.GOAL_REJECTED + self._find_rejection())
        return handle

    def _find_rejection(self) -> str:
        """Return why a goal was rejected, from the log: the answer to a goal has no text."""
        reasons: list[str] = []

        def on_log(log: Log) -> None:
            if log.msg.startswith(interfaces.GOAL_REJECTED):
                reasons.append(log.msg.removeprefix(interfaces.GOAL_REJECTED))

        self._node.create_subscription(Log, "/rosout", on_log, interfaces.IMPACT.qos)
        self.spin_until(lambda: bool(reasons), LOOK_TIMEOUT)
        self.spin_until(lambda: False, LOOK_PERIOD)  # the newest comes behind earlier ones
        return reasons[-1] if reasons else "see the log of the campaign node"

    def _check_rig(self) -> None:
        self._check()
        rest = self._node.count_publishers(interfaces.ACQUISITION_STATE.name)
        if not self._action.server_is_ready() and not rest:
            raise DeviceError("the campaign node has gone: see the rig's log")

    def cancel(self) -> None:
        """Ask a running campaign to stop, and wait until it has, for a bounded time."""
        if self._goal is None:
            return
        self._goal.cancel_goal_async()
        # A campaign node that has ended meanwhile does not answer.
        self.spin_until(
            lambda: self._result.done() or not self._action.server_is_ready(), CANCEL_TIMEOUT
        )
        self._goal = None

    def _on_liveliness(self, status: Any) -> None:
        """Show that the campaign node gives no sign of life."""
        if self._operator is None or self._goal is None:
            return
        if status.alive_count:
            self._gone_since = math.inf
            # A node that was started again answers that it does not know the goal.
            self._result = self._goal.get_result_async()
            return
        self._gone_since = time.monotonic()
        self._feedback.state = RunCampaign.Feedback.PAUSED
        self._feedback.message = "the campaign node has gone"
        self._operator.follow(self._feedback)

    def _on_feedback(self, message: Any) -> None:
        """Show a feedback; what it asks of a person is done outside of callbacks."""
        feedback, before = message.feedback, self._feedback
        self._feedback = feedback
        if self._operator is None:
            return
        self._operator.follow(feedback)
        if (feedback.state, feedback.sample) == (before.state, before.sample):
            return
        if feedback.state == RunCampaign.Feedback.WAITING_FOR_SAMPLE:
            self._duties.append(self._mount)
        elif feedback.state == RunCampaign.Feedback.WAITING_FOR_HAMMER:
            self._duties.append(self._put_back)

    def _mount(self, operator: Operator) -> None:
        sample = self._feedback.sample
        operator.mount(sample)
        request = ConfirmSample.Request(sample=sample)
        self.call(ConfirmSample, interfaces.CONFIRM_SAMPLE, request, SERVICE_TIMEOUT)

    def _put_back(self, operator: Operator) -> None:
        refusal, is_held = "", False
        while not is_held:
            operator.put_back(refusal)
            request = Trigger.Request()
            answer = self.call(Trigger, interfaces.CONFIRM_HELD, request, SERVICE_TIMEOUT)
            refusal, is_held = answer.message, answer.success

    def _on_release(self, release: HammerRelease) -> None:
        """Show a person who releases the hammer by hand that it is time."""
        if self._operator is not None and release.latest_contact > release.swing_time:
            self._operator.let_go(release.sample, release.latest_contact)

    def _on_acquisition_state(self, message: AcquisitionState) -> None:
        self._acquisition = message

    def _on_recorder_state(self, message: RecorderState) -> None:
        self._recording = message.uri

    @property
    def run_folder(self) -> Path | None:
        """Where the rig records, on the recorder's host; None: nowhere, or it is not known."""
        return Path(self._recording).parent if self._recording else None

    def check_run(self, folder: Path) -> None:
        """Require that the rig records into a run's folder, as far as that can be seen from here.

        Raises
        ------
        DeviceError
            If it records elsewhere.
        """
        self.spin_until(lambda: bool(self._recording), LOOK_TIMEOUT)
        recording = Path(self._recording)
        if recording.exists() and recording.parent != folder.resolve():
            raise DeviceError(
                f"the rig records into {recording.parent}: start it with"
                f" `impact-rig up --resume {folder}`"
            )


def read_newest_campaign(folder: Path) -> RigSetup:
    """Return the set-up of the newest campaign in the recordings of a run, as a message.

    Raises
    ------
    FileError
        If there is none.
    """
    newest: RigSetup | None = None
    for path in find_recordings(folder):
        for raw in Scan(path).read_messages(lambda channel: channel.type_name == SETUP_TYPE):
            message = deserialize_message(raw.data, RigSetup)
            if message.plan.impacts:
                newest = message
    if newest is None:
        raise FileError(f"{folder} holds no campaign that could go on")
    return newest
