"""What `impact-rig calibrate` prints: the new sensitivity, its hits and its uncertainty."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.text import Text

from impact_rig.core.calibration.sensitivity import Calibration
from impact_rig.core.calibration.trace_fit import HitFit, TraceFit
from impact_rig.core.hits.overrule import describe_label
from impact_rig.reporting.terminal.columns import Column
from impact_rig.reporting.terminal.console import ALARM, GOOD, print_table, print_text
from impact_rig.results.numbers import format_number
from impact_rig.results.results_file import record_to_json

PERCENT = 100.0
MILLIVOLT = 1e3
NO_FIT = TraceFit(math.nan, math.nan, math.nan)
EXPLANATION = (
    "Ratio: of the trace under test over what it should be. Misfit: RMS of what the line leaves,"
    " of the trace. Linearity: the largest deviation, of the peak."
)


def describe_fit(item: HitFit) -> str:
    """Return in a few words what a hit has given."""
    if item.flaw or item.fit is None:
        return f"not used: {item.flaw}"
    return f"ratio {item.fit.ratio:.5f}, misfit {PERCENT * item.fit.misfit:.2g} %"


def describe_sensitivity(calibration: Calibration) -> str:
    """Return the new sensitivity with its expanded uncertainty, and what has changed."""
    sensor, expanded = calibration.sensor, calibration.uncertainty.expanded
    new, old = (value * MILLIVOLT for value in (calibration.sensitivity, sensor.sensitivity))
    return (
        f"{sensor.channel} sensor: {new:.6g} mV per {sensor.unit}"
        f" ± {abs(old) * expanded:.2g} (95 %), {PERCENT * (calibration.ratio - 1.0):+.3g} % on"
        f" {old:.6g}"
    )


def print_calibration(
    console: Console, calibration: Calibration, fits: Sequence[HitFit], remarks: Sequence[str]
) -> None:
    """Print the result first, then the hits, then where the uncertainty comes from."""
    console.print(Text(describe_sensitivity(calibration), style=GOOD))
    console.print()
    _print_hits(console, fits)
    budget = calibration.uncertainty.budget
    columns = [
        Column("Source", [line.source for line in budget], is_text=True),
        Column("Type", [line.kind for line in budget], is_text=True),
        Column("u [%]", [f"{PERCENT * line.contribution:.2g}" for line in budget]),
        Column("Share [%]", [f"{PERCENT * line.share:.1f}" for line in budget]),
    ]
    print_table(console, "Where its uncertainty comes from", columns)
    for text in remarks:
        print_text(console, Text.assemble(("warning: ", ALARM), text))


def _print_hits(console: Console, fits: Sequence[HitFit]) -> None:
    values = [item.fit or NO_FIT for item in fits]
    columns = [
        Column("Hit", [describe_label(item.label) for item in fits], is_text=True),
        Column("Ratio", [format_number(fit.ratio, 5) for fit in values]),
        Column("Misfit [%]", [format_number(PERCENT * fit.misfit, 2) for fit in values]),
        Column("Linearity [%]", [format_number(PERCENT * fit.linearity, 2) for fit in values]),
    ]
    if any(item.flaw for item in fits):
        columns.append(Column("Not used", [item.flaw for item in fits], is_text=True))
    print_table(console, f"Hits: {len(fits)}", columns, [EXPLANATION])


def calibration_to_json(
    calibration: Calibration, fits: Sequence[HitFit], remarks: Sequence[str], file: str
) -> dict[str, Any]:
    """Return the same as plain values."""
    return {
        "file": file,
        "channel": calibration.sensor.channel,
        "unit": calibration.sensor.unit,
        "sensitivity_v_per_unit": calibration.sensitivity,
        "sensitivity_before_v_per_unit": calibration.sensor.sensitivity,
        "ratio": calibration.ratio,
        "uncertainty_of_ratio": record_to_json(calibration.uncertainty),
        "hits_used": calibration.hits,
        "hits": [
            {
                "hit": describe_label(item.label),
                **(dataclasses.asdict(item.fit) if item.fit else {}),
                "flaw": item.flaw,
            }
            for item in fits
        ],
        "warnings": list(remarks),
    }
