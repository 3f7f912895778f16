"""results.json: exact, whole, and strict when read."""

import functools
import json
import math
import operator
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impact_rig.core.estimates.paper_method import HammerEstimate, PaperEstimate
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.errors import FileError
from impact_rig.core.given.findings import Finding, Note, Reason, Subject
from impact_rig.core.given.quantity import Quantity
from impact_rig.core.given.records import SIMULATED, HitLabel, Origin
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.core.hit.judging import JudgedHit
from impact_rig.core.session import Session
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.rig import VirtualRig, VirtualRigSettings
from impact_rig.nodes.identity import NO_IDENTITY
from impact_rig.nodes.result_messages import hit_results_from_msg, hit_to_msg
from impact_rig.results import results_file
from impact_rig.results.campaign import (
    HitResults,
    Results,
    hit_results_from_judged,
    results_from_session,
)
from impact_rig.results.results_file import read_results, results_to_json, write_results
from impact_rig.results.wire import format_json

SAMPLE = SampleEstimate(
    "steel small",
    3,
    1,
    paper=PaperEstimate(contact_time=Quantity(2e-4)),
    notes=(Note(Subject.K2, "unknown"),),
)
REJECTED = HitResults(
    "steel small", 2, 1, 5, False, (Finding(Reason.WEAK, "too weak"),),
    injected_faults=("weak_hit",), origin=Origin(SIMULATED, "virtual rig"),
)  # fmt: skip
RESULTS = Results(
    PAPER_SETUP,
    HammerEstimate(Quantity(1e7), control_sample="steel small"),
    (SAMPLE,),
    (REJECTED,),
)


def test_what_is_written_is_read_again(tmp_path, results):
    path = tmp_path / "results.json"
    write_results(path, results)
    found = read_results(path)
    assert results_to_json(found) == results_to_json(results)
    assert (found.setup, found.hits) == (results.setup, results.hits)


@st.composite
def spans(draw):
    """Draw which points of three hits are lost: from where, and how many."""
    return draw(
        st.lists(
            st.tuples(st.integers(1, 3), st.integers(0, 4900), st.integers(1, 3000)), max_size=3
        )
    )


@settings(max_examples=15, deadline=None)
@given(lost=spans(), plant=st.sampled_from([Plant.PUBLISHED, Plant.CONTACT]))
def test_whatever_points_are_lost_what_is_written_is_read_again(tmp_path_factory, lost, plant):
    rig, session = VirtualRig(PAPER_SETUP, VirtualRigSettings(plant)), Session(PAPER_SETUP)
    for record in (1, 2, 3):
        for block in rig.strike(HitLabel("steel small", record, record)).split(100, 0):
            first = block.first_sample
            is_lost = any(
                record == each and start <= first < start + size for each, start, size in lost
            )
            if not is_lost or block.last:
                session.feed(block)
    path = tmp_path_factory.getbasetemp() / "lost.json"
    results = results_from_session(session.estimate_all(), {})
    write_results(path, results)
    assert results_to_json(read_results(path)) == results_to_json(results)


@pytest.mark.parametrize("mass", [-0.15, 1e300, math.inf])
def test_a_mass_that_no_body_has_is_none(tmp_path, mass):
    """A hit that lost its middle may weigh less than nothing."""
    judged = JudgedHit(HitLabel("steel small"), (), sample_mass=mass, hammer_peak=1e300)
    hit = hit_results_from_judged(judged, ())
    assert math.isnan(hit.sample_mass)
    assert math.isnan(hit.hammer_peak)
    assert hit_results_from_msg(hit_to_msg(judged, NO_IDENTITY)) == hit
    write_results(tmp_path / "results.json", replace(RESULTS, hits=(hit,)))
    assert read_results(tmp_path / "results.json").hits == (hit,)


@given(value=st.floats(allow_nan=False, allow_infinity=False))
def test_every_number_comes_back_bit_by_bit(value):
    paper = PaperEstimate(stiffness=Quantity(value))
    results = replace(RESULTS, samples=(replace(SAMPLE, paper=paper),))
    content = json.loads(format_json(results_to_json(results)))
    back = content["samples"][0]["stiffness_n_per_m"]
    assert (back, math.copysign(1, back)) == (value, math.copysign(1, value))


def test_the_file_has_the_promised_fields_and_nothing_of_this_host(tmp_path):
    path = tmp_path / "results.json"
    write_results(path, RESULTS)
    content = json.loads(path.read_text())
    assert content["format"] == {"name": "impact-rig results", "version": 13}
    assert (content["origin"], content["origin_source"]) == ("simulated", "virtual rig")
    assert {"stiffness_n_per_m", "damping_coefficient_n_s_per_m"} <= set(content["hammer"])
    assert {
        "name", "impacts_accepted", "impacts_rejected", "contact_time_s", "stiffness_n_per_m",
        "damping_coefficient_n_s_per_m", "damping_ratio", "log_decrement", "mse_hammer_percent",
        "mse_sample_percent",
    } <= set(content["samples"][0])  # fmt: skip
    assert content["hits"] == [
        {
            "sample": "steel small",
            "impact": 2,
            "attempt": 1,
            "record": 5,
            "accepted": False,
            "reasons": [{"reason": "weak", "explanation": "too weak"}],
            "contact_time_s": None,
            "hammer_peak_m_per_s2": None,
            "specimen_peak_m_per_s2": None,
            "impact_speed_m_per_s": None,
            "impact_speed_u_m_per_s": None,
            "sample_mass_kg": None,
            "findings": [],
            "injected_faults": ["weak_hit"],
            "origin": "simulated",
            "origin_source": "virtual rig",
            "file": "",
            "place": "",
        }
    ]
    assert set(content) == {
        "format", "origin", "origin_source", "setup", "hammer", "samples", "hits",
        "speed_exponents", "files", "remarks",
    }  # fmt: skip


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path, monkeypatch):
    path = tmp_path / "results.json"
    path.write_text("old")

    def fail(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(results_file.os, "fsync", fail)
    with pytest.raises(FileError, match=r"results.json: cannot be written \(No space left"):
        write_results(path, RESULTS)
    assert list(tmp_path.iterdir()) == [path]
    assert path.read_text() == "old"


@pytest.mark.parametrize(
    ("place", "value", "words"),
    [
        (
            ("samples", 0, "contact_time_s"),
            ...,
            r"field samples\[0\].contact_time_s is missing",
        ),
        (
            ("samples", 0, "impacts_accepted"),
            "three",
            "impacts_accepted is .three.: it must be a whole",
        ),
        (("samples", 0, "contact_time_u_s"), -1e-9, "u_s is -1e-09: it must be 0 or more"),
        (("format", "version"), 7, "version 7; this program reads version 13"),
        (("format", "name"), "a cake recipe", "is not a results file"),
        (("hits",), "none", "hits must be a list"),
    ],
)
def test_what_is_no_results_file_is_named(tmp_path, place, value, words):
    path = tmp_path / "results.json"
    content: Any = results_to_json(RESULTS)
    inner = functools.reduce(operator.getitem, place[:-1], content)
    inner[place[-1]] = value
    if value is ...:
        del inner[place[-1]]
    path.write_text(json.dumps(content))
    with pytest.raises(FileError, match=words) as error:
        read_results(path)
    assert str(path) in str(error.value)


@pytest.mark.parametrize("text", ["", "{", "[1, 2]", "\0\1\2"])
def test_other_text_is_refused(tmp_path, text):
    path = tmp_path / "results.json"
    path.write_text(text)
    with pytest.raises(FileError, match=r"results\.json: is not"):
        read_results(path)


@pytest.mark.parametrize(
    ("found", "written", "told"),
    [
        ('"record": 5', f'"record": {"9" * 400}', "must be a whole number"),
        ('"record": 5', f'"record": {"9" * 5000}', "is not JSON"),
        ('"record": 5', f'"record": {"[" * 100_000}', "nested too deep"),
        ('"record": 5', '"record": NaN', "is nan: it must be a whole number"),
        ('"record": 5', '"record": 1e999', "is inf: it must be a whole number"),
        ('"contact_time_u_s": null', '"contact_time_u_s": NaN', "is nan: it must be a finite"),
        ('"contact_time_u_s": null', '"contact_time_u_s": 1e999', "is inf: it must be a finite"),
        ('"contact_time_u_s": null', f'"contact_time_u_s": {"9" * 400}', "it must be a finite"),
        ('"record": 5', '"record": 5, "record": 6', "the key 'record' is there twice"),
        ('"unknown"', '"k\\ud800"', "holds half a letter"),
        (
            '"about": "k2"',
            '"about": "k3"',
            "about is 'k3': it must be a code, such as",
        ),
    ],
    ids=range(11),
)
def test_what_no_number_text_or_nesting_can_be_is_refused(tmp_path, found, written, told):
    path = tmp_path / "results.json"
    text = format_json(results_to_json(RESULTS))
    assert found in text
    path.write_text(text.replace(found, written, 1), encoding="utf-8")
    with pytest.raises(FileError, match=told) as caught:
        read_results(path)
    assert len(str(caught.value)) < 300


def test_json_is_the_same_and_steers_no_terminal():
    text = "\x9b2J \u202e \x7f \ud800 \x1b é"
    written = format_json({"name": text})
    assert json.loads(written) == {"name": text}
    assert written.replace("\n", "").isprintable()
    assert "é" in written
