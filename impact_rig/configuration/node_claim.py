"""One process for each node of a rig on this computer.

A node holds a socket named by ROS domain, namespace and node. Linux frees it when the process
ends, and tells a client the number of that process.
"""

import errno
import hashlib
import os
import socket
import struct
from collections.abc import Iterable

from impact_rig.core.given.errors import RigError

WAITING_CALLS = 1000
"""Connections that may wait while a node lives: none is accepted."""
_CREDENTIALS = struct.Struct("3i")
"""Process, user and group."""


def claim_node(full_name: str) -> socket.socket:
    """Claim a node's full name for this process, until the returned socket is closed.

    Raises
    ------
    RigError
        If another process is that node.
    """
    claim = socket.socket(socket.AF_UNIX)
    try:
        claim.bind(_make_address(full_name))
    except OSError as error:
        claim.close()
        if error.errno != errno.EADDRINUSE:
            raise
        check_free([full_name])
        raise RigError(f"another process is {full_name} already") from None
    claim.listen(WAITING_CALLS)
    return claim


def check_free(full_names: Iterable[str]) -> None:
    """Raise a `RigError` if one of these nodes is up on this computer already."""
    for full_name in full_names:
        if process := _find_process(full_name):
            raise RigError(
                f"process {process} is {full_name} of ROS domain {_read_domain()} already: stop"
                " that rig, or give this one another ROS_DOMAIN_ID or --namespace"
            )


def join_names(namespace: str, names: Iterable[str]) -> list[str]:
    """Return the full names of nodes of a namespace."""
    prefix = f"/{namespace.strip('/')}/" if namespace.strip("/") else "/"
    return [prefix + name for name in names]


def _find_process(full_name: str) -> int:
    """Return the number of the process that has claimed a name; 0: none."""
    with socket.socket(socket.AF_UNIX) as caller:
        caller.setblocking(False)
        try:
            caller.connect(_make_address(full_name))
        except OSError:
            return 0
        credentials = caller.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _CREDENTIALS.size)
    return int(_CREDENTIALS.unpack(credentials)[0])


def _make_address(full_name: str) -> bytes:
    # The length of such a name is limited, that of a namespace is not.
    name = f"{_read_domain()}:{full_name}".encode()
    return b"\0impact_rig:" + hashlib.sha256(name).hexdigest().encode()


def _read_domain() -> str:
    return os.environ.get("ROS_DOMAIN_ID") or "0"
