"""The visualizer shows what the rig says over real DDS."""

import math
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from impact_rig_msgs.msg import Impact, ModelComparison
from lifecycle_msgs.msg import State

from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.setup import CONTROL_SAMPLE, PAPER_SETUP
from impact_rig.devices.virtual.choices import Fault
from impact_rig.devices.virtual.rig import (
    FaultPlan,
    ScheduledFault,
    VirtualRig,
    VirtualRigSettings,
)
from impact_rig.nodes import interfaces
from impact_rig.nodes.estimator import EstimatorNode
from impact_rig.nodes.identity import Identity, make_id
from impact_rig.nodes.messages import block_to_msg, setup_to_msg, stamp_to_msg
from impact_rig.nodes.visualizer import VisualizerNode
from impact_rig.recordings.new_file import ROOM_FOR_ENDING

pytest.importorskip("rerun", reason="rerun-sdk is not installed")

SETUP = setup_to_msg(PAPER_SETUP, stamp_to_msg(7))


@pytest.fixture
def read(tmp_path):
    """Return a function that reads the view back with Rerun's own reader."""
    import rerun

    def run():
        reader = rerun.chunk.RrdReader(str(tmp_path / "run" / "session.rrd"))
        return reader, reader.stream().to_chunks()

    return run


def find_column(chunks, entity, column):
    return [
        value.as_py()
        for chunk in chunks
        if chunk.entity_path == entity
        for batch in [chunk.to_record_batch()]
        if column in batch.schema.names
        for value in batch.column(column)
    ]


def list_entities(chunks, prefix):
    return {chunk.entity_path for chunk in chunks if chunk.entity_path.startswith(prefix)}


def test_all_there_is_to_see_ends_up_in_the_file(harness, tmp_path, read):
    harness.add(EstimatorNode)
    output = tmp_path / "run" / "session.rrd"
    node = harness.add(VisualizerNode, output=str(output))
    estimates = harness.listen(interfaces.ESTIMATE)
    impacts = harness.listen(interfaces.IMPACT)
    harness.advertise(interfaces.SETUP).publish(SETUP)
    publisher = harness.advertise(interfaces.ACCELERATION)
    harness.wait_until(lambda: publisher.get_subscription_count() == 2)
    faults = FaultPlan(scheduled=(ScheduledFault(Fault.WEAK_HIT, 2),))
    rig = VirtualRig(PAPER_SETUP, VirtualRigSettings(faults=faults))
    hits = [rig.strike(HitLabel(CONTROL_SAMPLE, record, record)) for record in (1, 2)]
    for hit in hits:
        for block in hit.split(1000, 10**18):
            publisher.publish(block_to_msg(block))
    impacts.wait_for_count(2)
    estimates.wait_for_count(2)
    harness.wait_until(lambda: node.diagnose()["hits"] == 2)
    harness.wait_until(lambda: node.diagnose()["comparisons"] >= 2)
    harness.run(node.close)

    reader, chunks = read()
    # Before a set-up has come, and for its samples.
    assert len(reader.blueprints()) == 2
    for i, hit in enumerate(hits, start=1):
        rows = np.array(find_column(chunks, f"/hits/{i}", "Scalars:scalars"))
        assert rows.shape == (5000, 2)
        for channel, column in ((hit.hammer, 0), (hit.specimen, 1)):
            peak = np.max(np.abs(channel.output * channel.scale))
            assert np.max(np.abs(rows[:, column])) == pytest.approx(peak, rel=1e-6)
    (text,) = find_column(chunks, "/results", "TextDocument:text")[-1]
    assert "aluminium large" in text
    assert "212" in text
    levels = find_column(chunks, "/log", "TextLog:level")
    assert levels.count(["WARN"]) == 1
    (rejected,) = [
        text for (text,) in find_column(chunks, "/log", "TextLog:text") if "rejected" in text
    ]
    assert "weak" in rejected
    drawn = list_entities(chunks, r"/samples/aluminium\ large/")
    assert any("models" in name for name in drawn)
    # Of two hits one is in the mean.
    assert len({name for name in drawn if "/hammer/hits/" in name}) == 1


def test_what_comes_before_its_set_up_waits_for_it(harness, tmp_path):
    node = harness.add(VisualizerNode, output=str(tmp_path / "run" / "session.rrd"))
    setups, impacts = map(harness.advertise, (interfaces.SETUP, interfaces.IMPACT))
    harness.wait_until(lambda: impacts.get_subscription_count() == 1)

    def deliver(publisher, message):
        handled = node.intake.handled
        publisher.publish(message)
        harness.wait_until(lambda: node.intake.handled > handled)

    def list_records():
        return harness.run(lambda: [hit.record for hit in node._campaign.make_results().hits])

    identities = {number: Identity(make_id()) for number in (1, 2, 3)}
    for stamp in (1, 2):
        setup = setup_to_msg(PAPER_SETUP, stamp_to_msg(stamp))
        identities[stamp].fill(setup)
        deliver(setups, setup)
        for found in (1, 2, 3):
            verdict = Impact(
                record=10 * stamp + found, sample=CONTROL_SAMPLE, contact_time=math.nan
            )
            identities[found].fill(verdict)
            deliver(impacts, verdict)
        deliver(setups, setup)  # to who comes late: nothing begins afresh
        assert list_records() == [[11], [12, 22]][stamp - 1]


def test_what_cannot_be_shown_is_said_and_the_rest_goes_on(harness, tmp_path, monkeypatch):
    node = harness.add(VisualizerNode, output=str(tmp_path / "run" / "session.rrd"))
    monkeypatch.setattr(node._view.log, "log_setup", lambda *_: 1 / 0)
    setups, comparisons = map(harness.advertise, (interfaces.SETUP, interfaces.COMPARISON))
    harness.wait_until(lambda: comparisons.get_subscription_count() == 1)
    setups.publish(SETUP)
    harness.wait_until(lambda: "ZeroDivisionError" in (node.describe_warning() or ""))
    # Four empty traces, from a sender that knows no id.
    comparisons.publish(ModelComparison(sampling_rate=1e6))
    harness.wait_until(lambda: node.intake.dropped["comparison"] == 1)
    assert node.is_active
    assert node.diagnose()["left out"] == 1


NOWHERE = (
    ({}, "set output to the path of an .rrd file"),
    ({"output": "view.txt"}, "must end in .rrd"),
)


def test_a_view_that_goes_nowhere_fails_to_configure_and_says_what_to_set(harness):
    for number, (parameters, expected) in enumerate(NOWHERE):
        node = harness.add(VisualizerNode, namespace=f"/rig{number}", **parameters)
        assert not node.is_active
        assert node._state_machine.current_state[0] == State.PRIMARY_STATE_UNCONFIGURED
        assert expected in node.fault


def test_on_a_disk_that_is_nearly_full_no_view_is_begun(harness, tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=ROOM_FOR_ENDING))
    node = harness.add(VisualizerNode, output=str(tmp_path / "run" / "session.rrd"))
    assert "the disk is nearly full" in node.describe_warning()
    assert not node._subscriptions_of_view
