"""Discovery of nodes: how far they look for each other, and how soon they find each other.

Without `--network` a process stays on 127.0.0.1, whatever lies in its folder or environment. The
profile for Fast DDS also makes nodes find each other soon: a new node receives every topic
and service of all others at once. By default Linux has no room for all of that, what does not fit
is lost, and some of it is sent again only seconds later; and two nodes that have missed each
other's first announcement wait 3 s for the next.
"""

import os
import random
import shutil
import socket
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from impact_rig.configuration.processes import DISCOVERY, NETWORK, PROFILES, TRANSPORTS
from impact_rig.core.given.errors import DeviceError

PROFILE_FILE = Path("DEFAULT_FASTRTPS_PROFILES.xml")
"""A user's own profiles, in the folder in which a process runs."""
OPENERS = (
    *PROFILES, TRANSPORTS, "FASTDDS_ENVIRONMENT_FILE", "RMW_FASTRTPS_USE_QOS_FROM_XML",
    "ROS_STATIC_PEERS", "ROS_DISCOVERY_SERVER", "ROS_SUPER_CLIENT", "CYCLONEDDS_URI",
)  # fmt: skip
"""Variables by which a process would look, or answer, beyond 127.0.0.1."""
LOCAL_PROFILES = Path(__file__).with_name("fast_dds_local.xml")
LOCAL_PEERS = 32
"""Processes of this host that are looked for [-], as in `LOCAL_PROFILES`."""
SHARED_MEMORY = Path("/dev/shm")  # noqa: S108 - this is what Linux and Fast DDS use
LEAST_SHARED_MEMORY = 4_000_000
"""Free space of it that one more process needs [byte]: one was seen to take 1 MB."""


@contextmanager
def offer_profile() -> Iterator[None]:
    """Let the context and the first node made in the block stay here, and be found soon.

    Only a process that `NETWORK` lets leave this computer keeps what its environment says, and
    a user's own profiles. Fast DDS reads profiles once.

    Raises
    ------
    DeviceError
        If there is too little shared memory: Fast DDS would end the process with a bus error.
    """
    _check_shared_memory()
    before = dict(os.environ)
    if before.get(NETWORK) != "1":
        for name in OPENERS:
            os.environ.pop(name, None)
        os.environ.update({
            DISCOVERY: "LOCALHOST",
            "SKIP_DEFAULT_XML_FILE": "1",
            PROFILES[0]: str(LOCAL_PROFILES),
        })  # fmt: skip
    elif not (any(name in before for name in PROFILES) or PROFILE_FILE.exists()):
        os.environ[PROFILES[0]] = str(Path(__file__).with_name("fast_dds_network.xml"))
    try:
        yield
    except RuntimeError as error:  # of rclpy
        if before.get("ROS_SECURITY_ENABLE") != "true":
            raise
        keystore = before.get("ROS_SECURITY_KEYSTORE", "which is not set")
        raise DeviceError(
            f"ROS_SECURITY_ENABLE is true, and ROS_SECURITY_KEYSTORE ({keystore}) has no keys for"
            f" this node, or Fast DDS lacks security: make keys by `ros2 security` ({error})"
        ) from None
    finally:
        _restore_environment(before)


def _restore_environment(before: Mapping[str, str]) -> None:
    for name in os.environ.keys() - before.keys():
        del os.environ[name]
    os.environ.update(before)


def _check_shared_memory() -> None:
    if not SHARED_MEMORY.is_dir():
        return
    free = shutil.disk_usage(SHARED_MEMORY).free
    if free < LEAST_SHARED_MEMORY:
        raise DeviceError(
            f"{SHARED_MEMORY} has {free / 1e6:.1f} MB free, and a process of the rig needs"
            f" {LEAST_SHARED_MEMORY / 1e6:g} MB: once no node runs, remove what dead ones left"
            " there (fastrtps_*), or make it larger (in a container, --shm-size=256m)"
        )


DOMAINS = range(1, 101)
"""Those handed out: 0 is the default of ROS 2, and ports of higher ones reach into those of
outgoing connections."""


@contextmanager
def reserve_domain(domains: Sequence[int] = DOMAINS) -> Iterator[int]:
    """Reserve a ROS domain for the length of the block, and yield its number.

    A domain in which a node of this host runs is left out. One is chosen at random: one that has
    just become free may still carry the last messages of its user.

    Raises
    ------
    DeviceError
        If all are taken.
    """
    for number in random.SystemRandom().sample(domains, len(domains)):
        with socket.socket() as reservation:
            try:
                # As ROS 2's domain_coordinator does it.
                reservation.bind(("", 32768 + number))
            except OSError:
                continue
            if not _is_in_use(number):
                yield number
                return
    raise DeviceError(
        f"the ROS domains {domains[0]} to {domains[-1]} are all in use on this"
        " host: name another one in ROS_DOMAIN_ID"
    )


@contextmanager
def use_own_domain() -> Iterator[int]:
    """Let all nodes that start in the block, in any process, be in a ROS domain of their own."""
    before = dict(os.environ)
    with reserve_domain() as domain:
        os.environ.update({"ROS_DOMAIN_ID": str(domain), DISCOVERY: "LOCALHOST"})
        try:
            yield domain
        finally:
            _restore_environment(before)


def _is_in_use(domain: int) -> bool:
    """Return whether a node of this host is in a domain: each has a port, by DDSI-RTPS 2.5."""
    first = 7400 + 250 * domain + 10
    for port in range(first, first + 2 * LOCAL_PEERS, 2):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                return True
    return False
