"""A session: blocks in, verdicts and estimates out, in whatever order samples come."""

import gc
import sys
import tracemalloc
import weakref
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impact_rig.core.errors import ParameterError
from impact_rig.core.hits.hit import JudgedHit
from impact_rig.core.hits.overrule import Overrules
from impact_rig.core.hits.reasons import Reason
from impact_rig.core.session import Session
from impact_rig.core.setup.samples import RigSetup, Sample, SampleSet
from impact_rig.core.signals.record import HitLabel
from impact_rig.core.uncertainty.results import REMEMBERED_INPUTS, make_ensemble, make_input

SETUP = RigSetup(
    SampleSet((Sample("alike", 0.097), Sample("heavy", 0.297), Sample("third", 0.2)), "alike"),
    hammer_mass=0.1,
    impact_speed=0.08,
)
Make = Callable[..., Any]
Strike = Callable[..., tuple[JudgedHit, ...]]


@pytest.fixture(scope="session")
def strike(make_counts: Make, make_blocks: Make) -> Strike:
    """Feed a session one hit of 200 us at 1 MHz; the sample answers with a decaying wave."""

    def make(
        session: Session,
        sample: str,
        record: int,
        *,
        height: float = 900.0,
        size: int = 400,
        place: int = 500,
    ) -> tuple[JudgedHit, ...]:
        hammer = make_counts([(place, height)], 2500, seed=record)
        answer = [(place, 800.0), (place + 300, 150.0), (place + 600, 28.0)]
        specimen = make_counts(answer, 2500, seed=1000 + record)
        blocks = make_blocks(hammer, specimen, [size], label=HitLabel(sample, record))
        return tuple(hit for block in blocks for hit in session.feed(block))

    return make


def test_a_good_hit_is_judged_and_counted(strike: Strike) -> None:
    session = Session(SETUP)
    (hit,) = strike(session, "alike", 1)
    assert hit.accepted
    assert hit.label == HitLabel("alike", 1)
    # One hit of a versed-sine on a grid of 1 us, noise of 1 in 900.
    assert hit.contact_time == pytest.approx(200e-6, rel=0.01)
    estimate = session.estimate_sample("alike")
    assert (estimate.impacts_accepted, estimate.impacts_rejected) == (1, 0)


def test_a_rejected_hit_changes_no_estimate(strike: Strike) -> None:
    session = Session(SETUP)
    strike(session, "alike", 1)
    before = session.estimate_sample("alike")
    (hit,) = strike(session, "alike", 2, height=150.0)
    assert {item.reason for item in hit.rejections} == {Reason.WEAK}
    after = session.estimate_sample("alike")
    assert after.impacts_rejected == 1
    assert after.body == before.body
    assert after.contact == before.contact


def test_a_sample_measured_before_the_control_sample_gets_its_k2_afterwards(
    strike: Strike,
) -> None:
    session = Session(SETUP)
    strike(session, "heavy", 1)
    early = session.estimate_sample("heavy")
    assert np.isnan(early.body.stiffness)
    assert early.body.notes == (
        "k1: the control sample 'alike' has no accepted hit yet",
        "k2: not determined without k1",
    )
    assert early.contact is not None
    assert np.isfinite(early.body.damping_ratio)
    strike(session, "alike", 2)
    late = session.estimate_sample("heavy")
    assert np.isfinite(late.body.stiffness)
    assert late.contact == early.contact


def test_without_a_control_sample_there_is_no_stiffness_and_a_reason(strike: Strike) -> None:
    session = Session(replace(SETUP, samples=replace(SETUP.samples, control_sample="")))
    strike(session, "heavy", 1)
    assert session.estimate_hammer().notes == ("k1: the sample set has no control sample",)
    assert np.isnan(session.estimate_sample("heavy").body.stiffness)


def test_a_sample_without_an_accepted_hit_says_so(strike: Strike) -> None:
    session = Session(SETUP)
    for record in (1, 2):
        strike(session, "heavy", record, height=150.0)
    (estimate,) = session.estimate_all().samples
    assert estimate.contact is None
    assert (estimate.impacts_accepted, estimate.impacts_rejected) == (0, 2)
    assert estimate.notes == ("heavy: not determined, none of 2 hits was accepted",)


def test_results_come_in_the_order_of_the_set_and_rejections_in_that_of_arrival(
    strike: Strike,
) -> None:
    session = Session(SETUP)
    for record, (sample, height) in enumerate(
        [("third", 900.0), ("heavy", 150.0), ("alike", 900.0), ("third", 140.0)], start=1
    ):
        strike(session, sample, record, height=height)
    results = session.estimate_all()
    assert [item.name for item in results.samples] == ["alike", "heavy", "third"]
    assert session.names == ("alike", "heavy", "third")
    assert [hit.label.record for hit in results.rejected] == [2, 4]
    # By their text: what is not determined is NaN, which equals nothing.
    assert repr(results.hammer) == repr(session.estimate_hammer())


def get_numbers(session: Session) -> dict[str, tuple[object, ...]]:
    """Every number of every sample, to the last bit."""
    results = session.estimate_all()
    return {
        item.name: (
            item.contact,
            item.contact_time_spread,
            item.body,
            item.hammer_peak,
            [
                (c.hammer.mse_percent, c.specimen.mse_percent, c.hammer.shift, c.specimen.shift)
                for c in item.comparisons
            ],
            results.hammer,
        )
        for item in results.samples
    }


@given(order=st.permutations(["alike", "heavy", "third"]), size=st.integers(50, 2500))
@settings(max_examples=5)
def test_neither_the_order_of_samples_nor_the_size_of_blocks_changes_a_bit(
    strike: Strike, order: list[str], size: int
) -> None:
    def run(names: list[str], block: int) -> Session:
        session = Session(SETUP)
        for name in names:
            for hit in range(2):
                # A hit is known by sample and number, not by when it was struck.
                record = 10 * SETUP.samples.names.index(name) + hit + 1
                strike(session, name, record, size=block, place=500 + hit)
        return session

    # By their text, every bit of it: what is not determined is NaN, which equals nothing.
    assert repr(get_numbers(run(order, size))) == repr(
        get_numbers(run(["alike", "heavy", "third"], 2500))
    )


def test_an_unknown_sample_is_refused_and_nothing_is_counted(strike: Strike) -> None:
    session = Session(SETUP)
    with pytest.raises(ParameterError, match="unknown sample 'brass': the set has 'alike', 'h"):
        strike(session, "brass", 1)
    assert session.names == ()


def test_a_sampling_rate_too_low_for_the_filter_is_named(
    make_counts: Make, make_blocks: Make
) -> None:
    session = Session(SETUP)
    hammer = make_counts([(500, 900.0)], 2500)
    blocks = make_blocks(hammer, hammer, [2500], label=HitLabel("alike"), rate=51.2e3)
    with pytest.raises(ParameterError, match="too low for the 50 kHz low-pass"):
        session.feed(blocks[0])


def test_results_asked_for_twice_are_the_same_until_another_hit_comes(strike: Strike) -> None:
    session = Session(SETUP)
    strike_series(strike, session, [900.0] * 2)
    first = session.estimate_all()
    again = session.estimate_all()
    assert all(new is old for new, old in zip(again.samples, first.samples, strict=True))
    strike_series(strike, session, [900.0], first=3)
    assert len(session.estimate_all().accepted) == 3


def strike_series(
    strike: Strike, session: Session, heights: list[float], sample: str = "alike", first: int = 1
) -> list[JudgedHit]:
    return [
        hit
        for record, height in enumerate(heights, start=first)
        for hit in strike(session, sample, record, height=height, place=500 + record % 7)
    ]


def describe_rejected(session: Session) -> list[tuple[int, list[Reason]]]:
    return [
        (hit.label.record, [item.reason for item in hit.rejections])
        for hit in session.estimate_all().rejected
    ]


def test_a_hit_unlike_its_fellows_is_rejected_when_it_comes(strike: Strike) -> None:
    session = Session(SETUP)
    hits = strike_series(strike, session, [900.0] * 9 + [450.0])
    assert [hit.accepted for hit in hits] == [True] * 9 + [False]
    assert [item.reason for item in hits[-1].rejections] == [Reason.INCONSISTENT]
    estimate = session.estimate_sample("alike")
    assert (estimate.impacts_accepted, estimate.impacts_rejected) == (9, 1)


def test_an_early_one_is_found_once_there_are_fellows(strike: Strike) -> None:
    session = Session(SETUP)
    hits = strike_series(strike, session, [450.0] + [900.0] * 9)
    assert all(hit.accepted for hit in hits)
    assert describe_rejected(session) == [(1, [Reason.INCONSISTENT])]
    alone = Session(SETUP)
    strike_series(strike, alone, [900.0] * 9, first=2)
    assert session.estimate_sample("alike").contact == alone.estimate_sample("alike").contact


def test_of_more_hits_than_wanted_the_most_consistent_are_kept(strike: Strike) -> None:
    session = Session(replace(SETUP, analysis=replace(SETUP.analysis, keep_hits=4)))
    hits = strike_series(strike, session, [900.0, 800.0, 890.0, 905.0, 895.0, 1000.0])
    # Nothing is wrong with those that are left out: a campaign has no reason to repeat them.
    assert all(hit.accepted for hit in hits)
    assert describe_rejected(session) == [(2, [Reason.SURPLUS]), (6, [Reason.SURPLUS])]
    estimate = session.estimate_sample("alike")
    assert (estimate.impacts_accepted, estimate.impacts_rejected) == (4, 2)


def test_the_same_hits_give_the_same_selection_at_every_size_of_block(strike: Strike) -> None:
    def run(size: int) -> str:
        session = Session(replace(SETUP, analysis=replace(SETUP.analysis, keep_hits=5)))
        for record, height in enumerate([900.0, 450.0, 880.0, 910.0, 905.0, 893.0, 901.0], 1):
            strike(session, "alike", record, height=height, size=size)
        results = session.estimate_all()
        return repr((results.samples, [(hit.label, hit.rejections) for hit in results.rejected]))

    assert run(400) == run(2500) == run(77)


def test_a_person_leaves_out_one_hit_and_takes_another_in(strike: Strike) -> None:
    accepted, rejected = (frozenset({HitLabel("alike", record)}) for record in (2, 3))
    session = Session(SETUP, Overrules(accepted, rejected))
    strike_series(strike, session, [900.0, 150.0, 890.0])
    assert describe_rejected(session) == [(3, [Reason.OPERATOR])]
    estimate = session.estimate_sample("alike")
    assert estimate.impacts_accepted == 2
    assert estimate.warnings[-1].startswith(
        "hit 2 (alike/1.1) accepted by hand, although weak: hammer peak"
    )


def test_a_persons_word_on_hits_that_do_not_come_changes_nothing(strike: Strike) -> None:
    other = frozenset({HitLabel("alike", 99)})
    sessions = (
        Session(SETUP),
        Session(SETUP, Overrules(other)),
        Session(SETUP, Overrules(rejected=other)),
    )
    for session in sessions:
        strike_series(strike, session, [900.0, 150.0, 890.0])
    first, *others = (repr(session.estimate_all()) for session in sessions)
    assert others == [first, first]


def test_a_hit_without_a_pulse_cannot_be_taken_in(make_counts: Make, make_blocks: Make) -> None:
    label = HitLabel("alike", 7)
    session = Session(SETUP, Overrules(accepted=frozenset({label})))
    quiet = make_counts([], 2500)
    (block,) = make_blocks(quiet, quiet, [2500], label=label)
    with pytest.raises(ParameterError, match=r"hit 7 .* no pulse that could be measured"):
        session.feed(block)
    assert session.labels == ()


def test_without_masses_contact_times_remain_and_a_note_says_why(strike: Strike) -> None:
    known = Session(SETUP)
    strike(known, "heavy", 1)
    (heavy,) = (sample for sample in SETUP.samples.samples if sample.name == "heavy")
    samples = tuple(
        replace(sample, mass=np.nan) if sample == heavy else sample
        for sample in SETUP.samples.samples
    )
    session = Session(replace(SETUP, samples=replace(SETUP.samples, samples=samples)))
    strike(session, "heavy", 1)
    (estimate,) = session.estimate_all().samples
    assert estimate.contact is not None
    expected = known.estimate_sample("heavy").contact
    assert expected is not None
    assert estimate.contact.contact_time == expected.contact_time
    assert np.isnan(estimate.contact.equivalent_stiffness)
    assert "k and c: the mass of heavy is not known" in estimate.notes


def test_without_the_hammers_mass_the_control_sample_says_nothing_of_it(strike: Strike) -> None:
    session = Session(replace(SETUP, hammer_mass=np.nan))
    strike(session, "alike", 1)
    results = session.estimate_all()
    assert results.hammer.notes == ("k1: the mass of hammer is not known",)
    assert results.samples[0].contact is not None


def test_a_stated_stiffness_of_the_hammer_takes_the_control_samples_place(strike: Strike) -> None:
    measured = Session(SETUP)
    strike(measured, "alike", 1)
    strike(measured, "heavy", 2)
    k1 = measured.estimate_hammer().stiffness
    samples = replace(SETUP.samples, control_sample="")
    session = Session(replace(SETUP, samples=samples, hammer_stiffness=k1))
    strike(session, "heavy", 2)
    expected = measured.estimate_sample("heavy").body.stiffness
    assert session.estimate_sample("heavy").body.stiffness == pytest.approx(expected, rel=1e-12)


class TestLongRuns:
    """Many hits: memory and work stay what they are, and the numbers what they would be."""

    def test_traces_are_kept_of_so_many_hits_and_no_more(
        self, strike: Strike, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("impact_rig.core.session.KEPT_TRACES", 30)
        session, traces = Session(SETUP), []
        for record in range(1, 52):
            sample = SETUP.samples.names[record % 3]
            (hit,) = strike(session, sample, record)
            assert hit.filtered is not None
            # Views of the same array would keep it alive, too.
            traces.append(weakref.ref(hit.filtered.traces))
            del hit
            means = [mean for name in session.names if (mean := session.find_mean(name))]
            assert sum(mean.count for mean in means) == record
            assert sum(len(mean.hits) for mean in means) == min(record, 30)
        gc.collect()
        assert not [1 for trace in traces[:-1] if trace() is not None]
        # The three samples share what there is.
        assert [len(mean.hits) for mean in means] == [10, 10, 10]

    def test_memory_does_not_grow_with_the_hits(
        self, strike: Strike, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("impact_rig.core.session.KEPT_TRACES", 10)
        session = Session(SETUP)
        strike_series(strike, session, [900.0] * 20)
        tracemalloc.start()
        try:
            before, _ = tracemalloc.get_traced_memory()
            strike_series(strike, session, [900.0, 150.0] * 40, first=21)
            gc.collect()
            after, _ = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        # Filtered traces of one hit take 40 kB. The 10 that are kept may be others than before,
        # which were not counted.
        assert after - before < 10 * 20_000 + 80 * 1000

    def test_every_hit_counts_although_few_show_the_scatter(
        self, strike: Strike, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("impact_rig.core.session.LEAST_TRACES", 5)
        whole, sparing = Session(SETUP), Session(SETUP)
        heights = [900.0 + 5.0 * (record % 9) for record in range(60)]
        strike_series(strike, whole, heights)
        monkeypatch.setattr("impact_rig.core.session.KEPT_TRACES", 20)
        strike_series(strike, sparing, heights)
        expected, found = (session.estimate_sample("alike") for session in (whole, sparing))
        assert found.impacts_accepted == expected.impacts_accepted == 60
        assert found.contact is not None
        assert expected.contact is not None
        assert found.contact_time_spread == pytest.approx(expected.contact_time_spread, rel=1e-9)
        assert found.contact.contact_time == pytest.approx(expected.contact.contact_time, rel=1e-9)
        # Of 20 hits the scatter is known to a sixth; as that of a mean of 20 it would be 1.7
        # times as large.
        for uncertainties in (
            [item.contact.contact_time_uncertainty.standard for item in (found, expected)],
            [item.body.damping_ratio_uncertainty.standard for item in (found, expected)],
        ):
            assert 0.8 < uncertainties[0] / uncertainties[1] < 1.25

    def test_results_do_not_depend_on_how_long_ago_the_hammer_was_estimated(
        self, strike: Strike
    ) -> None:
        asked, quiet = Session(SETUP), Session(SETUP)
        for session in (asked, quiet):
            strike_series(strike, session, [900.0, 890.0, 910.0])
            if session is asked:
                session.estimate_hammer()
            strike_series(strike, session, [900.0, 905.0], "heavy", first=4)
        # What so many hits bring: more uncertain inputs than are told apart by name and value.
        for number in range(REMEMBERED_INPUTS):
            make_input("another", float(number), 1.0)
            make_ensemble("another", (0.0,), np.array([[1.0 + number]]), 5.0)
        assert repr(asked.estimate_all()) == repr(quiet.estimate_all())

    def test_what_is_settled_depends_on_the_hits_alone(
        self, strike: Strike, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("impact_rig.core.session.KEPT_TRACES", 12)
        monkeypatch.setattr("impact_rig.core.session.LEAST_TRACES", 4)
        live, file = Session(SETUP), Session(SETUP)
        for record in range(1, 31):
            name = SETUP.samples.names[record % 7 % 3]
            for session in (live, file):
                strike(session, name, record, height=450.0 if record == 9 else 900.0)
            live.estimate_sample(name)
        assert repr(live.estimate_all()) == repr(file.estimate_all())

    def test_samples_measured_before_give_way_to_the_next(
        self, strike: Strike, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("impact_rig.core.session.KEPT_TRACES", 20)
        monkeypatch.setattr("impact_rig.core.session.LEAST_TRACES", 8)
        session = Session(SETUP)
        kept, hits = [], []
        for number, name in enumerate(("alike", "heavy", "third")):
            strike_series(strike, session, [900.0] * 20, name, first=1 + 20 * number)
            session.estimate_sample(name)
            hits += [weakref.ref(hit) for hit in session.find_mean(name).hits]
            means = [session.find_mean(name) for name in ("alike", "heavy", "third")]
            kept.append([len(mean.hits) for mean in means if mean])
        # Never fewer than the least, even if that is more together.
        assert kept == [[20], [10, 10], [8, 8, 8]]
        # Nothing holds on to those that gave way.
        del means
        gc.collect()
        assert len([hit for hit in hits if hit() is not None]) == 24

    def test_the_work_for_a_hit_does_not_grow(
        self, strike: Strike, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("impact_rig.core.session.KEPT_TRACES", 10)
        session, calls = Session(SETUP), 0

        def count(_frame: object, event: str, _argument: object) -> None:
            nonlocal calls
            calls += event in ("call", "c_call")

        work = []
        for record in range(1, 71):
            calls = 0
            sys.setprofile(count)
            try:
                strike(session, "alike", record)
                session.estimate_sample("alike")
            finally:
                sys.setprofile(None)
            work.append(calls)
        # Fits take a step more or less.
        assert np.median(work[-15:]) < 1.1 * np.median(work[15:30])
