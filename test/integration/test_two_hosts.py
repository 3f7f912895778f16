"""One rig on two computers, and one that must stay on its own."""

import json
import subprocess
import sys

import pytest
from rosbags.highlevel import AnyReader

from .hosts import make_two_hosts, plug_in_cable, pull_cable
from .processes import COMMAND_LINE, TalkingProcess

TRIES = 20
"""How often a person asks to arm the hammer, which the cable disarmed, until it is found again."""
IMPACTS = 10
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
        start(desk, environment, "campaign", "--sample", "steel small", "--impacts", str(IMPACTS)
              ) as campaign,
    ):  # fmt: skip
        campaign.wait_for("sample 1 of 1")
        pull_cable(devices)
        paused = campaign.wait_for("paused: ")
        plug_in_cable(devices)
        for _ in range(TRIES):
            with start(desk, environment, "hammer", "arm") as person:
                if person.wait() == 0:
                    break
        campaign.wait_for("the campaign goes on", paused)
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


PROFILES_THAT_OPEN = """\
<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <transport_descriptors><transport_descriptor>
    <transport_id>open</transport_id><type>UDPv4</type>
  </transport_descriptor></transport_descriptors>
  <participant profile_name="open" is_default_profile="true"><rtps>
    <userTransports><transport_id>open</transport_id></userTransports>
    <useBuiltinTransports>false</useBuiltinTransports>
    <builtin><initialPeersList><locator><udpv4><address>198.18.0.2</address></udpv4></locator>
    </initialPeersList></builtin>
  </rtps></participant>
</profiles>
"""
OPEN = {
    "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
    "ROS_STATIC_PEERS": "198.18.0.2",
    "RMW_FASTRTPS_USE_QOS_FROM_XML": "1",
}


def arm_from(host, environment):
    """Let another computer arm the hammer; return whether it could, and what it was told."""
    done = subprocess.run(
        [*host.prefix, sys.executable, "-m", COMMAND_LINE, "hammer", "arm", "--network"],
        env={**environment, "ROS_STATIC_PEERS": "198.18.0.1"},
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("network", [False, True])
def test_only_a_rig_that_is_told_so_leaves_its_computer(
    hosts, make_environment, tmp_path, monkeypatch, network
):
    """Profiles in the working folder and in the environment would open it without a word."""
    (tmp_path / "DEFAULT_FASTRTPS_PROFILES.xml").write_text(PROFILES_THAT_OPEN)
    monkeypatch.chdir(tmp_path)
    environment = {**make_environment(), "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    words = ["--network"] if network else []
    with TalkingProcess(
        COMMAND_LINE, "up", "--only", "hammer", "--output", tmp_path / "run", *words,
        environment={**environment, **({} if network else OPEN)}, prefix=hosts[0].prefix,
    ) as rig:  # fmt: skip
        rig.wait_for("this node is active")
        could, told = arm_from(hosts[1], environment)
        assert could is network, told
