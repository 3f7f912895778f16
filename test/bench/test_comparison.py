"""Two benches compared: by how much a figure has changed, and whether that is more than chance."""

import math

import pytest

from impact_rig.bench.comparison import Change, compare_figure
from impact_rig.bench.figures import Figure


@pytest.mark.parametrize(
    ("now", "before", "percent", "is_beyond_spread"),
    [
        ((1.0, 2.0, 3.0), (1.0, 2.0, 3.0), 0.0, False),
        ((2.0, 3.0, 4.0), (1.0, 2.0, 3.0), 50.0, False),
        ((4.0, 5.0, 6.0), (1.0, 2.0, 3.0), 150.0, True),
        ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0), -60.0, True),
        ((-1.0, -1.0), (-2.0, -2.0), 50.0, True),
        ((5.0,), (1.0, 2.0, 3.0), 150.0, None),
        ((0.0,), (0.0,), 0.0, None),
    ],
)
def test_a_change_is_that_of_the_median_and_more_than_chance_where_quartiles_do_not_meet(
    now: tuple[float, ...],
    before: tuple[float, ...],
    percent: float,
    is_beyond_spread: bool | None,
) -> None:
    change = compare_figure(Figure("time", now), Figure("time", before))
    assert change == Change(pytest.approx(percent), is_beyond_spread)


def test_a_change_from_nothing_has_no_percentage() -> None:
    assert math.isnan(compare_figure(Figure("lost", (3.0,)), Figure("lost", (0.0,))).percent)
