"""The paper computed again: Table 3 from Tables 1 and 2, damping ratios from Table 4."""

import math
from dataclasses import dataclass

from impact_rig.core.damping.log_decrement import (
    compute_log_decrement,
    estimate_damping_ratio_from_coefficient,
)
from impact_rig.core.estimation.size_exponent import (
    HERTZ_EXPONENT,
    SPRING_EXPONENT,
    compute_size_residual,
    estimate_size_exponent,
)
from impact_rig.core.model.stiffness import (
    estimate_equivalent_mass,
    estimate_equivalent_stiffness,
    estimate_hammer_stiffness,
    estimate_sample_stiffness,
)
from impact_rig.core.quantity import Quantity
from impact_rig.core.setup.paper import (
    ACCELEROMETER_MASS,
    CONTROL_SAMPLE,
    HAMMER_DAMPING_COEFFICIENT,
    HAMMER_MASS,
    HAMMER_STIFFNESS,
    IMPACT_SPEED,
    PUBLISHED_SAMPLES,
    RELEASE_ANGLE,
    PublishedSample,
)
from impact_rig.results.numbers import compute_difference

SWING_TIME = 0.207
"""Section 3 [s]."""
PENDULUM_LENGTH = 0.265
"""Section 3, centre of mass to holder [m]."""
PRINTED_ANGULAR_SPEED = 0.31
"""Section 3 [rad/s]."""
CLOSE_PERCENT = 0.1
"""Agreement as good as the printed digits allow [%], our choice."""
NEAR_PERCENT = 0.5
"""Agreement where one more digit was lost in rounding [%], our choice."""


@dataclass(frozen=True)
class DampingArithmetic:
    """What a damping coefficient of Table 4 means.

    Attributes
    ----------
    damping_ratio, log_decrement : float
        zeta by (8) and Delta by (7) [-].
    peak_ratio : float
        U1/U2 [-].
    """

    damping_ratio: float
    log_decrement: float
    peak_ratio: float


@dataclass(frozen=True)
class CellArithmetic:
    """One cell of Table 3 computed from Tables 1 and 2.

    Attributes
    ----------
    name : str
        Of the sample.
    moving_mass_kg : float
        m2, accelerometer included [kg].
    printed_contact_time_s : float
        Table 2 [s].
    printed_stiffness_n_per_m, computed_stiffness_n_per_m : float
        k2 [N/m].
    difference_percent : float
        Of the computed from the printed stiffness [%].
    without_accelerometer_percent : float
        The same, had m2 not included the accelerometer [%].
    is_misprinted : bool
        Table 2 contradicts Table 3.
    corrected_contact_time_s : float
        What agrees with Table 3 [s]; the printed one unless that is a misprint.
    corrected_stiffness_n_per_m, corrected_difference_percent : float
        Computed from it [N/m], and its difference [%].
    damping_coefficient_n_s_per_m : float
        c2, Table 4 [N s/m].
    damping : DampingArithmetic
        What that means.
    """

    name: str
    moving_mass_kg: float
    printed_contact_time_s: float
    printed_stiffness_n_per_m: float
    computed_stiffness_n_per_m: float
    difference_percent: float
    without_accelerometer_percent: float
    is_misprinted: bool
    corrected_contact_time_s: float
    corrected_stiffness_n_per_m: float
    corrected_difference_percent: float
    damping_coefficient_n_s_per_m: float
    damping: DampingArithmetic


@dataclass(frozen=True)
class HammerArithmetic:
    """The hammer's stiffness and damping computed from the tables.

    Attributes
    ----------
    control_sample : str
        Whose contact time gives k1.
    printed_stiffness_n_per_m, computed_stiffness_n_per_m : float
        k1 [N/m].
    difference_percent : float
        [%]
    damping_coefficient_n_s_per_m : float
        c1, Table 4 [N s/m].
    damping : DampingArithmetic
        What that means.
    """

    control_sample: str
    printed_stiffness_n_per_m: float
    computed_stiffness_n_per_m: float
    difference_percent: float
    damping_coefficient_n_s_per_m: float
    damping: DampingArithmetic


@dataclass(frozen=True)
class SpeedArithmetic:
    """The impact speed computed from the swing.

    Attributes
    ----------
    printed_angular_speed_rad_per_s, computed_angular_speed_rad_per_s : float
        [rad/s]
    printed_speed_m_per_s, computed_speed_m_per_s : float
        [m/s]
    """

    printed_angular_speed_rad_per_s: float
    computed_angular_speed_rad_per_s: float
    printed_speed_m_per_s: float
    computed_speed_m_per_s: float


@dataclass(frozen=True)
class SizeArithmetic:
    """How the contact times of Table 2, misprint corrected, go with m_eq: tau = C m_eq^p.

    Attributes
    ----------
    material : str
        Whose samples; empty: of all, one C for each material.
    samples : int
        How many.
    exponent : Quantity
        p fitted [-].
    residual_percent : float
        RMS of what that leaves of the contact times [%].
    hertz_residual_percent, spring_residual_percent : float
        The same with p = 2/5, a Hertz contact, and p = 1/2, a linear spring [%].
    """

    material: str
    samples: int
    exponent: Quantity
    residual_percent: float
    hertz_residual_percent: float
    spring_residual_percent: float


@dataclass(frozen=True)
class PaperArithmetic:
    """Everything computed again.

    Attributes
    ----------
    hammer : HammerArithmetic
        k1, c1.
    samples : tuple of CellArithmetic
        The twelve cells.
    speed : SpeedArithmetic
        v1.
    sizes : tuple of SizeArithmetic
        Each material, then all.
    cells_within_0_1_percent, cells_within_0_5_percent : int
        Cells of Table 3 that agree so well with the printed contact time.
    misprinted : tuple of str
        Those that do not agree at all.
    """

    hammer: HammerArithmetic
    samples: tuple[CellArithmetic, ...]
    speed: SpeedArithmetic
    sizes: tuple[SizeArithmetic, ...]
    cells_within_0_1_percent: int
    cells_within_0_5_percent: int
    misprinted: tuple[str, ...]


def compute_paper() -> PaperArithmetic:
    """Compute the paper's tables again from its own printed numbers."""
    samples = tuple(_compute_cell(cell) for cell in PUBLISHED_SAMPLES)
    angular_speed = RELEASE_ANGLE / SWING_TIME
    return PaperArithmetic(
        hammer=_compute_hammer(),
        samples=samples,
        speed=SpeedArithmetic(
            printed_angular_speed_rad_per_s=PRINTED_ANGULAR_SPEED,
            computed_angular_speed_rad_per_s=angular_speed,
            printed_speed_m_per_s=IMPACT_SPEED,
            computed_speed_m_per_s=angular_speed * PENDULUM_LENGTH,
        ),
        sizes=_compute_sizes(),
        cells_within_0_1_percent=_count_within(samples, CLOSE_PERCENT),
        cells_within_0_5_percent=_count_within(samples, NEAR_PERCENT),
        misprinted=tuple(sample.name for sample in samples if sample.is_misprinted),
    )


def _count_within(samples: tuple[CellArithmetic, ...], percent: float) -> int:
    return sum(abs(sample.difference_percent) <= percent for sample in samples)


def _compute_stiffness(moving_mass: float, contact_time: float) -> float:
    equivalent_mass = estimate_equivalent_mass(HAMMER_MASS, moving_mass)
    equivalent = estimate_equivalent_stiffness(equivalent_mass, contact_time)
    return estimate_sample_stiffness(equivalent, HAMMER_STIFFNESS)


def _compute_sizes() -> tuple[SizeArithmetic, ...]:
    names = dict.fromkeys(cell.material for cell in PUBLISHED_SAMPLES)
    return (*(_compute_size(name) for name in names), _compute_size(""))


def _compute_size(material: str) -> SizeArithmetic:
    cells = [cell for cell in PUBLISHED_SAMPLES if material in ("", cell.material)]
    data = (
        [cell.material for cell in cells],
        [estimate_equivalent_mass(HAMMER_MASS, cell.mass + ACCELEROMETER_MASS) for cell in cells],
        [cell.contact_time for cell in cells],
    )
    fitted = estimate_size_exponent(*data)
    return SizeArithmetic(
        material=material,
        samples=len(cells),
        exponent=fitted.exponent,
        residual_percent=100.0 * fitted.residual,
        hertz_residual_percent=100.0 * compute_size_residual(*data, HERTZ_EXPONENT),
        spring_residual_percent=100.0 * compute_size_residual(*data, SPRING_EXPONENT),
    )


def _compute_damping(coefficient: float, stiffness: float, mass: float) -> DampingArithmetic:
    ratio = estimate_damping_ratio_from_coefficient(coefficient, stiffness, mass)
    log_decrement = compute_log_decrement(ratio)
    return DampingArithmetic(ratio, log_decrement, math.exp(log_decrement))


def _compute_cell(cell: PublishedSample) -> CellArithmetic:
    moving_mass = cell.mass + ACCELEROMETER_MASS
    computed = _compute_stiffness(moving_mass, cell.printed_contact_time)
    bare = _compute_stiffness(cell.mass, cell.printed_contact_time)
    corrected = _compute_stiffness(moving_mass, cell.contact_time)
    return CellArithmetic(
        name=cell.name,
        moving_mass_kg=moving_mass,
        printed_contact_time_s=cell.printed_contact_time,
        printed_stiffness_n_per_m=cell.stiffness,
        computed_stiffness_n_per_m=computed,
        difference_percent=compute_difference(computed, cell.stiffness),
        without_accelerometer_percent=compute_difference(bare, cell.stiffness),
        is_misprinted=cell.is_misprinted,
        corrected_contact_time_s=cell.contact_time,
        corrected_stiffness_n_per_m=corrected,
        corrected_difference_percent=compute_difference(corrected, cell.stiffness),
        damping_coefficient_n_s_per_m=cell.damping_coefficient,
        damping=_compute_damping(cell.damping_coefficient, cell.stiffness, moving_mass),
    )


def _compute_hammer() -> HammerArithmetic:
    control = next(cell for cell in PUBLISHED_SAMPLES if cell.name == CONTROL_SAMPLE)
    equivalent_mass = estimate_equivalent_mass(HAMMER_MASS, control.mass + ACCELEROMETER_MASS)
    computed = estimate_hammer_stiffness(
        estimate_equivalent_stiffness(equivalent_mass, control.contact_time)
    )
    return HammerArithmetic(
        control_sample=control.name,
        printed_stiffness_n_per_m=HAMMER_STIFFNESS,
        computed_stiffness_n_per_m=computed,
        difference_percent=compute_difference(computed, HAMMER_STIFFNESS),
        damping_coefficient_n_s_per_m=HAMMER_DAMPING_COEFFICIENT,
        damping=_compute_damping(HAMMER_DAMPING_COEFFICIENT, HAMMER_STIFFNESS, HAMMER_MASS),
    )
