"""Messages of other campaigns are told apart by one comparison of ids."""

import math

import pytest
from impact_rig_msgs.msg import Impact, StreamBlock

from impact_rig.nodes import interfaces
from impact_rig.nodes.identity import Identity, Membership, id_to_msg, make_id
from impact_rig.recordings.fields import NO_ID

WITHOUT_ID = {"note", "page/act", "replayer/state", "overrule/stored", "accelerometer/levels"}
"""Anybody's remarks, a replay's state, the stamp of an overrule, inputs without a campaign."""
TOPICS = [topic for topic in interfaces.RECORDED_TOPICS if topic.name not in WITHOUT_ID]


@pytest.mark.parametrize("topic", [*TOPICS, interfaces.STREAM], ids=lambda topic: topic.name)
def test_every_message_of_the_rig_carries_the_id(topic):
    assert hasattr(topic.type(), "campaign_id")


@pytest.fixture
def membership():
    return Membership()


def of(campaign_id):
    return Impact(campaign_id=id_to_msg(campaign_id), contact_time=math.nan)


def test_what_carries_another_id_is_foreign_once_a_node_has_joined(membership):
    own, other = make_id(), make_id()
    assert not any(map(membership.is_foreign, (of(other), of(NO_ID))))
    membership.join(Identity(own))
    assert not membership.is_foreign(of(own))
    assert membership.is_foreign(of(other))


def test_the_accelerometers_stream_is_no_foreign_one_while_a_campaign_begins(membership):
    own, other = Identity(make_id(), make_id()), Identity(make_id(), make_id())
    membership.join(own)
    block = StreamBlock()
    for identity in (Identity(NO_ID, own.stream_id), Identity(own.campaign_id), own):
        identity.fill(block)
        assert not membership.is_foreign(block)
    other.fill(block)
    assert membership.is_foreign(block)


def test_no_id_is_an_id_like_another(membership):
    membership.join(Identity(make_id()))
    assert membership.is_foreign(of(NO_ID))
    membership.join(Identity(NO_ID))
    assert not membership.is_foreign(of(NO_ID))
    assert membership.is_foreign(of(make_id()))
