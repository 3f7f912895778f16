"""A device that goes is missed at once, named, and taken again when it comes back."""

from diagnostic_msgs.msg import DiagnosticStatus
from impact_rig_msgs.msg import AcquisitionState

from impact_rig.nodes import interfaces

from .desk_rig import arm, make_record, wait_for_release, wait_for_state


def test_a_device_that_is_not_there_or_lost_is_named_and_comes_back_as_often_as_it_goes(
    harness, desk, rig, blocks, states, release
):
    seen = harness.listen(interfaces.DIAGNOSTICS)
    desk.unplug()
    node = rig()
    wait_for_state(states, AcquisitionState.FAULT, "the digitizer on the desk is gone")
    status, _ = seen.wait_for_count(1)[0].status
    assert status.level == DiagnosticStatus.ERROR
    assert "the digitizer on the desk is gone" in status.message
    desk.plug()
    harness.wait_until(lambda: node.is_active)
    for cycle in (1, 2):
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
    # The hammer was not released before: the first two armings published nothing.
    assert {block.record for block in got} == {3}


def test_a_device_that_is_lost_while_the_hammer_swings_leaves_one_empty_block(
    harness, desk, rig, blocks, states, release
):
    node = rig(reconnect_period=0.0)
    record = arm(harness).record
    release(record, latest_contact=60.0)
    wait_for_release(harness, node)
    desk.unplug()
    wait_for_state(states, AcquisitionState.FAULT)
    (block,) = blocks.wait_for_count(1)
    assert (block.record, block.triggered, block.last) == (record, False, True)
    release(record, latest_contact=60.0)
    desk.plug()
    harness.change_state("accelerometer", "configure", "activate")
    release(arm(harness).record)
    assert [item.record for item in blocks.wait_for_count(2)] == [record, record + 1]


def test_a_device_that_goes_while_nothing_is_armed_and_a_mistake_in_a_driver_are_faults(
    harness, desk, rig, states
):
    node = rig()
    desk.unplug()
    state = wait_for_state(states, AcquisitionState.FAULT)
    assert state.message == "the digitizer on the desk is gone: plug it in"
    assert "arm" not in desk.calls
    desk.plug()
    harness.wait_until(lambda: node.is_active)
    assert arm(harness).success
    desk.fail(KeyError("channel 3"))
    wait_for_state(
        states, AcquisitionState.FAULT, "the source's driver failed: KeyError: 'channel 3'"
    )
    harness.wait_until(lambda: node.is_active)
    assert arm(harness).success
