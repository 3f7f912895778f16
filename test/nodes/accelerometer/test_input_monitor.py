"""The input monitor: levels while no campaign runs, and hits as before afterwards."""

import pytest
from impact_rig_msgs.msg import AcquisitionState
from std_srvs.srv import SetBool

from impact_rig.core.given.errors import ParameterError
from impact_rig.nodes import interfaces

from .desk_rig import arm, make_record, wait_for_state


@pytest.fixture
def monitor(harness):
    """Return a function that turns the monitor on or off, and returns the answer."""
    return lambda on: harness.call(SetBool, interfaces.MONITOR_INPUT, SetBool.Request(data=on))


def test_levels_are_shown_and_nothing_of_them_is_a_block(
    harness, desk, rig, states, blocks, monitor
):
    levels = harness.listen(interfaces.INPUT_LEVELS)
    rig()
    assert monitor(True).success
    wait_for_state(states, AcquisitionState.IDLE, "the inputs are shown")
    assert desk.plan.continuous
    record = make_record()
    desk.deliver(record)
    (message, *_) = levels.wait(lambda got: got[-1].channels)
    hammer, specimen = interfaces.INPUT_LEVELS.convert(message).channels
    assert hammer.peak == pytest.approx(abs(record.hammer.acceleration).max(), rel=0.01)
    assert specimen.full_scale == record.specimen.full_scale
    refused = arm(harness)
    assert (refused.success, refused.message) == (False, "the input monitor runs: end it first")
    # As before.
    assert monitor(False).success
    levels.wait(lambda got: not got[-1].channels)
    assert not desk.plan.continuous
    assert arm(harness).success
    desk.deliver(make_record())
    wait_for_state(states, AcquisitionState.IDLE, "record complete")
    assert len({block.record for block in blocks.messages}) == 1
    assert "a hit is awaited" in (arm(harness).success and monitor(True).message)


def test_a_device_that_cannot_stream_waits_for_hits_as_before(
    harness, module, rig, monitor, monkeypatch
):
    configure = module.DeskSource.configure

    def refuse(source, plan):
        if plan.continuous:
            raise ParameterError("the desk records single hits only")
        return configure(source, plan)

    monkeypatch.setattr(module.DeskSource, "configure", refuse)
    rig()
    answer = monitor(True)
    assert (answer.success, answer.message) == (False, "the desk records single hits only")
    assert arm(harness).success


def test_a_device_that_is_gone_afterwards_is_lost_and_comes_back(
    harness, desk, rig, states, monitor
):
    node = rig()
    assert monitor(True).success
    desk.unplug()
    wait_for_state(states, AcquisitionState.FAULT, "plug it in")
    desk.plug()
    harness.wait_until(lambda: node.is_active)
    assert desk.plan.continuous
    assert monitor(False).success
    assert arm(harness).success
