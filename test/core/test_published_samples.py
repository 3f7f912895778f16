"""The published tables, as printed, and what contradicts itself in them."""

import math

import pytest

from impact_rig.core.setup import PAPER_SETUP, PUBLISHED_SAMPLES


@pytest.mark.parametrize(
    ("material", "totals"),
    # Rows of the printed tables, added up apart from the code: a typing error would show.
    [
        ("aluminium", (185.31e-3, 553.6e-6, 56.09e6, 1539)),
        ("steel", (500.33e-3, 592.4e-6, 120.58e6, 3323)),
        ("bronze", (628.14e-3, 653.6e-6, 89.37e6, 5299)),
        ("brass", (540.60e-3, 721.1e-6, 75.57e6, 4505)),
    ],
)
def test_rows_add_up(material, totals):
    columns = ("mass", "printed_contact_time", "stiffness", "damping_coefficient")
    for column, total in zip(columns, totals, strict=True):
        cells = (cell for cell in PUBLISHED_SAMPLES if cell.material == material)
        assert sum(getattr(cell, column) for cell in cells) == pytest.approx(total)


def test_masses_are_as_uncertain_as_they_are_rounded():
    # Half a unit of the last printed digit, rectangular: 0.5 g and 0.005 g over sqrt(3).
    coarse, fine = 0.5e-3 / math.sqrt(3), 0.005e-3 / math.sqrt(3)
    assert PAPER_SETUP.hammer_mass_uncertainty == pytest.approx(coarse, rel=0.01)
    assert PAPER_SETUP.samples.accelerometer_mass_uncertainty == pytest.approx(coarse, rel=0.01)
    for sample in PAPER_SETUP.samples.samples:
        assert sample.mass_uncertainty == pytest.approx(fine, rel=0.01)


def test_the_set_up_is_the_papers():
    assert PAPER_SETUP.samples.names == tuple(cell.name for cell in PUBLISHED_SAMPLES)
    assert PAPER_SETUP.samples.control_sample == "aluminium large"
    assert PAPER_SETUP.samples.accelerometer_mass == 3e-3
    assert (PAPER_SETUP.hammer_mass, PAPER_SETUP.impact_speed) == (0.1, 0.0819)
    for cell in PUBLISHED_SAMPLES:
        sample = PAPER_SETUP.samples.find(cell.name)
        assert sample.mass == cell.mass
        assert sample.reference_contact_time == cell.contact_time
        assert sample.reference_stiffness == cell.stiffness
        assert sample.reference_damping_coefficient == cell.damping_coefficient
