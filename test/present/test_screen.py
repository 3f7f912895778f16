"""What was found, in a terminal."""

import io
import re
from dataclasses import fields, replace

import pytest
from rich.console import Console

from impact_rig.core.estimates.paper_method import HammerEstimate, PaperEstimate
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.findings import Finding, Note, Reason, Subject
from impact_rig.core.given.quantity import Quantity
from impact_rig.core.given.records import IMPORTED, Origin
from impact_rig.core.given.setup import PAPER_SETUP, Sample, SampleSet
from impact_rig.present.screen import print_full, print_screen
from impact_rig.results.campaign import FileResults, HitResults, Results

REASONS = (
    Finding(
        Reason.OVERLOAD, "250 points in a row of the hammer at the rail of 1999 m/s^2 (203.8 g)"
    ),
    Finding(Reason.WEAK, "hammer peak 101.9 m/s^2 is below 300 m/s^2"),
)
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
    names = {item.name for item in fields(PaperEstimate)} - {"warnings", "notes"}
    numbers = names & values.keys()
    paper = PaperEstimate(**{name: values.pop(name) for name in numbers})
    return SampleEstimate(name, 10, 2, paper=paper, **values)


def test_eighty_columns_are_enough_and_every_name_keeps_its_line(results):
    text = render(print_full, results)
    assert max(map(len, text.splitlines())) <= 80
    for cell in PAPER_SETUP.samples.samples:
        # Tables 2 to 4, Fig. 6, shape, free decay, momenta, summary.
        assert len(re.findall(rf"^{cell.name}(?![,:])", text, re.MULTILINE)) in (8, 9)


def test_twelve_samples_fit_one_screen_with_the_largest_remarks_each_whole(results):
    warned = [
        replace(sample, warnings=(Note(subject, f"far {'too long ' * 25}: turn it"),))
        for subject, sample in zip(Subject, results.samples, strict=False)
    ]
    text = render(print_screen, replace(results, samples=tuple(warned)), ["the file is cut"])
    lines = text.splitlines()
    assert len(lines) <= 40
    assert max(map(len, lines)) <= 80
    for cell in PAPER_SETUP.samples.samples:
        assert len(re.findall(rf"^{cell.name}(?![,:])", text, re.MULTILINE)) == 1
    assert sum(line.startswith("- ") for line in lines) == 3
    assert " ".join(text.split()).count("long : turn it") == 2
    assert re.search(r"24 hits accepted, 0 rejected\. \d+ more remarks with --full\.", text)


@pytest.mark.parametrize(("terminal", "no_color"), [(True, ""), (True, "1"), (False, "")])
def test_a_row_that_stands_out_says_why_and_is_coloured_where_colour_is_wanted(
    monkeypatch, terminal, no_color
):
    monkeypatch.setenv("NO_COLOR", no_color)
    sample = make_sample("steel medium", contact_time=Quantity(204.2e-6, expanded=0.5e-6))
    text = render(print_full, make_results(sample), force_terminal=terminal)
    line = next(line for line in text.splitlines() if "203.20" in line)
    assert "2.0" in line.partition("0.50")[2]
    assert ("\x1b[3" in line) is (terminal and not no_color)
    assert terminal or "\x1b" not in text


def test_a_rejected_hit_is_listed_with_its_reasons_and_what_was_injected(results):
    rejected = HitResults(
        "steel small", 3, 2, 17, reasons=REASONS, injected_faults=("overload", "weak_hit")
    )
    text = render(print_full, replace(results, hits=(rejected,)), width=120)
    listed = text[text.index("Rejected hits: 1") :].partition("Table 2")[0]
    assert re.search(r"^steel small +3\.2 +17 +overload", listed, re.MULTILINE)
    for words in ("203.8 g", "weak: hammer peak", "weak_hit", "overload (1), weak (1)"):
        assert words in listed
    real = replace(rejected, injected_faults=())
    assert "Injected" not in render(print_full, replace(results, hits=(real,)))


def test_names_and_notes_are_shown_as_they_are():
    name = "[red]alloy :bomb:"
    setup = replace(PAPER_SETUP, samples=SampleSet((Sample(name, 0.1),), ""))
    sample = make_sample(name, notes=(Note(Subject.K2, "[bold]no"),))
    text = render(print_full, Results(setup, NO_HAMMER, (sample,), ()))
    assert name in text
    assert "[bold]no" in text


def test_plain_traces_are_shown_hit_by_hit_and_their_mean():
    hits = (
        FileResults(Origin(IMPORTED, "npy file", "lab/hit_1.npy"), True, ()),
        FileResults(Origin(IMPORTED, "npy file", "lab/hit_2.npy"), False, REASONS),
    )
    sample = make_sample(
        "steel small", contact_time=Quantity(2e-4), notes=(Note(Subject.K2, "no mass given"),)
    )
    results = make_results(sample)
    found = tuple(
        HitResults("steel small", n, 1, n, hit.accepted, hit.reasons, origin=hit.origin)
        for n, hit in enumerate(hits, start=1)
    )
    text = render(print_full, replace(results, hits=found, files=hits))
    assert text.startswith("Origin: imported (npy file) of 2 files: hit_1.npy and 1 more.")
    for words in ("hit_1.npy", "overload: 250", "200.00", "- steel small: k2: no mass given"):
        assert words in text
