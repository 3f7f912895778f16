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
from rclpy.action import ActionClient
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from std_msgs.msg import String
from std_srvs.srv import Trigger

from impact_rig.core.errors import DeviceError, FileError
from impact_rig.core.paper_method import HammerEstimate
from impact_rig.core.sample import SampleEstimate
from impact_rig.core.speed_exponents import SpeedExponents
from impact_rig.nodes import interfaces, result_messages
from impact_rig.nodes.discovery import offer_profile
from impact_rig.nodes.executor import make_executor
from impact_rig.recordings.messages import SETUP_TYPE, setup_from_msg
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.source import find_recordings
from impact_rig.results.campaign import Results
from impact_rig.results.wire import from_message

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
        note_liveliness: Callable[[Any], None] | None = None,
    ) -> None:
        """Subscribe to one of the rig's topics."""
        self._node.create_subscription(
            topic.type,
            topic.name,
            callback,
            qos or (topic.leased_qos if note_liveliness else topic.qos),
            event_callbacks=SubscriptionEventCallbacks(
                liveliness=note_liveliness, use_default_callbacks=False
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
            If nobody offers it, or no answer comes.
        """
        client = self._node.create_client(kind, name)
        try:
            if not self.spin_until(client.service_is_ready, timeout):
                raise DeviceError(
                    f"no rig offers {client.srv_name} within {timeout:g} s: start one with"
                    " `impact-rig up`, and check ROS_DOMAIN_ID and the namespace on both sides"
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
PLACES = {
    HammerState.HELD: "held",
    HammerState.SWINGING: "swinging",
    HammerState.FAULT: "lost",
    HammerState.AWAY: "away",
}


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
            If it was refused, or nobody answers.
        """
        response = self.call(Trigger, SERVICES[action], Trigger.Request(), self._timeout)
        if not response.success:
            raise DeviceError(f"refused: {response.message}")
        return str(response.message)

    def describe(self) -> str:
        """Return in words what the hammer does; raises `DeviceError` if it does not say it."""
        heard: list[HammerState] = []
        self.listen(interfaces.HAMMER_STATE, heard.append)
        if not self.spin_until(lambda: bool(heard), self._timeout):
            raise DeviceError(
                f"no hammer says what it does within {self._timeout:g} s: start a rig with"
                " `impact-rig up`, and check ROS_DOMAIN_ID and the namespace on both sides"
            )
        told = heard[-1]
        state = f"{PLACES[told.state]}, {'armed' if told.armed else 'not armed'}"
        why = "" if told.message == state else f" ({told.message})"
        return f"{state}{why}; holder: {told.holder or 'none'}"


CANCEL_TIMEOUT = 5.0
"""How long a cancelled campaign may take to end [s]."""
RESEND_PERIOD = 3.0
"""How soon an unanswered goal is sent again [s], our choice."""
GONE_TIMEOUT = 60.0
"""How long the campaign node may give no sign of life before its client gives up [s]."""
LOOK_TIMEOUT = 5.0
"""How long the recorder may take to say where it records [s]."""
SERVICE_TIMEOUT = 20.0
"""How long the rig may take to answer what a person has done [s], our choice."""
NEW_ONES = QoSProfile(
    depth=interfaces.RELEASE.qos.depth,
    reliability=interfaces.RELEASE.qos.reliability,
    durability=DurabilityPolicy.VOLATILE,
)
"""Releases of the past are nobody's business here."""


CampaignGoal: TypeAlias = RunCampaign.Goal
"""What to run, as the action's definition says it."""


@dataclass(frozen=True)
class CampaignOutcome:
    """What came of a campaign.

    Attributes
    ----------
    success : bool
        Whether every sample has its hits.
    message : str
        Why not.
    results : Results or None
        What was found, up to where it ended; None: the rig never told its set-up.
    recording : str
        Path on the recorder's host; empty: nothing was recorded.
    """

    success: bool
    message: str
    results: Results | None
    recording: str


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
        """Hear that the hammer may be let go by hand, within so many seconds."""
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
        self._gone_since = math.inf
        self._recording = ""
        self._operator: Operator | None = None
        self._feedback = RunCampaign.Feedback()
        self._duties: list[Callable[[], None]] = []
        self.listen(interfaces.VIRTUAL_IMPACT, self.keep_truth)
        self.listen(interfaces.SETUP, lambda _: None, note_liveliness=self._note_campaign)
        self.listen(interfaces.RECORDER_STATE, self._keep_recording)
        self.listen(interfaces.ACQUISITION_STATE, self._keep_acquisition)
        self.listen(interfaces.RELEASE, self._take_release, NEW_ONES)
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
                f" {timeout:g} s: start one with `impact-rig up`, and check ROS_DOMAIN_ID and"
                " the namespace on both sides"
            )

    def wait_for_listeners(self, count: int, timeout: float) -> bool:
        """Wait until `count` nodes listen to the accelerometers; return whether they do."""
        return self.spin_until(
            lambda: self._node.count_subscribers(interfaces.ACCELERATION.name) >= count, timeout
        )

    def publish_note(self, text: str, timeout: float) -> None:
        """Say something that belongs into the recording.

        Raises
        ------
        DeviceError
            If no recorder listens within `timeout` seconds.
        """
        if not self.spin_until(lambda: self._note.get_subscription_count() > 0, timeout):
            raise DeviceError(
                "nobody records the notes: start the recorder, or the campaign without them"
            )
        self._note.publish(String(data=text))

    @property
    def is_hammerless(self) -> bool:
        """Whether no hammer strikes anything: hits are computed."""
        return self._acquisition is not None and self._acquisition.hammerless

    def run(self, goal: CampaignGoal, operator: Operator) -> CampaignOutcome:
        """Run a campaign to its end.

        Parameters
        ----------
        goal : CampaignGoal
            What to run.
        operator : Operator
            Sees it, and does what is asked of a person.

        Raises
        ------
        DeviceError
            If the rig goes away.
        """
        self._operator = operator
        self._duties.clear()
        self._gone_since = math.inf
        self._goal = self._send_goal(goal, lambda message: self._follow(message.feedback))
        answer = self._await_answer(self._goal.get_result_async())
        self._goal = self._operator = None
        return self._conclude(answer.result, answer.status)

    def _await_answer(self, result_future: Future) -> Any:
        """Do what is asked for until the campaign is over."""
        while not result_future.done():
            if time.monotonic() - self._gone_since > GONE_TIMEOUT:
                raise DeviceError("the campaign node has gone")
            if self._duties:
                self._duties.pop(0)()
            elif not self.spin_until(lambda: result_future.done() or bool(self._duties), 1.0):
                self._check_rig()
        return result_future.result()

    def _note_campaign(self, status: Any) -> None:
        """Show that the campaign node gives no sign of life, if that is so."""
        if self._operator is None or self._goal is None:
            return
        if status.alive_count:
            # Another one that answers for the goal does not know it.
            self._goal.get_result_async().add_done_callback(self._look_whether_it_is_known)
            return
        self._gone_since = time.monotonic()
        self._feedback.state = RunCampaign.Feedback.PAUSED
        self._feedback.message = "the campaign node has gone"
        self._operator.follow(self._feedback)

    def _look_whether_it_is_known(self, future: Future) -> None:
        answer = future.result()
        is_unknown = answer is None or answer.status == GoalStatus.STATUS_UNKNOWN
        self._gone_since = -math.inf if is_unknown else math.inf

    def _follow(self, feedback: Any) -> None:
        """Show a feedback, and note what it asks of a person."""
        is_asked_already = (feedback.state, feedback.sample) == (
            self._feedback.state,
            self._feedback.sample,
        )
        self._feedback = feedback
        if self._operator is None:
            return
        self._operator.follow(feedback)
        if is_asked_already:
            return
        if feedback.state == RunCampaign.Feedback.WAITING_FOR_SAMPLE:
            self._duties.append(self._mount)
        elif feedback.state == RunCampaign.Feedback.WAITING_FOR_HAMMER:
            self._duties.append(self._put_back)

    def _mount(self) -> None:
        sample = self._feedback.sample
        if self._operator is not None:
            self._operator.mount(sample)
            request = ConfirmSample.Request(sample=sample)
            self.call(ConfirmSample, interfaces.CONFIRM_SAMPLE, request, SERVICE_TIMEOUT)

    def _put_back(self) -> None:
        refusal = ""
        while self._operator is not None:
            self._operator.put_back(refusal)
            answer = self.call(
                Trigger, interfaces.CONFIRM_HELD, Trigger.Request(), SERVICE_TIMEOUT
            )
            if answer.success:
                return
            refusal = answer.message

    def _take_release(self, release: HammerRelease) -> None:
        """Tell a person who lets the hammer go by hand that it is time."""
        if self._operator is not None and release.latest_contact > release.swing_time:
            self._operator.let_go(release.sample, release.latest_contact)

    def cancel(self) -> None:
        """Ask a running campaign to stop, and wait until it has, for a bounded time."""
        if self._goal is None:
            return
        result_future = self._goal.get_result_async()
        self._goal.cancel_goal_async()
        # A campaign node that has ended meanwhile answers nobody.
        self.spin_until(
            lambda: result_future.done() or not self._action.server_is_ready(), CANCEL_TIMEOUT
        )
        self._goal = None

    def _conclude(self, result: RunCampaign.Result, status: int) -> CampaignOutcome:
        return CampaignOutcome(
            success=result.success and status == GoalStatus.STATUS_SUCCEEDED,
            message=result.message,
            results=self.collect(result, has_truths=self.is_hammerless),
            recording=result.recording,
        )

    def _send_goal(self, goal: CampaignGoal, take_feedback: Callable[[Any], None]) -> Any:
        """Send the goal until it is answered.

        A server that has not met this client's reader yet drops both answer and goal.
        """
        pending: list[Future] = []
        while not any(future.done() for future in pending):
            self._check_rig()
            pending.append(self._action.send_goal_async(goal, take_feedback))
            self.spin_until(lambda: any(future.done() for future in pending), RESEND_PERIOD)
        return next(future.result() for future in pending if future.done())

    def _check_rig(self) -> None:
        self._check()
        rest = self._node.count_publishers(interfaces.ACQUISITION_STATE.name)
        if not self._action.server_is_ready() and not rest:
            raise DeviceError("the campaign node has gone: see the rig's log")

    def _keep_acquisition(self, message: AcquisitionState) -> None:
        self._acquisition = message

    def _keep_recording(self, message: RecorderState) -> None:
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
