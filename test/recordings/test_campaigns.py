"""Where a campaign begins: one table for recordings, replays and live nodes."""

from types import SimpleNamespace

import pytest

from impact_rig.recordings.campaigns import CampaignWatch
from impact_rig.recordings.fields import NO_ID

A, B = b"a" * 16, b"b" * 16


def make_setup(campaign: bytes, seconds: int) -> SimpleNamespace:
    """Return a set-up as a message of a version without trials."""
    header = SimpleNamespace(stamp=SimpleNamespace(sec=seconds, nanosec=0))
    ids = SimpleNamespace(uuid=campaign)
    return SimpleNamespace(header=header, campaign_id=ids, plan=SimpleNamespace())


@pytest.mark.parametrize(
    ("setups", "begins"),
    [
        # Every row: set-ups as (id, stamp [s]), and which of them begin a campaign.
        ([(A, 1)], [True]),
        ([(NO_ID, 0)], [True]),  # the campaign node has started; hits before it are its own
        ([(NO_ID, 0), (A, 1)], [True, True]),
        ([(A, 1), (A, 1)], [True, False]),  # the run was resumed, or the replay loops
        ([(A, 1), (A, 2)], [True, False]),
        ([(A, 1), (NO_ID, 0), (A, 1)], [True, False, False]),  # the campaign node was restarted
        ([(A, 1), (A, 0)], [True, False]),
        ([(A, 1), (B, 2), (B, 2)], [True, True, False]),
        ([(NO_ID, 1), (NO_ID, 1)], [True, True]),  # without ids each one begins a campaign
    ],
)
def test_a_set_up_begins_a_campaign_or_repeats_one(setups, begins):
    watch = CampaignWatch()
    assert [watch.add_setup(make_setup(*setup)) for setup in setups] == begins
