"""The estimator: finds impacts in the stream, judges them, estimates tau_p, k and c."""

from collections import deque
from importlib import import_module
from pathlib import Path
from typing import Any

from builtin_interfaces.msg import Time
from impact_rig_msgs import msg
from impact_rig_msgs.srv import GetResults, JoinCampaign, OverruleHit

from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.errors import ParameterError, RigError
from impact_rig.core.given.records import Block
from impact_rig.core.given.setup import RigSetup
from impact_rig.core.hit.judging import JudgedHit
from impact_rig.core.hit.overrules import Overrule
from impact_rig.core.hit.stream import StreamCutter
from impact_rig.core.session import Session
from impact_rig.nodes import interfaces
from impact_rig.nodes.identity import Identity, id_from_msg
from impact_rig.nodes.intake import Received
from impact_rig.nodes.ledger import Ledger
from impact_rig.nodes.messages import OWN_ESTIMATOR, block_to_msg
from impact_rig.nodes.result_messages import (
    comparison_to_msg,
    estimate_to_msg,
    hit_to_msg,
    overrule_to_msg,
    trace_to_msg,
)
from impact_rig.nodes.rig_node import RigNode
from impact_rig.recordings.campaigns import begins_campaign
from impact_rig.recordings.fields import stamp_from_msg
from impact_rig.recordings.messages import overrule_from_msg
from impact_rig.results.traces import align_hit

LIBRARIES = ("GTC", "scipy.fft", "scipy.interpolate", "scipy.ndimage", "scipy.optimize")
"""Modules that the core loads when it first needs them: no hit waits for that."""


class EstimatorNode(RigNode):
    """Feeds the blocks of the accelerometers to the core's session.

    In a campaign that is recorded, a record is judged when the recorder has stored it: whatever
    dies at whatever moment, the hit of a published verdict is on the disk. What is cut out of a
    running stream goes the same way: it is published, and comes back.

    Asked to join a campaign that the run's recordings have hits of, it reads those. Without a
    campaign that asks, it follows the set-ups that it receives: those of a replay.
    """

    # How long the answer with the results waits for other nodes to have what was published [s].
    patience = 2.0
    longest_work = 600  # many samples are estimated, or a run is read

    def __init__(self, **options: Any) -> None:
        super().__init__("estimator", **options)
        self._setup: msg.RigSetup | None = None
        self._ledger: Ledger | None = None
        self._incomplete: dict[str, None] = {}
        # Runs down when no hit comes: the next one would replace what it completes.
        self._quiet = self.create_timer(0.5, self._complete_next)
        self._quiet.cancel()
        self._cutter: StreamCutter | None = None  # of impacts out of a running stream
        # Made when the first block of a stream comes: else the accelerometers publish the impacts.
        self._cuts: Any = None
        self._early: deque[Received[Block]] = deque(maxlen=1000)  # without a set-up yet
        self._impact = self.advertise(interfaces.IMPACT)
        self._trace = self.advertise(interfaces.IMPACT_TRACE)
        self._full_scale: tuple[float, ...] = ()  # of the channels of the newest block [m/s^2]
        self._overrule = self.advertise(interfaces.OVERRULE)
        self._estimate = self.advertise(interfaces.ESTIMATE)
        self._hammer_estimate = self.advertise(interfaces.HAMMER_ESTIMATE)
        self._comparison = self.advertise(interfaces.COMPARISON)
        self.listen(interfaces.SETUP, self._on_setup)
        self.listen(interfaces.RECORD_STORED, self._on_stored)
        # A bag that is played at ten times its rate outruns the analysis: 400 hits wait, 30 MB.
        self.listen(interfaces.ACCELERATION.deepen(2000), self._on_block)
        self.listen(interfaces.STREAM, self._on_stream_block)
        self.listen(interfaces.OVERRULE, self._on_overrule)
        # Each with its stamp, until it is on the disk; and the newest stamp there [ns].
        self._unstored: dict[Overrule, int] = {}
        self._stored_overrule = 0
        self.listen(interfaces.OVERRULE_STORED, self._on_stored_overrule)
        self.create_service(OverruleHit, interfaces.OVERRULE_HIT, self._on_overrule_hit)
        self.create_service(GetResults, interfaces.GET_RESULTS, self._on_get_results)
        self.offer_to_join()

    def configure(self) -> None:
        """Import the libraries that the first hit would load."""
        for name in LIBRARIES:
            import_module(name)

    def deactivate(self) -> None:
        """Forget all hits: a campaign that goes on reads them again."""
        self._ledger = self._setup = None

    def diagnose(self) -> dict[str, Any]:
        """Return which record waits for the recorder, and the flow of a running stream."""
        waiting = self._ledger.waiting_record if self._ledger else 0
        text = f"the recorder has not said that record {waiting} is stored" if waiting else ""
        figures: dict[str, Any] = {"waiting for": text}
        if self._cutter is not None and self._cuts is not None:
            flow = self._cutter.flow
            figures |= {
                "stream blocks": flow.blocks,
                "stream gaps": flow.gaps,
                "stream points missing": flow.missing_points,
                "impacts while not armed": flow.other_impacts,
            }
        return figures

    def describe_warning(self) -> str | None:
        """Return how many points of a running stream were lost, or that there is no set-up."""
        if self._ledger is None and self._early:
            return (
                f"records come on {self.resolve_topic_name(interfaces.ACCELERATION.name)} and no"
                f" set-up on {self.resolve_topic_name(interfaces.SETUP.name)}: nothing is judged"
                " before a campaign runs, or another node publishes one there"
            )
        lost = self._cutter.flow.missing_points if self._cutter else 0
        if not lost:
            return None
        return (
            f"{lost} points of the stream were lost: this computer does not hold its rate;"
            " hits that lack points are rejected"
        )

    def join(
        self, setup: RigSetup, request: JoinCampaign.Request, response: JoinCampaign.Response
    ) -> None:
        """Take part in a campaign, with its hits in the run's recordings."""
        ledger = self._ledger
        is_same = self._setup is not None and self._setup.campaign_id == request.setup.campaign_id
        if ledger is None or not is_same or ledger.recording != request.recording:
            self._begin(request.setup, setup, request.recording)
        self._catch_up()

    def _begin(self, message: msg.RigSetup, setup: RigSetup, recording: str) -> None:
        self._setup, self._ledger = message, Ledger(Session(setup), recording)
        self._incomplete.clear()
        self._unstored.clear()
        if self._cutter is None or setup.analysis != self._cutter.settings:
            self._cutter = StreamCutter(setup.analysis)
        if recording:
            self._read_recordings(self._ledger)

    def _read_recordings(self, ledger: Ledger) -> None:
        problem = ledger.read(self.membership.identity.campaign_id, self.get_namespace())
        if problem:
            self.get_logger().warning(f"not all earlier hits of this campaign: {problem}")

    def _catch_up(self) -> None:
        """Judge stored records of which not all blocks have come."""
        ledger = self._ledger
        if ledger is None or not ledger.is_behind:
            return
        if Path(ledger.recording).exists():
            self._read_recordings(ledger)
        else:
            self._publish_hits(ledger.session, ledger.judge_incomplete())

    def _on_setup(self, received: Received[RigSetup]) -> None:
        """Follow the set-ups of a replay."""
        current = None if self._setup is None else self.membership.identity.campaign_id
        if self.membership.is_joined or not begins_campaign(received.message, current):
            return
        self.membership.identity = Identity(received.identity.campaign_id)
        self._begin(received.message, received.value, "")
        early = tuple(self._early)
        self._early.clear()
        for block in early:
            self._on_block(block)

    def _on_block(self, received: Received[Block]) -> None:
        if not self.is_active:
            return
        identity = received.identity
        if self._ledger is None or identity.campaign_id != self.membership.identity.campaign_id:
            self._early.append(received)
            if received.value.last and (warning := self.describe_warning()):
                self.get_logger().warning(warning, once=True)
            return
        block = received.value
        self._full_scale = tuple(channel.full_scale for channel in block.channels)
        key = (identity.stream_id, block.label.record)
        self._publish_hits(self._ledger.session, self._ledger.add_block(key, block))

    def _on_stream_block(self, received: Received[Block]) -> None:
        """Publish the impact that a block completes as `AccelerationBlock`."""
        if not self.is_active:
            return
        if self._cuts is None:
            hits = self.get_publishers_info_by_topic(interfaces.ACCELERATION.name)
            if any(item.node_name == "accelerometer" for item in hits):
                return  # it publishes its hits itself: somebody else streams
            self._cuts = self.advertise(interfaces.ACCELERATION)
        if self._cutter is not None:
            for cut in self._cutter.feed(received.value):
                self._cuts.publish(block_to_msg(cut, received.identity))

    def _on_stored(self, received: Received[msg.RecordStored]) -> None:
        if self._ledger is not None and self._ledger.recording:
            self._publish_hits(self._ledger.session, self._ledger.add_stored(received.value))

    def _on_overrule(self, received: Received[Overrule]) -> None:
        """Take a person's verdict on a hit of a replay."""
        ours = self.membership.identity.campaign_id
        if self._ledger is None or self.membership.is_joined:
            return
        if received.identity.campaign_id == ours:
            self._ledger.session.overrule(received.value, is_asked=False)

    def _on_stored_overrule(self, received: Received[Any]) -> None:
        self._stored_overrule = stamp_from_msg(received.value.stamp)

    def _on_overrule_hit(
        self, request: OverruleHit.Request, response: OverruleHit.Response
    ) -> OverruleHit.Response:
        """Judge a hit as a person wishes; "later": the recording has not got that yet."""
        identity, asked = self.membership.identity, request.overrule
        try:
            if self._ledger is None or id_from_msg(asked.campaign_id) != identity.campaign_id:
                raise ParameterError("the estimator has no such campaign: it may be over")
            overrule = overrule_from_msg(asked)
            if not (overrule.reason and overrule.who):
                raise ParameterError(
                    f"record {overrule.record}: a report says why a person decided on a hit, and"
                    " who did: give a reason and a name"
                )
            if overrule not in self._unstored:
                stamp = self._follow(self._ledger, overrule)
                self._unstored[overrule] = stamp if self._ledger.recording else 0
        except RigError as error:
            response.message = str(error)
            return response
        response.success = self._stored_overrule >= self._unstored[overrule]
        if response.success:
            del self._unstored[overrule]
        else:
            response.later, response.message = True, "the recorder has not stored it yet"
        return response

    def _follow(self, ledger: Ledger, overrule: Overrule) -> int:
        """Judge a hit as a person wishes, and publish that; return its stamp [ns]."""
        hit = ledger.session.overrule(overrule)
        message = overrule_to_msg(
            overrule, self.membership.identity, self.get_clock().now().to_msg()
        )
        self._overrule.publish(message)
        if hit is not None:
            self._publish_verdict(ledger.session, hit)
        return stamp_from_msg(message.header.stamp)

    def _publish_verdict(self, session: Session, hit: JudgedHit) -> None:
        """Publish a hit again, and its sample's new estimate."""
        self._impact.publish(hit_to_msg(hit, self.membership.identity))
        is_control = session.is_control(hit.label.sample)
        self._publish_estimate(session, session.estimate_numbers(hit.label.sample))
        self._incomplete |= dict.fromkeys(session.names if is_control else [hit.label.sample])
        self._quiet.reset()

    def _publish_hits(self, session: Session, hits: tuple[JudgedHit, ...]) -> None:
        for hit in hits:
            self._publish(session, hit)

    def _publish(self, session: Session, hit: JudgedHit) -> None:
        struck, is_control = hit.label.sample, session.is_control(hit.label.sample)
        try:
            # Made before the verdict is published, which gives all other nodes work.
            numbers = session.estimate_numbers(struck) if hit.accepted else None
        finally:
            self._impact.publish(hit_to_msg(hit, self.membership.identity))
        if numbers is not None:
            self._publish_estimate(session, numbers)
        if hit.filtered is not None and self._trace.get_subscription_count():
            aligned = align_hit(hit.label, hit.filtered)
            identity = self.membership.identity
            self._trace.publish(trace_to_msg(hit, aligned, self._full_scale, identity))
        if numbers is None:
            return
        # Everything beside the numbers takes most of the time, and the next hit replaces it.
        # The hammer's stiffness from the control sample changes every other sample's k2.
        self._incomplete |= dict.fromkeys(session.names if is_control else [struck])
        self._quiet.reset()

    def _complete_next(self) -> None:
        """Publish one whole estimate after each quiet time: a hit goes first."""
        if self._ledger is None or not self._incomplete:
            self._quiet.cancel()
            return
        name = next(iter(self._incomplete))
        del self._incomplete[name]
        session = self._ledger.session
        if name not in session.names:
            return  # a replay has begun again
        try:
            self._publish_estimate(session, session.estimate_sample(name))
        except Exception as error:  # noqa: BLE001 - the verdicts and numbers are published already
            self.report_fault(str(error) if isinstance(error, RigError) else repr(error))

    def _publish_estimate(self, session: Session, estimate: SampleEstimate) -> None:
        """Publish a sample's estimate and, of the control sample, the hammer's with it."""
        if not estimate.paper.contact_time.is_known:
            return
        stamp, identity = self.get_clock().now().to_msg(), self.membership.identity
        self._estimate.publish(estimate_to_msg(estimate, stamp, identity))
        self._publish_comparisons(estimate, stamp)
        if session.is_control(estimate.name):
            hammer = session.estimate_hammer(estimate.name)
            self._hammer_estimate.publish(estimate_to_msg(hammer, stamp, identity))

    def _publish_comparisons(self, estimate: SampleEstimate, stamp: Time) -> None:
        for comparison in estimate.comparisons:
            message = comparison_to_msg(estimate, comparison, stamp, self.membership.identity)
            self._comparison.publish(message)

    def _on_get_results(
        self, request: GetResults.Request, response: GetResults.Response
    ) -> GetResults.Response:
        self._catch_up()
        ledger, identity = self._ledger, self.membership.identity
        if ledger is None or self._setup is None:
            return response
        response.estimator, response.setup = OWN_ESTIMATOR, self._setup
        response.counts = [
            msg.SampleCount(
                sample=name,
                accepted=count.kept,
                rejected=count.left_out,
                attempts=count.attempts,
            )
            for name, count in ledger.session.count_hits().items()
        ]
        response.newest_record = ledger.newest_record
        response.waiting_record = ledger.waiting_record
        if request.counts_only:
            return response
        results = ledger.session.estimate_all()
        stamp = self.get_clock().now().to_msg()
        response.hammer = estimate_to_msg(results.hammer, stamp, identity)
        response.samples = [estimate_to_msg(item, stamp, identity) for item in results.samples]
        response.speed_exponents = [estimate_to_msg(item) for item in results.speed_exponents]
        for estimate, message in zip(results.samples, response.samples, strict=True):
            self._estimate.publish(message)
            if estimate.name in self._incomplete:
                self._publish_comparisons(estimate, stamp)
        if results.hammer.stiffness.is_known:
            self._hammer_estimate.publish(response.hammer)
        self._incomplete.clear()
        response.accepted = [hit_to_msg(hit, identity) for hit in results.accepted]
        response.rejected = [hit_to_msg(hit, identity) for hit in results.rejected]
        # The rig may end with the answer, and what was lost on its way has to be sent again.
        found = self._impact, self._trace, self._estimate, self._hammer_estimate, self._comparison
        if not self.wait_for_acks(found, self.patience):
            self.get_logger().warning(
                f"a node has not taken all results within {self.patience:g} s: its recording or"
                " view may lack the last ones"
            )
        return response
