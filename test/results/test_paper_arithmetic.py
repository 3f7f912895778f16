"""The paper computed again, against figures worked out by hand from its tables."""

import math

import pytest

from impact_rig.results.paper_arithmetic import compute_paper

PAPER = compute_paper()
CELLS = {cell.name: cell for cell in PAPER.samples}


def test_table_3_agrees_in_eleven_cells_and_the_twelfth_is_the_misprint():
    differences = sorted(abs(cell.difference_percent) for cell in PAPER.samples)
    assert differences[9] < 0.06
    assert differences[10] == pytest.approx(0.447, abs=0.001)
    assert differences[11] > 50
    assert (PAPER.cells_within_0_1_percent, PAPER.cells_within_0_5_percent) == (10, 11)
    assert PAPER.misprinted == ("brass medium",)


def test_the_corrected_contact_time_agrees_like_the_others():
    cell = CELLS["brass medium"]
    assert cell.computed_stiffness_n_per_m == pytest.approx(11.7e6, rel=0.003)
    assert cell.corrected_contact_time_s == pytest.approx(228e-6)
    assert abs(cell.corrected_difference_percent) < 0.06


def test_one_cell_by_hand():
    # Steel small: m2 = 56.32 g + 3 g, tau_p = 170 us, k1 = 22.54 MN/m.
    reduced = 0.1 * 0.05932 / 0.15932
    contact = reduced * (math.pi / 170e-6) ** 2
    expected = 22.54e6 * contact / (22.54e6 - contact)
    assert CELLS["steel small"].computed_stiffness_n_per_m == pytest.approx(expected, rel=1e-12)


def test_damping_of_table_4_spans_what_the_paper_says_of_its_peaks():
    ratios = [cell.damping.damping_ratio for cell in PAPER.samples]
    assert min(ratios) == pytest.approx(0.167, abs=0.001)
    assert max(ratios) == pytest.approx(0.477, abs=0.001)
    assert PAPER.hammer.damping.damping_ratio == pytest.approx(0.636, abs=0.001)
    assert PAPER.hammer.damping.peak_ratio == pytest.approx(177, abs=0.5)
    for cell in PAPER.samples:
        # zeta back from the peaks, by the exact relation of a damped oscillation.
        decrement = math.log(cell.damping.peak_ratio)
        back = decrement / math.sqrt(4 * math.pi**2 + decrement**2)
        assert back == pytest.approx(cell.damping.damping_ratio)


def test_the_hammer_comes_from_the_control_sample():
    assert PAPER.hammer.control_sample == "aluminium large"
    assert abs(PAPER.hammer.difference_percent) < 0.03


def test_the_impact_speed_was_rounded_on_the_way():
    assert PAPER.speed.computed_angular_speed_rad_per_s == pytest.approx(0.312, abs=5e-4)
    assert PAPER.speed.computed_speed_m_per_s == pytest.approx(0.0827, abs=5e-5)
    assert PAPER.speed.printed_speed_m_per_s == 0.0819


def test_table_2_goes_with_the_mass_like_a_hertz_contact():
    *materials, every = PAPER.sizes
    assert every.exponent.value == pytest.approx(0.390, abs=5e-4)
    assert every.exponent.standard == pytest.approx(0.012, abs=5e-4)
    assert every.hertz_residual_percent == pytest.approx(1.0, abs=0.05)
    assert every.spring_residual_percent == pytest.approx(3.6, abs=0.05)
    assert [size.material for size in materials] == ["aluminium", "steel", "bronze", "brass"]
    # Bronze small and large alone: ln(239.2/188) over ln(m_eq ratio), the middle one lies on it.
    light, heavy = (0.1 * m / (0.1 + m) for m in (0.07348, 0.35113))
    by_hand = math.log(239.2 / 188.0) / math.log(heavy / light)
    assert materials[2].exponent.value == pytest.approx(by_hand, abs=2e-3)
