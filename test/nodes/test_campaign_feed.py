"""What a display that comes late gets of a campaign, in whichever order its topics arrive."""

from impact_rig_msgs import msg

from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.nodes.campaign_feed import CampaignFeed
from impact_rig.nodes.identity import Identity, make_id
from impact_rig.nodes.intake import Received
from impact_rig.nodes.messages import setup_to_msg, stamp_to_msg


def make_setup(identity):
    message = identity.fill(setup_to_msg(PAPER_SETUP, stamp_to_msg(7)))
    return Received(PAPER_SETUP, message)


def make_hit(identity, record):
    return Received(record, identity.fill(msg.Impact(record=record)))


def test_hits_wait_for_their_set_up_and_those_of_other_campaigns_are_left_out():
    before, now = Identity(make_id()), Identity(make_id())
    told = []
    feed = CampaignFeed(
        lambda setup: told.append(setup.identity), lambda hit: told.append(hit.value)
    )
    feed.on_finding(make_hit(now, 1))
    feed.on_finding(make_hit(before, 9))
    feed.on_setup(make_setup(now))
    feed.on_finding(make_hit(now, 2))
    feed.on_setup(make_setup(now))
    feed.on_finding(make_hit(before, 10))
    assert told == [now, 1, 2]
    feed.on_setup(make_setup(before))
    assert told == [now, 1, 2, before, 9, 10]
