"""The accelerometers stream exactly what the virtual rig digitized, one arming at a time."""

import numpy as np
import pytest
from impact_rig_msgs.msg import HammerRelease
from impact_rig_msgs.srv import Arm
from std_srvs.srv import Trigger

from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.nodes import interfaces
from impact_rig.nodes.accelerometer import AccelerometerNode
from impact_rig.recordings.messages import block_from_msg

SAMPLE = "steel small"


@pytest.fixture
def rig(harness):
    """Return a function that starts the node, gives it the paper's set-up and listens."""

    def start(**parameters):
        harness.add(
            AccelerometerNode, required_subscribers="peer", trigger_timeout=0.01, **parameters
        )
        harness.tell_setup()
        return harness.listen(interfaces.ACCELERATION)

    return start


def arm(harness, sample=SAMPLE, impact=1):
    request = Arm.Request(sample=sample, impact=impact, attempt=1)
    return harness.ask(Arm, interfaces.ARM_ACCELEROMETER, request)


def ask_once(harness):
    request = Arm.Request(sample=SAMPLE, impact=1, attempt=1)
    return harness.call(Arm, interfaces.ARM_ACCELEROMETER, request)


def strike(harness, record):
    harness.advertise(interfaces.RELEASE).publish(
        HammerRelease(record=record, sample=SAMPLE, impact=1, attempt=1, swing_time=0.001)
    )


def test_streams_the_virtual_hit_of_its_seed_without_loss(harness, rig):
    blocks = rig(source="seed = 5", block_size=700)
    truths = harness.listen(interfaces.VIRTUAL_IMPACT)
    answer = arm(harness)
    assert answer.success, answer.message
    strike(harness, answer.record)

    received = [
        block_from_msg(message) for message in blocks.wait(lambda got: bool(got) and got[-1].last)
    ]

    expected = VirtualRig(PAPER_SETUP, VirtualRigSettings(seed=5)).strike(
        HitLabel(SAMPLE, record=answer.record)
    )
    assert [block.first_sample for block in received] == list(range(0, 5000, 700))
    for channel in ("hammer", "specimen"):
        counts = np.concatenate([getattr(block, channel).output for block in received])
        np.testing.assert_array_equal(counts, getattr(expected, channel).output)
    (truth,) = truths.wait_for_count(1)
    assert truth.contact_time == expected.model.contact_time
    assert list(truth.faults) == []


def test_a_release_for_another_record_does_nothing(harness, rig):
    blocks = rig()
    record = arm(harness).record
    strike(harness, record + 7)
    strike(harness, record)
    blocks.wait(lambda got: bool(got) and got[-1].last)
    assert {block.record for block in blocks.messages} == {record}


def test_refuses_an_unknown_sample_by_name(harness, rig):
    rig()
    answer = arm(harness, sample="tin")
    assert not answer.success
    assert "unknown sample 'tin'" in answer.message
    assert "'steel small'" in answer.message


def test_says_not_yet_until_those_who_must_not_miss_a_block_are_connected(harness):
    harness.add(AccelerometerNode)
    harness.listen(interfaces.ACCELERATION)
    harness.tell_setup()
    answers = [ask_once(harness)]
    harness.wait_until(
        lambda: (
            "'estimator' does not listen" in answers[-1].message
            or answers.append(ask_once(harness))
        )
    )
    answer = answers[-1]
    assert answer.message.startswith(interfaces.NOT_YET)
    assert not answer.success
    assert "required_subscribers" in answer.message


def test_refuses_to_arm_twice_until_disarmed(harness, rig):
    rig()
    assert arm(harness).success
    assert "already armed" in arm(harness, impact=2).message
    assert harness.call(Trigger, interfaces.DISARM_ACCELEROMETER).success
    assert arm(harness).success


def test_the_same_request_again_is_the_same_arming(harness, rig):
    rig()
    assert arm(harness).record == arm(harness).record == 1
