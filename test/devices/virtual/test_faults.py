"""Faults on request: by probability, or ordered for one hit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from impact_rig.core.errors import ParameterError
from impact_rig.core.signals.record import HitLabel
from impact_rig.devices.virtual.choices import Fault
from impact_rig.devices.virtual.faults import (
    FaultPlan,
    ScheduledFault,
    fault_from_name,
    faults_from_names,
    scheduled_fault_from_text,
)

LABEL = HitLabel("steel small", record=1, impact=3, attempt=1)


def draw(plan: FaultPlan, label: HitLabel = LABEL, seed: int = 1) -> tuple[Fault, ...]:
    return plan.draw(label, np.random.default_rng(seed))


def test_by_default_nothing_goes_wrong() -> None:
    assert all(draw(FaultPlan(), seed=seed) == () for seed in range(50))


def test_certainty_brings_every_fault_that_is_asked_for() -> None:
    assert draw(FaultPlan(1.0)) == tuple(Fault)
    asked = (Fault.OVERLOAD, Fault.DOUBLE_HIT)
    assert set(draw(FaultPlan(1.0, asked))) == set(asked)


def test_each_fault_comes_with_its_probability() -> None:
    random = np.random.default_rng(1)
    drawn = [FaultPlan(0.1).draw(LABEL, random) for _ in range(4000)]
    for fault in Fault:
        share = sum(fault in faults for faults in drawn) / 4000
        # Three standard deviations of 4000 draws.
        assert share == pytest.approx(0.1, abs=3 * np.sqrt(0.1 * 0.9 / 4000))


@given(probability=st.floats(0, 1), faults=st.sets(st.sampled_from(Fault)))
def test_a_draw_takes_the_same_from_its_source_whatever_comes(
    probability: float, faults: set[Fault]
) -> None:
    # So that what is drawn afterwards does not depend on the plan.
    random, reference = np.random.default_rng(5), np.random.default_rng(5)
    FaultPlan(probability, tuple(faults)).draw(LABEL, random)
    FaultPlan().draw(LABEL, reference)
    assert random.random() == reference.random()


@pytest.mark.parametrize(
    ("sample", "impact", "attempt", "comes"),
    [
        ("", 3, 1, True),
        ("steel small", 3, 1, True),
        ("brass large", 3, 1, False),
        ("", 4, 1, False),
        ("", 3, 2, False),
    ],
)
def test_an_ordered_fault_comes_once(sample: str, impact: int, attempt: int, comes: bool) -> None:
    plan = FaultPlan(scheduled=(ScheduledFault(Fault.WEAK_HIT, impact, sample),))
    label = HitLabel("steel small", record=9, impact=3, attempt=attempt)
    assert draw(plan, label) == ((Fault.WEAK_HIT,) if comes else ())


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("3:double_hit", ScheduledFault(Fault.DOUBLE_HIT, 3)),
        ("steel small/12:weak_hit", ScheduledFault(Fault.WEAK_HIT, 12, "steel small")),
        ("a/b:c/1:overload", ScheduledFault(Fault.OVERLOAD, 1, "a/b:c")),
    ],
)
def test_orders_are_read_from_text(text: str, expected: ScheduledFault) -> None:
    assert scheduled_fault_from_text(text) == expected


@pytest.mark.parametrize(
    "text", ["", "3", "double_hit", "x:double_hit", "-1:overload", "1.5:weak"]
)
def test_another_form_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(ParameterError) as error:
        scheduled_fault_from_text(text)
    assert repr(text) in str(error.value)
    assert "for example 3:double_hit" in str(error.value)


def test_impossible_orders_are_refused() -> None:
    with pytest.raises(ParameterError, match="impact number of a fault is 0: it must lie between"):
        scheduled_fault_from_text("0:overload")
    with pytest.raises(ParameterError, match="unknown fault 'earthquake': the virtual rig knows"):
        scheduled_fault_from_text("3:earthquake")
    with pytest.raises(ParameterError, match=r"fault probability is 1\.5: it must lie between"):
        FaultPlan(1.5)


def test_names_are_read_and_none_means_all() -> None:
    assert [fault_from_name(fault.value) for fault in Fault] == list(Fault)
    assert faults_from_names(["overload"]) == (Fault.OVERLOAD,)
    assert faults_from_names([]) == tuple(Fault)
    with pytest.raises(ParameterError, match="double_hit, overload, weak_hit, missed_trigger"):
        fault_from_name("double hit")
