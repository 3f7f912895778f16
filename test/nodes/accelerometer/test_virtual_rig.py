"""The accelerometers stream exactly what the virtual rig digitized, one arming at a time."""

import functools

import numpy as np
import pytest
from impact_rig_msgs.srv import Arm
from std_srvs.srv import Trigger

from impact_rig.core.records import HitLabel
from impact_rig.core.setup import PAPER_SETUP
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.nodes import interfaces
from impact_rig.nodes.accelerometer import AccelerometerNode
from impact_rig.recordings.messages import block_from_msg

from .desk_rig import SAMPLE, arm


@pytest.fixture
def start(harness):
    """Return a function that starts the node, and gives it the paper's set-up."""

    def start(**parameters):
        harness.add(
            AccelerometerNode, required_subscribers="peer", trigger_timeout=0.01, **parameters
        )
        harness.tell_setup()

    return start


def test_streams_the_virtual_hit_of_its_seed_without_loss_and_of_its_own_release_alone(
    harness, start, blocks, release
):
    start(source="seed = 5", block_size=700)
    truths = harness.listen(interfaces.VIRTUAL_IMPACT)
    answer = arm(harness)
    assert answer.success, answer.message
    release(answer.record + 7)
    release(answer.record)
    received = [block_from_msg(message) for message in blocks.wait(lambda got: got[-1].last)]
    label = HitLabel(SAMPLE, record=answer.record)
    expected = VirtualRig(PAPER_SETUP, VirtualRigSettings(seed=5)).strike(label)
    assert {block.label for block in received} == {label}
    assert [block.first_sample for block in received] == list(range(0, 5000, 700))
    for channel in ("hammer", "specimen"):
        counts = np.concatenate([getattr(block, channel).output for block in received])
        np.testing.assert_array_equal(counts, getattr(expected, channel).output)
    (truth,) = truths.wait_for_count(1)
    assert truth.contact_time == expected.model.contact_time
    assert list(truth.faults) == []


def test_refuses_an_unknown_sample_by_name_and_to_arm_twice_until_disarmed(harness, start, blocks):
    start()
    answer = arm(harness, sample="tin")
    assert not answer.success
    assert "unknown sample 'tin'" in answer.message
    assert "'steel small'" in answer.message
    # The same request again is the same arming.
    assert arm(harness).record == arm(harness).record == 1
    assert "already armed" in arm(harness, impact=2).message
    assert harness.call(Trigger, interfaces.DISARM_ACCELEROMETER).success
    assert arm(harness).success


def test_says_not_yet_until_those_who_must_not_miss_a_block_are_connected(harness, blocks):
    harness.add(AccelerometerNode)
    harness.tell_setup()
    request = Arm.Request(sample=SAMPLE, impact=1, attempt=1)
    ask = functools.partial(harness.call, Arm, interfaces.ARM_ACCELEROMETER, request)
    answer = harness.ask_until("'estimator' does not listen", ask)[-1]
    assert answer.message.startswith(interfaces.NOT_YET)
    assert not answer.success
    assert "required_subscribers" in answer.message
