"""One rig on two computers: the devices at one, what evaluates and records at the other."""

import json

import pytest
from rosbags.highlevel import AnyReader

from .hosts import make_two_hosts, plug_in_cable, pull_cable
from .processes import COMMAND_LINE, TalkingProcess

IMPACTS = 6
AT_THE_DEVICES = ("hammer", "accelerometer")
AT_THE_DESK = ("estimator", "recorder", "campaign")


@pytest.fixture(scope="module")
def hosts():
    with make_two_hosts() as made:
        yield made


def start(host, environment, command, *words):
    return TalkingProcess(
        COMMAND_LINE, command, "--network", *words,
        environment={**environment, "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"},
        prefix=host.prefix,
    )  # fmt: skip


def start_nodes(host, environment, names, *words):
    only = [word for name in names for word in ("--only", name)]
    return start(host, environment, "up", "--set", "hammer.swing_time=0.1", *only, *words)


def test_a_campaign_outlasts_a_cable_that_is_pulled_and_loses_no_hit(
    hosts, make_environment, tmp_path
):
    devices, desk = hosts
    environment = make_environment()
    run = tmp_path / "run"
    with (
        start_nodes(devices, environment, AT_THE_DEVICES),
        start_nodes(desk, environment, AT_THE_DESK, "--output", run),
        start(desk, environment, "campaign", "--samples", "steel small", "--impacts", str(IMPACTS)
              ) as campaign,
    ):  # fmt: skip
        campaign.wait_for("sample 1 of 1")
        pull_cable(devices)
        campaign.wait_for("paused: .* has gone: start it again, or see to the network")
        plug_in_cable(devices)
        campaign.wait_for("it goes on")
        assert campaign.wait() == 0, campaign.output[-2000:]
    results = json.loads((run / "results.json").read_text("utf-8"))
    assert {item["name"]: item["impacts_accepted"] for item in results["samples"]} == {
        "steel small": IMPACTS,
    }
    with AnyReader([run / "session.mcap"]) as reader:
        blocks = [item for item in reader.connections if item.topic == "/acceleration"]
        hits = [reader.deserialize(data, kind.msgtype)
                for kind, _, data in reader.messages(blocks)]  # fmt: skip
    whole = {hit.record for hit in hits if hit.last}
    assert {hit["record"] for hit in results["hits"]} <= whole
