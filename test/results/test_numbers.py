"""Numbers as people read them."""

import math
from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.results.numbers import format_uncertain


@pytest.mark.parametrize(
    ("value", "expanded", "text"),
    [
        (212.1234, 0.4321, "212.12 ± 0.43"),
        (212.1284, 0.4351, "212.13 ± 0.44"),
        (45.286, 1.234, "45.3 ± 1.2"),
        (2423.4, 341.0, "2420 ± 340"),
        (2423.4, 12.3, "2423 ± 12"),
        (0.35512, 0.00321, "0.3551 ± 0.0032"),
        # The rounded uncertainty gains a digit: it still has two.
        (0.5, 0.0996, "0.50 ± 0.10"),
        (-0.001, 0.5, "0.00 ± 0.50"),
        (1.0, 99.6, "0 ± 100"),
    ],
)
def test_a_value_is_rounded_where_its_uncertainty_is(value, expanded, text):
    assert format_uncertain(value, expanded, 2) == text


@pytest.mark.parametrize("expanded", [math.nan, math.inf, 0.0])
def test_a_value_without_uncertainty_stands_alone(expanded):
    assert format_uncertain(12.3456, expanded, 2) == "12.35"


@given(st.floats(-1e9, 1e9), st.floats(1e-9, 1e9))
def test_what_is_shown_lies_half_a_last_digit_from_the_truth_at_most(value, expanded):
    shown, wide = (Decimal(part) for part in format_uncertain(value, expanded, 2).split(" ± "))
    # Two digits of the uncertainty: its last one is worth 1 to 10 % of it.
    step = Decimal(10) ** (Decimal(repr(float(wide))).adjusted() - 1)
    assert abs(shown - Decimal(value)) <= Decimal("0.5000001") * step
    assert abs(wide - Decimal(expanded)) <= Decimal("0.5000001") * step
    assert len(wide.normalize().as_tuple().digits) <= 2
