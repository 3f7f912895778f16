"""The page at the rig: what the rig says goes to browsers, what a person does comes back.

It knows the rig through topics, services and the action alone. Nothing waits for it, and it is no
way around the interlock: it asks the hammer as every other program does.
"""

import math
import shutil
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

from action_msgs.srv import CancelGoal
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.srv import Act as ActService
from impact_rig_msgs.srv import ConfirmSample, OverruleHit
from rclpy.node import Node
from rclpy.task import Future as RosFuture
from std_msgs.msg import String
from std_srvs.srv import SetBool

from impact_rig.configuration.processes import Notice, notify
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.errors import DeviceError, ParameterError
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.hit.overrules import Overrule, Verdict
from impact_rig.nodes import interfaces
from impact_rig.nodes.acts import fill_act
from impact_rig.nodes.campaign_feed import CampaignFeed
from impact_rig.nodes.executor import make_executor, spin_until
from impact_rig.nodes.identity import Identity, id_to_msg, make_id
from impact_rig.nodes.intake import Intake, Received
from impact_rig.nodes.result_messages import overrule_to_msg
from impact_rig.nodes.rig_node import RigNode
from impact_rig.page.access import Address, keep_token
from impact_rig.page.sentence import make_sentence, say_plainly
from impact_rig.page.server import LONGEST_FIELD, STOP, Act, Answer, Form, PageServer
from impact_rig.page.traces import integrate_hammer, pack_traces
from impact_rig.page.view import make_view
from impact_rig.recordings.campaigns import is_trial
from impact_rig.recordings.fields import NO_ID
from impact_rig.results.campaign import HitResults
from impact_rig.results.traces import JudgedTraces
from impact_rig.status.rig_status import RigStatus
from impact_rig.status.states import CampaignStatus, HammerStatus, NodeHealth

SHOW_PERIOD = 0.05
"""Between two views at least [s]: a person sees no more."""
REFUSAL_TIME = 0.5
"""How long a campaign may take to refuse what a form asks for [s], our choice: it looks at no more
than names and numbers."""
RETRY_PERIOD = 0.02
"""How soon a node is asked again that has answered "later" [s]."""
LARGEST_RECORD = 2**32 - 1
ACTS = {
    **interfaces.HAMMER_ACTS,
    "pause": interfaces.PAUSE_CAMPAIGN,
    "resume": interfaces.RESUME_CAMPAIGN,
}
"""Services for a person's acts, by the names of their forms."""
FROM_CAMPAIGN = ("mounted", "start", "resume")
"""Acts that are made from the campaign's state, and may lead to a swing."""
LATE_ACTS = (*interfaces.LATE_ACTS, *FROM_CAMPAIGN)
"""Acts that do nothing when they come late."""
QUIET = (interfaces.NOTE, interfaces.PAGE_ACT, interfaces.DIAGNOSTICS)
"""Topics that anybody may flood: what they say is shown once a second."""
ANSWERERS = {"overrule": "analysis", "monitor": "source"}
"""Who answers to an act, if not the campaign or the hammer."""


class PageNode(RigNode):
    """Serves the page at the rig."""

    def __init__(self, **options: Any) -> None:
        super().__init__("page", **options)
        self._status = RigStatus(self.get_namespace())
        self._feed = feed = CampaignFeed(self._on_campaign, self._on_finding)
        self._server: PageServer | None = None
        self._is_shown, self._shown_sentence = True, ("", "")
        self._traced = ""  # sample of the newest trace
        self._lock = threading.Lock()  # of what the rig has said
        self._notes = self.advertise(interfaces.NOTE)
        self._asked = self.advertise(interfaces.PAGE_ACT)
        self._hands = _Hands(self)
        hammer = replace(
            interfaces.HAMMER_STATE, name=self.resolve_topic_name(interfaces.HAMMER_STATE.name)
        )
        Intake(self._hands.node).subscribe(hammer, self._on_hammer)
        ask, campaigns = self._ask, f"{interfaces.RUN_CAMPAIGN}/_action"
        start = RunCampaign.Impl.SendGoalService
        self._results = self._hands.node.create_client(
            RunCampaign.Impl.GetResultService,
            self.resolve_service_name(f"{campaigns}/get_result"),
        )
        self._acts: dict[str, Act] = {
            **{act: ask(act, ActService, service) for act, service in ACTS.items()},
            "mounted": ask("mounted", ConfirmSample, interfaces.CONFIRM_SAMPLE, _read_sample),
            "overrule": ask("overrule", OverruleHit, interfaces.OVERRULE_HIT, self._read_overrule),
            "monitor": ask("monitor", SetBool, interfaces.MONITOR_INPUT, _read_switch),
            "start": ask("start", start, f"{campaigns}/send_goal", _read_goal, self._answer_start),
            # A request without a goal's id cancels them all.
            "end": ask("end", CancelGoal, f"{campaigns}/cancel_goal"),
            "note": self._note,
        }
        self.offer_to_join()
        for topic, callback in (
            (interfaces.SETUP, feed.on_setup),
            (interfaces.CAMPAIGN_STATE, self._on_state),
            (interfaces.ACQUISITION_STATE, self._on_state),
            (interfaces.RECORDER_STATE, self._on_state),
            (interfaces.INPUT_LEVELS, self._on_state),
            (interfaces.NOTE, self._on_note),
            (interfaces.PAGE_ACT, self._on_note),
            (interfaces.DIAGNOSTICS, self._on_health),
            (interfaces.IMPACT, feed.on_finding),
            (interfaces.ESTIMATE, feed.on_finding),
            (interfaces.IMPACT_TRACE, feed.on_finding),
        ):
            self.listen(topic, callback)
        # Stops that the hammer has answered to, and whose state has not come yet.
        self._stops: list[tuple[Future[Answer], Answer]] = []
        self._open_stop = Form({}, "", "")  # the newest that was asked for
        self._told = ""  # of the address, besides itself
        self._hands.start()
        self.create_timer(SHOW_PERIOD, self._show)
        self.create_timer(1.0, self._look_round)
        self._disk = ""

    def configure(self) -> None:
        """Listen for browsers."""
        paths = (self.get_value(name) for name in ("certificate", "key"))
        files = [Path(path) if path else None for path in paths]
        address = Address(self.get_value("address"), self.get_value("port"), *files)
        token, self._told = "", ""
        if not address.is_local:
            token, path = keep_token(Path.cwd())
            self._told = f", by its link: the token is in {path}"
        self._server = PageServer(address, self._acts, token, LATE_ACTS)
        self._server.__enter__()
        self._server.show(make_view(self._status))
        if address.port not in (0, self._server.port):
            self.get_logger().warning(
                f"port {address.port} is taken: the page is at port {self._server.port}"
            )

    def activate(self) -> None:
        """Announce the address of the page; its token goes only to the process that started it."""
        if self._server is not None:
            self.get_logger().info(f"the page listens at {self._server.origin}{self._told}")
            notify(Notice.PAGE, " ".join(self._server.links))

    def close(self) -> None:
        """Close, and let nothing more be done."""
        super().close()
        self._hands.end()

    def cleanup(self) -> None:
        """Close the page."""
        if self._server is not None:
            self._server.__exit__()
            self._server = None

    # What the rig says.

    def on_received(
        self, topic: interfaces.Topic, callback: Callable[[Any], None], received: Received[Any]
    ) -> None:
        """Call back, and show soon."""
        with self._lock:
            super().on_received(topic, callback, received)
        self._is_shown &= topic in QUIET

    def _on_campaign(self, received: Received[RigSetup]) -> None:
        self._status.begin(received.value, is_trial=is_trial(received.message))

    def _on_hammer(self, received: Received[HammerStatus]) -> None:
        """Show at once whether the hammer is armed."""
        with self._lock:
            self._status.keep(received.value)
        self._is_shown = False
        self._show()
        self._settle_stops()

    def _on_state(self, received: Received[Any]) -> None:
        self._status.keep(received.value)

    def _on_note(self, received: Received[String]) -> None:
        text = received.value.data[:LONGEST_FIELD]
        self._status.notes.appendleft(f"{datetime.now().astimezone():%H:%M} {text}")

    def _on_health(self, received: Received[tuple[NodeHealth, ...]]) -> None:
        self._status.add_health(received.value)

    def _on_finding(self, received: Received[HitResults | SampleEstimate | JudgedTraces]) -> None:
        match received.value:
            case HitResults() as hit:
                self._status.add_hit(hit)
            case SampleEstimate() as estimate:
                self._status.estimates[estimate.name] = estimate
            case JudgedTraces() as traces:
                self._add_traces(traces)

    def _add_traces(self, traces: JudgedTraces) -> None:
        label = traces.aligned.label
        self._status.full_scales = traces.full_scale
        self._status.speed_changes = {label.record: integrate_hammer(traces)}  # of the last hit
        if self._server is not None:
            packed = pack_traces(traces, self._status.list_levels())
            self._server.show_trace(label.record, packed, is_first=label.sample != self._traced)
            self._traced = label.sample

    def _show(self) -> None:
        """Show what is new; the sentence also changes by time alone."""
        if (server := self._server) is None:
            return
        with self._lock:
            sentence = make_sentence(self._status).key
            if not self._is_shown or sentence != self._shown_sentence:
                self._is_shown, self._shown_sentence = True, sentence
                server.show(make_view(self._status, self._disk))

    def _look_round(self) -> None:
        """Show what has changed of the disk and of the nodes' health; repeat an open stop."""
        if self._status.stop_asked_at is not None:
            # Its tab may be closed.
            with suppress(DeviceError):
                self._acts[STOP](self._open_stop)
        self._disk = ""
        if path := self._status.recorder.uri:
            with suppress(OSError):  # it is on another computer
                self._disk = f"{shutil.disk_usage(Path(path).parent).free / 1e9:.0f} GB left"
        self._is_shown = False

    # What a person does; called in the server's thread.

    def _ask(
        self,
        act: str,
        kind: Any,
        name: str,
        read: Callable[[Form], dict[str, Any]] = lambda _: {},
        follow: Callable[[Any, "Future[Answer]"], None] | None = None,
    ) -> Act:
        """Return an act that calls a service of the rig with what `read` finds in a form.

        `follow` gives the answer to what was done, where the service itself cannot.
        """
        client = self._hands.node.create_client(kind, self.resolve_service_name(name))

        def call(form: Form) -> "Future[Answer]":
            answer: Future[Answer] = Future()
            request, deadline = kind.Request(**read(form)), time.monotonic() + self.answer_timeout
            if hasattr(asked := getattr(request, "goal", request), "by"):
                self._fill(asked, act, form)
            if act == STOP:
                self._open_stop = form
                self._status.stop_asked_at = self._status.stop_asked_at or self._status.clock()
            if not client.service_is_ready():
                who = ANSWERERS.get(act, name.partition("/")[0])
                raise DeviceError(f"not done: the {who} does not answer")

            def finish(done: Any) -> None:
                response = done.result()
                if getattr(response, "later", False) and time.monotonic() < deadline:
                    threading.Timer(RETRY_PERIOD, send).start()
                    return
                # Goals are accepted, their ends have a code, all other acts succeed.
                is_done = getattr(response, "accepted", not getattr(response, "return_code", 0))
                if follow is not None and is_done:
                    follow(request, answer)
                    return
                message = getattr(response, "message", "")
                result = Answer(getattr(response, "success", is_done), say_plainly(message))
                if act == STOP and result.done:
                    self._stops.append((answer, result))
                    self._settle_stops()
                else:
                    _settle(answer, result)

            def send() -> None:
                pending = client.call_async(request)
                pending.add_done_callback(finish)
                # Who asked has gone: nothing is kept.
                answer.add_done_callback(lambda _: client.remove_pending_request(pending))

            send()
            self._write_down(self._asked, form, _describe(act, form))
            return answer

        return call

    def _fill(self, request: Any, act: str, form: Form) -> None:
        """Say who acts; of what may lead to a swing also from which state, and until when."""
        request.by = form.by
        if act not in LATE_ACTS:
            return
        try:
            hammer, hammer_stamp, campaign, stamp = map(int, form["seen"].split()[2:])
        except ValueError:
            raise ParameterError("not done: the form does not say what was shown") from None
        state: CampaignStatus | HammerStatus = HammerStatus(number=hammer, stamp=hammer_stamp)
        if act in FROM_CAMPAIGN:
            state = CampaignStatus(number=campaign, stamp=stamp)
        if not state.stamp:
            raise DeviceError("not done: the rig has not said anything yet")
        fill_act(request, state, form.by)

    def _settle_stops(self) -> None:
        """Answer to stops once the hammer's own state says that it is stopped."""
        if not self._status.hammer.is_stopped:
            return
        self._status.stop_asked_at = None
        stops, self._stops = self._stops, []
        for answer, result in stops:
            _settle(answer, result)

    def _answer_start(self, request: Any, answer: "Future[Answer]") -> None:
        """Answer that a campaign begins, unless it is refused: that is its result, at once."""
        begun = threading.Timer(REFUSAL_TIME, _settle, [answer, Answer(done=True, message="")])

        def refuse(done: Any) -> None:
            begun.cancel()
            result = done.result().result
            message = "" if result.success else say_plainly(result.message)
            _settle(answer, Answer(result.success, message))

        asked = self._results.call_async(self._results.srv_type.Request(goal_id=request.goal_id))
        asked.add_done_callback(refuse)
        begun.start()

    def _read_overrule(self, form: Form) -> dict[str, Any]:
        """Return a person's verdict on a hit; raises `ParameterError` if it cannot be meant."""
        record, verdict = form["record"], form["verdict"]
        names = [item.name.lower() for item in Verdict]
        if not record.isdecimal() or verdict not in names:
            raise ParameterError(
                f"record {record!r} is {verdict!r}: write a number, and one of {', '.join(names)}"
            )
        # A number that no message holds is that of no hit.
        number = min(int(record), LARGEST_RECORD)
        overrule = Overrule(number, Verdict[verdict.upper()], form["reason"], form.who)
        identity = Identity(self._feed.campaign_id or NO_ID)
        stamp = self.get_clock().now().to_msg()
        return {"overrule": overrule_to_msg(overrule, identity, stamp)}

    def _write_down(self, publisher: Any, form: Form, what: str) -> None:
        """Publish an act or a note, and its person, for the recording."""
        publisher.publish(String(data=f"{form.by}: {what}"[:LONGEST_FIELD]))

    def _note(self, form: Form) -> "Future[Answer]":
        answer: Future[Answer] = Future()
        self._write_down(self._notes, form, f"{form['about']} {form['text']}".strip())
        answer.set_result(Answer(done=True, message="noted"))
        return answer


class _Hands:
    """A node in a thread of its own: acts wait for none of the rig's other messages."""

    def __init__(self, page: RigNode) -> None:
        self.node = Node(
            f"{page.get_name()}_acts",
            context=page.context,
            namespace=page.get_namespace(),
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._executor = make_executor(page.context)
        self._executor.add_node(self.node)
        self._stop = RosFuture()
        self._thread = threading.Thread(
            target=spin_until, args=(self._executor, self._stop), daemon=True
        )

    def start(self) -> None:
        """Begin to listen and to act."""
        self._thread.start()

    def end(self) -> None:
        """End; safe to call twice."""
        if not self._stop.done():
            self._stop.set_result(None)
            self._thread.join()
            self._executor.shutdown()
            self.node.destroy_node()


def _settle(answer: "Future[Answer]", result: Answer) -> None:
    """Give an answer, unless there is one or the asker has given up.

    An error in a callback of the executor would end the process.
    """
    with suppress(InvalidStateError):
        answer.set_result(result)


def _describe(act: str, form: Form) -> str:
    """Return an act with its object: a hit, samples, why."""
    hit = f"hit {form['record']}" if form["record"] else ""
    given = (hit, form["verdict"], form["reason"], *form.fields.get("sample", ()), form["impacts"])
    return " ".join((act, ", ".join(filter(None, given)))).strip()


def _read_sample(form: Form) -> dict[str, Any]:
    return {"sample": form["sample"]}


def _read_switch(form: Form) -> dict[str, Any]:
    return {"data": form["on"] == "yes"}


def _read_goal(form: Form) -> dict[str, Any]:
    """Return the goal of a filled in form; raises `ParameterError` if it cannot be meant."""
    tries = form["trial"] == "yes"
    impacts = "1" if tries else form["impacts"]
    samples = form.fields.get("sample", ())
    if not samples:
        raise ParameterError("no sample is chosen: choose those to strike")
    if not impacts.isdecimal() or not 1 <= int(impacts) <= 1000:  # noqa: PLR2004
        raise ParameterError(f"hits of each sample are {impacts!r}: write 1 to 1000")
    try:
        angles = [math.radians(float(part)) for part in form["angles"].split(",") if part.strip()]
    except ValueError:
        raise ParameterError(f"release angles are {form['angles']!r}: write 5, 10, 20") from None
    goal = RunCampaign.Goal(
        samples=samples[: 1 if tries else None],
        impacts=int(impacts),
        attempts_per_impact=int(tries),
        trial=tries,
        confirm_samples=form["ask"] == "yes",
        release_angles=angles,
        campaign_id=id_to_msg(make_id()),
    )
    return {"goal_id": goal.campaign_id, "goal": goal}
