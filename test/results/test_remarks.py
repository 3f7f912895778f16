"""What needs attention is said once, with its subject, the largest effect on a result first."""

from dataclasses import fields, replace

import pytest

from impact_rig.core.estimates.contact_law import ContactLaw
from impact_rig.core.estimates.paper_method import HammerEstimate, PaperEstimate
from impact_rig.core.estimates.pulse_shape import PulseShapeEstimate, ShapeFit
from impact_rig.core.estimates.ringing import BY_FREE_DECAY, FreeDecayEstimate, reach
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.given.findings import Finding, Note, Reason, Subject
from impact_rig.core.given.quantity import Quantity
from impact_rig.core.given.records import SIMULATED, Origin
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.core.hit.overrules import Overrule, Verdict
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.rig import VirtualRigSettings
from impact_rig.results.campaign import HitResults, Results
from impact_rig.results.references import PLANTS
from impact_rig.results.remarks import (
    Remark,
    describe_origin,
    find_common,
    gather_remarks,
    gather_sample_remarks,
    select_attention,
    tabulate_marks,
    tabulate_overrules,
)

KNOWN = {"stiffness": Quantity(45e6), "damping_coefficient": Quantity(1170.0)}
HAMMER = HammerEstimate(stiffness=Quantity(22e6))
LAW = ContactLaw(
    exponent=Quantity(1.5),
    duration=Quantity(200e-6, expanded=1e-6),
    restitution=Quantity(0.9, expanded=0.01),
    residual_percent=0.1,
)
SHAPE = PulseShapeEstimate("half-sine", True, 1.0, (ShapeFit("versed-sine", 3.0, 220e-6),))
CONTACT = {"contact_time": Quantity(220e-6), "contact_law": LAW, "pulse_shape": SHAPE}


def make_sample(name: str = "tin", *warnings: Note, **values: object) -> SampleEstimate:
    values = {**KNOWN, **values}
    names = {item.name for item in fields(PaperEstimate)} - {"warnings", "notes"}
    numbers = names & values.keys()
    paper = PaperEstimate(**{name: values.pop(name) for name in numbers})
    return SampleEstimate(name, 4, 0, warnings=warnings, paper=paper, **values)


def gather(*samples: SampleEstimate, hammer: HammerEstimate = HAMMER, **values: object):
    results = Results(PAPER_SETUP, hammer, samples, values.pop("hits", ()))
    return gather_remarks(results, **values)


def tell(*samples: SampleEstimate, **values: object) -> list[tuple[str, str]]:
    return [(remark.about, remark.text) for remark in gather(*samples, **values)]


def test_the_same_warning_is_said_once_of_all_samples():
    loud, odd = Note(Reason.RINGING, "loud"), Note(Subject.HITS, "odd")
    samples = [make_sample("tin", loud, odd), make_sample("zinc", loud)]
    assert tell(*samples) == [("all samples", "ringing: loud"), ("tin", "hits: odd")]


def test_what_one_hit_leaves_open_its_table_says():
    lone = make_sample(notes=(Note(Subject.UNCERTAINTY, "of one hit"), Note(Subject.MASS, "x")))
    assert len(tell(lone)) == 2
    few = tell(replace(lone, impacts_accepted=3))
    assert "strike 4 times or more" in few[0][1]
    assert tell(replace(lone, impacts_accepted=1)) == [few[0], ("tin", "mass: x")]


def test_two_notes_on_one_subject_are_both_told():
    notes = [Note(Subject.SENSOR, text) for text in ("hammer", "specimen", "both")]
    told = tell(make_sample("tin", *notes[:2]), make_sample("zinc", notes[2]))
    assert told == [
        ("tin", "sensor: hammer"),
        ("tin", "sensor: specimen"),
        ("zinc", "sensor: both"),
    ]


def test_details_that_differ_are_those_of_one_sample():
    names = ("tin", "zinc", "lead", "iron")
    samples = [make_sample(name, Note(Subject.MASS, name)) for name in names]
    told = tell(*samples, make_sample("gold"))
    assert told == [("4 of 5 samples", "mass: tin (tin; others alike)")]


def test_a_contact_law_says_how_far_k_is_off():
    # By hand: (220 / 200)^2 - 1 and (240 / 200)^2 - 1.
    long = make_sample("zinc", **{**CONTACT, "contact_time": Quantity(240e-6)})
    ((about, text),) = tell(make_sample(**CONTACT), long)
    assert about == "all samples"
    assert "k_eq by the contact law is 21 to 44 % higher" in text


@pytest.mark.parametrize(
    "law",
    [
        replace(LAW, duration=Quantity(219.5e-6, expanded=1e-6)),
        replace(LAW, restitution=Quantity(1.02, expanded=0.01)),
        replace(LAW, residual_percent=4.0),
        ContactLaw(),
    ],
)
def test_a_law_that_does_not_describe_the_pulse_better_says_nothing(law):
    assert tell(make_sample(**{**CONTACT, "contact_law": law})) == []


def test_dampings_that_differ_beyond_their_uncertainties_are_named():
    decay = FreeDecayEstimate(damping_ratio=Quantity(0.2, 0.005, 0.01))
    far, near = (
        make_sample(
            damping_ratio=reach(Quantity(ratio, 0.005, 0.01), decay.damping_ratio, BY_FREE_DECAY),
            free_decay=decay,
        )
        for ratio in (0.25, 0.215)
    )
    ((_, text),) = tell(far)
    assert "log decrement is 25 % higher than by the free decay" in text
    assert tell(near) == []


def test_what_changes_a_result_most_comes_first_and_further_methods_need_no_attention():
    notes = (
        Note(Subject.STIFFNESS_AND_DAMPING, "no mass"),
        Note(Subject.FREE_DECAY, "too short"),
        Note(Subject.CONTACT_LAW, "no law fits"),
    )
    bare = SampleEstimate("lead", 4, 0, notes=notes)
    lost = SampleEstimate("iron", 0, 1)
    hits = (
        HitResults("iron", 1, 1, 1, reasons=(Finding(Reason.WEAK, "3 %"),)),
        HitResults("tin", 1, 1, 2, accepted=True),
    )
    samples = (make_sample(**CONTACT), bare, lost)
    remarks = gather(*samples, hits=hits, reading=["it is cut"])
    assert [(remark.about, remark.text.partition(":")[0]) for remark in remarks] == [
        ("iron", "strike again, no hit was accepted"),
        ("tin", "the pulse is no versed-sine"),
        ("file", "it is cut"),
        ("lead", "k and c"),
        ("hits", "1 of 2 rejected"),
        ("lead", "free decay"),
        ("lead", "contact law"),
    ]
    assert len(select_attention(remarks)) == 5


def test_a_hammer_without_stiffness_needs_attention():
    (remark,) = gather(
        make_sample(), hammer=HammerEstimate(notes=(Note(Subject.K1, "no control sample"),))
    )
    assert (remark.about, remark.text) == ("hammer", "k1: no control sample")
    assert select_attention([remark])


def test_a_sample_by_itself_has_its_own_numbers():
    odd, notes = Note(Subject.HITS, "odd"), (Note(Subject.FREE_DECAY, "none"),)
    sample = make_sample("tin", odd, notes=notes, **CONTACT)
    law, *others = gather_sample_remarks(sample)
    assert "is 21 % higher" in law.text
    assert others == [
        Remark("hits: odd"),
        Remark("free decay: none"),
    ]


def test_notes_of_all_samples_are_said_of_them_at_once_and_those_of_a_plant_with_its_origin():
    of_all, own, known = (
        Note(about, "x") for about in (Subject.K1, Subject.HITS, Subject.MOMENTA)
    )
    samples = (make_sample("tin", of_all, own, known), make_sample("zinc", of_all))
    results = Results(PAPER_SETUP, HAMMER, samples, ())
    assert find_common(results) == {of_all}
    origin = Origin(SIMULATED, "virtual rig, plant published")
    hit = HitResults("tin", 1, 1, 1, accepted=True, origin=origin)
    simulated = replace(results, hits=(hit,))
    assert find_common(simulated) == {of_all, known}
    assert gather_sample_remarks(samples[0], find_common(simulated)) == [Remark("hits: x")]
    contact = replace(hit, origin=Origin(SIMULATED, "virtual rig, plant contact"))
    silent = HammerEstimate(Quantity(2e7), notes=(Note(Subject.C1, "no second peak"),))
    assert tell(make_sample(), hammer=silent) == [("hammer", "c1: no second peak")]
    assert tell(make_sample(), hammer=silent, hits=(contact,)) == []
    alike = replace(
        results, samples=(make_sample("tin", **CONTACT), make_sample("zinc", **CONTACT))
    )
    assert gather_sample_remarks(alike.samples[0], find_common(alike)) == []
    assert len(gather_sample_remarks(alike.samples[0])) == 1


def test_every_hit_has_a_mark_in_its_order_with_brackets_where_a_person_decided():
    overrule = Overrule(3, Verdict.REJECT, "loose cable", "Ann", 1_700_000_000_000_000_000)
    double = Finding(Reason.DOUBLE_HIT, "a second pulse")
    hits = (
        HitResults("tin", 2, 1, 3, reasons=(double, overrule.finding)),
        HitResults("tin", 1, 1, 1, accepted=True),
        HitResults("tin", 1, 2, 2, reasons=(double,)),
    )
    results = Results(PAPER_SETUP, HAMMER, (make_sample(),), hits)
    (marks,) = tabulate_marks(results)
    assert marks.rows == [("tin", "✓ ✗ (✗)", "1", "2")]
    (decided,) = tabulate_overrules(results, [(hits[0].label, overrule)])
    assert decided.rows == [
        ("3 (tin/2.1)", "left out by hand", "loose cable", "Ann", "2023-11-14 22:13:20 UTC",
         "double_hit: a second pulse"),
    ]  # fmt: skip
    assert tabulate_overrules(results, []) == []


@pytest.mark.parametrize("plant", Plant)
def test_the_origin_says_what_is_true_of_each_plant(plant):
    origin = VirtualRigSettings(plant=plant).origin
    assert describe_origin([origin]) == f"Origin: {origin}.\n{PLANTS[origin.source].description}"


def test_a_plant_without_damping_lacks_nothing():
    origin = Origin(SIMULATED, "virtual rig, plant contact")
    unknown = Quantity(float("nan"))
    sample = make_sample(notes=(Note(Subject.C2, "no second peak"),), damping_coefficient=unknown)
    hit = HitResults("tin", 1, 1, 1, accepted=True, origin=origin)
    assert not select_attention(gather(sample, hits=(hit,)))
    assert select_attention(gather(sample))
