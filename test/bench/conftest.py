"""What the tests of the bench measure with: little, quickly."""

import pytest

from bench.campaigns import Campaign, Campaigns
from bench.measure import Bench, Extent
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.recordings.messages import MessageEncoder
from impact_rig.recordings.qos import OfferedQos
from impact_rig.recordings.writer import McapWriter

HITS = 3
TIME = 1_700_000_000_000_000_000


@pytest.fixture(scope="session")
def recording(tmp_path_factory):
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


class OneCampaign(Campaigns):
    """A campaign that there is already, in place of any number of them."""

    def __init__(self, recording):
        self._campaign = Campaign(recording, 1.5)

    def take(self, count, *_):
        return (self._campaign,) * count


@pytest.fixture
def bench(tmp_path, recording):
    """Return what a part works with."""
    extent = Extent(demos=2, seconds=1.0, hits=2, kills=1, mutations=6, repeats=2)
    return Bench(tmp_path, extent, OneCampaign(recording), lambda *_: None)
