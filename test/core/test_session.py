"""A session: blocks in, verdicts and estimates out, in any order of samples, of any number."""

import gc
import weakref
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from impact_rig.core.given.errors import ParameterError
from impact_rig.core.given.findings import Note, Reason, Subject
from impact_rig.core.given.quantity import make_result
from impact_rig.core.given.records import (
    MEASURED,
    SIMULATED,
    Block,
    ChannelBlock,
    HitLabel,
    Origin,
)
from impact_rig.core.hit.judging import JudgedHit
from impact_rig.core.hit.overrules import Overrule, Overrules, Verdict
from impact_rig.core.session import Session
from impact_rig.results.campaign import results_from_session
from impact_rig.results.wire import to_json

from .blocks import FULL_SCALE, RATE, SETUP, strike, strike_series
from .struck import DURATION, Impact


def test_a_rejected_hit_changes_no_estimate():
    session = Session(SETUP)
    strike(session, "alike", 1)
    before = session.estimate_sample("alike")
    (hit,) = strike(session, "alike", 2, height=80.0)
    assert {item.reason for item in hit.rejections} == {Reason.WEAK}
    after = session.estimate_sample("alike")
    assert after.impacts_rejected == 1
    assert repr(make_result(replace(after, impacts_rejected=0))) == repr(make_result(before))


def test_a_sample_measured_before_the_control_sample_gets_its_k2_afterwards():
    session = Session(SETUP)
    strike(session, "heavy", 1)
    early = session.estimate_sample("heavy")
    assert np.isnan(early.paper.stiffness.value)
    assert early.notes[:2] == (
        Note(Subject.K2, "not determined without k1"),
        Note(Subject.K1, "the control sample 'alike' has no accepted hit yet"),
    )
    assert early.paper.contact_time.is_known
    assert np.isfinite(early.paper.damping_ratio.value)
    strike(session, "alike", 2)
    late = session.estimate_sample("heavy")
    assert np.isfinite(late.paper.stiffness.value)
    assert late.paper.contact_time == early.paper.contact_time


def test_a_sample_without_an_accepted_hit_says_so():
    session = Session(SETUP)
    for record in (1, 2):
        strike(session, "heavy", record, height=80.0)
    (estimate,) = session.estimate_all().samples
    assert not estimate.paper.contact_time.is_known
    assert (estimate.impacts_accepted, estimate.impacts_rejected) == (0, 2)
    assert estimate.notes == (Note(Subject.HITS, "0 of 2 accepted"),)


def test_neither_the_order_of_samples_nor_the_size_of_blocks_changes_a_bit():
    def run(names: list[str], block: int) -> Session:
        session = Session(SETUP)
        for name in names:
            for hit in range(2):
                # A hit is known by sample and number, not by when it was struck.
                record = 10 * SETUP.samples.names.index(name) + hit + 1
                strike(session, name, record, size=block, place=500 + hit)
        return session

    # By their text, every bit of it: what is not determined is NaN, which equals nothing.
    one, other = (
        run(*how).estimate_all()
        for how in ((["heavy", "third", "alike"], 333), (["alike", "heavy", "third"], 2500))
    )
    assert repr(one.hammer) == repr(other.hammer)
    for sample, same in zip(one.samples, other.samples, strict=True):
        assert repr(make_result(sample)) == repr(make_result(same))


def test_without_masses_contact_times_remain_and_a_note_says_why():
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
    assert estimate.paper.contact_time.is_known
    expected = known.estimate_sample("heavy")
    assert estimate.paper.contact_time == expected.paper.contact_time
    assert estimate.paper.log_decrement == expected.paper.log_decrement
    assert estimate.free_decay.frequency == expected.free_decay.frequency
    assert np.isnan(estimate.paper.equivalent_stiffness.value)
    assert Note(Subject.STIFFNESS_AND_DAMPING, "the mass of heavy is not known") in estimate.notes


def test_without_the_hammers_mass_the_control_sample_says_nothing_of_it():
    session = Session(replace(SETUP, hammer_mass=np.nan))
    strike(session, "alike", 1)
    results = session.estimate_all()
    assert results.hammer.notes == (Note(Subject.K1, "the mass of hammer is not known"),)
    assert results.samples[0].paper.contact_time.is_known


def test_a_stated_stiffness_of_the_hammer_takes_the_control_samples_place():
    measured = Session(SETUP)
    strike(measured, "alike", 1)
    strike(measured, "heavy", 2)
    k1 = measured.estimate_hammer().stiffness.value
    samples = replace(SETUP.samples, control_sample="")
    session = Session(replace(SETUP, samples=samples, hammer_stiffness=k1))
    strike(session, "heavy", 2)
    expected = measured.estimate_sample("heavy").paper.stiffness.value
    assert session.estimate_sample("heavy").paper.stiffness.value == pytest.approx(
        expected, rel=1e-12
    )


@pytest.mark.parametrize(
    ("signs", "named"),
    [((-1, 1), "hammer and sample"), ((-1, -1), "hammer"), ((1, 1), "sample")],
)
def test_a_hit_of_the_other_sign_is_named_and_in_no_mean(signs, named):
    sound, mixed = Session(SETUP), Session(SETUP)
    hits = []
    for record in range(1, 7):
        impact, label = Impact(seed=record, resonance=300e3), HitLabel("alike", record, record)
        hits += mixed.feed(
            replace(impact, signs=(1, -1) if record % 2 else signs).make_block(label)
        )
        if record % 2:
            sound.feed(impact.make_block(label))
    assert [hit.accepted for hit in hits] == [True, False] * 3
    (told,) = hits[1].rejections
    assert str(told) == f"polarity: {named} of the other sign than in the hits before"
    ours, theirs = (session.estimate_sample("alike") for session in (mixed, sound))
    assert ours.paper.contact_time.value == theirs.paper.contact_time.value


SIMULATED_ORIGIN = Origin(SIMULATED, "virtual rig, plant published")


def judge_another(**changes: Any) -> tuple[Session, JudgedHit]:
    """Strike a sample three times, then once with other blocks; return session and last hit."""
    session = Session(SETUP)
    strike_series(session, [900.0, 890.0, 910.0])
    (hit,) = session.feed(replace(make_block(4), **changes))
    return session, hit


def make_block(record: int, sample: str = "alike", rate: float = RATE) -> Block:
    """Return a hit of 200 us, whole, at another rate if need be."""
    place, width = round(500e-6 * rate), round(200e-6 * rate)
    rise = np.sin(np.pi * np.arange(width) / width) ** 2
    hammer = np.random.default_rng(record).standard_normal(round(2500e-6 * rate))
    hammer[place : place + width] += 900.0 * rise
    counts = np.rint(hammer).astype(np.int32)
    channel = ChannelBlock(counts, FULL_SCALE / 2048, 0.0, FULL_SCALE)
    label = HitLabel(sample, record, record)
    return Block(0, rate, channel, replace(channel, output=-counts), label, last=True)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            {"origin": SIMULATED_ORIGIN},
            "simulated (virtual rig, plant published), the hits before unknown",
        ),
        (
            {"specimen": ChannelBlock(np.empty(0), 1.0, 0.0, 0.0)},
            "of one channel, the hits before of 2",
        ),
        (
            vars(make_block(4, rate=2e6)),
            "sampled at 2000000 Hz, the hits before sampled at 1000000 Hz",
        ),
    ],
)
def test_hits_of_another_kind_share_no_mean(changes, told):
    session, hit = judge_another(**changes)
    assert [item.reason for item in hit.rejections] == [Reason.OTHER_KIND]
    assert told in str(hit.rejections[0])
    sound = Session(SETUP)
    strike_series(sound, [900.0, 890.0, 910.0])
    ours, theirs = (each.estimate_sample("alike") for each in (session, sound))
    assert ours.paper.contact_time == theirs.paper.contact_time
    assert (ours.impacts_accepted, ours.impacts_rejected) == (3, 1)


@pytest.mark.parametrize("sample", ["alike", "heavy"])
def test_a_hit_that_equals_another_point_by_point_counts_once(sample):
    session, first = judge_another()
    copied = replace(make_block(4), label=HitLabel(sample, 5, 5))
    (hit,) = session.feed(copied)
    assert [item.reason for item in hit.rejections] == [Reason.COPY]
    assert str(first.label) in str(hit.rejections[0])
    points = copied.hammer.output.copy()
    points[points.argmax()] += 1
    apart = replace(copied, hammer=replace(copied.hammer, output=points))
    (hit,) = session.feed(replace(apart, label=HitLabel(sample, 6, 6)))
    assert hit.accepted


def test_a_rate_that_is_too_low_for_the_low_pass_shuts_no_other_hits_away():
    session, hit = judge_another(**vars(make_block(4, rate=100e3)))
    (found,) = hit.rejections
    assert found.reason is Reason.FEW_POINTS
    assert "a sampling rate of 100 kHz is too low for the 50 kHz low-pass" in str(found)
    assert session.estimate_all().samples[0].impacts_accepted == 3


@pytest.mark.parametrize("changes", [{"origin": SIMULATED_ORIGIN}, {"signs": -1}])
def test_a_hit_of_another_kind_or_sign_cannot_be_accepted_although_it_is_weak(changes):
    """What is wrong with it besides hides nothing."""
    block = make_block(4)
    weak = replace(block.hammer, scale=changes.pop("signs", 1) * 0.1 * block.hammer.scale)
    session = Session(SETUP, Overrules(accepted=frozenset({block.label})))
    strike_series(session, [900.0, 890.0, 910.0])
    with pytest.raises(ParameterError, match="it shares no mean with the others"):
        session.feed(replace(block, hammer=weak, **changes))


def test_a_simulated_control_sample_says_nothing_of_a_measured_one():
    session = Session(SETUP)
    session.feed(replace(make_block(1), origin=SIMULATED_ORIGIN))
    session.feed(replace(make_block(2, "heavy"), origin=Origin(MEASURED, "sound card")))
    session.feed(replace(make_block(3, "third"), origin=SIMULATED_ORIGIN))
    heavy, third = map(session.estimate_sample, ("heavy", "third"))
    why = "k1: the control sample 'alike' has hits that are simulated"
    assert any(
        note.startswith(why) and note.endswith(", not measured") for note in map(str, heavy.notes)
    )
    assert not heavy.paper.stiffness.is_known
    assert heavy.paper.contact_time.is_known
    assert third.paper.stiffness.is_known


def test_what_counts_is_what_is_averaged():
    """As the first hit turns out to be the odd one."""
    session = Session(SETUP)
    for record in range(1, 11):
        wide = 1.1 if record == 1 else 1.0
        impact = Impact(seed=record, resonance=300e3, duration=wide * DURATION)
        session.feed(impact.make_block(HitLabel("alike", record, record)))
    count = session.count_hits()["alike"]
    results = session.estimate_all()
    assert (count.kept, count.left_out) == (len(results.accepted), len(results.rejected)) == (9, 1)
    # The tenth impact had an attempt already.
    assert count.attempts == 1


def test_traces_stay_in_single_precision_only():
    session, traces = Session(SETUP), []
    for record in range(1, 10):
        (hit,) = strike(session, SETUP.samples.names[record % 3], record)
        assert hit.filtered is not None
        # Views of the same array would keep it alive, too.
        traces.append(weakref.ref(hit.filtered.traces))
        del hit
    gc.collect()
    assert not [1 for trace in traces[:-1] if trace() is not None]


def test_every_hit_counts_although_every_other_shows_the_scatter():
    # Of 128 hits all show the scatter, of 130 every other.
    heights = [900.0 + 5.0 * (record % 9) for record in range(130)]
    session = Session(SETUP)
    strike_series(session, heights[:128])
    expected = session.estimate_sample("alike")
    strike_series(session, heights[128:], first=129)
    found = session.estimate_sample("alike")
    said = Note(Subject.SCATTER, "that of 65 of 130 hits, evenly over the series")
    assert said in found.notes
    assert not any("evenly" in note.explanation for note in expected.notes)
    assert (expected.impacts_accepted, found.impacts_accepted) == (128, 130)
    # Of 65 hits the scatter is known to a tenth; as that of a mean of 65 it would be larger by
    # half.
    for uncertainties in (
        [item.paper.contact_time.standard for item in (found, expected)],
        [item.paper.damping_ratio.standard for item in (found, expected)],
    ):
        assert 0.8 < uncertainties[0] / uncertainties[1] < 1.2


def test_results_do_not_depend_on_what_was_asked_before():
    asked, quiet = Session(SETUP), Session(SETUP)
    for session in (asked, quiet):
        strike_series(session, [900.0, 890.0, 910.0])
        if session is asked:
            session.estimate_sample("alike")
        strike_series(session, [900.0, 905.0], "heavy", first=4)
        if session is asked:
            session.estimate_hammer("heavy")
            session.estimate_numbers("alike")
            session.estimate_sample("heavy")
    assert repr(asked.estimate_all()) == repr(quiet.estimate_all())


def test_the_control_samples_stiffness_knows_of_the_hammers():
    """Both are of the same hits: k2 = k1 = 2 k_eq, with one and the same uncertainty."""
    session = Session(SETUP)
    strike_series(session, [900.0, 890.0, 910.0])
    session.estimate_hammer("heavy")
    k2, k1 = session.estimate_sample("alike").paper.stiffness, session.estimate_hammer().stiffness
    assert k2.value == pytest.approx(k1.value, rel=1e-12)
    assert k2.standard == pytest.approx(k1.standard, rel=1e-9)


def overrule(session, *verdicts):
    for record, verdict in verdicts:
        session.overrule(Overrule(record, verdict, "loose cable", "Ann"))


@pytest.mark.parametrize(
    "verdicts",
    [
        [(2, Verdict.REJECT)],
        # The weak one, and the first, which says what all are.
        [(4, Verdict.ACCEPT), (1, Verdict.REJECT)],
        [(1, Verdict.REJECT), (2, Verdict.REJECT), (1, Verdict.UNDO)],
    ],
)
def test_what_a_person_makes_of_a_hit_later_counts_as_if_it_had_been_known(verdicts):
    heights, later = [900.0, 890.0, 910.0, 100.0], Session(SETUP)
    strike_series(later, heights)
    as_judged = later.estimate_all()
    overrule(later, *verdicts)
    known = Overrules()
    for record, verdict in verdicts:
        known = known.add(Overrule(record, verdict, "loose cable", "Ann"))
    before = Session(SETUP, known)
    strike_series(before, heights)
    assert write(later) == write(before) != write_results(as_judged)
    assert later.count_hits() == before.count_hits()
    overrule(
        later,
        *((record, Verdict.UNDO) for record in (1, 2, 4) if later.overrules.is_decided(record)),
    )
    assert write(later) == write_results(as_judged)


def write(session):
    return write_results(session.estimate_all())


def write_results(results):
    return to_json(results_from_session(results, {}))


def test_results_say_who_left_a_hit_out_or_took_it_in_and_why():
    session = Session(SETUP)
    strike_series(session, [900.0, 890.0, 910.0, 100.0])
    overrule(session, (2, Verdict.REJECT), (4, Verdict.ACCEPT))
    _, rejected, _, taken = results_from_session(session.estimate_all(), {}).hits
    assert str(rejected.reasons[-1]) == "operator: left out by hand, by Ann: loose cable"
    assert str(taken.findings[-1]) == "operator: accepted by hand, by Ann: loose cable"


@pytest.mark.parametrize(
    ("record", "verdict", "told"),
    [
        (9, Verdict.REJECT, "has no hit of record 9"),
        (1, Verdict.UNDO, "record 1 is as the analysis judges it: nothing to undo"),
        (4, Verdict.ACCEPT, "it shares no mean with the others"),
    ],
)
def test_a_verdict_that_cannot_be_is_refused_and_nothing_changes(record, verdict, told):
    session = Session(SETUP)
    strike_series(session, [900.0, 890.0, 910.0])
    session.feed(replace(make_block(4), origin=SIMULATED_ORIGIN))
    before = write(session)
    with pytest.raises(ParameterError, match=told):
        overrule(session, (record, verdict))
    assert write(session) == before


def test_what_another_analysis_cannot_accept_is_as_it_judges_it():
    recorded = Overrules().add(Overrule(4, Verdict.ACCEPT))
    session = Session(SETUP, recorded)
    strike_series(session, [900.0, 890.0, 910.0])
    (hit,) = session.feed(replace(make_block(4), origin=SIMULATED_ORIGIN))
    assert [item.reason for item in hit.rejections] == [Reason.OTHER_KIND]
