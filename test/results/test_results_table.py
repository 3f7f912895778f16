"""Results in columns for spreadsheets."""

import csv
import io
import math
from dataclasses import replace

import pytest

from impact_rig.core.paper_method import HammerEstimate
from impact_rig.core.sample import SampleEstimate
from impact_rig.core.setup import PAPER_SETUP, Sample, SampleSet
from impact_rig.results.campaign import Results
from impact_rig.results.results_table import format_results_table


@pytest.mark.parametrize("name", ['=HYPERLINK("x")', "+1+2", "-cmd", "@sum", "'tis"])
def test_no_cell_is_a_formula_and_the_name_is_behind_an_apostrophe(name):
    samples = SampleSet((Sample(name, 0.1),), "")
    estimate = SampleEstimate(name, 1, 0, hammer_peak=-2.5, specimen_peak=math.nan)
    results = Results(replace(PAPER_SETUP, samples=samples), HammerEstimate(), (estimate,), ())
    (row,) = csv.DictReader(io.StringIO(format_results_table([results])))
    assert row["name"] == f"'{name}"
    assert row["hammer_peak_m_per_s2"] == "-2.5"
    assert row["specimen_peak_m_per_s2"] == ""
