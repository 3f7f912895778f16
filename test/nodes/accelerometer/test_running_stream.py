"""A running stream of a device: gaps are passed on, and its end is said."""

from dataclasses import replace

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from impact_rig_msgs.msg import AcquisitionState

from impact_rig.nodes import interfaces
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.recordings.messages import block_from_msg

from .desk_rig import arm, make_record, wait_for_release, wait_for_state


def test_a_running_stream_passes_gaps_on_and_each_node_counts_and_names_them(harness, desk, rig):
    seen = harness.listen(interfaces.DIAGNOSTICS)
    stream = harness.listen(interfaces.STREAM)
    estimator = harness.add(EstimatorNode)
    node = rig(mode="continuous", stream_block_size=2500)
    record = replace(make_record(), last=False)
    harness.wait_until(lambda: node.diagnose()["subscribers"] == 2 and estimator._setup)
    desk.deliver(record, replace(record, first_sample=7500))
    got = [block_from_msg(item) for item in stream.wait_for_count(4)]
    assert [block.first_sample for block in got] == [0, 2500, 7500, 10000]
    assert not any(block.last for block in got)
    assert desk.calls == ["configure", "arm"]
    for name, figure, word in (
        ("accelerometer", "points lost", "2500 points of the source were lost"),
        ("estimator", "stream points missing", "2500 points of the stream were lost"),
    ):
        status = wait_for_losses(seen, f"/{name}", figure)
        assert (status.level, word in status.message) == (DiagnosticStatus.WARN, True)


def wait_for_losses(collector, node, figure):
    """Wait until a figure of a node's diagnostics is above 0; return the diagnostics."""

    def find(arrays):
        newest = [array.status[0] for array in arrays if array.status[0].name == node][-1:]
        values = {item.key: item.value for status in newest for item in status.values}
        return newest if int(values.get(figure, 0)) > 0 else []

    return find(collector.wait(find))[0]


def make_quiet():
    """Return 2 ms of a stream in which nothing happens."""
    record = make_record()
    hammer = replace(record.hammer, output=np.zeros(5000, np.int32))
    return replace(record, last=False, hammer=hammer)


@pytest.fixture
def impacts(harness):
    """Return the verdicts of an estimator."""
    harness.add(EstimatorNode)
    return harness.listen(interfaces.IMPACT)


@pytest.fixture
def stream_rig(rig):
    """Return a function that starts the accelerometers with a running stream."""
    options = {"mode": "continuous", "subscribers": 1, "trigger_timeout": 60.0}
    return lambda period: rig(reconnect_period=period, **options)


@pytest.mark.parametrize("end", ["loss", "deactivation"])
def test_a_hit_that_the_end_of_the_stream_cuts_off_is_rejected_at_once(
    harness, desk, stream_rig, states, impacts, release, end
):
    stream = harness.listen(interfaces.STREAM)
    node = stream_rig(0.0)
    desk.deliver(make_quiet())
    record = arm(harness).record
    release(record)
    wait_for_release(harness, node)
    desk.deliver(replace(make_record().cut(0, 1200), first_sample=5000))
    stream.wait_for_count(2)
    if end == "loss":
        desk.unplug()
        wait_for_state(states, AcquisitionState.FAULT)
    else:
        harness.change_state("accelerometer", "deactivate")
    (verdict,) = impacts.wait_for_count(1)
    assert (verdict.record, verdict.accepted) == (record, False)
    assert verdict.reasons[0].reason == "gap"
    got = stream.wait(lambda got: block_from_msg(got[-1]).ends_stream)
    final = block_from_msg(got[-1])
    assert (final.first_sample, final.hammer.output.size) == (6200, 0)


def test_a_stream_that_breaks_off_while_the_hammer_swings_gets_one_verdict(
    harness, desk, stream_rig, states, impacts, release
):
    node = stream_rig(0.3)
    quiet = make_quiet()
    desk.deliver(quiet)
    record = arm(harness).record
    desk.deliver(replace(quiet, first_sample=5000))
    release(record)
    wait_for_release(harness, node)
    desk.unplug()
    wait_for_state(states, AcquisitionState.FAULT)
    (verdict,) = impacts.wait_for_count(1)
    assert verdict.record == record
    assert verdict.reasons[0].reason == "no_trigger"
    desk.plug()
    harness.wait_until(lambda: node.is_active)
    assert arm(harness).success
    release(record + 1)
    desk.deliver(quiet)
    desk.deliver(replace(make_record(), last=False, first_sample=5000))
    desk.deliver(replace(quiet, first_sample=10_000))
    assert [item.record for item in impacts.wait_for_count(2)] == [record, record + 1]
