"""Hits that are settled: a reader learns of them, and of those that should not be there."""

import pytest

from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.estimation.settled import add_settled
from impact_rig.core.hits.settled_hits import SettledHits

ESTIMATE = SampleEstimate("heavy", 1000, 3, warnings=("w",), notes=("n",))


def test_where_none_is_settled_nothing_is_said() -> None:
    assert add_settled(ESTIMATE, SettledHits(0, 0, 0.0)) is ESTIMATE


def test_a_note_says_how_many_hits_show_the_scatter() -> None:
    found = add_settled(ESTIMATE, SettledHits(872, 0, 0.0))
    assert found.notes[:-1] == ("n",)
    assert found.notes[-1] == (
        "scatter of 872 hits: they are in the mean for good, and their traces are not kept; that"
        " of the other 128, evenly over the series, stands for all"
    )
    assert found.warnings == ("w",)


@pytest.mark.parametrize(("shift", "said"), [(0.000234, "longer"), (-0.000234, "shorter")])
def test_a_warning_names_those_that_are_outliers_by_now(shift: float, said: str) -> None:
    found = add_settled(ESTIMATE, SettledHits(872, 2, shift))
    assert found.warnings[:-1] == ("w",)
    assert found.warnings[-1] == (
        "2 of 872 hits that are in the mean for good are outliers by now: they make tau_p"
        f" 0.023 % {said}"
    )
