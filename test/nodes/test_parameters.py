"""A parameter takes what it can mean, says so, and no set parameter keeps a node from its work."""

import pytest
from rcl_interfaces.srv import DescribeParameters
from rclpy.clock import ClockType

from impact_rig.nodes.accelerometer import AccelerometerNode
from impact_rig.nodes.campaign import CampaignNode
from impact_rig.nodes.hammer import HammerNode
from impact_rig.nodes.recorder import RecorderNode

MEGAHERTZ = 'sampling_rate = "1 MHz"'


def test_what_is_none_of_the_choices_is_refused_with_the_choices(harness):
    name, choices = "compression", "zstd, lz4, none"
    node = harness.add(RecorderNode, autostart=False)
    before = node.get_value(name)
    refusal = harness.set_parameter(node.get_name(), name, "bogus")
    assert refusal.startswith(f"{name} is 'bogus': it must be one of {choices}")
    assert node.get_value(name) == before
    request = DescribeParameters.Request(names=[name])
    answer = harness.call(DescribeParameters, f"{node.get_name()}/describe_parameters", request)
    assert answer.descriptors[0].additional_constraints.startswith(f"one of {choices}")


def test_a_virtual_rig_that_is_wrong_is_mended(harness):
    node = harness.add(AccelerometerNode, source='faults = "earthquake"', reconnect_period=0.05)
    assert not node.is_configured
    assert not harness.set_parameter(node.get_name(), "source", 'faults = "overload"')
    harness.wait_until(lambda: node.is_active)


@pytest.mark.parametrize("kind", [HammerNode, AccelerometerNode])
def test_a_node_with_a_device_goes_by_the_computer_s_clock(harness, kind):
    node = harness.add(kind)
    assert harness.set_parameter(node.get_name(), "use_sim_time", True)
    late = harness.add(kind, namespace="/late", use_sim_time=True)
    assert not late.is_configured
    assert "must be false" in late.fault


def test_setting_the_computer_s_clock_holds_up_no_timer(harness):
    for kind in (HammerNode, AccelerometerNode, CampaignNode, RecorderNode):
        node = harness.add(kind, autostart=False)
        clocks = {timer.clock.clock_type for timer in node.timers}
        assert clocks == {ClockType.STEADY_TIME}


def test_what_is_read_when_a_node_is_configured_is_refused_until_it_is_cleaned_up(harness):
    node = harness.add(AccelerometerNode)
    refusal = harness.set_parameter(node.get_name(), "source", MEGAHERTZ)
    assert refusal == (
        "source is read when the node is configured: deactivate and clean up the node first"
    )
    # The same value again changes nothing.
    assert not harness.set_parameter(node.get_name(), "source", node.get_value("source"))
    harness.change_state(node.get_name(), "deactivate", "cleanup")
    assert not harness.set_parameter(node.get_name(), "source", MEGAHERTZ)
    harness.change_state(node.get_name(), "configure", "activate")
    assert node._open.acquisition.sampling_rate == 1e6


def test_a_live_parameter_is_taken_at_any_time_and_a_whole_number_is_a_number(harness):
    node = harness.add(HammerNode, swing_time=1)
    assert node.get_value("swing_time") == 1.0
    assert node.is_active
    assert not harness.set_parameter(node.get_name(), "swing_time", 0.1)
    assert node.get_value("swing_time") == 0.1
