"""Addresses of viewers, and of what listens for them."""

from __future__ import annotations

import ipaddress
import socket
from urllib.parse import quote, urlsplit

from impact_rig.core.errors import DeviceError, ParameterError

LOOPBACK = "127.0.0.1"
"""What is listened on unless told otherwise: nobody on another host sees it."""
DEFAULT_PORT = 9876
"""Rerun's own."""
ANSWER_TIMEOUT = 1.0
"""How long a viewer may take to accept a connection [s], our choice."""


def check_viewer_address(address: str) -> tuple[str, int]:
    """Return host and port of a viewer's address.

    Raises
    ------
    ParameterError
        If the address does not read like ``rerun+http://HOST:9876/proxy``.
    """
    try:
        parts = urlsplit(address)
        port = parts.port or DEFAULT_PORT
    except ValueError:
        parts, port = urlsplit(""), 0
    known = parts.scheme in ("rerun", "rerun+http", "rerun+https")
    if not (known and parts.hostname and parts.path == "/proxy"):
        raise ParameterError(
            f"viewer address is {address!r}: it must read like"
            f" {make_viewer_address(LOOPBACK, DEFAULT_PORT)}"
        )
    return parts.hostname or "", port


def make_viewer_address(host: str, port: int) -> str:
    """Return the address under which a viewer, or what feeds one, is found."""
    return f"rerun+http://{_bracket(host)}:{port}/proxy"


def make_page_address(host: str, port: int, relay: str) -> str:
    """Return the address of a page with a viewer that shows what the `relay` has."""
    return f"http://{_bracket(host)}:{port}/?url={quote(relay, safe='')}"


def check_listen_address(address: str) -> str:
    """Return an address of this host that may be listened on.

    Raises
    ------
    ParameterError
        If it is no IP address.
    """
    try:
        return str(ipaddress.ip_address(address))
    except ValueError:
        raise ParameterError(
            f"listen is {address!r}: it must be an IP address of this host: {LOOPBACK} for itself"
            " alone, 0.0.0.0 for everybody"
        ) from None


def is_local(address: str) -> bool:
    """Return whether only this host reaches what listens on an IP address."""
    return ipaddress.ip_address(address).is_loopback


def choose_reachable_name(listen: str) -> str:
    """Return under which name others reach what listens on an IP address."""
    return socket.gethostname() if ipaddress.ip_address(listen).is_unspecified else listen


def choose_loopback(listen: str) -> str:
    """Return under which address this host reaches what listens on an IP address."""
    if not ipaddress.ip_address(listen).is_unspecified:
        return listen
    return "::1" if ":" in listen else LOOPBACK


def choose_port(listen: str, port: int) -> int:
    """Return a port that can be listened on.

    Parameters
    ----------
    listen : str
        IP address of this host.
    port : int
        The one that is wanted; 0: any free one.

    Raises
    ------
    DeviceError
        If the address is none of this host, or the port is taken.
    """
    family = socket.AF_INET6 if ":" in listen else socket.AF_INET
    try:
        with socket.socket(family) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((listen, port))
            return int(probe.getsockname()[1])
    except OSError as error:
        raise DeviceError(
            f"{listen}, port {port} cannot be listened on: {error.strerror}; give an address of"
            " this host and a port that nobody uses, 0 for any free one"
        ) from None


def is_answering(host: str, port: int) -> bool:
    """Return whether somebody accepts a connection there."""
    try:
        socket.create_connection((host, port), timeout=ANSWER_TIMEOUT).close()
    except OSError:
        return False
    return True


def _bracket(host: str) -> str:
    return f"[{host}]" if ":" in host else host
