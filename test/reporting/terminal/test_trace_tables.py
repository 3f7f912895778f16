"""Hits from plain traces, for people and programs."""

import io
import json

from rich.console import Console

from impact_rig.reporting.terminal.trace_tables import print_trace_results
from impact_rig.results.estimates import HammerResults, SampleResults
from impact_rig.results.results_file import format_json
from impact_rig.results.trace_series import (
    FileResults,
    TraceResults,
    trace_results_to_json,
)

GOOD = FileResults(
    "lab/hit_1.npy",
    True,
    (),
    100e-6,
    200e-6,
    1.59,
    512.0,
    contact_time_u_s=0.6e-6,
    contact_time_expanded_s=1.2e-6,
    best_shape="versed-sine",
    shape_residual_percent=0.31,
)
BAD = FileResults("lab/hit_2.npy", False, ("overload: 5 points at the rail",))
SAMPLE = SampleResults("tin", 1, 1, contact_time_s=200e-6, notes=("k and c: no mass given",))
RESULTS = TraceResults(HammerResults(), (SAMPLE,), (GOOD, BAD))


def render(results: TraceResults, width: int = 80) -> str:
    console = Console(file=io.StringIO(), width=width, markup=False, highlight=False)
    print_trace_results(console, results)
    text: str = console.file.getvalue()
    return text


def test_each_hit_has_its_line_with_verdict_and_widths() -> None:
    lines = render(RESULTS, width=120).splitlines()
    good, bad = (next(line for line in lines if name in line) for name in ("hit_1", "hit_2"))
    assert good.split() == [
        "hit_1.npy", "200.0", "±", "1.2", "accepted", "100.00", "1.590", "versed-sine", "0.3",
        "512",
    ]  # fmt: skip
    assert bad.split()[:2] == ["hit_2.npy", "-"]
    assert "overload: 5 points at the rail" in bad


def test_folders_are_shown_where_the_names_are_the_same() -> None:
    twin = FileResults("other/hit_1.npy", True, ())
    text = render(TraceResults(HammerResults(), (), (GOOD, twin)), width=120)
    assert "lab/hit_1.npy" in text
    assert "other/hit_1.npy" in text


def test_the_mean_shows_what_is_known_and_names_what_is_not() -> None:
    text = render(RESULTS)
    assert "tin: mean of 1 hit\n" in text
    assert "contact time τp" in text
    assert "stiffness k2" not in text
    assert "- tin: k and c: no mass given" in text


def test_the_json_has_hits_and_samples_with_null_for_what_is_not_known() -> None:
    content = json.loads(format_json(trace_results_to_json(RESULTS)))
    assert content["format"] == {"name": "impact-rig trace results", "version": 2}
    assert [hit["file"] for hit in content["hits"]] == ["lab/hit_1.npy", "lab/hit_2.npy"]
    assert content["hits"][1]["contact_time_s"] is None
    assert content["samples"][0]["contact_time_s"] == 200e-6
    assert content["hammer"]["stiffness_n_per_m"] is None
