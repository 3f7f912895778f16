"""What a rig adds to the environment, so that the nodes of several computers hear each other."""

import pytest

from impact_rig.configuration.network import (
    DISCOVERY,
    PROFILES,
    TRANSPORTS,
    find_network_variables,
)

LARGE_SOCKETS = "DEFAULT?sockets_size=4000000B"


def test_a_rig_stays_on_its_computer_unless_told_otherwise():
    assert find_network_variables({}, network=False) == {DISCOVERY: "LOCALHOST"}


def test_between_computers_sockets_hold_a_block_of_the_stream():
    assert find_network_variables({}, network=True) == {
        DISCOVERY: "SUBNET",
        TRANSPORTS: LARGE_SOCKETS,
    }


@pytest.mark.parametrize("network", [True, False])
@pytest.mark.parametrize(
    ("chosen", "expected"),
    [("SUBNET", {TRANSPORTS: LARGE_SOCKETS}), ("LOCALHOST", {}), ("OFF", {})],
)
def test_what_the_environment_says_of_the_range_goes_first(chosen, expected, network):
    assert find_network_variables({DISCOVERY: chosen}, network=network) == expected


@pytest.mark.parametrize("name", [TRANSPORTS, *PROFILES])
def test_transports_that_somebody_has_chosen_are_left_alone(name):
    assert find_network_variables({name: "own"}, network=True) == {DISCOVERY: "SUBNET"}
