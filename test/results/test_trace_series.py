"""Hits from plain traces, one in each row."""

from impact_rig.core.quantity import Quantity
from impact_rig.core.records import IMPORTED, Origin
from impact_rig.results.campaign import FileResults
from impact_rig.results.trace_series import tabulate_hits

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
