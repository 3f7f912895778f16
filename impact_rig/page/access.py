"""Who reaches the page: its address and links, its token, and the connections that are kept."""

import errno
import fcntl
import hashlib
import ipaddress
import os
import secrets
import socket
import ssl
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote, urlsplit

from tornado.iostream import IOStream
from tornado.netutil import bind_sockets

from impact_rig.core.given.errors import DeviceError, ParameterError

TOKEN = "token"  # noqa: S105 - name of a field and of a cookie
MOST_STRANGERS, MOST_STRANGERS_OF_ONE = 32, 16
"""Connections that have not yet shown that they may ask: in all, and from one address [-]."""
MOST_KNOWN = 64
"""Connections that have [-]: nine open pages take fifteen."""
PORTS_TRIED = 20
GET_ADDRESS = 0x8915
"""SIOCGIFADDR of Linux: an interface's address."""


@dataclass(frozen=True)
class Address:
    """Where the page is served, and to whom.

    On the loopback address every user of this computer may act; elsewhere only a person who has
    the token of the link.
    """

    host: str = "127.0.0.1"
    port: int = 0  # 0: any that is free
    certificate: Path | None = None  # of the server, in PEM, with TLS
    key: Path | None = None  # of the certificate; None: in the same file

    @property
    def is_local(self) -> bool:
        """Whether only this computer reaches it."""
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return self.host.lower() == "localhost"

    @property
    def scheme(self) -> str:
        """Scheme of its links."""
        return "https" if self.certificate else "http"

    @property
    def hosts(self) -> list[str]:
        """Hosts by which a person reaches it."""
        if self.host not in ("0.0.0.0", "::"):  # noqa: S104 - this binds nothing
            return [self.host]
        return [*list_own_addresses()] or [socket.gethostname()]

    def make_tls(self) -> ssl.SSLContext | None:
        """Return the TLS to serve with; None: none.

        Raises
        ------
        ParameterError
            If certificate or key cannot be used.
        """
        if self.certificate is None:
            if self.key is None:
                return None
            raise ParameterError(f"the page's key {self.key} has no certificate: state it, too")
        context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
        try:
            # Without a password OpenSSL would ask for one at the terminal, for ever.
            context.load_cert_chain(self.certificate, self.key, password="")
        except (OSError, ValueError) as error:
            beside = f" with the key {self.key}" if self.key else ""
            raise ParameterError(
                f"the page's certificate {self.certificate}{beside} cannot be used ({error}):"
                " it must be PEM, and the key without a password"
            ) from None
        return context

    def listen(self) -> list[socket.socket]:
        """Return sockets that listen: at the port, or at the next one that is free.

        Raises
        ------
        DeviceError
            If the address cannot be listened at.
        """
        for port in range(self.port, min(self.port + PORTS_TRIED, 65536)):
            try:
                return bind_sockets(port, self.host)
            except (OSError, UnicodeError) as error:
                reason = getattr(error, "strerror", None) or str(error)
                if getattr(error, "errno", None) != errno.EADDRINUSE:
                    break
        raise DeviceError(
            f"the page cannot listen at {self.host}:{self.port} ({reason}): state an address of"
            " this computer and a free port"
        )

    def is_served(self, asked: str, local: str, port: int) -> bool:
        """Return whether the Host of a request names this page.

        Parameters
        ----------
        asked : str
            As the browser sent it.
        local : str
            Address of this computer at which the request came in.
        port : int
            Of the page.
        """
        names = {self.host, local}
        if not self.is_local:
            names |= {socket.gethostname(), socket.getfqdn()}
        served = {read_host(f"[{name}]" if ":" in name else name, 0)[0] for name in names}
        name, asked_port = read_host(asked, 443 if self.certificate else 80)
        return name in served and asked_port == port


def read_host(text: str, default_port: int) -> tuple[str, int]:
    """Return name and port of a Host: in small letters, localhost as its address."""
    try:
        parts = urlsplit(f"//{text}")
        name, port = parts.hostname or "", parts.port or default_port
    except ValueError:
        return "", 0
    return ("127.0.0.1" if name == "localhost" else name), port


def list_own_addresses() -> Iterator[str]:
    """Yield the addresses of this computer's networks."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        for _, name in socket.if_nameindex():
            try:
                answer = fcntl.ioctl(
                    probe.fileno(), GET_ADDRESS, struct.pack("256s", name.encode())
                )
            except OSError:  # it has none
                continue
            address = socket.inet_ntoa(answer[20:24])
            if not ipaddress.ip_address(address).is_loopback:
                yield address


def make_link(scheme: str, host: str, port: int, token: str) -> str:
    """Return the page's address for a person."""
    named = f"[{host}]" if ":" in host else host
    query = f"?{TOKEN}={quote(token)}" if token else ""
    return f"{scheme}://{named}:{port}/{query}"


def keep_token(folder: Path) -> tuple[str, Path]:
    """Return the token of all pages that are started in a folder, and the file that keeps it.

    The file is this user's alone, and not in the folder, which others may get.
    """
    state = Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state")
    name = hashlib.sha256(str(folder.resolve()).encode()).hexdigest()[:16]
    path = state / "impact_rig" / f"page-{name}"
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        number = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o600)
        with os.fdopen(number, "r+", encoding="ascii") as file:
            os.fchmod(number, 0o600)
            token = file.read().strip() or secrets.token_urlsafe(24)
            file.seek(0)
            file.write(token)
    except (OSError, RuntimeError, UnicodeError) as error:
        raise DeviceError(
            f"the page's token cannot be kept in {path} ({error}): make it writable, or set"
            " XDG_STATE_HOME"
        ) from None
    return token, path


class Connections:
    """Those that are open: a stranger's gives way to the next one, never one that is known.

    A connection is known once a request on it has shown that it may ask.
    """

    def __init__(self) -> None:
        self._strangers: dict[IOStream, str] = {}  # with their addresses, the oldest first
        self._known: set[IOStream] = set()

    def admit(self, stream: IOStream, address: str) -> None:
        """Take a new connection, before anything is read from it."""
        self._strangers = {it: at for it, at in self._strangers.items() if not it.closed()}
        same = [it for it, at in self._strangers.items() if at == address]
        for old in (*same[: 1 - MOST_STRANGERS_OF_ONE], *[*self._strangers][: 1 - MOST_STRANGERS]):
            old.close()
        self._strangers[stream] = address

    def know(self, stream: IOStream) -> bool:
        """Keep a connection that may ask; return whether there was room for it."""
        if stream in self._known:
            return True
        self._known = {it for it in self._known if not it.closed()}
        if len(self._known) >= MOST_KNOWN:
            return False
        self._strangers.pop(stream, None)
        self._known.add(stream)
        return True
