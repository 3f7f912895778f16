"""Whatever dies at whatever moment: the hit of every verdict that was published is on the disk."""

import random
import signal
import threading
from pathlib import Path

import pytest
from impact_rig_msgs.action import RunCampaign
from impact_rig_msgs.msg import AccelerationBlock
from rclpy.action import ActionClient
from rclpy.serialization import deserialize_message

from impact_rig.nodes import interfaces

from ..recordings.text_recordings import read_by_stream

RIG = {
    "hammer": {"swing_time": 0.001},
    "accelerometer": {"trigger_timeout": 0.001},
    "estimator": {},
    "campaign": {},
}
KILLS = 1
"""Of the recorder alone, before all nodes are killed [-]."""
LONGEST_HIT = 0.05
"""What a hit of this rig takes on a quiet machine [s]: a kill should meet every part of it."""
START_PATIENCE = 60.0
"""How long five processes may take to start side by side before the test fails [s]."""


def find_whole_records(path: Path) -> set[int]:
    """Return the records whose every point is in a file without an end, by another library."""
    points, whole = {}, set()
    for topic, message in read_by_stream(path):
        if topic == "/acceleration":
            block = deserialize_message(message.data, AccelerationBlock)
            assert block.first_sample == points.get(block.record, 0)
            points[block.record] = block.first_sample + len(block.hammer.counts)
            if block.last:
                whole.add(block.record)
    return whole


@pytest.fixture
def rig(harness, start_process):
    """Start the nodes but the recorder; return them with a client of the campaign."""
    processes = {name: start_process(name, **parameters) for name, parameters in RIG.items()}
    client = ActionClient(harness.peer, RunCampaign, interfaces.RUN_CAMPAIGN)
    harness.wait_until(client.server_is_ready, START_PATIENCE)
    return processes, client


def _is_recording(states, path):
    return any(state.recording and state.uri == str(path) for state in states.messages)


def test_every_verdict_that_was_seen_has_its_hit_in_a_file(harness, start_process, rig, tmp_path):
    processes, client = rig
    verdicts = harness.listen(interfaces.IMPACT)
    states = harness.listen(interfaces.RECORDER_STATE)
    dice = random.Random(1)
    paths = [tmp_path / f"{number}.mcap" for number in range(KILLS + 1)]
    for path in paths:
        processes["recorder"] = start_process("recorder", output=path)
        # A recorder that comes after one that was killed makes the rig whole again.
        harness.wait_until(lambda path=path: _is_recording(states, path), START_PATIENCE)
        seen = len(verdicts.messages)
        goal = RunCampaign.Goal(samples=["steel small"], impacts=1000)
        campaign = harness.wait(client.send_goal_async(goal))
        verdicts.wait_for_count(seen + 3)
        killed = ["recorder"] if path is not paths[-1] else list(processes)

        def kill(names: list[str] = killed) -> None:
            for name in names:
                processes[name].send_signal(signal.SIGKILL)

        threading.Timer(dice.uniform(0.0, LONGEST_HIT), kill).start()
        processes["recorder"].wait()
        if path is not paths[-1]:
            # What was wrongly judged would be told before the campaign ends.
            harness.wait(campaign.cancel_goal_async())
            harness.wait(campaign.get_result_async())
    found = [find_whole_records(path) for path in paths]
    assert all(len(records) >= 3 for records in found)
    assert {verdict.record for verdict in verdicts.messages} <= set().union(*found)
