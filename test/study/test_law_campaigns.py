"""The contact law on contacts of mixed losses, through sensors that are not stated."""

from .law_campaigns import ASKED, run_many

CAMPAIGNS = 4


def test_laws_of_mixed_losses_are_given_and_within_their_uncertainty():
    outcomes = list(run_many(CAMPAIGNS, seed=3))
    given = [outcome for outcome in outcomes if outcome.law.is_known]
    assert len(given) >= CAMPAIGNS - 1
    for name in ASKED:
        assert sum(outcome.ratios[name] > 1.5 for outcome in given) <= 1, name
