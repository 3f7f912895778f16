"""What was found, in a terminal."""

import io
import re
from dataclasses import replace

import pytest
from rich.console import Console

from impact_rig.core.estimation.fits import FittedModel
from impact_rig.core.estimation.paper_method import HammerEstimate
from impact_rig.core.estimation.sample import SampleEstimate
from impact_rig.core.origin import IMPORTED, Origin
from impact_rig.core.quantity import BudgetLine, Quantity
from impact_rig.core.setup.paper import PAPER_SETUP, PUBLISHED_SAMPLES
from impact_rig.core.setup.samples import Sample, SampleSet
from impact_rig.present.terminal.results import print_budgets, print_results
from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.trace_series import FileResults

REASONS = (
    "overload: 250 points in a row of the hammer at the rail of 1999 m/s^2 (203.8 g)",
    "weak: hammer peak 101.9 m/s^2 is below 300 m/s^2",
)
NUMBER = re.compile(r"(?<![\w.])[+-]?\d+(?:\.\d+)?(?![\w.]*\d)")
NO_HAMMER = HammerEstimate()


def render(show, *values: object, width: int = 80, **options: object) -> str:
    console = Console(
        file=io.StringIO(), width=width, markup=False, highlight=False, emoji=False, **options
    )
    show(console, *values)
    text: str = console.file.getvalue()
    return text


def make_results(*found: SampleEstimate, hammer: HammerEstimate = NO_HAMMER) -> Results:
    return Results(PAPER_SETUP, hammer, found, ())


def make_sample(name: str, **values: object) -> SampleEstimate:
    return SampleEstimate(name, 10, 2, **values)


def test_eighty_columns_are_enough_and_every_name_keeps_its_line(results):
    text = render(print_results, results)
    assert max(map(len, text.splitlines())) <= 80
    for cell in PUBLISHED_SAMPLES:
        # Tables 2 to 4, Fig. 6, pulse shape, contact law and free decay; no model describes it.
        assert len(re.findall(rf"^{cell.name}(?![,:])", text, re.MULTILINE)) == 7


@pytest.mark.parametrize(("terminal", "no_color"), [(True, ""), (True, "1"), (False, "")])
def test_a_row_that_stands_out_says_why_and_is_coloured_where_colour_is_wanted(
    monkeypatch, terminal, no_color
):
    monkeypatch.setenv("NO_COLOR", no_color)
    sample = make_sample("steel medium", contact_time=Quantity(204.2e-6, expanded=0.99e-6))
    text = render(print_results, make_results(sample), force_terminal=terminal)
    line = next(line for line in text.splitlines() if "203.20" in line)
    assert "no" in line
    assert ("\x1b[3" in line) is (terminal and not no_color)
    assert terminal or "\x1b" not in text


def test_budgets_and_what_the_traces_do_not_determine_are_printed():
    fitted = FittedModel("driven", True, undetermined=("k2 and c2 only together",))
    budget = (BudgetLine("sampling clock", "B", 1e4, 1.0),)
    stiffness = Quantity(45e6, 1e4, 2e4, budget=budget)
    sample = make_sample("steel medium", stiffness=stiffness, identifications=(fitted,))
    text = render(print_results, make_results(sample))
    assert "- steel medium: k2 and c2 only together" in text
    budgets = render(print_budgets, [sample], NO_HAMMER)
    assert "steel medium: k = 45.000 ± 0.020 MN/m" in budgets


def test_a_rejected_hit_is_listed_with_its_reasons_and_what_was_injected(results):
    rejected = HitResults(
        "steel small", 3, 2, 17, reasons=REASONS, injected_faults=("overload", "weak_hit")
    )
    text = render(print_results, replace(results, hits=(rejected,)), width=120)
    listed = text[text.index("Rejected hits: 1") :].partition("Table 2")[0]
    assert re.search(r"^steel small +3\.2 +17 +overload", listed, re.MULTILINE)
    for words in ("203.8 g", "weak: hammer peak", "weak_hit", "overload (1), weak (1)"):
        assert words in listed
    real = replace(rejected, injected_faults=())
    assert "Injected" not in render(print_results, replace(results, hits=(real,)))


def test_what_is_not_determined_is_named_once_with_whom_it_is_about():
    note = "k2: not determined without k1"
    samples = [make_sample(name, notes=(note,)) for name in ("steel small", "steel large")]
    other = make_sample("brass small", contact_time=Quantity(1e-4))
    hammer = HammerEstimate(notes=("k1: no control sample",))
    text = render(print_results, make_results(*samples, other, hammer=hammer))
    assert f"- steel small, steel large: {note}" in text
    assert "- hammer: k1: no control sample" in text
    assert f"- all samples: {note}" in render(print_results, make_results(*samples))


def test_names_and_notes_are_shown_as_they_are():
    name = "[red]alloy :bomb:"
    setup = replace(PAPER_SETUP, samples=SampleSet((Sample(name, 0.1),), ""))
    sample = make_sample(name, notes=("k2: [bold]no",))
    text = render(print_results, Results(setup, NO_HAMMER, (sample,), ()))
    assert name in text
    assert "[bold]no" in text


def test_plain_traces_are_shown_hit_by_hit_and_their_mean():
    hits = (
        FileResults(Origin(IMPORTED, "npy file", "lab/hit_1.npy"), True, ()),
        FileResults(Origin(IMPORTED, "npy file", "lab/hit_2.npy"), False, REASONS),
    )
    sample = make_sample("steel small", contact_time=Quantity(2e-4), notes=("k: no mass given",))
    text = render(print_results, make_results(sample), hits)
    assert text.startswith("Origin: imported (npy file): hit_1.npy, hit_2.npy.")
    for words in (
        "hit_1.npy",
        "accepted",
        "overload: 250",
        "200.00",
        "- steel small: k: no mass given",
    ):
        assert words in text
