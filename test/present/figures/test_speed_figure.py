"""The figure of the impact speed has a point for each series and the exponents in words."""

import math
from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.contact_law import ContactLaw
from impact_rig.core.paper_method import HammerEstimate
from impact_rig.core.quantity import Quantity
from impact_rig.core.sample import SampleEstimate
from impact_rig.core.setup import PAPER_SETUP
from impact_rig.core.speed_exponents import estimate_speed_exponents
from impact_rig.present.figures.speed_figure import SHOWN, draw_speed
from impact_rig.results.campaign import Results
from impact_rig.results.results_table import format_results_table
from impact_rig.results.tables import tabulate_contact_times, tabulate_speed_exponents

ANGLES = tuple(map(math.radians, (4.0, 8.0, 16.0)))
BODIES = ("steel small", "brass large")


def make_law(speed, place):
    """Return a Hertz contact without loss."""
    return ContactLaw(
        impact_speed=Quantity(speed, 1e-3, 2e-3),
        duration=Quantity((150e-6 + 50e-6 * place) * speed**-0.2, 1e-7, 2e-7),
        peak_force=Quantity(100.0 * (1.0 + place) * speed**1.2, 0.1, 0.2),
        restitution=Quantity(0.9, 1e-3, 2e-3),
    )


@pytest.fixture(scope="module")
def results():
    setup = PAPER_SETUP.at_angles(ANGLES)
    samples = tuple(
        SampleEstimate(
            name, 1, 0, contact_law=make_law(setup.for_series(name).impact_speed, place)
        )
        for place, body in enumerate(BODIES)
        for name in setup.samples.find_series([body])
    )
    exponents = estimate_speed_exponents(setup, samples)
    return Results(setup, HammerEstimate(), samples, (), exponents)


@pytest.mark.parametrize(("shown", "exponent"), list(zip(SHOWN, (-0.2, 1.2, 0.0), strict=True)))
def test_each_sample_has_a_point_for_each_speed_and_a_straight_line(results, shown, exponent):
    panel = draw_speed(results, *shown)
    for bars in panel.axes[0].containers:
        points = np.log(bars.lines[0].get_xydata())
        assert len(points) == len(ANGLES)
        slopes = np.diff(points[:, 1]) / np.diff(points[:, 0])
        assert slopes == pytest.approx(exponent, abs=1e-6)
    texts = [text.get_text() for text in panel.legends[0].get_texts()]
    assert texts[0].startswith(f"steel small: p = {exponent:.3f}")


def test_the_table_has_a_row_for_each_sample_and_one_for_all(results):
    (table,) = tabulate_speed_exponents(results.speed_exponents)
    assert [row[:2] for row in table.rows] == [
        ("steel small", "3"),
        ("brass large", "3"),
        ("all", "6"),
    ]
    assert [float(cell.split()[0]) for cell in table.rows[2][2:]] == pytest.approx(
        [-0.2, 1.2, 0.0], abs=1e-3
    )
    assert tabulate_speed_exponents(()) == []


def test_spreadsheets_have_angle_and_exponents_in_each_row(results):
    header, first, *_ = format_results_table([results]).splitlines()
    row = dict(zip(header.split(","), first.split(","), strict=True))
    assert float(row["release_angle_rad"]) == pytest.approx(ANGLES[0])
    assert float(row["speed_exponents_duration"]) == pytest.approx(-0.2)
    plain = format_results_table([replace(results, speed_exponents=())])
    assert plain.splitlines()[0] == header


def test_what_the_rig_s_one_speed_lets_expect_is_not_held_against_other_angles(results):
    table = tabulate_contact_times(results)
    assert "Reference [µs]" not in [column.name for column in table.columns]
    assert "Δ/U" not in [column.name for column in table.columns]
