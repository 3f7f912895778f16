"""The profile for Fast DDS: it is used, it has room, and a user's own stays."""

import contextlib
import os
import shutil
import socket
import struct
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

import psutil
import pytest
import rclpy
from impact_rig_msgs.srv import GetResults
from terminal import run_program

from impact_rig.configuration.processes import ACTIVE, DISCOVERY, NETWORK, PROFILES
from impact_rig.core.given.errors import DeviceError
from impact_rig.nodes import discovery, interfaces
from impact_rig.nodes.discovery import DOMAINS, offer_profile, reserve_domain

OPEN = {
    "FASTRTPS_DEFAULT_PROFILES_FILE": "mine.xml",
    "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
    "ROS_STATIC_PEERS": "198.18.0.2",
    DISCOVERY: "SUBNET",
}


@pytest.fixture
def opened(monkeypatch):
    """Set in the environment what leads beyond this computer."""
    for name, value in OPEN.items():
        monkeypatch.setenv(name, value)


def test_in_the_block_nothing_leads_beyond_this_computer_and_after_it_all_is_as_before(
    opened, monkeypatch
):
    monkeypatch.delenv(NETWORK, raising=False)
    before = dict(os.environ)
    with offer_profile():
        own = Path(os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"])
        assert "127.0.0.1" in ET.parse(own).getroot().itertext()
        assert os.environ[DISCOVERY] == "LOCALHOST"
        assert not os.environ.keys() & (OPEN.keys() - {DISCOVERY, PROFILES[0]})
    assert dict(os.environ) == before


def test_security_without_keys_is_said(monkeypatch):
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
    monkeypatch.setenv("ROS_SECURITY_STRATEGY", "Enforce")
    done = run_program([sys.executable, "-m", "impact_rig.nodes", "hammer"])
    assert done.returncode == 2
    assert done.stderr.startswith("error: ROS_SECURITY_ENABLE is true, and ROS_SECURITY_KEYSTORE")
    assert len(done.stderr.splitlines()) == 1


def test_between_computers_who_has_a_profile_keeps_it(opened, monkeypatch, tmp_path):
    monkeypatch.setenv(NETWORK, "1")
    before = dict(os.environ)
    with offer_profile():
        assert dict(os.environ) == before
    monkeypatch.delenv(PROFILES[0])
    monkeypatch.chdir(tmp_path)
    with offer_profile():
        assert PROFILES[0] in os.environ
    discovery.PROFILE_FILE.touch()
    with offer_profile():
        assert PROFILES[0] not in os.environ


def test_a_node_asks_to_be_remembered_for_a_minute_of_silence(ros_domain, start_process):
    """What it announces to the last of its neighbours, by the tables of DDSI-RTPS 2.5."""
    port = 7400 + 250 * ros_domain + 10 + 2 * (discovery.LOCAL_PEERS - 1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as neighbour:
        neighbour.bind(("127.0.0.1", port))
        start_process("hammer").wait_for(ACTIVE)
        announcement = neighbour.recv(1 << 16, socket.MSG_DONTWAIT)
    lease = struct.pack("<HHiI", 0x0002, 8, 60, 0)  # PID_PARTICIPANT_LEASE_DURATION
    assert announcement.startswith(b"RTPS")
    assert lease in announcement


def _count_waiting_bytes(port: int) -> int:
    """Return how many bytes a UDP port has received that are not read yet."""
    for line in Path("/proc/net/udp").read_text().splitlines()[1:]:
        words = line.split()
        if int(words[1].partition(":")[2], 16) == port:
            return int(words[4].partition(":")[2], 16)
    raise AssertionError(f"port {port} is not open")


@pytest.mark.skipif(not Path("/proc/net/udp").exists(), reason="only Linux says who has read")
def test_a_node_does_not_read_what_comes_from_outside_of_this_host(harness, start_process):
    process = psutil.Process(start_process("estimator").process.pid)
    harness.call(GetResults, interfaces.GET_RESULTS)
    ports = {item.laddr for item in process.net_connections("udp4")}
    own = {place for place in ports if place.ip == "127.0.0.1"}
    assert own
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for ip, port in ports:
            sender.sendto(b"RTPS", ("127.0.0.1" if ip == "0.0.0.0" else ip, port))
        # Fast DDS sends from other ports, which it never reads.
        harness.wait_until(lambda: any(not _count_waiting_bytes(port) for _, port in own))
        harness.call(GetResults, interfaces.GET_RESULTS)
    assert all(_count_waiting_bytes(port) for _, port in ports - own)


HOLDING = """
import sys
from impact_rig.nodes.discovery import reserve_domain
with reserve_domain() as number:
    print(number, flush=True)
    sys.stdin.read()
"""


def test_a_domain_that_is_reserved_here_or_by_another_process_is_not_given_again():
    other = subprocess.Popen(
        [sys.executable, "-c", HOLDING], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    try:
        taken = int(other.stdout.readline())
        with contextlib.ExitStack() as stack:
            ours = {stack.enter_context(reserve_domain()) for _ in range(20)}
        assert len(ours) == 20
        assert taken not in ours
        assert ours < {*DOMAINS}
    finally:
        other.communicate()


def test_a_domain_in_which_nodes_run_is_not_given():
    """As those of a rig whose ROS_DOMAIN_ID a person chose, who reserves nothing."""
    beyond = [DOMAINS.stop]
    with reserve_domain(beyond) as number:
        assert number == DOMAINS.stop
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=number, args=[])
    node = rclpy.create_node("another", context=context)
    with pytest.raises(DeviceError, match="101 to 101 are all in use"), reserve_domain(beyond):
        pass
    node.destroy_node()
    context.try_shutdown()


def test_without_shared_memory_to_spare_no_node_is_made():
    # Fast DDS maps a file there, and would die by a signal when it writes to it.
    script = (
        "mount -t tmpfs -o size=1m tmpfs /dev/shm || exit 77\n"
        f"exec {sys.executable} -m impact_rig.nodes hammer"
    )
    words = ["unshare", "--mount", "sh", "-c", script]
    if os.geteuid() or shutil.which("unshare") is None:
        pytest.skip("a small /dev/shm needs root and unshare")
    done = run_program(words)
    if done.returncode == 77:
        pytest.skip(f"a small /dev/shm cannot be made: {done.stderr}")
    assert done.returncode == 2
    assert done.stderr.startswith("error: /dev/shm has 1.0 MB free, and a process of the rig need")
