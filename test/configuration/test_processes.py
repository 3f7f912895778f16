"""One list says which processes make a rig, whoever starts them."""

from datetime import datetime

import pytest

from impact_rig.configuration.processes import (
    RecordingPlan,
    list_rig_processes,
    make_run_folder_name,
    make_viewer_parameters,
)
from impact_rig.core.errors import ParameterError

ADDRESS = "rerun+http://desk:9876/proxy"


def by_name(**options):
    return {item.name: dict(item.parameters) for item in list_rig_processes("out", **options)}


def test_a_whole_rig_records_and_shows_into_its_folder():
    nodes = by_name(rig_file="my.toml", virtual={"seed": 3}, swing={"swing_time": 0.3})
    assert nodes == {
        "hammer": {"rig_file": "my.toml", "swing_time": 0.3},
        "accelerometer": {"rig_file": "my.toml", "seed": 3},
        "estimator": {},
        "campaign": {"rig_file": "my.toml"},
        "recorder": {"output": "out/session.mcap", "attachments": "my.toml"},
        "visualizer": {"output": "out/session.rrd"},
    }


def test_without_recorder_nobody_waits_for_one():
    nodes = by_name(record=False, visualize=False)
    assert "recorder" not in nodes
    assert "visualizer" not in nodes
    assert nodes["hammer"] == {"require_recorder": False}
    assert nodes["accelerometer"] == {"required_subscribers": "estimator"}


def test_a_running_stream_is_recorded_where_there_is_one():
    plan = RecordingPlan(stream=True)
    nodes = by_name(continuous=True, recording=plan)
    assert nodes["accelerometer"] == {"mode": "continuous"}
    assert nodes["recorder"] == {"output": "out/session.mcap", "record_stream": True}
    for options in (
        {"virtual": {"mode": "continuous"}},
        {"overrides": {"accelerometer": {"mode": "continuous"}}},
    ):
        assert by_name(recording=plan, **options)["recorder"]["record_stream"]
    with pytest.raises(ParameterError, match="there is no running stream to be recorded"):
        by_name(recording=plan)


def test_two_computers_share_the_nodes_of_one_rig():
    whole = by_name(continuous=True, rig_file="my.toml", record=False, viewers=("web",))
    at_the_devices = by_name(
        continuous=True, rig_file="my.toml", record=False, viewers=("web",),
        only=("hammer", "accelerometer"),
    )  # fmt: skip
    elsewhere = by_name(
        continuous=True, rig_file="my.toml", record=False, viewers=("web",),
        only=("visualizer", "campaign", "estimator"),
    )  # fmt: skip
    assert at_the_devices.keys() == {"hammer", "accelerometer"}
    assert at_the_devices | elsewhere == whole


@pytest.mark.parametrize(("options", "name"), [({}, "hamer"), ({"record": False}, "recorder")])
def test_a_node_that_the_rig_has_not_cannot_be_started_alone(options, name):
    with pytest.raises(ParameterError, match=rf"no node '{name}' to start: the rig has \['hammer"):
        by_name(only=("hammer", name), **options)


def test_viewers_stand_beside_the_file():
    assert by_name(viewers=("spawn", "web", ADDRESS))["visualizer"] == {
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
    with pytest.raises(ParameterError, match="is fed by the visualizer"):
        by_name(viewers=("web",), visualize=False)


def test_overrides_go_before_everything_else():
    nodes = by_name(virtual={"seed": 3}, overrides={"accelerometer": {"seed": 4}})
    assert nodes["accelerometer"]["seed"] == 4


def test_run_folders_sort_by_time():
    assert make_run_folder_name(datetime(2026, 1, 2, 3, 4, 5)) == "runs/2026-01-02T03-04-05"


def test_a_run_is_recorded_as_it_is_asked_for():
    plan = RecordingPlan(bag=True, compression="lz4", notes="bench 3")
    assert by_name(recording=plan)["recorder"] == {
        "output": "out/session",
        "compression": "lz4",
        "notes": "bench 3",
    }
