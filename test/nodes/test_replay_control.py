"""A replay under control: paused, stepped, sped up, looped, cut, and as the clock of others."""

import time
from itertools import pairwise

import pytest
from impact_rig_msgs.msg import AccelerationBlock, ReplayerState
from impact_rig_msgs.srv import GetResults
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from impact_rig.core.setup.paper import CONTROL_SAMPLE
from impact_rig.nodes import interfaces
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.replayer import ReplayerNode

from .replays import PEER, START, make_events, make_hits, wait_for_end, write_recording


def start(harness, path, **parameters):
    return harness.add(
        ReplayerNode, file=str(path), **{"required_subscribers": PEER, **parameters}
    )


def list_samples(blocks):
    return [item.first_sample for item in blocks]


def test_a_pause_holds_until_it_is_ended(harness, tmp_path, monkeypatch):
    monkeypatch.setattr("impact_rig.nodes.replayer.STATE_PERIOD", 0.1)
    path = write_recording(tmp_path / "session.mcap", make_events(100, pause=0.02))
    blocks = harness.listen(interfaces.ACCELERATION)
    states = harness.listen(interfaces.REPLAYER_STATE)
    node = start(harness, path)
    blocks.wait_for_count(5)
    assert harness.call(Trigger, interfaces.PAUSE_REPLAYER).success
    # The state comes again and again: between two of them nothing went on.
    paused = [
        item
        for item in states.wait(lambda items: count_paused(items) >= 3)
        if item.state == ReplayerState.PAUSED
    ]
    assert paused[-2].messages == paused[-1].messages < 101
    assert paused[-1].header.stamp != paused[-2].header.stamp
    assert harness.call(Trigger, interfaces.RESUME_REPLAYER).success
    wait_for_end(harness, node)
    assert list_samples(blocks.wait_for_count(100)) == list(range(100))


def count_paused(states):
    return sum(item.state == ReplayerState.PAUSED for item in states)


def test_a_step_goes_to_the_end_of_the_next_record(harness, tmp_path):
    # At the original speed each of these records would take an hour.
    path = write_recording(tmp_path / "session.mcap", make_events(9, blocks=3, pause=1200.0))
    blocks = harness.listen(interfaces.ACCELERATION)
    node = start(harness, path, start_paused=True)
    harness.wait_until(lambda: node.describe_state()["state"] == ReplayerState.PAUSED)
    assert not blocks.messages
    for record in (1, 2, 3):
        assert harness.call(Trigger, interfaces.STEP_REPLAYER).success
        assert list_samples(blocks.wait_for_count(3 * record)) == list(range(3 * record))
    wait_for_end(harness, node)


def test_without_a_replay_there_is_nothing_to_control(harness):
    harness.add(ReplayerNode, autostart=False)
    for service in (
        interfaces.PAUSE_REPLAYER, interfaces.RESUME_REPLAYER, interfaces.STEP_REPLAYER
    ):  # fmt: skip
        answer = harness.call(Trigger, service)
        assert not answer.success
        assert "nothing is being replayed" in answer.message


def test_the_state_tells_how_far_it_is(harness, tmp_path):
    path = write_recording(tmp_path / "session.mcap", make_events(6, blocks=2, pause=0.5))
    harness.listen(interfaces.ACCELERATION)
    states = harness.listen(interfaces.REPLAYER_STATE)
    node = start(harness, path, rate=0.001)
    states.wait(lambda items: bool(items) and items[-1].state == ReplayerState.PLAYING)
    node.set_parameters([Parameter("rate", value=0.0)])
    messages = states.wait(lambda items: items[-1].state == ReplayerState.DONE)
    last = messages[-1]
    assert (last.uri, last.messages, last.record) == (str(path), 7, 3)
    assert last.position == last.duration == pytest.approx(3.0)
    assert last.message == "done: 7 messages"


def test_a_part_begins_with_the_set_up_that_was_valid_there(harness, tmp_path):
    path = write_recording(tmp_path / "session.mcap", make_events(10, pause=0.1))
    setups = harness.listen(interfaces.SETUP)
    blocks = harness.listen(interfaces.ACCELERATION)
    # Blocks 0, 1, 2 ... at 0.1 s, 0.2 s, 0.3 s ...: the end is left out.
    node = start(harness, path, rate=0.0, start=0.35, end=0.8)
    wait_for_end(harness, node)
    assert list_samples(blocks.wait_for_count(4)) == [3, 4, 5, 6]
    assert len(setups.wait_for_count(1)) == 1


NO_PARTS = (
    ({"start": 5.0}, "start is 5 s: the recording takes 1 s"),
    ({"start": 0.5, "end": 0.5}, "end is 0.5 s: it must be later than start"),
    ({"hits": ["77"]}, "there is no hit '77'"),
    ({"samples": ["tin"]}, "no hit of a sample 'tin': there are brass"),
)


def test_a_part_that_is_none_is_refused(harness, tmp_path):
    path = write_recording(tmp_path / "session.mcap", make_events(10, pause=0.1))
    for number, (parameters, told) in enumerate(NO_PARTS):
        assert told in start(harness, path, namespace=f"/rig{number}", **parameters).fault


def test_each_pass_of_a_loop_estimates_afresh(harness, tmp_path):
    hits = make_hits({CONTROL_SAMPLE: 4})
    path = write_recording(tmp_path / "session.mcap", hits)
    harness.add(EstimatorNode)
    impacts = harness.listen(interfaces.IMPACT)
    node = start(harness, path, rate=0.0, loop=3, required_subscribers="estimator")
    wait_for_end(harness, node)
    assert [item.record for item in impacts.wait_for_count(12)] == [1, 2, 3, 4] * 3
    (sample,) = harness.call(GetResults, interfaces.GET_RESULTS).samples
    assert (sample.impacts_accepted, sample.impacts_rejected) == (4, 0)


def test_a_loop_without_end_is_ended_by_deactivation(harness, tmp_path):
    path = write_recording(tmp_path / "session.mcap", make_events(5, pause=0.01))
    blocks = harness.listen(interfaces.ACCELERATION)
    node = start(harness, path, loop=0)
    assert list_samples(blocks.wait_for_count(15))[:15] == [0, 1, 2, 3, 4] * 3
    node.trigger_deactivate()
    assert node.describe_state()["message"] == "stopped"


def test_it_is_the_clock_of_nodes_with_simulated_time(harness, tmp_path):
    path = write_recording(tmp_path / "session.mcap", make_events(20, pause=0.01))
    harness.listen(interfaces.ACCELERATION)
    clock = harness.make_collector()
    topic = interfaces.CLOCK
    harness.peer.create_subscription(topic.type, topic.name, clock.take, topic.qos)
    simulated = Node(
        "simulated",
        context=harness.peer.context,
        parameter_overrides=[Parameter("use_sim_time", value=True)],
    )
    harness.peer.executor.add_node(simulated)
    harness.wait_until(lambda: harness.peer.count_subscribers("/clock") == 2)
    node = start(harness, path, publish_clock=1000.0)
    wait_for_end(harness, node)
    end = START + 200_000_000
    harness.wait_until(lambda: simulated.get_clock().now().nanoseconds == end)
    simulated.destroy_node()
    times = [item.clock.sec * 10**9 + item.clock.nanosec for item in clock.messages]
    assert all(earlier <= later for earlier, later in pairwise(times))
    assert START <= times[0] <= times[-1] <= end
    # More than there are messages: it goes on in between.
    assert len(set(times)) > 30


def test_a_slow_estimator_is_waited_for(harness, tmp_path, monkeypatch):
    from impact_rig.nodes import estimator as module

    convert, taken = module.block_from_msg, []

    def convert_slowly(message: AccelerationBlock):
        taken.append(message.first_sample)
        time.sleep(0.003)
        return convert(message)

    monkeypatch.setattr(module, "block_from_msg", convert_slowly)
    hits = make_hits({CONTROL_SAMPLE: 45})
    path = write_recording(tmp_path / "session.mcap", hits)
    harness.add(EstimatorNode)
    impacts = harness.listen(interfaces.IMPACT)
    start(harness, path, rate=0.0, required_subscribers="estimator")
    impacts.wait_for_count(45)
    assert len(taken) == sum(item[1] is interfaces.ACCELERATION for item in hits) > 200
