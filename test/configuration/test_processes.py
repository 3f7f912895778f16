"""One list says which processes make a rig, whoever starts them."""

from datetime import datetime

import pytest

from impact_rig.configuration.processes import (
    DISCOVERY,
    NETWORK,
    PROFILES,
    TRANSPORTS,
    list_rig_processes,
    make_network_variables,
    make_run_folder_name,
    make_viewer_parameters,
)
from impact_rig.core.errors import ParameterError

LARGE_SOCKETS = "DEFAULT?sockets_size=4000000B"


@pytest.mark.parametrize("environment", [{}, {DISCOVERY: "SUBNET", NETWORK: "1"}])
def test_a_rig_stays_on_its_computer_unless_told_otherwise(environment):
    expected = {NETWORK: "0", DISCOVERY: "LOCALHOST"}
    assert make_network_variables(environment, network=False) == expected


def test_between_computers_sockets_hold_a_block_of_the_stream():
    assert make_network_variables({}, network=True) == {
        NETWORK: "1",
        DISCOVERY: "SUBNET",
        TRANSPORTS: LARGE_SOCKETS,
    }


@pytest.mark.parametrize(
    ("chosen", "expected"),
    [("SUBNET", {TRANSPORTS: LARGE_SOCKETS}), ("LOCALHOST", {}), ("OFF", {})],
)
def test_between_computers_what_the_environment_says_of_the_range_goes_first(chosen, expected):
    found = make_network_variables({DISCOVERY: chosen}, network=True)
    assert found == {NETWORK: "1", **expected}


@pytest.mark.parametrize("name", [TRANSPORTS, *PROFILES])
def test_transports_that_somebody_has_chosen_are_left_alone(name):
    assert make_network_variables({name: "own"}, network=True) == {
        NETWORK: "1",
        DISCOVERY: "SUBNET",
    }


LIVE: dict[str, object] = {}
ADDRESS = "rerun+http://desk:9876/proxy"


def by_name(**options):
    return {item.name: dict(item.parameters) for item in list_rig_processes("out", **options)}


def test_a_whole_rig_records_and_shows_into_its_folder():
    nodes = by_name(
        rig_file="my.toml", source={"seed": 3, "plant": "dynamics"}, swing={"swing_time": 0.3}
    )
    assert nodes == {
        "hammer": {"rig_file": "my.toml", "swing_time": 0.3},
        "accelerometer": {"rig_file": "my.toml", "source": 'seed = 3\nplant = "dynamics"'},
        "estimator": LIVE,
        "campaign": {"rig_file": "my.toml"},
        "recorder": {**LIVE, "output": "out/session.mcap", "attachments": "my.toml"},
        "visualizer": {**LIVE, "output": "out/session.rrd"},
    }


def test_a_running_stream_is_recorded_where_there_is_one():
    nodes = by_name(continuous=True, record_stream=True)
    assert nodes["accelerometer"] == {"mode": "continuous"}
    assert nodes["recorder"] == {**LIVE, "output": "out/session.mcap", "record_stream": True}
    for options in ({"overrides": {"accelerometer": {"mode": "continuous"}}},):
        assert by_name(record_stream=True, **options)["recorder"]["record_stream"]
    with pytest.raises(ParameterError, match="there is no running stream to record"):
        by_name(record_stream=True)


def test_two_computers_share_the_nodes_of_one_rig():
    whole = by_name(continuous=True, rig_file="my.toml", viewers=("web",))
    at_the_devices = by_name(
        continuous=True, rig_file="my.toml", viewers=("web",),
        only=("hammer", "accelerometer"),
    )  # fmt: skip
    elsewhere = by_name(
        continuous=True, rig_file="my.toml", viewers=("web",),
        only=("visualizer", "campaign", "estimator", "recorder"),
    )  # fmt: skip
    assert at_the_devices.keys() == {"hammer", "accelerometer"}
    assert at_the_devices | elsewhere == whole


@pytest.mark.parametrize(
    ("options", "name"), [({}, "hamer"), ({"visualize": False}, "visualizer")]
)
def test_a_node_that_the_rig_has_not_cannot_be_started_alone(options, name):
    with pytest.raises(ParameterError, match=rf"no node '{name}' to start: the rig has \['hammer"):
        by_name(only=("hammer", name), **options)


def test_viewers_stand_beside_the_file():
    assert by_name(viewers=("spawn", "web", ADDRESS))["visualizer"] == {
        **LIVE,
        "output": "out/session.rrd",
        "spawn": True,
        "web": True,
        "connect": ADDRESS,
    }
    assert make_viewer_parameters(["web", "web", ADDRESS, ADDRESS]) == {
        "web": True,
        "connect": ADDRESS,
    }


@pytest.mark.parametrize(
    ("viewers", "expected"),
    [
        (("browser",), r"viewer is 'browser': it must be spawn, web, or an address"),
        (("http://desk/",), r"viewer is 'http://desk/'"),
        ((ADDRESS, "rerun+http://lab/proxy"), r"two viewers elsewhere"),
    ],
)
def test_a_viewer_that_cannot_be_meant_is_named(viewers, expected):
    with pytest.raises(ParameterError, match=expected):
        by_name(viewers=viewers)


def test_a_viewer_needs_the_node_that_feeds_it():
    with pytest.raises(ParameterError, match="needs the visualizer"):
        by_name(viewers=("web",), visualize=False)


def test_overrides_go_before_everything_else():
    nodes = by_name(source={"seed": 3}, overrides={"accelerometer": {"source": "seed = 4"}})
    assert nodes["accelerometer"]["source"] == "seed = 4"


def test_run_folders_sort_by_time():
    assert make_run_folder_name(datetime(2026, 1, 2, 3, 4, 5)) == "runs/2026-01-02T03-04-05"


def test_a_run_is_recorded_as_it_is_asked_for():
    assert by_name(notes="bench 3")["recorder"] == {
        **LIVE,
        "output": "out/session.mcap",
        "notes": "bench 3",
    }
