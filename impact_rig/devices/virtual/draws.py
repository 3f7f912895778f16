"""The truth behind what is stated: masses, gains and clock within their ±, drawn by a seed."""

from dataclasses import dataclass, replace

import numpy as np

from impact_rig.core.estimates.uncertainty import ASSUMED_GAIN, ASSUMED_MASS
from impact_rig.core.given.sensors import CHANNELS
from impact_rig.core.given.setup import RigSetup


@dataclass(frozen=True)
class Drawn:
    """What is true of a rig; what is stated of it is known to its laboratory."""

    setup: RigSetup  # with the true masses
    clock: float = 1.0  # true over stated sampling rate [-]
    gains: tuple[float, ...] = (1.0, 1.0)  # read over true acceleration, by channel [-]


def draw_truth(stated: RigSetup, seed: int) -> Drawn:
    """Draw masses, clock and gains within what is stated of them, or else what is assumed."""
    samples = stated.samples
    source = np.random.default_rng(np.random.SeedSequence((seed, 3)))
    hammer, accelerometer, clock, *draws = source.standard_normal(
        3 + len(CHANNELS) + len(samples.samples)
    ).tolist()
    gains, bodies = draws[: len(CHANNELS)], draws[len(CHANNELS) :]

    def move(mass: float, standard: float, draw: float) -> float:
        return mass + (standard or ASSUMED_MASS * mass) * draw

    truth = replace(
        stated,
        hammer_mass=move(stated.hammer_mass, stated.hammer_mass_uncertainty, hammer),
        samples=replace(
            samples,
            accelerometer_mass=move(
                samples.accelerometer_mass, samples.accelerometer_mass_uncertainty, accelerometer
            ),
            samples=tuple(
                replace(sample, mass=move(sample.mass, sample.mass_uncertainty, draw))
                for sample, draw in zip(samples.samples, bodies, strict=True)
            ),
        ),
    )
    known = [stated.find_sensor(it).sensitivity_uncertainty or ASSUMED_GAIN for it in CHANNELS]
    return Drawn(
        truth,
        1.0 + stated.clock_uncertainty * clock,
        tuple(1.0 + part * draw for part, draw in zip(known, gains, strict=True)),
    )
