"""The paper computed again from its own printed numbers, and equations (5) and (6)."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import linregress

from impact_rig.core.estimates.equations import (
    estimate_damping_ratio,
    estimate_damping_ratio_from_coefficient,
    estimate_equivalent_mass,
    estimate_equivalent_stiffness,
    estimate_hammer_stiffness,
    estimate_sample_stiffness,
)
from impact_rig.core.given.setup import (
    CONTROL_SAMPLE,
    HAMMER_DAMPING_COEFFICIENT,
    HAMMER_STIFFNESS,
    MISPRINTS,
    PAPER_SETUP,
)

from ..contacts import strike_body

HAMMER_MASS, ACCELEROMETER_MASS = 0.1, 3e-3
CELLS = {cell.name: cell for cell in PAPER_SETUP.samples.samples}
MASSES = {
    name: estimate_equivalent_mass(HAMMER_MASS, cell.mass + ACCELEROMETER_MASS)
    for name, cell in CELLS.items()
}


def compute_stiffness(name, contact_time):
    equivalent = estimate_equivalent_stiffness(MASSES[name], contact_time)
    return estimate_sample_stiffness(equivalent, HAMMER_STIFFNESS)


def find_difference(name, contact_time):
    """Return by how much the computed stiffness differs from the printed one [%]."""
    return 100.0 * (compute_stiffness(name, contact_time) / CELLS[name].reference_stiffness - 1.0)


def test_table_3_agrees_in_eleven_cells_and_the_twelfth_is_the_misprint():
    printed = {name: cell.reference_contact_time for name, cell in CELLS.items()} | MISPRINTS
    found = {name: find_difference(name, time) for name, time in printed.items()}
    by_size = sorted(found, key=lambda name: abs(found[name]))
    assert all(abs(found[name]) < 0.06 for name in by_size[:10])
    assert abs(found[by_size[10]]) == pytest.approx(0.447, abs=0.001)
    assert by_size[11] == "brass medium"
    assert compute_stiffness("brass medium", 288.1e-6) == pytest.approx(11.7e6, rel=0.003)
    assert abs(find_difference("brass medium", 228e-6)) < 0.06
    assert CELLS["brass medium"].reference_contact_time == pytest.approx(228e-6)


def test_the_hammer_comes_from_the_control_sample():
    control = CELLS[CONTROL_SAMPLE]
    equivalent = estimate_equivalent_stiffness(
        MASSES[control.name], control.reference_contact_time
    )
    assert estimate_hammer_stiffness(equivalent) == pytest.approx(HAMMER_STIFFNESS, rel=3e-4)


def test_damping_of_table_4_spans_what_the_paper_says_of_its_peaks():
    ratios = [
        estimate_damping_ratio_from_coefficient(
            cell.reference_damping_coefficient,
            cell.reference_stiffness,
            cell.mass + ACCELEROMETER_MASS,
        )
        for cell in CELLS.values()
    ]
    assert (min(ratios), max(ratios)) == pytest.approx((0.167, 0.477), abs=0.001)
    hammer = estimate_damping_ratio_from_coefficient(
        HAMMER_DAMPING_COEFFICIENT, HAMMER_STIFFNESS, HAMMER_MASS
    )
    assert hammer == pytest.approx(0.636, abs=0.001)
    # Its first peak is 177 times the next one.
    assert estimate_damping_ratio(math.log(177.0)) == pytest.approx(hammer, abs=0.001)


def test_table_2_goes_with_the_mass_like_a_hertz_contact():
    # tau_p = C m_eq^p, a constant C for each material: p = 2/5 for Hertz, 1/2 for a spring.
    materials = np.array([cell.material for cell in CELLS.values()])
    mass = np.log([MASSES[cell.name] for cell in CELLS.values()])
    time = np.log([cell.reference_contact_time for cell in CELLS.values()])
    for material in set(materials):
        chosen = materials == material
        mass[chosen] -= mass[chosen].mean()
        time[chosen] -= time[chosen].mean()
    line = linregress(mass, time)
    # Four constants take four degrees of freedom, of which the line counts one.
    standard = line.stderr * math.sqrt((12 - 2) / (12 - 4 - 1))
    assert line.slope == pytest.approx(0.390, abs=5e-4)
    assert standard == pytest.approx(0.012, abs=5e-4)
    assert np.std(time - 2 / 5 * mass) == pytest.approx(0.010, abs=5e-4)
    assert np.std(time - 1 / 2 * mass) == pytest.approx(0.036, abs=5e-4)


def test_contact_time_is_when_two_bodies_on_a_spring_part():
    m1, m2, k = 0.1, 0.17, 15e6
    equivalent = estimate_equivalent_mass(m1, m2)
    tau = strike_body(1.0, 0.0).time[-1] * np.sqrt(equivalent / k)
    assert estimate_equivalent_stiffness(equivalent, tau) == pytest.approx(k, rel=1e-7)


@given(sample=st.floats(1e3, 1e9), ratio=st.floats(1e-3, 1e3))
def test_springs_in_series_are_taken_apart_again(sample, ratio):
    hammer = sample * ratio
    equivalent = hammer * sample / (hammer + sample)
    # The difference 1/k_eq - 1/k1 loses the digits of the ratio.
    assert estimate_sample_stiffness(equivalent, hammer) == pytest.approx(sample, rel=1e-10)
