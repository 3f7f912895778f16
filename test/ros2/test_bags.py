"""Recordings of the rig in rosbag2's hands, and rosbag2's in the rig's."""

import re

CONVERSION = "output_bags: [{{uri: {uri}, storage_id: {storage}, all_topics: true}}]\n"


def analyze(tools, path):
    """Return the results of a recording as `results.json` holds them."""
    return tools.run("impact-rig", "analyze", path, "--json")


def convert(tools, source, kind, storage):
    """Return a bag of one storage converted to another."""
    target = tools.folder / f"converted_{storage}"
    plan = tools.folder / f"{storage}.yaml"
    plan.write_text(CONVERSION.format(uri=target, storage=storage))
    tools.run("ros2", "bag", "convert", "-i", source, kind, "-o", plan)
    return target


def test_a_bag_of_ros2_bag_record_gives_the_live_results(bags, tools):
    assert analyze(tools, bags.theirs) == bags.results


def test_our_recording_is_read_by_ros2_bag(bags, tools):
    assert analyze(tools, bags.ours) == bags.results
    text = tools.run("ros2", "bag", "info", "-s", "mcap", bags.ours)
    assert re.search(r"Topic: /acceleration \| Type: impact_rig_msgs/msg/AccelerationBlock", text)
    assert re.search(r"/impact \|.* Count: 6 ", text)


def test_converted_to_sqlite_and_back_nothing_is_lost(bags, tools):
    back = convert(tools, convert(tools, bags.ours, "mcap", "sqlite3"), "sqlite3", "mcap")
    assert analyze(tools, back) == bags.results


def test_our_recording_played_by_ros2_bag_is_estimated_again(bags, tools):
    ask = "/again/estimator/get_results", "impact_rig_msgs/srv/GetResults"
    with tools.start(
        "ros2", "run", "impact_rig", "estimator", "--ros-args", "-r", "__ns:=/again"
    ) as estimator:
        assert "samples=[]" in tools.call(*ask)
        # What is lost of discovery on a busy machine is sent again after 3 s.
        tools.run(
            "ros2", "bag", "play", "-s", "mcap", bags.ours, "--delay", "8",
            "--disable-keyboard-controls", "--topics", "/setup", "/acceleration",
            "--remap", "/setup:=/again/setup", "/acceleration:=/again/acceleration",
        )  # fmt: skip
        while tools.call(*ask).count("impact_rig_msgs.msg.Impact(") < 6:  # within the test's time
            pass
        assert estimator.interrupt() == 0, estimator.text


def test_a_bag_played_into_a_live_rig_is_none_of_its_campaign(bags, rig, tools):
    """All of it, in the rig's namespace, with the QoS that `ros2 bag record` has found."""
    names = (
        "setup", "acceleration", "release", "impact", "recorder/stored", "recorder/state",
        "hammer/state", "accelerometer/state", "virtual_impact", "estimate",
    )  # fmt: skip
    run = ("ros2", "action", "send_goal", "--feedback", "/bench/campaign/run")
    goal = '{samples: ["brass small"], impacts: 3, confirm_samples: true}'
    with tools.start(*run, "impact_rig_msgs/action/RunCampaign", goal) as campaign:
        campaign.wait_for("sample: brass small")
        tools.run(
            "ros2", "bag", "play", bags.theirs, "--rate", "5", "--disable-keyboard-controls",
            "--topics", *(f"/{name}" for name in names),
            "--remap", *(f"/{name}:=/bench/{name}" for name in names),
        )  # fmt: skip
        # Two publishers of hammer/state have disarmed the hammer: a person arms it again, a
        # moment later.
        arm = "impact-rig", "hammer", "arm", "--namespace", "bench"
        tools.run_until(lambda said: "refused" not in said, *arm)
        confirm = "/bench/campaign/confirm_sample", "impact_rig_msgs/srv/ConfirmSample"
        tools.call(*confirm, "{sample: brass small}")
        campaign.wait_for("Goal finished with status: SUCCEEDED")
    hits = re.findall(r"^ +sample: (\w+ \w+)", campaign.text, re.MULTILINE)
    assert len(hits) >= 3
    assert set(hits) == {"brass small"}
    assert "speaks on " in rig.terminal.text
