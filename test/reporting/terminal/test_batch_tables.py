"""Many recordings in one table."""

import io
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from impact_rig.reporting.terminal.batch_tables import BatchCampaign, print_batch, shorten_paths
from impact_rig.results.campaign import Results
from impact_rig.results.estimates import HammerResults, SampleResults
from impact_rig.results.setup_results import SetupResults

TIMES = (144.61e-6, 144.93e-6, 145.22e-6)
NAN = float("nan")


def make_campaign(
    name: str, contact_time: float, number: int = 1, stiffness: float = 15.6e6
) -> BatchCampaign:
    sample = SampleResults(
        "aluminium small",
        10,
        2,
        contact_time_s=contact_time,
        contact_time_expanded_s=0.3e-6,
        stiffness_n_per_m=stiffness,
        stiffness_expanded_n_per_m=0.4e6,
    )
    return BatchCampaign(
        Path(name), number, Results(SetupResults(), HammerResults(), (sample,), ())
    )


def render(campaigns: list[BatchCampaign], width: int = 80) -> str:
    console = Console(file=io.StringIO(), width=width, markup=False, highlight=False)
    print_batch(console, campaigns)
    text: str = console.file.getvalue()
    return text


@pytest.mark.parametrize(
    ("paths", "names"),
    [
        (["runs/a/session.mcap", "runs/b/session.mcap"], ["a", "b"]),
        (["runs/a/session.mcap", "old/b.mcap"], ["runs/a/session.mcap", "old/b.mcap"]),
        (["x/a.mcap", "x/b.mcap"], ["a.mcap", "b.mcap"]),
        (["x/a.mcap", "x/a.mcap"], ["a.mcap", "a.mcap"]),
        (["/one/session.mcap", "/two/session.mcap"], ["one", "two"]),
    ],
)
def test_recordings_have_the_shortest_names_that_tell_them_apart(
    paths: list[str], names: list[str]
) -> None:
    assert shorten_paths(list(map(Path, paths))) == names


def test_each_row_has_recording_sample_hits_and_values_with_uncertainty() -> None:
    text = render([make_campaign("a.mcap", TIMES[0]), make_campaign("b.mcap", TIMES[1])])
    row = next(line for line in text.splitlines() if line.startswith("a.mcap"))
    cells = "a.mcap aluminium small 10 of 12 144.61 ± 0.30 15.60 ± 0.40 -"
    assert " ".join(row.split()) == cells
    assert "Between" not in text


def test_the_spread_of_three_recordings_is_the_standard_deviation() -> None:
    campaigns = [make_campaign(f"{time}.mcap", time) for time in TIMES]
    text = render(campaigns).partition("Between the recordings")[2]
    row = next(line for line in text.splitlines() if line.startswith("aluminium small"))
    spread = 100 * np.std(TIMES, ddof=1) / np.mean(TIMES)
    assert row.split() == (
        f"aluminium small 3 {np.mean(TIMES) * 1e6:.2f} {spread:.2f} 15.60 0.00 - -".split()
    )


def test_what_was_determined_twice_only_has_no_spread() -> None:
    stiffnesses = (15.5e6, 15.6e6, NAN)
    campaigns = [
        make_campaign(f"{number}.mcap", TIMES[0], stiffness=stiffness)
        for number, stiffness in enumerate(stiffnesses)
    ]
    text = render(campaigns).partition("Between the recordings")[2]
    row = next(line for line in text.splitlines() if line.startswith("aluminium small"))
    assert row.split()[-4:] == ["-", "-", "-", "-"]


def test_campaigns_of_one_recording_are_numbered() -> None:
    text = render([make_campaign("a.mcap", TIMES[0]), make_campaign("a.mcap", TIMES[1], 2)])
    assert "a.mcap, 1" in text
    assert "a.mcap, 2" in text
