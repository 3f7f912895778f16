"""What a sensor's resonance does to results: what to warn of, and which ringing is its own."""

from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.setup.sensors import CHANNELS

NEAR_LOW_PASS = 2.0
"""Resonance over the cutoff below which the low-pass lets ringing through [-], our choice: at
twice the cutoff a sixteenth is left."""
NEAR_CONTACT = 5.0
"""Resonance times contact time below which the contact makes a sensor ring [-], our choice: the
spectrum of a pulse is a few thousandths of its level from there on."""
PART_OF_CUTOFF = 0.5
"""Part of the cutoff above which what rings after a contact is no body's [-], our choice."""
SAME_FREQUENCY = 0.05
"""Difference of two frequencies that are one [-], our choice: a mount's resonance moves so far."""


def check_sensors(setup: RigSetup, contact_time: float) -> tuple[str, ...]:
    """Warn of stated resonances near the low-pass or the spectrum of a contact [s]."""
    cutoff = setup.analysis.cutoff_frequency
    warnings = []
    for channel in CHANNELS:
        resonance = setup.find_sensor(channel).resonance
        what = f"the resonance of the {channel}'s sensor, {resonance * 1e-3:.4g} kHz, lies near"
        if resonance and cutoff and resonance < NEAR_LOW_PASS * cutoff:
            warnings.append(
                f"{what} the low-pass of {cutoff * 1e-3:.4g} kHz: the models are sent through it,"
                " widths and peaks are read with its ringing; a low-pass of"
                f" {resonance / NEAR_LOW_PASS * 1e-3:.3g} kHz leaves little of that"
            )
        if resonance and resonance * contact_time < NEAR_CONTACT:
            warnings.append(
                f"{what} the spectrum of a contact this short, which makes it ring: the models are"
                " sent through it, widths and peaks are not; take a sensor with a higher one"
            )
    return tuple(warnings)


def explain_ringing(frequency: float, setup: RigSetup) -> str:
    """Say why what rings at a frequency [Hz] is the sensor's and no body's; empty: it may be."""
    sensor, cutoff = setup.find_sensor("specimen"), setup.analysis.cutoff_frequency
    rings = f"what rings at {frequency * 1e-3:.3g} kHz"
    if abs(frequency - sensor.resonance) < SAME_FREQUENCY * sensor.resonance:
        return f"{rings} is the sensor, by the resonance that is stated of it, and no body"
    if cutoff and frequency > PART_OF_CUTOFF * cutoff:
        return (
            f"{rings}, above half the low-pass of {cutoff * 1e-3:.4g} kHz, is a sensor or its"
            " mount, and no body"
        )
    return ""
