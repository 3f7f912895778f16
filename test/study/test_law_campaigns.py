"""The contact law on contacts of mixed losses, through sensors that nobody states."""

from .law_campaigns import ASKED, run_many

CAMPAIGNS = 12


def test_laws_of_mixed_losses_are_given_and_within_their_uncertainty():
    outcomes = list(run_many(CAMPAIGNS, seed=3))
    given = [outcome for outcome in outcomes if outcome.law.is_known]
    # Seven in eight of many.
    assert len(given) >= CAMPAIGNS * 2 // 3
    for name in ASKED:
        off = sum(outcome.ratios[name] > 1.5 for outcome in given)
        assert off <= 1, name
