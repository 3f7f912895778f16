"""One list says which processes make a rig, for `up` and for ROS 2's launch."""

import sys
from pathlib import Path

import pytest

from impact_rig.configuration.processes import (
    DISCOVERY,
    NETWORK,
    PROFILES,
    TRANSPORTS,
    choose_view,
    list_rig_processes,
    make_network_variables,
)
from impact_rig.configuration.rig_file import RigFile
from impact_rig.configuration.toml_table import parse_toml_table
from impact_rig.core.given.errors import FileError, ParameterError
from impact_rig.core.given.setup import PAPER_SETUP

LARGE_SOCKETS = "DEFAULT?sockets_size=4000000B"


@pytest.mark.parametrize("environment", [{}, {DISCOVERY: "SUBNET", NETWORK: "1"}])
def test_a_rig_stays_on_its_computer_unless_told_otherwise(environment):
    expected = {NETWORK: "0", DISCOVERY: "LOCALHOST"}
    assert make_network_variables(environment, network=False) == expected


@pytest.mark.parametrize(
    ("environment", "expected"),
    [
        ({}, {DISCOVERY: "SUBNET", TRANSPORTS: LARGE_SOCKETS}),
        ({DISCOVERY: "SUBNET"}, {TRANSPORTS: LARGE_SOCKETS}),
        ({DISCOVERY: "LOCALHOST"}, {}),
        ({DISCOVERY: "OFF"}, {}),
        *(({name: "own"}, {DISCOVERY: "SUBNET"}) for name in (TRANSPORTS, *PROFILES)),
    ],
)
def test_between_computers_sockets_hold_a_block_unless_the_environment_decides(
    environment, expected
):
    assert make_network_variables(environment, network=True) == {NETWORK: "1", **expected}


MINE = RigFile(PAPER_SETUP, path=Path("my.toml"), hammer={"swing_time": 0.3})
ADDRESS = "rerun+http://desk:9876/proxy"


def by_name(**options):
    return {item.name: dict(item.parameters) for item in list_rig_processes("out", **options)}


def test_a_whole_rig_records_and_shows_into_its_folder():
    nodes = by_name(rig=MINE, source={"seed": 3, "plant": "dynamics", "fault_probability": None})
    assert nodes == {
        "hammer": {"rig_file": "my.toml", "swing_time": 0.3},
        "accelerometer": {"rig_file": "my.toml", "source": 'seed = 3\nplant = "dynamics"'},
        "estimator": {},
        "campaign": {"rig_file": "my.toml"},
        "recorder": {"output": "out/session.mcap", "attachments": "my.toml"},
        "visualizer": {"output": "out/session.rrd"},
    }


def test_what_the_driver_topic_reads_is_recorded_as_hits_alone():
    source = 'driver = "topic"\nhammer.channel = "/imu.a.x"\nspecimen.channel = "/body.a[0]"'
    mine = RigFile(PAPER_SETUP, source=parse_toml_table(source))
    assert by_name(rig=mine)["recorder"]["exclude_topics"] == "/imu,/body"


def test_a_running_stream_is_recorded_where_there_is_one():
    nodes = by_name(continuous=True, record_stream=True)
    assert nodes["accelerometer"] == {"mode": "continuous"}
    assert nodes["recorder"] == {"output": "out/session.mcap", "record_stream": True}
    overrides = {"accelerometer": {"mode": "continuous"}}
    assert by_name(record_stream=True, overrides=overrides)["recorder"]["record_stream"]
    with pytest.raises(ParameterError, match="there is no running stream to record"):
        by_name(record_stream=True)


def test_two_computers_share_the_nodes_of_one_rig():
    whole = by_name(continuous=True, rig=MINE, viewers=("web",))
    parts = ("hammer", "accelerometer"), ("visualizer", "campaign", "estimator", "recorder")
    at_the_devices, elsewhere = (
        by_name(continuous=True, rig=MINE, viewers=("web",), only=only) for only in parts
    )
    assert at_the_devices.keys() == {"hammer", "accelerometer"}
    assert at_the_devices | elsewhere == whole


@pytest.mark.parametrize(
    ("options", "name"), [({}, "hamer"), ({"visualize": False}, "visualizer")]
)
def test_a_node_that_the_rig_has_not_cannot_be_started_alone(options, name):
    with pytest.raises(ParameterError, match=rf"no node '{name}' to start: the rig has \['hammer"):
        by_name(only=("hammer", name), **options)


@pytest.mark.parametrize(
    ("viewers", "visualize", "expected"),
    [
        (("browser",), True, r"viewer is 'browser': it must be spawn, web, or one address"),
        (("http://desk/",), True, r"viewer is 'http://desk/'"),
        (
            (ADDRESS, "rerun+http://lab/proxy"),
            True,
            r"viewer is 'rerun\+http://lab/proxy': .* or one address",
        ),
        (("web",), False, "needs the visualizer"),
    ],
)
def test_a_viewer_that_cannot_be_meant_is_named(viewers, visualize, expected):
    with pytest.raises(ParameterError, match=expected):
        by_name(viewers=viewers, visualize=visualize)


@pytest.mark.parametrize("has_rerun", [True, False])
def test_the_view_is_shown_where_the_node_s_python_has_rerun(tmp_path, has_rerun):
    python, node = tmp_path / "a folder" / "python3", tmp_path / "visualizer"
    python.parent.mkdir()
    (tmp_path / ("rerun.py" if has_rerun else "other.py")).write_text("")
    python.write_text(f'#!/bin/sh\nPYTHONPATH="{tmp_path}" exec {sys.executable} -S "$@"\n')
    python.chmod(0o755)
    node.write_text(f'#!"{python}"\nimport rclpy\n')
    assert choose_view("auto", node) is has_rerun
    assert not choose_view("false", node)
    if not has_rerun:
        with pytest.raises(FileError, match=r"visualizer:=true: rerun-sdk is not installed"):
            choose_view("true", node)
