"""A parameter takes what it can mean, says so, and no set parameter keeps a node from its work."""

import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import DescribeParameters, SetParameters
from rclpy.clock import ClockType
from rclpy.parameter import Parameter

from impact_rig.nodes.accelerometer import AccelerometerNode
from impact_rig.nodes.campaign import CampaignNode
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.hammer import HammerNode
from impact_rig.nodes.recorder import RecorderNode
from impact_rig.nodes.replayer import ReplayerNode

CONFIGURE, CLEAN_UP = Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_CLEANUP
MEGAHERTZ = 'sampling_rate = "1 MHz"'
ACTIVATE, DEACTIVATE = Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_DEACTIVATE


def set_parameter(harness, node, name, value) -> str:
    """Set a parameter as `ros2 param set` does; return why it was refused, empty: it was not."""
    parameter = Parameter(name, value=value).to_parameter_msg()
    assert isinstance(parameter, ParameterMessage)
    request = SetParameters.Request(parameters=[parameter])
    service = f"{node.get_name()}/set_parameters"
    (result,) = harness.call(SetParameters, service, request).results
    assert result.successful != bool(result.reason)
    return result.reason


def go(harness, node, *transitions):
    """Lead a node through transitions, as `ros2 lifecycle set` does."""
    for number in transitions:
        request = ChangeState.Request(transition=Transition(id=number))
        assert harness.call(ChangeState, f"{node.get_name()}/change_state", request).success


@pytest.fixture
def recorder(harness, tmp_path):
    return harness.add(RecorderNode, output=str(tmp_path / "a"), required_topics="")


@pytest.mark.parametrize(
    ("kind", "name", "choices"),
    [
        (RecorderNode, "compression", "zstd, lz4, none"),
        (ReplayerNode, "topics", "inputs, all"),
    ],
)
def test_what_is_none_of_the_choices_is_refused_with_the_choices(harness, kind, name, choices):
    node = harness.add(kind, autostart=False)
    before = node.get_value(name)
    refusal = set_parameter(harness, node, name, "bogus")
    assert refusal.startswith(f"{name} is 'bogus': it must be one of {choices}")
    assert node.get_value(name) == before
    request = DescribeParameters.Request(names=[name])
    answer = harness.call(DescribeParameters, f"{node.get_name()}/describe_parameters", request)
    assert answer.descriptors[0].additional_constraints.startswith(f"one of {choices}")


def test_what_makes_no_source_is_refused(harness):
    node = harness.add(AccelerometerNode)
    go(harness, node, DEACTIVATE, CLEAN_UP)
    for source in ("seed: 7", 'faults = "earthquake"', 'pre_trigger = "1 s"', 'driver = "magic"'):
        assert set_parameter(harness, node, "source", source)
    go(harness, node, CONFIGURE, ACTIVATE)


def test_a_virtual_rig_that_is_wrong_is_mended(harness):
    node = harness.add(AccelerometerNode, source='faults = "earthquake"')
    assert not node.is_configured
    assert not set_parameter(harness, node, "source", 'faults = "overload"')
    go(harness, node, CONFIGURE, ACTIVATE)


@pytest.mark.parametrize("kind", [HammerNode, AccelerometerNode])
def test_a_node_with_a_device_goes_by_the_computer_s_clock(harness, kind):
    node = harness.add(kind)
    assert "must be false" in set_parameter(harness, node, "use_sim_time", value=True)
    late = harness.add(kind, namespace="/late", use_sim_time=True)
    assert not late.is_configured
    assert "must be false" in late.fault


def test_setting_the_computer_s_clock_holds_up_no_timer(harness):
    for kind in (HammerNode, AccelerometerNode, CampaignNode, RecorderNode):
        node = harness.add(kind, autostart=False)
        clocks = {timer.clock.clock_type for timer in node.timers}
        assert clocks == {ClockType.STEADY_TIME}


def test_what_was_read_already_is_refused_until_it_would_be_read_again(harness):
    node = harness.add(AccelerometerNode)
    refusal = set_parameter(harness, node, "source", MEGAHERTZ)
    assert refusal == (
        "source is read when the node is configured, which it is: deactivate and clean up"
        " the node first"
    )
    # The same value again changes nothing.
    assert not set_parameter(harness, node, "source", node.get_value("source"))
    go(harness, node, DEACTIVATE)
    assert "clean up the node first" in set_parameter(harness, node, "source", MEGAHERTZ)
    go(harness, node, CLEAN_UP)
    assert not set_parameter(harness, node, "source", MEGAHERTZ)
    go(harness, node, CONFIGURE, ACTIVATE)
    assert node._open.acquisition.sampling_rate == 1e6


def test_a_recorder_takes_what_is_read_when_it_is_activated_while_it_is_not(
    harness, recorder, tmp_path
):
    assert "deactivate the node first" in set_parameter(harness, recorder, "compression", "lz4")
    go(harness, recorder, DEACTIVATE)
    assert not set_parameter(harness, recorder, "output", str(tmp_path / "b"))
    assert not set_parameter(harness, recorder, "compression", "lz4")
    assert not set_parameter(harness, recorder, "sync", "chunk")
    assert "must be above 0" in set_parameter(harness, recorder, "flush_period", 0.0)
    go(harness, recorder, ACTIVATE)
    go(harness, recorder, DEACTIVATE)
    assert (tmp_path / "b" / "metadata.yaml").is_file()


def test_what_is_read_whenever_it_is_needed_is_taken_at_any_time(harness):
    node = harness.add(HammerNode)
    assert node.is_active
    for name, value in (("swing_time", 0.1), ("require_recorder", False)):
        assert not set_parameter(harness, node, name, value)
        assert node.get_value(name) == value


def test_what_is_read_at_the_start_is_never_taken(harness):
    node = harness.add(EstimatorNode)
    assert "read-only" in set_parameter(harness, node, "stream_depth", 7)
    assert "read-only" in set_parameter(harness, node, "autostart", False)
