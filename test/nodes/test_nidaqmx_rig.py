"""A rig of National Instruments' devices: real nodes, NI's protocol, a simulated device."""

import numpy as np
import pytest
from impact_rig_msgs.msg import AcquisitionState, HammerState
from impact_rig_msgs.srv import Arm, Release
from std_srvs.srv import Trigger

pytest.importorskip("nidaqmx", reason="the drivers need the Python package nidaqmx")
pytest.importorskip("grpc", reason="the drivers need the Python package grpcio")

from impact_rig.configuration.rig_file import read_template
from impact_rig.core.setup.calibration import STANDARD_GRAVITY
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.nodes import interfaces
from impact_rig.nodes.accelerometer import AccelerometerNode
from impact_rig.nodes.hammer import HammerNode
from impact_rig.nodes.messages import setup_to_msg, stamp_to_msg
from impact_rig.recordings.messages import block_from_msg
from impact_rig.testing.peers.nidaqmx_server import SENSITIVITY, NidaqmxServer

SAMPLE = "steel small"
CYCLES = 5
RIG = """
[source]
driver = "nidaqmx"
sampling_rate = "2.5 MHz"
record_duration = "2 ms"
pre_trigger = "200 us"
trigger_level = "5 g"
server = "{address}"
[source.hammer]
channel = "Dev1/ai0"
sensitivity = "10 mV/g"
iepe_current = "4 mA"
range = "5 V"
[source.specimen]
channel = "Dev1/ai1"
sensitivity = "10 mV/g"
iepe_current = "4 mA"
range = "5 V"
[holder]
driver = "nidaqmx"
line = "Dev1/port0/line0"
server = "{address}"
swing_time = "1 ms"
return_time = "1 ms"
"""


@pytest.fixture
def hit():
    return VirtualRig(PAPER_SETUP, VirtualRigSettings()).strike(HitLabel(SAMPLE))


@pytest.fixture
def server(hit):
    with NidaqmxServer(SENSITIVITY, SENSITIVITY) as server:
        server.device.on_level = lambda line, level: None if level else server.feed(hit)
        yield server


@pytest.fixture
def rig(harness, server, tmp_path):
    """Return the blocks that the nodes of the rig publish."""
    path = tmp_path / "rig.toml"
    path.write_text(read_template() + RIG.format(address=server.address))
    options = {"rig_file": str(path), "reconnect_period": 0.02}
    blocks = harness.listen(interfaces.ACCELERATION)
    harness.add(AccelerometerNode, required_subscribers="peer", **options)
    harness.add(HammerNode, require_recorder=False, **options)
    harness.advertise(interfaces.SETUP).publish(setup_to_msg(PAPER_SETUP, stamp_to_msg(1)))
    return blocks


def arm(harness, impact):
    """Arm the accelerometers; return the number of the record."""
    request = Arm.Request(sample=SAMPLE, impact=impact, attempt=1)
    answer = harness.ask(Arm, interfaces.ARM_ACCELEROMETER, request)
    assert answer.success, answer.message
    return answer.record


def hit_once(harness, impact):
    """Strike once; return the number of the record."""
    assert harness.call(Trigger, interfaces.ARM_HAMMER).success
    record = arm(harness, impact)
    request = Release.Request(record=record, sample=SAMPLE, impact=impact, attempt=1)
    # The hammer has to hear that the source is armed.
    harness.wait_until(lambda: harness.ask(Release, interfaces.RELEASE_HAMMER, request).success)
    return record


def test_what_the_line_lets_go_is_published_as_it_was_fed(harness, rig, server, hit):
    record = hit_once(harness, 1)
    received = [
        block_from_msg(message) for message in rig.wait(lambda got: bool(got) and got[-1].last)
    ]
    assert {block.label.record for block in received} == {record}
    assert server.device.falls == {"Dev1/port0/line0": 1}
    for name in ("hammer", "specimen"):
        numbers = np.concatenate([getattr(block, name).output for block in received])
        fed = getattr(hit, name).output * getattr(hit, name).scale
        assert numbers.shape == (5000,)
        assert np.max(numbers) == pytest.approx(np.max(fed), abs=0.1)
        if name == "hammer":
            assert np.argmax(np.abs(numbers) > 5 * STANDARD_GRAVITY) == 500, "its trigger"


def test_a_device_that_is_unplugged_and_comes_back_loses_and_doubles_no_hit(harness, rig, server):
    acquisition = harness.listen(interfaces.ACQUISITION_STATE)
    hammer = harness.listen(interfaces.HAMMER_STATE)
    records = []
    for cycle in range(1, CYCLES + 1):
        arm(harness, cycle)
        acquisition.wait(lambda got: got[-1].state == AcquisitionState.ARMED)
        server.unplug()
        lost = acquisition.wait(lambda got: got[-1].state == AcquisitionState.FAULT)[-1]
        assert "NI device Dev1" in lost.message
        assert "cannot be reached" in lost.message
        lost = hammer.wait(lambda got: got[-1].state == HammerState.FAULT)[-1]
        assert "NI line Dev1/port0/line0" in lost.message
        server.plug()
        acquisition.wait(lambda got: got[-1].state == AcquisitionState.IDLE)
        hammer.wait(lambda got: got[-1].state == HammerState.HELD)
        records.append(hit_once(harness, cycle))
        rig.wait(lambda got, count=cycle: sum(block.last for block in got) == count)
    assert [block.record for block in rig.messages if block.last] == records
    assert len(set(records)) == CYCLES
    assert server.device.falls == {"Dev1/port0/line0": CYCLES}
