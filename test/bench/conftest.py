"""What the tests of the bench measure with: little, quickly."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from impact_rig.bench.part import Bench, Extent
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.recording.interfaces.message_encoder import MessageEncoder
from impact_rig.recording.interfaces.qos_profiles import OfferedQos
from impact_rig.recording.writing.mcap_writer import McapWriter

HITS = 3
TIME = 1_700_000_000_000_000_000


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a recording of three hits, each in a chunk of its own."""
    path = tmp_path_factory.mktemp("campaign") / "session.mcap"
    encoder, rig = MessageEncoder(), VirtualRig(PAPER_SETUP, VirtualRigSettings())
    with McapWriter(path) as writer:
        channel = writer.add_channel("/setup", encoder.setup_definition, (OfferedQos(),))
        writer.add_message(channel, encoder.encode_setup(PAPER_SETUP, TIME), TIME, TIME)
        channel = writer.add_channel("/acceleration", encoder.block_definition, (OfferedQos(),))
        for record in range(1, HITS + 1):
            for block in rig.strike(HitLabel("steel large", record, record)).split(1000, 0):
                writer.add_message(channel, encoder.encode_block(block), TIME, TIME)
            writer.flush()
    return path


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    """Return what a part works with."""
    return Bench(tmp_path, Extent(seconds=1.0, kills=1, mutations=6, repeats=2), lambda *_: None)


@pytest.fixture
def without_campaign(recording: Path, monkeypatch: Any) -> Callable[[str], None]:
    """Return a function that lets a part use `recording` in place of a campaign of its own."""

    def replace(part: str) -> None:
        monkeypatch.setattr(f"impact_rig.bench.parts.{part}.record_campaign", lambda *_: recording)

    return replace
