"""What the rig states about itself, as uncertain numbers: masses and clock."""

from dataclasses import dataclass

from impact_rig.core.arithmetic import UncertainNumber
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.uncertainty.results import make_input


@dataclass(frozen=True)
class RigNumbers:
    """Uncertain inputs that a rig shares among all its hits on one sample.

    The same set-up always gives the same inputs, so that two samples know of their common
    hammer, accelerometer and clock.

    Attributes
    ----------
    hammer_mass : UncertainNumber
        m1 [kg].
    moving_mass : UncertainNumber
        m2, sample and accelerometer [kg].
    clock : UncertainNumber
        Factor on every measured time [-], 1 with the uncertainty of the sampling rate: times go
        with it, rates against it.
    notes : tuple of str
        Which masses state no uncertainty.
    """

    hammer_mass: UncertainNumber
    moving_mass: UncertainNumber
    clock: UncertainNumber
    notes: tuple[str, ...] = ()


def find_rig_numbers(setup: RigSetup, sample: str) -> RigNumbers:
    """Return masses and clock of the hits on `sample` with their stated uncertainties.

    Raises
    ------
    ParameterError
        If the set has no such sample.
    """
    struck, samples = setup.samples.find(sample), setup.samples
    hammer_mass = make_input(
        "mass of the hammer", setup.hammer_mass, setup.hammer_mass_uncertainty
    )
    accelerometer_mass = make_input(
        "mass of the accelerometer",
        samples.accelerometer_mass,
        samples.accelerometer_mass_uncertainty,
    )
    sample_mass = make_input(f"mass of {sample}", struck.mass, struck.mass_uncertainty)
    unstated = [
        name
        for name, mass, uncertainty in (
            ("the hammer", setup.hammer_mass, setup.hammer_mass_uncertainty),
            (
                "the accelerometer",
                samples.accelerometer_mass,
                samples.accelerometer_mass_uncertainty,
            ),
            (sample, struck.mass, struck.mass_uncertainty),
        )
        if mass > 0.0 and uncertainty == 0.0
    ]
    notes = (
        (f"uncertainty of k and c: none is stated for the mass of {' and '.join(unstated)}",)
        if unstated
        else ()
    )
    return RigNumbers(
        hammer_mass=hammer_mass,
        moving_mass=sample_mass + accelerometer_mass,
        clock=make_input("sampling clock", 1.0, setup.clock_uncertainty),
        notes=notes,
    )
