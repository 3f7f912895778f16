"""The published campaign: Tables 1 to 4 and the set-up, with the misprint marked."""

import math
from dataclasses import dataclass

from impact_rig.core.setup.samples import RigSetup, Sample, SampleSet

HAMMER_MASS = 0.100
"""m1, Table 1 [kg]."""
ACCELEROMETER_MASS = 3e-3
"""Accelerometer on every sample, Table 1 [kg]. It belongs to m2: only so do equations (5) and
(6) turn Table 2 into Table 3."""
HAMMER_MASS_UNCERTAINTY = 0.29e-3
ACCELEROMETER_MASS_UNCERTAINTY = 0.29e-3
SAMPLE_MASS_UNCERTAINTY = 0.0029e-3
"""Standard uncertainties of the printed masses by their rounding alone [kg]: half a unit of the
last digit of 100 g, 3 g and 21.31 g, rectangular, so over sqrt(3)."""
IMPACT_SPEED = 0.0819
"""v1 as printed [m/s]; 0.312 rad/s times 265 mm would be 0.0827."""
RELEASE_ANGLE = math.radians(3.7)
"""Section 3: the hammer swings from here [rad]."""
HAMMER_STIFFNESS = 22.54e6
"""k1, Table 3 [N/m]."""
HAMMER_DAMPING_COEFFICIENT = 1909.0
"""c1, Table 4 [N s/m]."""
PULSE_NAME = "versed-sine"
"""What equation (4) is called."""
CONTROL_SAMPLE = "aluminium large"


@dataclass(frozen=True)
class PublishedSample:
    """One cell of Tables 1 to 4, in SI units.

    Attributes
    ----------
    name, material, size : str
        `name` is material and size.
    mass : float
        Without accelerometer [kg], Table 1.
    printed_contact_time : float
        tau_p as Table 2 prints it [s].
    stiffness : float
        k2 [N/m], Table 3.
    damping_coefficient : float
        c2 [N s/m], Table 4.
    contact_time : float
        tau_p that agrees with Table 3 [s]: the printed one unless that is a misprint.
    """

    material: str
    size: str
    mass: float
    printed_contact_time: float
    stiffness: float
    damping_coefficient: float
    contact_time: float

    @property
    def name(self) -> str:
        """Material and size."""
        return f"{self.material} {self.size}"

    @property
    def is_misprinted(self) -> bool:
        """Whether Table 2 contradicts Table 3 for this sample."""
        return self.contact_time != self.printed_contact_time


def _cell(
    material: str,
    size: str,
    numbers: tuple[float, float, float, float],
    corrected: float | None = None,
) -> PublishedSample:
    mass_g, contact_time_us, stiffness_mn_per_m, damping = numbers
    return PublishedSample(
        material=material,
        size=size,
        mass=mass_g / 1e3,
        printed_contact_time=contact_time_us / 1e6,
        stiffness=stiffness_mn_per_m * 1e6,
        damping_coefficient=damping,
        contact_time=(contact_time_us if corrected is None else corrected) / 1e6,
    )


PUBLISHED_SAMPLES = (
    _cell("aluminium", "small", (21.31, 144.8, 15.56, 206)),
    _cell("aluminium", "medium", (61.62, 196.8, 17.99, 531)),
    _cell("aluminium", "large", (102.38, 212.0, 22.54, 802)),
    _cell("steel", "small", (56.32, 170.0, 29.18, 483)),
    _cell("steel", "medium", (166.91, 203.2, 45.29, 1170)),
    _cell("steel", "large", (277.10, 219.2, 46.11, 1670)),
    _cell("bronze", "small", (70.48, 188.0, 24.89, 848)),
    _cell("bronze", "medium", (209.53, 226.4, 31.26, 2028)),
    _cell("bronze", "large", (348.13, 239.2, 33.22, 2423)),
    _cell("brass", "small", (60.86, 189.0, 20.71, 667)),
    # 288.10 us would give 11.7 MN/m; Table 3's 26.99 MN/m needs 228.0 us.
    _cell("brass", "medium", (180.14, 288.1, 26.99, 1070), corrected=228.0),
    _cell("brass", "large", (299.60, 244.0, 27.87, 2768)),
)

PAPER_SETUP = RigSetup(
    samples=SampleSet(
        samples=tuple(
            Sample(
                name=cell.name,
                mass=cell.mass,
                material=cell.material,
                reference_contact_time=cell.contact_time,
                reference_stiffness=cell.stiffness,
                reference_damping_coefficient=cell.damping_coefficient,
                mass_uncertainty=SAMPLE_MASS_UNCERTAINTY,
            )
            for cell in PUBLISHED_SAMPLES
        ),
        control_sample=CONTROL_SAMPLE,
        accelerometer_mass=ACCELEROMETER_MASS,
        accelerometer_mass_uncertainty=ACCELEROMETER_MASS_UNCERTAINTY,
    ),
    hammer_mass=HAMMER_MASS,
    hammer_mass_uncertainty=HAMMER_MASS_UNCERTAINTY,
    impact_speed=IMPACT_SPEED,
    release_angle=RELEASE_ANGLE,
    name="paper",
    description="twelve metal cylinders struck by a pendulum hammer",
)
