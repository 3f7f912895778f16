"""Effects of sensors on results are reported; their ringing is not taken for a sample's."""

from dataclasses import replace

import pytest

from impact_rig.core.quantity import Quantity
from impact_rig.core.sample import (
    FreeDecayEstimate,
    SampleEstimate,
    check_sensors,
    explain_ringing,
    withdraw_shared_ringing,
)
from impact_rig.core.sensors import Sensor
from impact_rig.core.setup import PAPER_SETUP, RigSetup

NAMES = ("aluminium small", "steel medium", "brass large")


def describe(channel: str, resonance: float) -> RigSetup:
    return replace(PAPER_SETUP, sensors=(Sensor(channel, resonance=resonance),))


def test_a_resonance_near_the_low_pass_is_warned_of():
    (warning,) = check_sensors(describe("hammer", 70e3), 212e-6)
    assert "hammer's sensor, 70 kHz, lies near the low-pass of 50 kHz" in warning
    assert "a low-pass of 35 kHz" in warning
    assert check_sensors(describe("hammer", 110e3), 212e-6) == ()
    assert check_sensors(PAPER_SETUP, 212e-6) == ()


def test_a_resonance_near_the_spectrum_of_the_contact_is_warned_of():
    (warning,) = check_sensors(describe("specimen", 110e3), 40e-6)
    assert "specimen's sensor, 110 kHz, lies near the spectrum of a contact" in warning


@pytest.mark.parametrize(
    ("frequency", "resonance", "told"),
    [
        (55e3, 0.0, "55 kHz, above half the low-pass of 50 kHz"),
        (20.5e3, 20e3, "20.5 kHz is the sensor, by the resonance that is stated"),
        (20.5e3, 40e3, None),
        (4e3, 0.0, None),
    ],
)
def test_which_ringing_is_a_sensors(frequency, resonance, told):
    text = explain_ringing(frequency, describe("specimen", resonance))
    assert told in text if told else text is None


def ring(name: str, frequency: float) -> SampleEstimate:
    decay = FreeDecayEstimate(
        stiffness=Quantity(1e9), damping_ratio=Quantity(0.02), frequency=frequency
    )
    return SampleEstimate(
        name, 5, 0, damping_ratio=Quantity(0.03), log_decrement=0.2, first_peak_time=0.0,
        second_peak_time=1.0 / frequency, free_decay=decay,
    )  # fmt: skip


def test_what_rings_alike_on_samples_of_other_masses_is_no_samples():
    found = withdraw_shared_ringing(
        [ring(name, 20e3 * factor) for name, factor in zip(NAMES, (1.0, 1.01, 0.99), strict=True)],
        PAPER_SETUP,
    )
    for sample in found:
        assert not sample.free_decay.is_known
        assert not sample.damping_ratio.is_known
        assert "20 kHz does so on all samples, though their masses differ" in sample.notes[-1]


def test_samples_that_ring_each_in_its_own_way_keep_what_they_have():
    own = [ring(name, frequency) for name, frequency in zip(NAMES, (4e3, 2.6e3, 2e3), strict=True)]
    assert withdraw_shared_ringing(own, PAPER_SETUP) == tuple(own)
    # Two may well be alike by chance.
    two = [ring(name, 4e3) for name in NAMES[:2]]
    assert withdraw_shared_ringing(two, PAPER_SETUP) == tuple(two)
