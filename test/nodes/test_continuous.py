"""Continuous mode: the stream runs all the time, and the estimator finds the impacts in it."""

import numpy as np
import pytest
from impact_rig_msgs.msg import AccelerationBlock, AcquisitionState, HammerRelease
from impact_rig_msgs.srv import Arm
from mcap.reader import make_reader
from rclpy.serialization import deserialize_message

from impact_rig.core.given.errors import FileError
from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.setup import PAPER_SETUP, RigSetup
from impact_rig.core.session import Session
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.nodes import interfaces
from impact_rig.nodes.accelerometer import AccelerometerNode
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.recorder import RecorderNode
from impact_rig.nodes.replayer import RunToReplay
from impact_rig.recordings.run import Run
from impact_rig.recordings.schemas import MessageDefinition
from impact_rig.recordings.writer import RecordingWriter

SAMPLE = "steel small"
# Gentle on a busy machine: fifty blocks a second.
GENTLE = {"mode": "continuous", "stream_block_size": 50_000}


@pytest.fixture
def start_rig(harness):
    """Return a function that starts accelerometers and estimator, and gives them a set-up."""

    def start(subscribers=1, **parameters):
        harness.add(EstimatorNode)
        options = {**GENTLE, "trigger_timeout": 0.5, **parameters}
        node = harness.add(AccelerometerNode, **options)
        harness.wait_until(lambda: node._blocks.get_subscription_count() == subscribers)
        harness.tell_setup()

    return start


@pytest.fixture
def strike(harness):
    """Return a function that arms, releases, and returns the verdict."""
    impacts = harness.listen(interfaces.IMPACT)
    states = harness.listen(interfaces.ACQUISITION_STATE)
    releases = harness.advertise(interfaces.RELEASE)

    def run(sample=SAMPLE, impact=1):
        request = Arm.Request(sample=sample, impact=impact, attempt=1)
        answer = harness.ask(Arm, interfaces.ARM_ACCELEROMETER, request)
        assert answer.success, answer.message
        releases.publish(
            HammerRelease(
                record=answer.record, sample=sample, impact=impact, attempt=1, swing_time=0.02
            )
        )
        verdicts = impacts.wait(lambda got: bool(got) and got[-1].record == answer.record)
        states.wait(
            lambda got: got[-1].record == answer.record and got[-1].state == AcquisitionState.IDLE
        )
        return verdicts[-1]

    return run


def test_a_hit_is_found_in_the_stream_as_the_virtual_rig_struck_it(harness, start_rig, strike):
    start_rig(source="seed = 5")
    hits = harness.listen(interfaces.ACCELERATION)
    truths = harness.listen(interfaces.VIRTUAL_IMPACT)
    verdict = strike()
    assert verdict.accepted, verdict.reasons
    (message,) = hits.messages
    expected = VirtualRig(PAPER_SETUP, VirtualRigSettings(seed=5)).strike(HitLabel(SAMPLE))
    # From its first point on, all that the rig's own record holds before the cut ends.
    cut = np.array(message.hammer.counts)
    whole = expected.hammer.output
    start = next(
        offset
        for offset in range(cut.size)
        if np.array_equal(cut[offset : offset + 20], whole[:20])
    )
    common = min(cut.size - start, whole.size)
    np.testing.assert_array_equal(cut[start : start + common], whole[:common])
    assert common > 4900
    # tau_p scatters by 0.3 % from hit to hit; this one's is known, and noise adds a tenth of that.
    (truth,) = truths.wait_for_count(1)
    assert verdict.contact_time == pytest.approx(truth.contact_time, rel=2e-3)


@pytest.mark.parametrize(
    ("fault", "reason"), [("missed_trigger", "no_trigger"), ("lost_block", "gap")]
)
def test_what_does_not_come_is_judged_by_the_reason_it_did_not(start_rig, strike, fault, reason):
    start_rig(source=f'scheduled_faults = "1:{fault}"')
    verdict = strike()
    assert not verdict.accepted
    assert verdict.reasons[0].reason == reason
    assert strike(impact=2).accepted


def test_a_recording_of_the_stream_alone_holds_the_same_hits(harness, start_rig, strike, tmp_path):
    path, stream_alone = tmp_path / "session.mcap", tmp_path / "stream.mcap"
    harness.add(RecorderNode, output=str(path), record_stream=True, compression="lz4")
    # On a busy machine, recorder and all others in this process hold no more.
    slow = {"source": 'sampling_rate = "500 kHz"', "stream_block_size": 10_000}
    start_rig(subscribers=2, **slow)
    for impact in (1, 2):
        assert strike(impact=impact).accepted
    harness.change_state("recorder", "deactivate")
    leave_out(path, stream_alone, "/acceleration")
    expected, found = judge(path), judge(stream_alone)
    assert len(expected) == 2
    assert [hit.label for hit in found] == [hit.label for hit in expected]
    assert [hit.contact_time for hit in found] == [hit.contact_time for hit in expected]
    assert len(replay(path)) == 2
    with pytest.raises(FileError, match="impact-rig analyze"):
        replay(stream_alone)


def leave_out(path, copy, left_out):
    """Copy a recording without the messages of one topic."""
    with path.open("rb") as file, RecordingWriter(copy) as writer:
        channels = {}
        for schema, channel, message in make_reader(file).iter_messages():
            if channel.topic != left_out:
                if channel.id not in channels:
                    definition = MessageDefinition(schema.name, schema.data.decode())
                    channels[channel.id] = writer.add_channel(channel.topic, definition, ())
                writer.add_message(
                    channels[channel.id], message.data, message.log_time, message.publish_time
                )


def replay(path):
    """Return the blocks of hits that a replay publishes."""
    messages = RunToReplay(Run(path)).read_messages()
    # Not compared as bytes: what pads a message is any.
    return [
        deserialize_message(message.data, AccelerationBlock)
        for message in messages
        if message.topic is interfaces.ACCELERATION
    ]


def judge(path):
    """Return the hits of a recording."""
    session, hits = Session(PAPER_SETUP), []
    for event in Run(path).events():
        if not isinstance(event, RigSetup):
            hits += session.feed(event)
    return hits
