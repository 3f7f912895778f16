"""Messages of other campaigns are told apart by one comparison of ids."""

import pytest
from impact_rig_msgs.msg import Impact, StreamBlock

from impact_rig.nodes import interfaces
from impact_rig.nodes.identity import Identity, Membership, id_to_msg, make_id
from impact_rig.recordings.messages import NO_ID

WITHOUT_ID = {"note", "replayer/state"}
"""Anybody's remarks, and what a replay says of itself."""
TOPICS = [topic for topic in interfaces.RECORDED_TOPICS if topic.name not in WITHOUT_ID]


@pytest.mark.parametrize("topic", [*TOPICS, interfaces.STREAM], ids=lambda topic: topic.name)
def test_every_message_of_the_rig_carries_the_id(topic):
    assert hasattr(topic.type(), "campaign_id")


@pytest.fixture
def warnings():
    return []


@pytest.fixture
def membership(warnings):
    return Membership(warnings.append)


def of(campaign_id):
    return Impact(campaign_id=id_to_msg(campaign_id))


def test_a_node_that_has_joined_none_takes_everything(membership, warnings):
    assert not membership.is_foreign(of(make_id()), "impact")
    assert not membership.is_foreign(of(NO_ID), "impact")
    assert not warnings


def test_what_carries_another_id_is_foreign_and_warned_of_once(membership, warnings):
    own, other = make_id(), make_id()
    assert membership.join(Identity(own))
    assert not membership.join(Identity(own))
    for _ in range(3):
        assert not membership.is_foreign(of(own), "impact")
        assert membership.is_foreign(of(other), "impact")
    (warning,) = warnings
    assert warning.startswith("impact carries the id of another campaign")


def test_the_accelerometers_stream_is_no_foreign_one_while_a_campaign_begins(membership):
    own, other = Identity(make_id(), make_id()), Identity(make_id(), make_id())
    membership.join(own)
    block = StreamBlock()
    for identity in (Identity(NO_ID, own.stream_id), Identity(own.campaign_id), own):
        identity.fill(block)
        assert not membership.is_foreign(block, "acceleration/stream")
    other.fill(block)
    assert membership.is_foreign(block, "acceleration/stream")


def test_no_id_is_an_id_like_another(membership):
    membership.join(Identity(make_id()))
    assert membership.is_foreign(of(NO_ID), "impact")
    membership.join(Identity(NO_ID))
    assert not membership.is_foreign(of(NO_ID), "impact")
    assert membership.is_foreign(of(make_id()), "impact")
