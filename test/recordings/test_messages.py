"""A set-up and a block, read back from their messages."""

import dataclasses
import math

import numpy as np
import pytest

from impact_rig.core.records import NOT_ARMED, Block, ChannelBlock, HitLabel
from impact_rig.core.setup import PAPER_SETUP, AnalysisSettings, RigSetup, Sample, SampleSet
from impact_rig.recordings.messages import (
    MessageEncoder,
    block_from_msg,
    setup_from_msg,
)

STAMP = 1_700_000_000_123_456_789


@pytest.fixture
def decode():
    """Return a function that decodes by mcap-ros2-support, which shares no code with rosbags."""
    from mcap_ros2._dynamic import generate_dynamic

    def call(definition, data):
        return generate_dynamic(definition.type_name, definition.text)[definition.type_name](data)

    return call


def make_block(hammer: np.ndarray, specimen: np.ndarray, label: HitLabel) -> Block:
    return Block(
        label=label,
        first_sample=2**40,
        sampling_rate=25_600.5,
        hammer=ChannelBlock(hammer, 0.25, -1.5, 512.0),
        specimen=ChannelBlock(specimen, -9.80665, 0.0, 0.0),
        last=True,
        stamp=STAMP,
    )


@pytest.mark.parametrize(
    ("hammer", "specimen", "label"),
    [
        (np.arange(5, dtype=np.int32), np.arange(5) / 3.0, HitLabel("brass, small", 7, 3, 2)),
        (np.array([0.1, -0.0, 5e-324, 1e308]), np.empty(0), NOT_ARMED),
    ],
    ids=["counts and numbers", "no specimen, of a stream"],
)
def test_a_block_comes_back_bit_by_bit_in_the_memory_of_its_message(
    decode, hammer, specimen, label
):
    encoder, block = MessageEncoder(), make_block(hammer, specimen, label)
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
        own = getattr(message, name)
        own = own.counts if output.dtype == np.int32 else own.values
        assert np.shares_memory(came.output, own) or not output.size
        assert not came.output.flags.writeable
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
