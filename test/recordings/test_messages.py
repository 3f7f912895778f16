"""A set-up, read back from its message."""

import dataclasses
import math

import numpy as np
import pytest

from impact_rig.core.given.setup import PAPER_SETUP, AnalysisSettings, RigSetup, Sample, SampleSet
from impact_rig.recordings.messages import MessageEncoder, setup_from_msg

STAMP = 1_700_000_000_123_456_789


UNKNOWN = RigSetup(
    SampleSet((Sample("aluminium, large", math.nan),), ""),
    hammer_mass=math.nan,
    impact_speed=0.0819,
    analysis=AnalysisSettings(cutoff_frequency=0.0, record_duration=1.0),
    description="Größe 5 µm",
)


@pytest.mark.parametrize("setup", [PAPER_SETUP, UNKNOWN], ids=["the paper's", "hardly known"])
def test_a_setup_comes_back_as_it_was(setup):
    """By mcap-ros2-support, which shares no code with rosbags."""
    from mcap_ros2._dynamic import generate_dynamic

    encoder = MessageEncoder()
    definition = encoder.setup_definition
    decode = generate_dynamic(definition.type_name, definition.text)[definition.type_name]
    found = setup_from_msg(decode(encoder.encode_setup(setup, STAMP)))
    np.testing.assert_equal(dataclasses.asdict(found), dataclasses.asdict(setup))
