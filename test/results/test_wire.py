"""Records to JSON, messages and rows, and back: nothing is lost, nothing changes its name."""

import json
import math
from dataclasses import replace

import pytest

from impact_rig.core.estimates.paper_method import HammerEstimate, PaperEstimate
from impact_rig.core.estimates.pulse_shape import PulseShapeEstimate, ShapeFit
from impact_rig.core.estimates.ringing import FreeDecayEstimate
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.findings import Note, Reason, Subject
from impact_rig.core.given.quantity import BudgetLine, Quantity
from impact_rig.core.given.sensors import Sensor
from impact_rig.core.given.setup import PAPER_SETUP, AnalysisSettings, RigSetup, Sample, SampleSet
from impact_rig.results.wire import WireError, from_json, to_json

STIFFNESS = Quantity(3e6, 4e4, 9e4, budget=(BudgetLine("mass", "B", 4e4, 1.0),))
ESTIMATE = SampleEstimate(
    "tin",
    3,
    1,
    paper=PaperEstimate(contact_time=Quantity(2e-4), stiffness=STIFFNESS),
    pulse_shape=PulseShapeEstimate("Hertz", True, 1.1, (ShapeFit("Hertz", 0.2, 2e-4),)),
    free_decay=FreeDecayEstimate(stiffness=STIFFNESS, frequency=2500.0),
    notes=(Note(Subject.K2, "one: two"), Note(Reason.DRIFT, "two")),
)
OPEN = Quantity(3e6, 4e5, 9e5, 2.3e6, math.nan)
"""Its interval has no upper end."""
SETUP = replace(
    PAPER_SETUP,
    samples=SampleSet((Sample("tin", 0.01, "metal", 2e-4, 3e6, 4.0, 1e-3),), "tin", 5e-3, 6e-4),
    hammer_mass_uncertainty=3e-4,
    analysis=AnalysisSettings(cutoff_frequency=7e4),
    sensors=(
        Sensor("hammer", "force", "N", 2.25e-3, 2200.0, "SN 7", "2026-03-01", 0.01, resonance=7e4),
    ),
)


@pytest.mark.parametrize("record", [ESTIMATE, SETUP, HammerEstimate(stiffness=OPEN)])
def test_a_record_comes_back_from_json_as_it_was(record):
    content = json.loads(json.dumps(to_json(record), allow_nan=False))
    assert repr(from_json(type(record), content)) == repr(record)


def test_json_tells_a_quantity_by_name_and_unit_and_its_budget_beside_it():
    content = to_json(ESTIMATE)
    assert content["stiffness_n_per_m"] == 3e6
    assert content["stiffness_u_n_per_m"] == 4e4
    assert content["stiffness_expanded_n_per_m"] == 9e4
    assert (content["stiffness_lower_n_per_m"], content["stiffness_upper_n_per_m"]) == (
        2.91e6, 3.09e6,
    )  # fmt: skip
    assert content["budget"] == [
        {"quantity": "stiffness", "source": "mass", "kind": "B", "contribution": 4e4, "share": 1.0}
    ]
    assert content["contact_time_u_s"] is None
    assert content["free_decay"]["frequency_hz"] == 2500.0
    assert "comparisons" not in content


def test_a_set_up_that_cannot_be_meant_is_refused_with_its_place():
    content = {**to_json(SETUP), "samples": []}
    with pytest.raises(WireError, match="setup: the sample set is empty"):
        from_json(RigSetup, content, "setup")
