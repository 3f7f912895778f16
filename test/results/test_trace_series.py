"""Hits from plain traces, for people and programs."""

import json

from impact_rig.core.estimation.paper_method import HammerEstimate
from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.origin import IMPORTED, Origin
from impact_rig.core.quantity import Quantity
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.results.campaign import Results
from impact_rig.results.results_file import format_json
from impact_rig.results.trace_series import FileResults, tabulate_hits, trace_results_to_json

GOOD = FileResults(
    Origin(IMPORTED, "npy file", "lab/hit_1.npy", "'a', points 0 to 99"),
    True,
    (),
    100e-6,
    Quantity(200e-6, 0.6e-6, 1.2e-6),
    1.59,
    512.0,
    best_shape="versed-sine",
    shape_residual_percent=0.31,
    measured_peak=512.0,
)
BAD = FileResults(
    Origin(IMPORTED, "npy file", "lab/hit_2.npy"), False, ("overload: 5 points at the rail",)
)
SAMPLE = SampleEstimate(
    "steel small", 1, 1, contact_time=Quantity(200e-6), notes=("k and c: no mass given",)
)
RESULTS = Results(PAPER_SETUP, HammerEstimate(), (SAMPLE,), ())


def test_each_hit_has_its_row_with_verdict_and_widths():
    table = tabulate_hits((GOOD, BAD))
    assert table.rows[0] == (
        "hit_1.npy", "200.0 ± 1.2", "accepted", "100.00", "1.590", "versed-sine", "0.3", "512",
        "'a', points 0 to 99",
    )  # fmt: skip
    assert table.rows[1][:3] == ("hit_2.npy", "-", "overload: 5 points at the rail")
    assert table.marked == {1}


def test_folders_are_shown_where_the_names_are_the_same():
    table = tabulate_hits((GOOD, FileResults(Origin(IMPORTED, file="other/hit_1.npy"), True, ())))
    assert [row[0] for row in table.rows] == ["lab/hit_1.npy", "other/hit_1.npy"]


def test_the_json_has_hits_and_samples_with_null_for_what_is_not_known():
    content = json.loads(format_json(trace_results_to_json(RESULTS, (GOOD, BAD))))
    assert content["format"] == {"name": "impact-rig trace results", "version": 5}
    assert (content["origin"], content["origin_source"]) == ("imported", "npy file")
    assert [hit["file"] for hit in content["hits"]] == ["lab/hit_1.npy", "lab/hit_2.npy"]
    assert content["hits"][0]["place"] == "'a', points 0 to 99"
    assert content["hits"][1]["contact_time_s"] is None
    assert content["samples"][0]["contact_time_s"] == 200e-6
    assert content["hammer"]["stiffness_n_per_m"] is None
