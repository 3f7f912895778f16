"""The estimator: finds impacts in the stream, judges them, estimates tau_p, k and c."""

import itertools
from collections import deque
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from builtin_interfaces.msg import Time
from impact_rig_msgs.msg import (
    AccelerationBlock,
    RecorderState,
    RecordStored,
    RigSetup,
    StreamBlock,
)
from impact_rig_msgs.srv import GetResults

from impact_rig.core.errors import RigError
from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.session import Session
from impact_rig.core.signals.record import Block
from impact_rig.nodes import interfaces
from impact_rig.nodes.estimator_gate import MissedStart, StorageGate
from impact_rig.nodes.estimator_stream import StreamCutting, StreamListener
from impact_rig.nodes.process import run_node
from impact_rig.nodes.result_messages import (
    comparison_to_msg,
    estimate_to_msg,
    hit_to_msg,
    record_to_msg,
)
from impact_rig.nodes.rig_node import Read, RigNode
from impact_rig.recordings.messages import block_from_msg, setup_from_msg, stamp_from_msg
from impact_rig.recordings.new_file import list_parts
from impact_rig.recordings.reader import read_recording

WAITING_BLOCKS = 1000
"""Blocks kept while no set-up has arrived [-], our choice: a few seconds of streaming."""

CHECK_PAUSE = 0.015
"""How long no hit may have come before what stands beside the numbers follows [s], our choice:
less than any swing takes, so that it is done before the next hit."""
CATCH_UP_PAUSE = 0.5
"""How long no hit on the control sample may have come before the other samples' estimates follow
what it says [s], our choice: longer than from hit to hit, so that none of them waits."""


class EstimatorNode(RigNode):
    """Feeds the core's session with what the accelerometers publish.

    While a recorder records, a block is evaluated when the recorder has stored it: whatever dies
    at whatever moment, the hit of a published verdict is on the disk. What is cut out of a running
    stream goes the same way: it is published, and comes back. The stream is taken and cut in a
    thread of its own, however long an evaluation takes.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("estimator", **options)
        self.declare_replays()
        self.declare(
            "stream_depth", interfaces.STREAM_DEPTH,
            "blocks of a running stream that may wait before the oldest are lost [-]",
            low=1, high=100_000, read=Read.AT_START,
        )  # fmt: skip
        self._session: Session | None = None
        self._knows_recording = False
        self._last_read: tuple[Block | None, list[JudgedHit]] = (None, [])
        self._setup_stamp = Time()
        self._unchecked: dict[str, None] = {}
        self._checking = self.create_timer(CHECK_PAUSE, self._check)
        self._checking.cancel()
        self._outdated: dict[str, None] = {}
        self._pause = self.create_timer(CATCH_UP_PAUSE, self._catch_up)
        self._pause.cancel()
        self._cutting = StreamCutting(self)
        self._early: deque[AccelerationBlock] = deque(maxlen=WAITING_BLOCKS)
        self._gate = StorageGate()
        self._recorder: RecorderState | None = None
        self._impact = self.advertise(interfaces.IMPACT)
        self._estimate = self.advertise(interfaces.ESTIMATE)
        self._hammer_estimate = self.advertise(interfaces.HAMMER_ESTIMATE)
        self._comparison = self.advertise(interfaces.COMPARISON)
        self._counts = {"impacts accepted": 0, "impacts rejected": 0, "blocks": 0}
        self.listen(interfaces.SETUP, self._take_setup)
        self.listen(interfaces.RECORD_STORED, self._take_stored)
        self._of_recorder = self.listen(interfaces.RECORDER_STATE, self._follow_recorder)
        self._missed_start = MissedStart()
        self.listen(interfaces.ACCELERATION, self._take_block, is_informed=True)
        self.create_service(GetResults, interfaces.GET_RESULTS, self._answer)
        self._stream = StreamListener(
            self,
            interfaces.make_stream_topic(self.get_value("stream_depth")),
            self._take_stream_block,
        )

    def deactivate(self) -> None:
        """Forget what waits."""
        self._warn(self._gate.drop())

    def destroy_node(self) -> None:
        """Take no more of the stream, and end."""
        self._stream.stop()
        super().destroy_node()

    def diagnose(self) -> dict[str, Any]:
        """Return how much has been judged, and what a record waits for."""
        return {
            **self._counts,
            "waiting for": self._gate.describe_obstacle(),
            **self._cutting.describe(),
        }

    def describe_warning(self) -> str:
        """Return what has been lost of a running stream."""
        return self._cutting.describe_warning()

    def _take_setup(self, message: RigSetup) -> None:
        self._gate.add_setup(message)
        self._work_off()

    def _take_block(self, message: AccelerationBlock, info: Mapping[str, Any]) -> None:
        if self._missed_start.is_missed(message, info) or not self.is_active:
            return
        self._gate.is_open = not self._is_recorded()
        self._gate.add_block(message)
        self._work_off()

    def _take_stream_block(self, message: StreamBlock, behind: int) -> None:
        if self.is_active:
            self._cutting.feed(message, behind)

    def _take_stored(self, message: RecordStored) -> None:
        self._warn(self._gate.add_stored(message))
        self._work_off()

    def _follow_recorder(self, message: RecorderState) -> None:
        previous, self._recorder = self._recorder, message
        goes_on = message.recording and previous and message.uri == previous.uri
        if previous is not None and previous.recording and not goes_on:
            # What one recording did not store, the next one will not.
            self._warn(self._gate.drop())
        self._gate.is_open = not message.recording
        self._work_off()
        self._read_recording()

    def _is_recorded(self) -> bool:
        """Whether a recorder records; one that is there and has not been heard of may well do."""
        if self._recorder is None:
            return bool(self._of_recorder.get_publisher_count())
        return self._recorder.recording

    def _warn(self, text: str) -> None:
        if text:
            self.get_logger().warning(text)

    def _work_off(self) -> None:
        """Evaluate what may be evaluated now."""
        for message in self._gate.pass_on():
            try:
                if isinstance(message, RigSetup):
                    self._begin(message)
                elif self._session is None:
                    self._early.append(message)
                else:
                    self._evaluate(self._session, message)
            except RigError as error:
                self.report_fault(str(error))

    def _begin(self, message: RigSetup) -> None:
        if self._session is not None and not stamp_from_msg(message.header.stamp):
            return  # A campaign node has come, and no campaign has begun.
        self._knows_recording = self._session is not None
        setup = setup_from_msg(message)
        self._session = Session(setup)
        self._setup_stamp = message.header.stamp
        self._unchecked.clear()
        self._outdated.clear()
        self._cutting.use_settings(setup.analysis)
        while self._early:
            self._evaluate(self._session, self._early.popleft())
        self._read_recording()

    def _read_recording(self) -> None:
        """Take the hits of a campaign that had begun before this node was started again.

        They are on the disk, if it is this computer's.
        """
        begun, recorder = stamp_from_msg(self._setup_stamp), self._recorder
        if self._session is None or self._knows_recording or not begun:
            return
        if recorder is None or not recorder.recording:
            return
        self._knows_recording = True
        session = Session(self._session.setup)
        record: list[Block] = []
        try:
            for _, blocks in itertools.groupby(
                self._read_blocks(Path(recorder.uri), begun), lambda block: block.label
            ):
                for block in record:
                    session.feed(block)
                record = list(blocks)
            if record and record[-1].last:  # else its end is still on its way here
                hits = [hit for block in record for hit in session.feed(block)]
                self._last_read = (record[-1], hits)
        except RigError as error:
            self.report_fault(str(error))
        self._session = session

    def _read_blocks(self, path: Path, begun: int) -> Iterator[Block]:
        """Yield the blocks of a campaign; of a damaged file those before the damage."""
        for part in list_parts(path):
            try:
                for event in read_recording(part, self.get_namespace()).events():
                    if isinstance(event, Block) and event.stamp >= begun:
                        yield event
            except RigError as error:
                self._warn(f"earlier hits of this campaign are not all known: {error}")

    def _evaluate(self, session: Session, message: AccelerationBlock) -> None:
        self._counts["blocks"] += 1
        block, (last, read) = block_from_msg(message), self._last_read
        if last and last.label == block.label and last.stamp >= block.stamp:
            # It was on its way here when its record was read from the disk.
            hits = tuple(read) if block.last else ()
        else:
            hits = session.feed(block)
        for hit in hits:
            self._publish(session, hit)

    def _publish(self, session: Session, hit: JudgedHit) -> None:
        struck, is_control = hit.label.sample, session.is_control(hit.label.sample)
        try:
            # Made before the verdict is out, which wakes everybody else.
            numbers = session.estimate_numbers(struck) if hit.accepted else None
        finally:
            self._impact.publish(hit_to_msg(hit, self._setup_stamp))
            self._counts["impacts accepted" if hit.accepted else "impacts rejected"] += 1
        if numbers is None:
            return
        stamp = self.get_clock().now().to_msg()
        self._publish_estimate(numbers, stamp)
        if is_control:
            hammer = session.estimate_hammer(struck)
            self._hammer_estimate.publish(estimate_to_msg(hammer, stamp, self._setup_stamp))
        # What stands beside the numbers takes most of the time: it follows when nothing hurries.
        self._unchecked[struck] = None
        self._checking.reset()
        self._outdated.pop(struck, None)
        if is_control:
            # What the control sample says of the hammer changes every other sample's k2. The next
            # hit does not wait for them: they follow when no more come on the control sample.
            self._outdated |= dict.fromkeys(name for name in session.names if name != struck)
            self._pause.reset()

    def _check(self) -> None:
        """Publish the estimates of the samples struck last anew, with what stands beside them."""
        self._checking.cancel()
        names = tuple(self._unchecked)
        self._unchecked.clear()
        for name in names:
            self._publish_anew(name)

    def _catch_up(self) -> None:
        """Publish one estimate that a hit on the control sample has changed; then the others.

        What has come meanwhile goes first.
        """
        self._pause.cancel()
        if not self._outdated:
            return
        name = next(iter(self._outdated))
        del self._outdated[name]
        self._publish_anew(name)
        self.run_soon(self._go_on)

    def _go_on(self) -> None:
        # A hit on the control sample has begun the pause anew, and changes them once more.
        if self._pause.is_canceled():
            self._catch_up()

    def _publish_anew(self, name: str) -> None:
        """Publish the estimate of a sample with what stands beside the numbers."""
        if self._session is None:
            return
        try:
            stamp = self.get_clock().now().to_msg()
            self._publish_estimate(self._session.estimate_sample(name), stamp)
        except RigError as error:
            self.report_fault(str(error))

    def _publish_estimate(self, estimate: SampleEstimate, stamp: Time) -> None:
        if not estimate.contact_time.is_known:
            return
        setup_stamp = self._setup_stamp
        self._estimate.publish(estimate_to_msg(estimate, stamp, setup_stamp))
        for comparison in estimate.comparisons:
            self._comparison.publish(comparison_to_msg(estimate, comparison, stamp, setup_stamp))

    def _answer(self, _: GetResults.Request, response: GetResults.Response) -> GetResults.Response:
        is_silent = self._recorder is None and self._of_recorder.get_publisher_count()
        if self._session is None or (is_silent and not self._knows_recording):
            return response  # what the recorder has of this campaign is not known yet
        response.setup_stamp = setup_stamp = self._setup_stamp
        results = self._session.estimate_all()
        self._unchecked.clear()
        self._outdated.clear()
        stamp = self.get_clock().now().to_msg()
        response.hammer = estimate_to_msg(results.hammer, stamp, setup_stamp)
        response.samples = [
            estimate_to_msg(estimate, stamp, setup_stamp) for estimate in results.samples
        ]
        response.speed_exponents = [record_to_msg(item) for item in results.speed_exponents]
        for estimate in response.samples:
            # Now with the model fitted: recorder and view want to know.
            self._estimate.publish(estimate)
        response.accepted = [hit_to_msg(hit, setup_stamp) for hit in results.accepted]
        response.rejected = [hit_to_msg(hit, setup_stamp) for hit in results.rejected]
        return response


def main() -> int:
    """Run the node."""
    return run_node(EstimatorNode)
