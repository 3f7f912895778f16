"""Quality of service is written as rosbag2 does, and read from any of its versions."""

import pytest

from impact_rig.recordings.qos import OfferedQos, choose_qos, format_offered_qos, parse_offered_qos

LATCHED = OfferedQos("reliable", "transient_local", "keep_last", 16)
BEST_EFFORT = OfferedQos("best_effort", "volatile", "unknown", 0, lifespan=10_000_000_250)


@pytest.mark.parametrize("profiles", [(), (LATCHED,), (LATCHED, BEST_EFFORT)])
def test_what_is_written_is_read_again(profiles):
    assert parse_offered_qos(format_offered_qos(profiles)) == profiles


def test_numbers_of_older_rosbag2_are_understood():
    text = "- {history: 3, depth: 0, reliability: 2, durability: 1}"
    assert parse_offered_qos(text) == (OfferedQos("best_effort", "transient_local", "unknown", 0),)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "  ",
        "[",
        "5",
        "- 3",
        "a: b",
        "- [1]",
        "[" * 2000,
        "- 2001-99-99",
        "- depth: 1\n" * 10_000,
    ],
    ids=range(10),
)
def test_what_cannot_be_understood_says_nothing(text):
    assert parse_offered_qos(text) == ()


def test_strange_values_fall_back_to_the_defaults_of_ros():
    text = "- {history: [], depth: x, reliability: {}, durability: 77, lifespan: 3}"
    assert parse_offered_qos(text) == (OfferedQos("reliable", "volatile", "unknown", 0),)


def test_publishers_that_agree_are_followed():
    assert choose_qos((LATCHED, LATCHED)) == LATCHED
    assert choose_qos((BEST_EFFORT,)) == OfferedQos("best_effort", "volatile", "keep_last", 10)


def test_publishers_that_differ_give_the_default():
    assert choose_qos((LATCHED, BEST_EFFORT)) == OfferedQos(
        "reliable", "volatile", "keep_last", 16
    )
    assert choose_qos(()) == OfferedQos()
