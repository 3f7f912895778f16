"""One rig on two computers, and one that must stay on its own.

The computers are network namespaces with a cable between them, each with its own name.
"""

import contextlib
import json
import re
import signal
import subprocess
import sys
import uuid
from collections.abc import Iterator
from dataclasses import dataclass

import pytest
from terminal import Terminal, run_program

from impact_rig.recordings.contents import inspect_run
from impact_rig.recordings.hits import HitState
from impact_rig.recordings.run import Run

RIG = (sys.executable, "-m", "impact_rig.cli.main")
TRIES = 20
"""How often a person asks to arm the hammer, which the cable disarmed, until it is found again."""
IMPACTS = 10
AT_THE_DEVICES = ("hammer", "accelerometer")
AT_THE_DESK = ("estimator", "recorder", "campaign")


@pytest.fixture(scope="module")
def two_hosts():
    with make_two_hosts() as made:
        yield made


@pytest.fixture
def hosts(two_hosts):
    """Both computers, with the cable as a test that fails does not leave it."""
    for host in two_hosts:
        switch_multicast(host, is_on=True)
        plug_in_cable(host)
    return two_hosts


def start(host, environment, command, *words):
    return Terminal(
        [*host.prefix, *RIG, command, "--network", *words],
        {**environment, "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"},
    )


def start_nodes(host, environment, names, *words):
    only = [word for name in names for word in ("--only", name)]
    return start(host, environment, "up", "--set", "hammer.swing_time=0.1", *only, *words)


@pytest.mark.parametrize("multicast", [True, False], ids=["multicast", "static peers"])
def test_a_campaign_outlasts_a_cable_that_is_pulled_and_loses_no_hit(
    hosts, environment, tmp_path, multicast
):
    devices, desk = hosts
    run = tmp_path / "run"
    for host in hosts:
        switch_multicast(host, is_on=multicast)
    if not multicast:
        environment = {**environment, "ROS_STATIC_PEERS": "198.18.0.1;198.18.0.2"}
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
        for _ in range(TRIES):  # where the computer is busy, it is disarmed again
            with start(desk, environment, "hammer", "arm") as person:
                person.wait()
            with contextlib.suppress(subprocess.TimeoutExpired):
                campaign.process.wait(3.0)
                break
        campaign.wait_for("the campaign goes on", paused)
        assert campaign.wait() == 0, campaign.text[-2000:]
    results = json.loads((run / "results.json").read_text("utf-8"))
    assert {item["name"]: item["impacts_accepted"] for item in results["samples"]} == {
        "steel small": IMPACTS,
    }
    stored = inspect_run(Run(run / "session.mcap")).hits
    whole = {hit.record for hit in stored if hit.state is HitState.SAVED}
    assert {hit["record"] for hit in results["hits"] if hit["accepted"]} <= whole


BROWSE = """
import sys, urllib.request
link, act = sys.argv[1:]
if act:
    form = urllib.request.Request(link + act, b"", {"Origin": link.rstrip("/")})
    urllib.request.urlopen(form, timeout=30).read()
print(urllib.request.urlopen(link, timeout=30).read().decode())
"""
"""As a browser without a script: does an act, and shows the page."""


def test_a_stop_at_the_page_while_the_cable_is_out_stops_the_hammer_once_it_is_back(
    hosts, environment, tmp_path
):
    devices, desk = hosts
    with (
        start_nodes(devices, environment, AT_THE_DEVICES),
        start_nodes(desk, environment, AT_THE_DESK, "--page", "--set", "page.port=0",
                    "--output", tmp_path / "run") as rig,
        start(desk, environment, "campaign", "--sample", "steel small", "--impacts", "10000"
              ) as campaign,
    ):  # fmt: skip

        def browse(act=""):
            words = [*desk.prefix, sys.executable, "-c", BROWSE, link, act]
            return run_program(words, env=environment).stdout

        def wait_until_shown(sentence, act=""):
            for _ in range(TRIES):
                if sentence in (shown := browse(act)):
                    return
            raise AssertionError(shown)

        rig.wait_for("the page is at http")
        link = re.search(r"the page is at (http://\S+)", rig.text)[1]
        campaign.wait_for("sample 1 of 1")
        wait_until_shown("<dd>yes, since ")
        pull_cable(devices)
        campaign.wait_for("paused: ")
        wait_until_shown("THE HAMMER DOES NOT ANSWER", "stop")
        plug_in_cable(devices)
        wait_until_shown("STOPPED", "stop")  # as a browser sends it until it is confirmed
        assert "emergency stop lasts" in arm_from(desk, environment)[1]


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
    """Let another computer arm the hammer; return whether it could, and the answer."""
    words = [*host.prefix, *RIG, "hammer", "arm", "--network"]
    done = run_program(words, env={**environment, "ROS_STATIC_PEERS": "198.18.0.1"})
    return done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("network", [False, True])
def test_only_a_rig_that_is_told_so_leaves_its_computer(
    hosts, environment, tmp_path, monkeypatch, network
):
    """Profiles in the working folder and in the environment would open it without a word."""
    (tmp_path / "DEFAULT_FASTRTPS_PROFILES.xml").write_text(PROFILES_THAT_OPEN)
    monkeypatch.chdir(tmp_path)
    environment = {**environment, "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    words = ["--network"] if network else []
    with Terminal(
        [*hosts[0].prefix, *RIG, "up", "--only", "hammer", "--output", tmp_path / "run", *words],
        {**environment, **({} if network else OPEN)},
    ) as rig:
        rig.wait_for("this node is active")
        # A busy computer finds a node late; one that is not to be found is looked for once.
        tries = (arm_from(hosts[1], environment)[0] for _ in range(TRIES if network else 1))
        assert any(tries) is network


MULTICAST = "224.0.0.0/4"


@dataclass(frozen=True)
class Host:
    """One of the computers.

    Attributes
    ----------
    keeper : int
        Number of the process that keeps its namespaces.
    namespace, cable_end : str
        Names of its network namespace and of its end of the cable.
    """

    keeper: int
    namespace: str
    cable_end: str

    @property
    def prefix(self) -> tuple[str, ...]:
        """What stands before a command to run it there."""
        return ("nsenter", "--target", str(self.keeper), "--mount", "--uts", "--net", "--")


def run(*words: str) -> None:
    subprocess.run(words, check=True, capture_output=True, text=True)


def pull_cable(host: Host) -> None:
    run("ip", "-n", host.namespace, "link", "set", host.cable_end, "down")


def plug_in_cable(host: Host) -> None:
    run("ip", "-n", host.namespace, "link", "set", host.cable_end, "up")
    run("ip", "-n", host.namespace, "route", "replace", MULTICAST, "dev", host.cable_end)


def switch_multicast(host: Host, *, is_on: bool) -> None:
    word = "on" if is_on else "off"
    run("ip", "-n", host.namespace, "link", "set", host.cable_end, "multicast", word)


@contextlib.contextmanager
def make_two_hosts() -> Iterator[tuple[Host, Host]]:
    """Make two computers for the length of the block; skip the test where that cannot be done."""
    token = uuid.uuid4().hex[:6]
    namespaces = [f"impact-rig-{token}-{end}" for end in "ab"]
    ends = [f"rig{token}{end}" for end in "ab"]
    with contextlib.ExitStack() as stack:
        try:
            for namespace in namespaces:
                run("ip", "netns", "add", namespace)
                stack.callback(run, "ip", "netns", "del", namespace)
            run("ip", "link", "add", ends[0], "netns", namespaces[0], "type", "veth",
                "peer", "name", ends[1], "netns", namespaces[1])  # fmt: skip
        except (OSError, subprocess.CalledProcessError) as error:
            pytest.skip(
                f"two computers in one cannot be made: {getattr(error, 'stderr', error)} (root"
                " can; on Debian, apt-get install iproute2 util-linux)"
            )
        hosts = []
        for number, (namespace, end) in enumerate(zip(namespaces, ends, strict=True), start=1):
            keeper = stack.enter_context(_keep(namespace, f"host-{number}"))
            hosts.append(Host(keeper, namespace, end))
            run("ip", "-n", namespace, "link", "set", "lo", "up")
            # Of those set aside for tests of networks, RFC 2544.
            run("ip", "-n", namespace, "addr", "add", f"198.18.0.{number}/24", "dev", end)
            plug_in_cable(hosts[-1])
        yield hosts[0], hosts[1]


@contextlib.contextmanager
def _keep(namespace: str, hostname: str) -> Iterator[int]:
    """Start what keeps a host's name and shared memory; yield its process number."""
    set_up = f"hostname {hostname} && mount -t tmpfs tmpfs /dev/shm && echo up && exec sleep 86400"
    keeper = subprocess.Popen(
        ["ip", "netns", "exec", namespace, "unshare", "--mount", "--uts", "sh", "-c", set_up],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        assert keeper.stdout is not None
        if (word := keeper.stdout.readline().strip()) != "up":
            pytest.skip(f"two computers in one cannot be made: {word}")
        yield keeper.pid
    finally:
        keeper.send_signal(signal.SIGKILL)
        keeper.communicate()
