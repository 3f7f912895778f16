"""Recordings to be replayed, and what it takes to see them through."""

from pathlib import Path

from impact_rig_msgs.msg import AccelerationBlock, HammerRelease
from rclpy.serialization import serialize_message

from impact_rig.core.given.records import HitLabel
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.nodes import interfaces
from impact_rig.nodes.identity import Identity, make_id
from impact_rig.nodes.messages import block_to_msg, setup_to_msg, stamp_to_msg, virtual_hit_to_msg
from impact_rig.nodes.recorder import describe_qos
from impact_rig.recordings.schemas import find_message_definition
from impact_rig.recordings.writer import RecordingWriter

PEER = "peer"
"""The node that listens in these tests, wherever the replayer is."""
START = 1_700_000_000_000_000_000
PAUSE = 0.3
"""Between two hits [s]."""


def write_recording(path: Path, events, *, namespace="", attachment=(), **options) -> Path:
    """Write (time [s], topic, message) as a recorder in the namespace would."""
    writer = RecordingWriter(path, **options)
    if attachment:
        writer.add_attachment(*attachment)
    channels = {}
    for offset, topic, message in events:
        if topic.name not in channels:
            channels[topic.name] = writer.add_channel(
                f"{namespace}/{topic.name}",
                find_message_definition(topic.type_name),
                (describe_qos(topic.qos),),
            )
        stamp = START + round(offset * 1e9)
        writer.add_message(channels[topic.name], serialize_message(message), stamp, stamp)
    writer.close()
    return path


def make_events(count, blocks=1, pause=0.0):
    """Return a set-up and small blocks, `pause` seconds apart."""
    setup = setup_to_msg(PAPER_SETUP, stamp_to_msg(START))
    return [
        (0.0, interfaces.SETUP, setup),
        *(
            (
                (index + 1) * pause,
                interfaces.ACCELERATION,
                AccelerationBlock(
                    record=index // blocks + 1,
                    first_sample=index,
                    sample="brass",
                    last=index % blocks == blocks - 1,
                ),
            )
            for index in range(count)
        ),
    ]


def make_hits(counts):
    """Return a set-up, and releases, truths and blocks of hits of the virtual rig."""
    rig, identity = VirtualRig(PAPER_SETUP, VirtualRigSettings()), Identity(make_id(), make_id())
    setup = setup_to_msg(PAPER_SETUP, stamp_to_msg(START))
    identity.fill(setup)
    events = [(0.0, interfaces.SETUP, setup)]
    record = 0
    for sample, count in counts.items():
        for impact in range(1, count + 1):
            record += 1
            hit = rig.strike(HitLabel(sample, record=record, impact=impact))
            label = {"record": record, "sample": sample, "impact": impact, "attempt": 1}
            truth = virtual_hit_to_msg(hit, stamp_to_msg(START))
            messages = [
                (interfaces.RELEASE, HammerRelease(**label)),
                (interfaces.VIRTUAL_IMPACT, truth),
                *(
                    (interfaces.ACCELERATION, block_to_msg(part, identity))
                    for part in hit.split(1000, START)
                ),
            ]
            events += [(record * PAUSE, *item) for item in messages]
    return events


def wait_for_end(harness, node):
    harness.wait_until(lambda: node.diagnose()["message"].startswith("done"))
    harness.wait_until(lambda: not node.is_active)
