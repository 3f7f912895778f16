"""A set-up survives the way through a message, uncertainties included."""

from dataclasses import asdict, replace

import pytest

from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.nodes.messages import setup_to_msg, stamp_to_msg
from impact_rig.recording.interfaces.messages import setup_from_msg


@pytest.mark.parametrize(
    "setup", [PAPER_SETUP, replace(PAPER_SETUP, hammer_mass_uncertainty=0.0, clock_uncertainty=0)]
)
def test_a_set_up_comes_back_as_it_went(setup):
    # The paper's samples have all their reference values, so that nothing is NaN.
    assert asdict(setup_from_msg(setup_to_msg(setup, stamp_to_msg(7)))) == asdict(setup)
