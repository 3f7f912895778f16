"""A set-up and a block of the stream, read back from their messages."""

import dataclasses
import math
from array import array
from types import SimpleNamespace

import numpy as np
import pytest

from impact_rig.core.records import NOT_ARMED, Block, ChannelBlock, HitLabel
from impact_rig.core.setup import PAPER_SETUP, AnalysisSettings, RigSetup, Sample, SampleSet
from impact_rig.recordings.messages import (
    MessageEncoder,
    block_from_msg,
    setup_from_msg,
)


class TestStreamBlock:
    """A block of the running stream."""

    def make(self, counts: object, values: object = (), **fields: object) -> SimpleNamespace:
        channel = SimpleNamespace(
            counts=counts, values=values, scale=0.5, offset=0.0, full_scale=2000.0, overload=False
        )
        place = {"record": 0, "sample": "", "impact": 0, "attempt": 0, "last": False, **fields}
        return SimpleNamespace(
            header=SimpleNamespace(stamp=SimpleNamespace(sec=2, nanosec=7)),
            first_sample=5000,
            sampling_rate=2.5e6,
            hammer=channel,
            specimen=channel,
            **place,
        )

    def test_reads_the_message_s_own_counts(self):
        counts = array("i", range(100))
        block = block_from_msg(self.make(counts))
        assert np.shares_memory(block.hammer.output, np.frombuffer(counts, np.int32))
        assert not block.hammer.output.flags.writeable
        assert (block.first_sample, block.stamp, block.label) == (5000, 2_000_000_007, NOT_ARMED)

    def test_reads_numbers_of_a_source_that_does_not_count_in_place(self):
        values = array("d", [0.25, 0.5])
        block = block_from_msg(self.make(array("i"), values))
        assert np.shares_memory(block.hammer.output, np.frombuffer(values))
        assert block.hammer.resolution == 0.0


STAMP = 1_700_000_000_123_456_789


@pytest.fixture
def decode():
    """Return a function that decodes by mcap-ros2-support, which shares no code with rosbags."""
    from mcap_ros2._dynamic import generate_dynamic

    def call(definition, data):
        return generate_dynamic(definition.type_name, definition.text)[definition.type_name](data)

    return call


def make_block(hammer: np.ndarray, specimen: np.ndarray) -> Block:
    return Block(
        label=HitLabel("brass, small", 7, 3, 2),
        first_sample=2**40,
        sampling_rate=25_600.5,
        hammer=ChannelBlock(hammer, 0.25, -1.5, 512.0),
        specimen=ChannelBlock(specimen, -9.80665, 0.0, 0.0),
        last=True,
        stamp=STAMP,
    )


@pytest.mark.parametrize(
    ("hammer", "specimen"),
    [
        pytest.param(np.arange(5, dtype=np.int32), np.arange(5) / 3.0, id="counts and numbers"),
        pytest.param(np.array([0.1, -0.0, 5e-324, 1e308]), np.empty(0), id="no specimen"),
    ],
)
def test_a_block_comes_back_bit_by_bit(decode, hammer, specimen):
    encoder, block = MessageEncoder(), make_block(hammer, specimen)
    message = decode(encoder.block_definition, encoder.encode_block(block))
    assert (message.hammer.counts == []) is (hammer.dtype != np.int32)
    # The other decoder gives lists, the rig's reads arrays.
    for channel in (message.hammer, message.specimen):
        channel.counts = np.array(channel.counts, np.int32)
        channel.values = np.array(channel.values, np.float64)
    found = block_from_msg(message)
    for name in ("label", "first_sample", "sampling_rate", "triggered", "last", "stamp"):
        assert getattr(found, name) == getattr(block, name)
    for name, output in (("hammer", hammer), ("specimen", specimen)):
        sent, came = getattr(block, name), getattr(found, name)
        assert came.output.tobytes() == output.tobytes()
        assert (came.scale, came.offset, came.full_scale) == (
            sent.scale,
            sent.offset,
            sent.full_scale,
        )


UNKNOWN = RigSetup(
    SampleSet((Sample("aluminium, large", math.nan),), ""),
    hammer_mass=math.nan,
    impact_speed=0.0819,
    analysis=AnalysisSettings(cutoff_frequency=0.0, keep_hits=3, record_duration=1.0),
    description="Größe 5 µm",
)


@pytest.mark.parametrize("setup", [PAPER_SETUP, UNKNOWN], ids=["the paper's", "hardly known"])
def test_a_setup_comes_back_as_it_was(decode, setup):
    encoder = MessageEncoder()
    found = setup_from_msg(decode(encoder.setup_definition, encoder.encode_setup(setup, STAMP)))
    np.testing.assert_equal(dataclasses.asdict(found), dataclasses.asdict(setup))
