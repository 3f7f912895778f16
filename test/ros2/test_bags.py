"""Recordings of the rig in rosbag2's hands, and rosbag2's in the rig's."""

import re

CONVERSION = "output_bags: [{{uri: {uri}, storage_id: {storage}, all_topics: true}}]\n"


def analyze(tools, path):
    """Return the results of a recording as `results.json` holds them."""
    return tools.run("impact-rig", "analyze", path, "--json")


def convert(tools, source, storage):
    """Return a bag converted to another storage."""
    target = tools.folder / f"converted_{storage}"
    plan = tools.folder / f"{storage}.yaml"
    plan.write_text(CONVERSION.format(uri=target, storage=storage))
    tools.run("ros2", "bag", "convert", "-i", source, "-o", plan)
    return target


def test_a_bag_of_ros2_bag_record_gives_the_live_results(bags, tools):
    assert analyze(tools, bags.theirs) == bags.results


def test_our_recording_is_read_by_ros2_bag(bags, tools):
    assert analyze(tools, bags.ours) == bags.results
    text = tools.run("ros2", "bag", "info", bags.ours)
    assert re.search(r"Topic: /acceleration \| Type: impact_rig_msgs/msg/AccelerationBlock", text)
    assert re.search(r"/impact \|.* Count: 6 ", text)


def test_converted_to_sqlite_and_back_nothing_is_lost(bags, tools):
    back = convert(tools, convert(tools, bags.ours, "sqlite3"), "mcap")
    assert analyze(tools, back) == bags.results


def test_our_recording_played_by_ros2_bag_is_estimated_again(bags, tools):
    ask = (
        "ros2", "service", "call", "/again/estimator/get_results",
        "impact_rig_msgs/srv/GetResults",
    )  # fmt: skip
    with tools.start(
        "ros2", "run", "impact_rig", "estimator", "--ros-args", "-r", "__ns:=/again"
    ) as estimator:
        assert "samples=[]" in tools.run(*ask)
        tools.run(
            "ros2", "bag", "play", bags.ours, "--delay", "3", "--disable-keyboard-controls",
            "--topics", "/setup", "/acceleration",
            "--remap", "/setup:=/again/setup", "/acceleration:=/again/acceleration",
        )  # fmt: skip
        tools.run_until(lambda text: text.count("impact_rig_msgs.msg.Impact(") == 6, *ask)
        assert estimator.interrupt() == 0, estimator.text
