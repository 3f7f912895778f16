"""Recordings of the virtual rig, written without ROS."""

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.record import Block, HitLabel
from impact_rig.devices.virtual.faults import FaultPlan, scheduled_fault_from_text
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.recording.interfaces.message_encoder import MessageEncoder
from impact_rig.recording.interfaces.qos_profiles import OfferedQos
from impact_rig.recording.writing.mcap_writer import McapWriter

MILLISECOND = 1_000_000
"""[ns]"""
BLOCK_SIZE = 1000

Write = Callable[[Path, Sequence[RigSetup | Block]], Path]
Strike = Callable[..., tuple[Block, ...]]


def write_events(path: Path, events: Sequence[RigSetup | Block]) -> Path:
    """Write set-ups and blocks as a recorder does, a millisecond after each other."""
    encoder = MessageEncoder()
    path.parent.mkdir(exist_ok=True)
    with McapWriter(path, chunk_size=100_000) as writer:
        setups = writer.add_channel("/setup", encoder.setup_definition, (OfferedQos(),))
        blocks = writer.add_channel("/acceleration", encoder.block_definition, (OfferedQos(),))
        for number, event in enumerate(events, start=1):
            time = number * MILLISECOND
            if isinstance(event, RigSetup):
                writer.add_message(setups, encoder.encode_setup(event, time), time, time)
            else:
                writer.add_message(blocks, encoder.encode_block(event), time, time)
    return path


def strike_once(sample: str, record: int, impact: int, attempt: int = 1, fault: str = "") -> tuple:
    """Return the blocks of one hit."""
    scheduled = (scheduled_fault_from_text(f"{impact}:{fault}"),) if fault else ()
    rig = VirtualRig(PAPER_SETUP, VirtualRigSettings(faults=FaultPlan(scheduled=scheduled)))
    return rig.strike(HitLabel(sample, record, impact, attempt)).split(BLOCK_SIZE, 0)


@pytest.fixture(scope="session")
def write() -> Write:
    """Return the function that writes a recording."""
    return write_events


@pytest.fixture(scope="session")
def strike_for_recording() -> Strike:
    """Return the function that strikes one hit."""
    return strike_once
