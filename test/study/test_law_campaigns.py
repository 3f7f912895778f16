"""The contact law on contacts of mixed losses, through sensors that are not stated."""

import math

import numpy as np
import pytest

from impact_rig.core.session import Session

from .law_campaigns import ASKED, draw_laboratory, run_many, strike

CAMPAIGNS = 12


def test_laws_of_mixed_losses_are_given_and_within_their_uncertainty():
    outcomes = list(run_many(CAMPAIGNS, seed=3))
    given = [outcome for outcome in outcomes if outcome.law.is_known]
    # Nine in ten of many.
    assert len(given) >= CAMPAIGNS * 2 // 3
    for name in ASKED:
        off = sum(outcome.ratios[name] > 1.5 for outcome in given)
        assert off <= 1, name


@pytest.mark.parametrize(
    ("number", "name", "source"),
    [
        (97, "exponent", "what the contact law leaves"),
        (100, "impact_speed", "scatter of the hits on struck"),
        (129, "restitution", "form of the loss"),
        (44, "exponent", "zero after the impact"),
    ],
)
def test_without_a_line_of_its_budget_the_truth_falls_outside(number, name, source):
    random = np.random.default_rng((1, number))
    struck = strike(draw_laboratory(random), random)
    session = Session(struck.setup)
    for block in struck.blocks:
        session.feed(block)
    found = getattr(session.estimate_sample("struck").contact_law, name)
    (line,) = (line for line in found.budget if line.source == source)
    others = math.sqrt(max(found.standard**2 - line.contribution**2, 0.0))
    error = abs(found.value - struck.truth[name])
    assert found.expanded / found.standard * others < error <= found.expanded
