"""What contradicts the paper's method is said, and what does not is not."""

from dataclasses import replace

import pytest

from impact_rig.core.estimation.assumptions import DRIVEN_PEAK, STEPS
from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.session import Session
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.digitizer import DigitizerSettings
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings

SAMPLE = "aluminium large"


def strike(
    settings: VirtualRigSettings, truth: RigSetup = PAPER_SETUP, stated: RigSetup = PAPER_SETUP
) -> SampleEstimate:
    """Return the estimate of the control sample after five hits."""
    rig, session = VirtualRig(truth, settings), Session(stated)
    for impact in range(1, 6):
        for block in rig.strike(HitLabel(SAMPLE, impact, impact)).split(5000, 0):
            session.feed(block)
    (estimate,) = session.estimate_all().samples
    return estimate


def test_a_rig_as_the_paper_describes_it_gives_no_warning() -> None:
    assert strike(VirtualRigSettings()).warnings == ()


def test_a_body_that_is_driven_at_its_peak_is_told_from_one_that_decays() -> None:
    assert strike(VirtualRigSettings(plant=Plant.DYNAMICS)).warnings == (DRIVEN_PEAK,)


@pytest.mark.parametrize("noise", [0.0, 5e-4])
def test_steps_larger_than_the_noise_are_named(noise: float) -> None:
    # A step of eight bits is 1/128 of full scale.
    digitizer = DigitizerSettings(bits=8, noise=noise)
    assert STEPS in strike(VirtualRigSettings(digitizer=digitizer)).warnings


def test_a_control_sample_of_another_mass_is_named_with_both_masses() -> None:
    heavy = replace(PAPER_SETUP, hammer_mass=0.15)
    (warning,) = strike(VirtualRigSettings(), heavy, heavy).warnings
    assert warning.startswith(
        "the control sample 'aluminium large' of 105.4 g is not alike to the hammer of 150 g"
    )


def test_forces_that_do_not_balance_are_named() -> None:
    # The hammer is really a tenth heavier than stated: its acceleration shows too little force.
    truth = replace(PAPER_SETUP, hammer_mass=1.1 * PAPER_SETUP.hammer_mass)
    warnings = strike(VirtualRigSettings(plant=Plant.DYNAMICS), truth).warnings
    assert warnings[-1].startswith(
        "by the identification the sample feels 1.1 times the force of the hammer"
    )
