"""A person's word on single hits: named without doubt, recorded, and never impossible."""

from typing import Any

import pytest

from impact_rig.core.errors import ParameterError
from impact_rig.core.hits import (
    FilteredHit,
    JudgedHit,
    Overrules,
    describe_overruled,
    find_label,
    overrule_hit,
)
from impact_rig.core.records import HitLabel
from impact_rig.core.verdict import Finding, Reason

FIRST = HitLabel("steel small", 17, 3, 1)
SECOND = HitLabel("steel small", 18, 3, 2)
OTHER = HitLabel("brass", 3, 1, 1)
LABELS = (FIRST, SECOND, OTHER)
WEAK = Finding(Reason.WEAK, "too weak")


def make_hit(label: HitLabel, *rejections: Finding, pulse: bool = True) -> JudgedHit:
    filtered: Any = object.__new__(FilteredHit) if pulse else None
    return JudgedHit(label, rejections, filtered=filtered)


@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("17", FIRST),
        ("3", OTHER),
        ("steel small/3.1", FIRST),
        ("steel small/3.2", SECOND),
        ("brass/1", OTHER),
        ("brass/1.1", OTHER),
    ],
)
def test_a_hit_is_called_by_record_or_by_place(name, label):
    assert find_label(name, LABELS) == label


@pytest.mark.parametrize("name", ["19", "steel", "brass/2", "brass/1.2", "", "17.1"])
def test_an_unknown_hit_is_named(name):
    with pytest.raises(ParameterError, match=f"there is no hit '{name}'") as error:
        find_label(name, LABELS)
    assert "records 3 to 18" in str(error.value)


def test_a_place_with_several_attempts_is_not_guessed():
    with pytest.raises(ParameterError) as error:
        find_label("steel small/3", LABELS)
    assert "17 (steel small/3.1), 18 (steel small/3.2)" in str(error.value)


def test_a_hit_named_in_both_is_refused():
    with pytest.raises(ParameterError, match=r"hit 17 \(steel small/3\.1\) is both"):
        Overrules(frozenset({FIRST}), frozenset({FIRST}))


def test_a_hit_rejected_by_hand_keeps_its_other_reasons():
    hit = overrule_hit(make_hit(FIRST, WEAK), Overrules(rejected=frozenset({FIRST})))
    assert [str(item) for item in hit.rejections] == [
        "weak: too weak",
        "operator: left out by hand",
    ]


def test_a_hit_accepted_by_hand_remembers_what_was_against_it():
    hit = overrule_hit(make_hit(FIRST, WEAK), Overrules(accepted=frozenset({FIRST})))
    assert hit.accepted
    assert describe_overruled(hit, "hit 17") == (
        "hit 17 accepted by hand, although weak: too weak"
    )


@pytest.mark.parametrize(
    ("hit", "told"),
    [
        (make_hit(FIRST, WEAK, pulse=False), r"no pulse that could be measured \(weak: too weak"),
        (make_hit(FIRST, Finding(Reason.POLARITY, "")), "a mean of both signs is of neither"),
    ],
)
def test_what_no_mean_can_hold_cannot_be_accepted_by_hand(hit, told):
    with pytest.raises(ParameterError, match=rf"hit 17 .* cannot be accepted by hand: .*{told}"):
        overrule_hit(hit, Overrules(accepted=frozenset({FIRST})))
