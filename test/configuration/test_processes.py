"""One list says which processes make a rig, whoever starts them."""

from datetime import datetime

from impact_rig.configuration.processes import (
    RecordingPlan,
    list_rig_processes,
    make_run_folder_name,
)


def by_name(**options):
    return {item.name: dict(item.parameters) for item in list_rig_processes("out", **options)}


def test_a_whole_rig_records_and_shows_into_its_folder():
    nodes = by_name(rig_file="my.toml", virtual={"seed": 3})
    assert nodes == {
        "hammer": {},
        "accelerometer": {"seed": 3},
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
