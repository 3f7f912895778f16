"""Where numbers come from, and what is said of several hits together."""

import pytest

from impact_rig.core.errors import ParameterError
from impact_rig.core.records import IMPORTED, MEASURED, SIMULATED, Origin, join_origins

REAL, VIRTUAL = Origin(MEASURED, "digitizer 7"), Origin(SIMULATED, "virtual rig")


def test_hits_of_one_kind_are_told_by_their_sources():
    files = [Origin(IMPORTED, "csv file", f"hit_{number}.csv", "'a'") for number in (1, 2)]
    assert join_origins(files) == Origin(IMPORTED, "csv file")
    other = Origin(MEASURED, "digitizer 8")
    assert join_origins([REAL, REAL, other]) == Origin(MEASURED, "digitizer 7; digitizer 8")


def test_one_simulated_hit_among_measured_ones_is_not_lost():
    found = join_origins([REAL] * 9 + [VIRTUAL])
    assert str(found) == "mixed (measured (digitizer 7), simulated (virtual rig))"


def test_an_unheard_of_kind_is_refused():
    with pytest.raises(ParameterError, match=r"'guessed': it must be one of measured, simulated"):
        Origin("guessed")


def test_words_of_a_source_do_not_steer_a_terminal():
    assert Origin(MEASURED, "scope\x1b[2J\n").source == "scope?[2J?"
