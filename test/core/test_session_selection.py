"""Which hits of a session are in the means: outliers, the most consistent, and a person's word."""

from dataclasses import replace

import pytest

from impact_rig.core.errors import ParameterError
from impact_rig.core.hits import Overrules
from impact_rig.core.records import Block, HitLabel
from impact_rig.core.session import Session
from impact_rig.core.verdict import Reason

from .blocks import SETUP, make_blocks, make_counts
from .struck import Impact


def test_a_hit_without_a_pulse_cannot_be_taken_in():
    label = HitLabel("alike", 7)
    session = Session(SETUP, Overrules(accepted=frozenset({label})))
    quiet = make_counts([], 2500)
    (block,) = make_blocks(quiet, quiet, [2500], label=label)
    with pytest.raises(ParameterError, match=r"hit 7 .* no pulse that could be measured"):
        session.feed(block)
    assert session.get_selection("alike").kept == ()


def turn(blocks: list[Block], *, hammer: bool, sample: bool) -> list[Block]:
    return [
        replace(
            block,
            hammer=replace(
                block.hammer, output=-block.hammer.output if hammer else block.hammer.output
            ),
            specimen=replace(
                block.specimen, output=-block.specimen.output if sample else block.specimen.output
            ),
        )
        for block in blocks
    ]


class TestPolarity:
    """Hits of both signs are never averaged."""

    @pytest.mark.parametrize(
        ("hammer", "sample", "named"),
        [(True, True, "hammer and sample"), (True, False, "hammer"), (False, True, "sample")],
    )
    @pytest.mark.parametrize("turns", [False, True])
    def test_the_other_sign_is_named_and_rejected_or_turned(self, hammer, sample, named, turns):
        sound, mixed = (
            Session(replace(SETUP, analysis=replace(SETUP.analysis, turns_polarity=turns)))
            for _ in range(2)
        )
        hits = []
        for record in range(1, 7):
            impact = Impact(seed=record, resonance=300e3)
            block = impact.make_block(HitLabel("alike", record, record))
            sound.feed(block)
            is_turned = record % 2 == 0
            (other,) = turn([block], hammer=hammer and is_turned, sample=sample and is_turned)
            hits += mixed.feed(other)
        assert [hit.accepted for hit in hits] == [True, turns] * 3
        told = hits[1].findings if turns else hits[1].rejections
        assert [item.reason for item in told] == [Reason.POLARITY]
        assert told[0].explanation.startswith(f"{named} of the other sign than in the hits before")
        ours, theirs = (session.estimate_sample("alike") for session in (mixed, sound))
        if turns:
            assert ours.contact_time.value == theirs.contact_time.value
            assert ours.contact_law.duration.value == theirs.contact_law.duration.value
        else:
            assert ours.contact_time.value == pytest.approx(theirs.contact_time.value, rel=2e-3)

    def test_a_hit_of_the_other_sign_cannot_be_accepted_by_hand(self):
        first, second = (HitLabel("alike", record, record) for record in (1, 2))
        session = Session(SETUP, Overrules(frozenset({second})))
        session.feed(Impact().make_block(first))
        with pytest.raises(ParameterError, match="of both signs is of neither; turns_polarity"):
            session.feed(Impact(signs=(-1, 1)).make_block(second))
