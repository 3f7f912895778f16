"""Intervals: even for what was measured, by their ends for what is far from linear."""

import GTC
import pytest

from impact_rig.core.estimates.uncertainty import UNEVEN, Known, RigNumbers, derive, make_input

FACTOR = 1.959964
"""Of the 95 % interval over the standard uncertainty, for infinite degrees of freedom."""


@pytest.mark.parametrize(("share", "is_even"), [(0.999, True), (1.001, False)])
def test_a_formula_s_interval_is_uneven_where_it_is_wide(share, is_even):
    wide = share * UNEVEN / 2.0  # of x; y = 1 / x^2 has twice that
    x = Known(make_input("x", 1.0, wide / FACTOR))
    found = derive(lambda value: 1.0 / value**2, x).state()
    assert found.expanded == pytest.approx(share * UNEVEN, rel=1e-6)
    even = 1.0 - share * UNEVEN, 1.0 + share * UNEVEN
    ends = even if is_even else (1.0 / (1.0 + wide) ** 2, 1.0 / (1.0 - wide) ** 2)
    assert (found.lower, found.upper) == pytest.approx(ends, rel=1e-6)


def test_a_measured_value_s_interval_is_even_however_wide_and_a_constant_has_none():
    wide = Known(make_input("x", 1.0, 0.5)).state()
    ends = 1.0 - 0.5 * FACTOR, 1.0 + 0.5 * FACTOR
    assert (wide.lower, wide.upper) == pytest.approx(ends, rel=1e-6)
    exact = Known(GTC.constant(2.0)).state()
    assert (exact.value, exact.standard, exact.expanded) == (2.0, 0.0, 0.0)


@pytest.mark.parametrize(("is_force", "speed"), [(False, 1.5), (True, 6.0)])
def test_a_measured_force_changes_the_speed_of_the_hammer_by_its_mass(is_force, speed):
    mass, exact = make_input("mass", 0.1, 0.001), GTC.constant(1.0)
    load = GTC.constant(0.4) if is_force else mass
    rig = RigNumbers(mass, exact, load, exact, (exact, exact), exact, exact)
    change = rig.find_speed(GTC.constant(1.5))
    assert change.x == pytest.approx(speed)
    assert bool(change.u) is is_force
