"""How soon nodes find each other: a profile for Fast DDS, where nobody has given another.

A node that comes hears of every topic and service of all others at once. By default Linux has
no room for all of that, what does not fit is lost, and some of it is sent again only seconds
later; and two nodes that have missed each other's first announcement wait 3 s for the next.
"""

import contextlib
import os
import random
import shutil
import socket
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import filterfalse
from pathlib import Path

from impact_rig.configuration.processes import DISCOVERY
from impact_rig.core.errors import DeviceError

LOCALHOST = "LOCALHOST"
PROFILE_VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"
"""Names a file with somebody's own profiles."""
PROFILE_FILE = Path("DEFAULT_FASTRTPS_PROFILES.xml")
"""The same, in the folder in which a process runs."""
RECEIVE_BUFFER = 4 << 20
"""Of each socket [byte], our choice: ten times what a node hears of a whole rig. Linux gives
what net.core.rmem_max allows, at least twice its default."""
ANNOUNCEMENT_PERIOD = 300_000_000
"""Between two announcements of a node [ns], our choice: some hundred bytes each."""
PARTICIPANT_LEASE = 60
"""After what silence nodes forget each other altogether [s], our choice: one that was frozen for
30 s soon after its start was, with the 20 s of Fast DDS, in 7 of 25 cases never fully found again.
That a node is silent is known much sooner, by the leases of its topics."""
LOCAL_PEERS = 32
"""Processes of this host that are looked for [-]: as many as ROS 2 looks for."""
SHARED_MEMORY = Path("/dev/shm")  # noqa: S108 - this is what Linux and Fast DDS use
LEAST_SHARED_MEMORY = 4_000_000
"""Free space of it that one more process needs [byte], our choice: one was seen to take 1 MB."""

_PROFILES = """\
<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  {transports}
  <participant profile_name="impact_rig" is_default_profile="true">
    <rtps>
      {sockets}
      <builtin><discovery_config>
        <leaseDuration><sec>{lease}</sec></leaseDuration>
        <leaseAnnouncement><sec>0</sec><nanosec>{period}</nanosec></leaseAnnouncement>
      </discovery_config></builtin>
    </rtps>
  </participant>
</profiles>
"""
_LOCAL_TRANSPORT = f"""\
<transport_descriptors><transport_descriptor>
    <transport_id>udp</transport_id>
    <type>UDPv4</type>
    <receiveBufferSize>{RECEIVE_BUFFER}</receiveBufferSize>
    <maxInitialPeersRange>{LOCAL_PEERS}</maxInitialPeersRange>
    <interfaceWhiteList><address>127.0.0.1</address></interfaceWhiteList>
  </transport_descriptor></transport_descriptors>"""
_LOCAL_SOCKETS = "<userTransports><transport_id>udp</transport_id></userTransports>"


@contextlib.contextmanager
def offer_profile() -> Iterator[None]:
    """Let the first node that is made in the block be found soon, and with it its process.

    Fast DDS reads its profiles once. Whoever has given profiles of their own keeps them.

    Raises
    ------
    DeviceError
        If there is too little shared memory: Fast DDS would end the process with a bus error.
    """
    _check_shared_memory()
    is_given = os.environ.get(PROFILE_VARIABLE) or PROFILE_FILE.exists()
    path = None if is_given else _write_profiles()
    if path is None:
        yield
        return
    os.environ[PROFILE_VARIABLE] = str(path)
    try:
        yield
    finally:
        del os.environ[PROFILE_VARIABLE]
        path.unlink(missing_ok=True)


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


def _write_profiles() -> Path | None:
    """Write the profiles into a new file; None: there is no room for one, and nodes find later."""
    text = make_profiles(is_local=os.environ.get(DISCOVERY) == LOCALHOST)
    try:
        with tempfile.NamedTemporaryFile(
            "w", encoding="utf-8", prefix="impact_rig_", suffix=".xml", delete=False
        ) as file:
            file.write(text)
    except OSError:
        return None
    return Path(file.name)


def make_profiles(*, is_local: bool) -> str:
    """Return the text of the file.

    Parameters
    ----------
    is_local : bool
        ROS stays on this host. Then it makes sockets of its own, which ask nobody how large they
        are to be; one that is named here goes before them. Those between hosts are chosen by
        `impact_rig.configuration.processes`.
    """
    return _PROFILES.format(
        transports=_LOCAL_TRANSPORT if is_local else "",
        sockets=_LOCAL_SOCKETS if is_local else "",
        lease=PARTICIPANT_LEASE,
        period=ANNOUNCEMENT_PERIOD,
    )


FIRST_DOMAIN = 1
"""0 is that of whoever names none."""
DOMAINS = 100
"""How many are handed out [-]: ports of higher ones reach into those of outgoing connections."""


@contextmanager
def reserve_domain() -> Iterator[int]:
    """Reserve a ROS domain for the length of the block, and yield its number.

    None in which a node of this host is, though nobody has reserved it. The search begins at
    random: one that has just become free may still be left by the last messages of whoever used
    it.

    Raises
    ------
    DeviceError
        If all are taken.
    """
    from domain_coordinator import domain_id

    begin = random.SystemRandom().randrange(DOMAINS)
    candidates = (FIRST_DOMAIN + (begin + place) % DOMAINS for place in range(DOMAINS))
    unused = filterfalse(_is_in_use, candidates)
    reservation = domain_id(lambda: next(unused))
    try:
        number = reservation.__enter__()
    except RuntimeError as error:  # also where no candidate is left
        raise DeviceError(
            f"the ROS domains {FIRST_DOMAIN} to {FIRST_DOMAIN + DOMAINS - 1} are all in use on"
            " this host: name another one in ROS_DOMAIN_ID"
        ) from error
    try:
        yield number
    finally:
        # Not told of an error in the block, which it would take for a domain that is in use.
        reservation.__exit__(None, None, None)


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
