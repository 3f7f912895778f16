"""Packages of other people: one that checks a campaign, and nodes whose samples the rig takes."""

import json
import os
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from .tools import Tools

OUTSIDE = Path(__file__).with_name("outside")
RUN = ("ros2", "action", "send_goal", "/campaign/run", "impact_rig_msgs/action/RunCampaign")
NO_PLUGINS = "-p no:launch_testing -p no:launch_ros -p no:launch_pytest -p no:cacheprovider"


@pytest.fixture(scope="module")
def workspace(own_tools):
    """Return the tools, with both packages built and found, in a domain of their own."""
    colcon = ("colcon", "--log-base", "log")
    own_tools.run(*colcon, "build", "--base-paths", OUTSIDE)
    prefixes = [own_tools.folder / "install" / item.name for item in OUTSIDE.iterdir()]
    before = own_tools.environment["AMENT_PREFIX_PATH"]
    paths = [next(prefix.glob("lib/python*/site-packages"), prefix) for prefix in prefixes]
    environment = {
        **own_tools.environment,
        "AMENT_PREFIX_PATH": os.pathsep.join([*map(str, prefixes), before]),
        "PYTHONPATH": os.pathsep.join([*map(str, paths), own_tools.environment["PYTHONPATH"]]),
        "PYTEST_ADDOPTS": NO_PLUGINS,
    }
    return Tools(environment, own_tools.folder)


def analyze(tools, folder):
    """Return the results of a run's only sample, and its origin."""
    results = json.loads(tools.run("impact-rig", "analyze", folder, "--json"))
    (sample,) = results["samples"]
    return sample, results["origin"]


def test_a_package_checks_a_campaign_by_the_fixture_and_its_tests_pass_in_colcon(workspace):
    told = workspace.run(
        "colcon", "--log-base", "log", "test", "--base-paths", OUTSIDE, "--packages-select",
        "campaign_check", "--event-handlers", "console_direct+", "--return-code-on-test-failure",
    )  # fmt: skip
    assert "2 passed" in told


def test_a_launch_test_includes_the_rig(workspace):
    told = workspace.run("launch_test", OUTSIDE / "campaign_check/test/check_rig.launch.py")
    assert told.count("OK") >= 2


def test_another_node_is_the_accelerometer_of_a_campaign(workspace):
    folder = workspace.folder / "bench"
    launch = ("ros2", "launch", "bench_accelerometer", "bench.launch.py", f"output:={folder}")
    with workspace.start(*launch) as rig:
        rig.wait_for("recording to ")
        assert "SUCCEEDED" in workspace.run(*RUN, "{impacts: 3}")
        assert rig.interrupt() == 0, rig.text
    sample, origin = analyze(workspace, folder)
    assert sample["contact_time_s"] == pytest.approx(8e-3, rel=2e-3)
    assert origin == "simulated"


IMU_RIG = """
[hammer]
mass = "1 kg"
impact_speed = "1 m/s"
[samples]
control = ""
[[sample]]
name = "foam"
mass = "2 kg"
[analysis]
cutoff_frequency = "200 Hz"
pre_trigger = "30 ms"
record_duration = "200 ms"
[source]
driver = "topic"
sampling_rate = "1 kHz"
trigger_level = "10 m/s^2"
[source.hammer]
channel = "/imu/data.linear_acceleration.x"
"""
IMU_CONTACT = 16e-3


def write_imu_bag(path):
    """Write 45 s of an IMU on a hammer that strikes every 1.5 s."""
    bags = pytest.importorskip("rosbag2_py")
    imu = pytest.importorskip("sensor_msgs.msg").Imu()
    from rclpy.serialization import serialize_message

    writer = bags.SequentialWriter()
    writer.open(
        bags.StorageOptions(uri=str(path), storage_id="mcap"), bags.ConverterOptions("cdr", "cdr")
    )
    writer.create_topic(bags.TopicMetadata(0, "/imu/data", "sensor_msgs/msg/Imu", "cdr"))
    start, random = 1_700_000_000_000_000_000, np.random.default_rng(1)
    imu.linear_acceleration.z = 9.81
    for number in range(45_000):
        stamp, since = start + number * 1_000_000, number % 1500 * 1e-3 - 1.0
        pulse = np.sin(np.pi * since / IMU_CONTACT) ** 2 if 0.0 < since < IMU_CONTACT else 0.0
        imu.linear_acceleration.x = 80.0 * pulse + random.normal(scale=0.05)
        imu.header.stamp.sec, imu.header.stamp.nanosec = divmod(stamp, 1_000_000_000)
        writer.write("/imu/data", serialize_message(imu), stamp)
    del writer


def test_an_imu_played_by_ros2_bag_is_the_accelerometer_of_a_campaign(workspace):
    """It strikes when it likes, so the rig waits for the next contact behind each release."""
    bag, folder = workspace.folder / "imu", workspace.folder / "foam"
    write_imu_bag(bag)
    rig_file, waits = workspace.folder / "imu.toml", workspace.folder / "waits.yaml"
    rig_file.write_text(IMU_RIG)
    waits.write_text("/**/accelerometer: {ros__parameters: {trigger_timeout: 10.0}}\n")
    play = ("ros2", "bag", "play", bag, "--disable-keyboard-controls")
    with workspace.launch(folder, waits, f"rig_file:={rig_file}") as rig, ExitStack() as stack:
        rig.wait_for("no node publishes on /imu/data")
        player = stack.enter_context(workspace.start(*play))
        rig.wait_for("the device is back")
        assert "SUCCEEDED" in workspace.run(*RUN, "{impacts: 2}")
        player.interrupt()
        assert rig.interrupt() == 0, rig.text
    sample, origin = analyze(workspace, folder)
    assert sample["contact_time_s"] == pytest.approx(IMU_CONTACT, rel=5e-3)
    assert origin == "measured"
