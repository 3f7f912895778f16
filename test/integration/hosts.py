"""Two computers in one: network namespaces with a cable between them, each with its own name."""

import contextlib
import os
import shutil
import signal
import subprocess
import uuid
from collections.abc import Iterator
from dataclasses import dataclass

import pytest

MULTICAST = "224.0.0.0/4"
TOOLS = ("ip", "unshare", "nsenter", "mount")


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


@contextlib.contextmanager
def make_two_hosts() -> Iterator[tuple[Host, Host]]:
    """Make two computers for the length of the block; skip the test where that cannot be done."""
    if missing := [tool for tool in TOOLS if shutil.which(tool) is None]:
        pytest.skip(
            f"two computers in one need {', '.join(missing)}: on Debian,"
            " apt-get install iproute2 util-linux"
        )
    if os.geteuid() != 0:
        pytest.skip("two computers in one need network namespaces, which only root can make")
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
        except subprocess.CalledProcessError as error:
            pytest.skip(f"two computers in one cannot be made: {error.stderr.strip()}")
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
