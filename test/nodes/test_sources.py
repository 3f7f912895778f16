"""The accelerometers read whatever source a rig file names: here one of another package."""

import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from impact_rig_msgs.msg import AcquisitionState, HammerRelease
from impact_rig_msgs.srv import Arm
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from std_srvs.srv import Trigger

from impact_rig.configuration.rig_file import read_template
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.acceleration_source import AcquiredBlock
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.nodes import interfaces
from impact_rig.nodes.accelerometer import AccelerometerNode
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.messages import setup_to_msg, stamp_to_msg
from impact_rig.recording.interfaces.messages import block_from_msg, stream_block_from_msg

SAMPLE = "steel small"
SOURCE = """
[source]
driver = "desk"
sampling_rate = "2.5 MHz"
trigger_level = "5 g"
serial = 7
[source.hammer]
channel = 1
sensitivity = "10 mV/g"
[source.specimen]
channel = 2
sensitivity = "10 mV/g"
"""
DIAGNOSTICS = interfaces.Topic("diagnostics", DiagnosticArray, interfaces.ACCELERATION.qos)


@pytest.fixture
def module(tmp_path, monkeypatch):
    """Install a package that brings the driver `desk`; return the driver's module."""
    metadata = tmp_path / "packages" / "desk_digitizer-1.0.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: desk-digitizer\nVersion: 1.0\n"
    )
    (metadata / "entry_points.txt").write_text(
        "[impact_rig.acceleration_sources]\n"
        "desk = desk_digitizer:DeskSource\n"
        "unpaid = desk_digitizer_license:DeskSource\n"
    )
    monkeypatch.syspath_prepend(metadata.parent)
    monkeypatch.syspath_prepend(Path(__file__).parent / "third_party")
    import desk_digitizer

    desk_digitizer.DESK = desk_digitizer.Desk()
    yield desk_digitizer
    del sys.modules["desk_digitizer"]


@pytest.fixture
def desk(module):
    return module.DESK


@pytest.fixture
def rig(harness, module, blocks, tmp_path):
    """Return a function that starts the accelerometers with the rig file, and gives a set-up."""

    def start(source=SOURCE, **parameters):
        path = tmp_path / "rig.toml"
        path.write_text(read_template() + source)
        node = harness.add(
            AccelerometerNode,
            rig_file=str(path),
            **{
                "required_subscribers": "peer",
                "trigger_timeout": 0.01,
                "reconnect_period": 0.02,
                **parameters,
            },
        )
        harness.advertise(interfaces.SETUP).publish(setup_to_msg(PAPER_SETUP, stamp_to_msg(1)))
        return node

    return start


@pytest.fixture
def blocks(harness):
    return harness.listen(interfaces.ACCELERATION)


@pytest.fixture
def states(harness):
    return harness.listen(interfaces.ACQUISITION_STATE)


@pytest.fixture
def release(harness):
    """Return a function that lets the hammer go for a record."""
    publisher = harness.advertise(interfaces.RELEASE)

    def run(record, latest_contact=0.0):
        publisher.publish(
            HammerRelease(
                record=record,
                sample=SAMPLE,
                impact=1,
                attempt=1,
                swing_time=0.0,
                latest_contact=latest_contact,
            )
        )

    return run


def arm(harness):
    request = Arm.Request(sample=SAMPLE, impact=1, attempt=1)
    return harness.call(Arm, interfaces.ARM_ACCELEROMETER, request)


def make_record(overloaded=False):
    """Return a good hit as one block, as a device may deliver it."""
    hit = VirtualRig(PAPER_SETUP, VirtualRigSettings(seed=3)).strike(HitLabel(SAMPLE))
    return AcquiredBlock(
        first_sample=0,
        hammer=replace(hit.hammer, overloaded=overloaded),
        specimen=hit.specimen,
        last=True,
        stamp=time.time_ns(),
    )


def wait_for_state(states, state, words=""):
    found = states.wait(
        lambda got: any(item.state == state and words in item.message for item in got)
    )
    return next(item for item in found if item.state == state and words in item.message)


def wait_for_release(harness, node):
    """Wait until the node has heard of a release."""
    harness.wait_until(lambda: node._arming is None or node._arming.is_released)


def test_a_record_is_streamed_as_the_device_gave_it_in_blocks_of_the_wanted_size(
    harness, desk, rig, blocks, states, release
):
    rig(block_size=700)
    answer = arm(harness)
    assert answer.success, answer.message
    release(answer.record, latest_contact=60.0)
    record = make_record(overloaded=True)
    desk.deliver(record)
    got = [block_from_msg(item) for item in blocks.wait(lambda got: got and got[-1].last)]
    assert [block.first_sample for block in got] == list(range(0, 5000, 700))
    for channel in ("hammer", "specimen"):
        counts = np.concatenate([getattr(block, channel).output for block in got])
        np.testing.assert_array_equal(counts, getattr(record, channel).output)
    # The device does not say in which part of the record: every piece says it.
    assert {block.hammer.overloaded for block in got} == {True}
    assert {block.specimen.overloaded for block in got} == {False}
    assert got[1].stamp - got[0].stamp == pytest.approx(700 / 2.5e6 * 1e9, abs=1)
    assert desk.plan.block_size == 700
    state = wait_for_state(states, AcquisitionState.IDLE, "record complete")
    assert (state.source, state.simulated) == ("desk digitizer 7", False)


def test_a_hit_that_nobody_let_go_of_is_published_and_told(
    harness, desk, rig, blocks, states, release
):
    rig()
    record = arm(harness).record
    desk.deliver(make_record())
    got = blocks.wait(lambda got: got and got[-1].last)
    assert {block.record for block in got} == {record}
    state = wait_for_state(states, AcquisitionState.IDLE, "before it was let go")
    assert state.record == record
    assert arm(harness).record == record + 1


def test_what_does_not_come_in_time_is_said_by_an_empty_block_and_the_device_is_disarmed(
    harness, desk, rig, blocks, states, release
):
    rig()
    release(arm(harness).record)
    (block,) = blocks.wait_for_count(1)
    assert (block.triggered, block.last, len(block.hammer.counts)) == (False, True, 0)
    wait_for_state(states, AcquisitionState.IDLE, "no impact came in time")
    assert desk.calls == ["configure", "arm", "disarm"]


def test_a_hit_may_come_until_the_latest_contact(harness, desk, rig, blocks, release):
    node = rig(trigger_timeout=0.0)
    record = arm(harness).record
    release(record, latest_contact=60.0)
    wait_for_release(harness, node)
    reads = desk.reads
    # The swing is over at once: by now nobody would wait any more.
    harness.wait_until(lambda: desk.reads > reads + 2)
    desk.deliver(make_record())
    got = blocks.wait(lambda got: got and got[-1].last)
    assert got[-1].triggered


def test_an_arming_without_a_release_waits_until_it_is_disarmed(harness, desk, rig, blocks):
    rig()
    assert arm(harness).success
    harness.wait_until(lambda: desk.reads > 2)
    assert harness.call(Trigger, interfaces.DISARM_ACCELEROMETER).success
    harness.wait_until(lambda: "disarm" in desk.calls)
    assert arm(harness).record == 2
    assert blocks.messages == []


def test_a_record_that_stalls_gets_one_verdict_for_its_gap(
    harness, module, desk, rig, blocks, states, release
):
    impacts = harness.listen(interfaces.IMPACT)
    harness.add(EstimatorNode)
    rig(required_subscribers="estimator, peer")
    record = arm(harness).record
    release(record, latest_contact=60.0)
    desk.deliver(module.cut(make_record(), 0, 700))
    wait_for_state(states, AcquisitionState.IDLE, "the record breaks off")
    (verdict,) = impacts.wait_for_count(1)
    assert verdict.record == record
    assert verdict.reasons[0].startswith("gap:")
    assert "4550 points missing at point 700" in verdict.reasons[0]
    # The next one is whole.
    release(arm(harness).record, latest_contact=60.0)
    desk.deliver(make_record())
    assert [item.record for item in impacts.wait_for_count(2)] == [record, record + 1]


def test_a_device_that_is_lost_is_named_and_comes_back_as_often_as_it_goes(
    harness, desk, rig, blocks, states, release
):
    node = rig()
    for cycle in range(1, 6):
        answer = arm(harness)
        assert (answer.success, answer.record) == (True, cycle)
        desk.unplug()
        states.wait(
            lambda got, record=cycle: (
                (got[-1].state, got[-1].record) == (AcquisitionState.FAULT, record)
            )
        )
        assert not node.is_configured
        assert states.messages[-1].message == "the digitizer on the desk is gone: plug it in"
        assert "the digitizer on the desk is gone" in arm(harness).message
        desk.plug()
        harness.wait_until(lambda: node.is_active)
    release(arm(harness).record, latest_contact=60.0)
    desk.deliver(make_record())
    got = blocks.wait(lambda got: got and got[-1].last)
    # Nobody had let the hammer go before: nothing of those armings was published.
    assert {block.record for block in got} == {6}


@pytest.mark.parametrize("first", ["release", "loss", "neither"])
def test_a_device_that_is_lost_while_the_hammer_swings_leaves_one_empty_block(
    harness, desk, rig, blocks, states, release, first
):
    node = rig(reconnect_period=0.0)
    record = arm(harness).record
    if first == "release":
        release(record, latest_contact=60.0)
        wait_for_release(harness, node)
        desk.unplug()
        wait_for_state(states, AcquisitionState.FAULT)
    elif first == "neither":
        # Both are there when the node comes to look.
        gate = threading.Event()
        busy = threading.Thread(target=lambda: harness.run(gate.wait))
        busy.start()
        desk.unplug()
        harness.wait_until(
            lambda: not any(thread.name == "source" for thread in threading.enumerate())
        )
        release(record, latest_contact=60.0)
        gate.set()
        busy.join()
        wait_for_state(states, AcquisitionState.FAULT)
    else:
        # The release is on its way when the device goes.
        desk.unplug()
        wait_for_state(states, AcquisitionState.FAULT)
        release(record, latest_contact=60.0)
    (block,) = blocks.wait_for_count(1)
    assert (block.record, block.triggered, block.last) == (record, False, True)
    release(record, latest_contact=60.0)
    desk.plug()
    for transition in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
        request = ChangeState.Request(transition=Transition(id=transition))
        assert harness.call(ChangeState, "accelerometer/change_state", request).success
    release(arm(harness).record)
    assert [item.record for item in blocks.wait_for_count(2)] == [record, record + 1]


def test_a_device_that_is_lost_within_a_record_closes_it(
    harness, module, desk, rig, blocks, states, release
):
    impacts = harness.listen(interfaces.IMPACT)
    harness.add(EstimatorNode)
    node = rig(required_subscribers="estimator, peer", trigger_timeout=60.0)
    record = arm(harness).record
    release(record)
    desk.deliver(module.cut(make_record(), 0, 700))
    blocks.wait_for_count(1)
    desk.unplug()
    (verdict,) = impacts.wait_for_count(1)
    assert verdict.reasons[0].startswith("gap:")
    wait_for_state(states, AcquisitionState.FAULT)
    desk.plug()
    harness.wait_until(lambda: node.is_active)
    release(arm(harness).record)
    desk.deliver(make_record())
    assert [item.record for item in impacts.wait_for_count(2)] == [record, record + 1]


def test_a_device_that_does_not_arm_says_why_in_the_answer(harness, desk, rig, states):
    rig(reconnect_period=0.0)
    desk.unplug()
    answer = arm(harness)
    assert not answer.success
    assert answer.message == "the digitizer on the desk is gone: plug it in"
    wait_for_state(states, AcquisitionState.FAULT, "the digitizer on the desk is gone")


def test_a_device_that_is_not_there_at_first_is_waited_for(harness, desk, rig, states):
    seen = harness.listen(DIAGNOSTICS)
    desk.unplug()
    node = rig()
    wait_for_state(states, AcquisitionState.FAULT, "the digitizer on the desk is gone")
    (status,) = seen.wait_for_count(1)[0].status
    assert status.level == DiagnosticStatus.ERROR
    assert "the digitizer on the desk is gone" in status.message
    desk.plug()
    harness.wait_until(lambda: node.is_active)
    assert arm(harness).success


def test_a_mistake_in_a_driver_is_a_fault_like_any_other(harness, desk, rig, states):
    node = rig()
    assert arm(harness).success
    desk.fail(KeyError("channel 3"))
    state = wait_for_state(states, AcquisitionState.FAULT)
    assert state.message == "the source's driver failed: KeyError: 'channel 3'"
    harness.wait_until(lambda: node.is_active)
    assert arm(harness).success


@pytest.mark.parametrize(
    ("source", "words"),
    [
        (SOURCE.replace('"desk"', '"dusk"'), "driver of [source] is 'dusk': it must be one of"),
        (SOURCE.replace("serial = 7", "serial = 70"), "it must be a whole number between 1 and 9"),
        (SOURCE.replace("serial", "cereal"), "unknown key 'cereal': did you mean 'serial'?"),
        (SOURCE.replace("10 mV/g", "10 mV/kg", 1), "per 'kg': it must be a voltage per"),
        # A source that measures nothing needs no sensors, only what it plays.
        ('[source]\ndriver = "recording"\nfile = "none.mcap"\n', "there is no file none.mcap"),
    ],
)
def test_what_a_rig_file_says_wrongly_is_named_with_file_and_line(harness, rig, source, words):
    node = rig(source)
    assert not node.is_configured
    assert "rig.toml: line " in node.fault
    assert words in node.fault


def test_a_driver_whose_library_is_missing_says_which(harness, rig):
    node = rig(SOURCE.replace('"desk"', '"unpaid"'))
    assert not node.is_configured
    assert "'desk_digitizer_license'" in node.fault
    assert "desk-digitizer" in node.fault


def test_a_running_stream_passes_gaps_on_and_counts_them(harness, desk, rig):
    seen = harness.listen(DIAGNOSTICS)
    stream = harness.listen(interfaces.make_stream_topic(400))
    node = rig(mode="continuous", stream_block_size=2500)
    record = replace(make_record(), last=False)
    harness.wait_until(lambda: node.diagnose()["subscribers"])
    desk.deliver(record, replace(record, first_sample=7500))
    got = [stream_block_from_msg(item) for item in stream.wait_for_count(4)]
    assert [block.first_sample for block in got] == [0, 2500, 7500, 10000]
    assert not any(block.last for block in got)
    assert desk.calls == ["configure", "arm"]
    values = seen.wait(lambda got: read_values(got).get("points lost") == "2500")
    assert read_values(values)["blocks sent"] == "4"


def read_values(messages):
    """Return the newest figures of the accelerometers; none if they have not come yet."""
    found = [item for array in messages for item in array.status if item.name == "/accelerometer"]
    return {item.key: item.value for item in found[-1].values} if found else {}


@pytest.mark.parametrize("first", ["release", "loss"])
def test_a_stream_that_breaks_off_while_the_hammer_swings_gets_one_verdict(
    harness, desk, rig, states, release, first
):
    impacts = harness.listen(interfaces.IMPACT)
    harness.add(EstimatorNode)
    node = rig(
        mode="continuous",
        required_subscribers="estimator, peer",
        trigger_timeout=60.0,
        reconnect_period=0.3,
    )
    quiet = make_record()
    quiet = replace(
        quiet, last=False, hammer=replace(quiet.hammer, output=np.zeros(5000, np.int32))
    )
    desk.deliver(quiet)
    record = arm(harness).record
    desk.deliver(replace(quiet, first_sample=5000))
    if first == "release":
        release(record)
        wait_for_release(harness, node)
    desk.unplug()
    wait_for_state(states, AcquisitionState.FAULT)
    if first == "loss":
        release(record)
    (verdict,) = impacts.wait_for_count(1)
    assert verdict.record == record
    assert verdict.reasons[0].startswith("no_trigger:")
    desk.plug()
    harness.wait_until(lambda: node.is_active)
    assert arm(harness).success
    release(record + 1)
    desk.deliver(quiet)
    desk.deliver(replace(make_record(), last=False, first_sample=5000))
    desk.deliver(replace(quiet, first_sample=10_000))
    assert [item.record for item in impacts.wait_for_count(2)] == [record, record + 1]
