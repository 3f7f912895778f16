"""The page's web server: fragments of the page out by WebSocket, acts in as plain forms.

It knows neither ROS nor the rig: it is given what to show, and functions that act. It runs in a
thread of its own; `PageServer.show` and `show_trace` may be called from any thread.
"""

import asyncio
import hmac
import ipaddress
import json
import re
import secrets
import ssl
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self, TypeAlias
from urllib.parse import quote, unquote, urlsplit

from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets
from tornado.web import Application, HTTPError, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from impact_rig.core.given.errors import DeviceError, ParameterError, RigError

STATIC = {"page.css": "text/css; charset=utf-8", "page.js": "text/javascript; charset=utf-8"}
MACROS = ("act", "note", "strength", "numbers")
HEARTBEAT = 1.0
"""How often each page hears that the server is there [s]; after three of them it greys."""
LONGEST_FORM = 20_000
"""Largest form of an act [bytes]."""
LONGEST_FIELD = 1000
"""Longest text of a person [characters], as in the templates."""
KEPT_TRACES = 10
"""How many traces of a sample a page gets that opens late, and draws at each hit [-]."""
TOKEN = "token"  # noqa: S105 - the name of a cookie
WHO = "who"
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self';"
    " img-src data:; form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)


@dataclass(frozen=True)
class Answer:
    """Outcome of an act."""

    done: bool
    message: str  # what was done, or why not


@dataclass(frozen=True)
class Form:
    """A form as a person has filled it in, with the person's name."""

    fields: Mapping[str, tuple[str, ...]]
    who: str

    @property
    def signature(self) -> str:
        """The person's name, to be appended to the act."""
        return f", {self.who}" if self.who else ""

    def __getitem__(self, name: str) -> str:
        """Return the first value of a field; empty: it is not there."""
        return self.fields.get(name, ("",))[0].strip()


Act: TypeAlias = Callable[[Form], "Future[Answer]"]


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
            return self.host == "localhost"

    def make_tls(self) -> ssl.SSLContext | None:
        """Return the TLS to serve with; None: none.

        Raises
        ------
        ParameterError
            If certificate or key cannot be used.
        """
        if self.certificate is None:
            return None
        context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
        try:
            context.load_cert_chain(self.certificate, self.key)
        except OSError as error:
            raise ParameterError(
                f"the page's certificate {self.certificate} cannot be used: {error}"
            ) from None
        return context


class PageServer:
    """Serves the page to any number of browsers; use it in a ``with`` statement.

    Parameters
    ----------
    address : Address
        Where to listen.
    acts : mapping of str to callable
        What a person can do, by the name of its form. Called in the server's thread; a `RigError`
        says why it is not done.

    Raises
    ------
    DeviceError
        If the address cannot be listened at.
    ParameterError
        If the certificate cannot be used.
    """

    patience = 10.0  # [s], how long the rig may take to answer

    def __init__(self, address: Address, acts: Mapping[str, Act]) -> None:
        self._address = address
        self.token = "" if address.is_local else secrets.token_urlsafe(24)
        self._tls = address.make_tls()
        try:
            self._sockets = bind_sockets(address.port, address.host)
        except OSError as error:
            raise DeviceError(
                f"the page cannot listen at {address.host}:{address.port}: {error.strerror}"
            ) from None
        self.port: int = self._sockets[0].getsockname()[1]
        self.acts = acts
        from jinja2 import Environment, PackageLoader, StrictUndefined

        environment = Environment(
            loader=PackageLoader("impact_rig.page"), autoescape=True, undefined=StrictUndefined
        )
        parts: Any = environment.get_template("parts.html").module
        environment.globals |= {name: getattr(parts, name) for name in MACROS}
        self._template = environment.get_template("page.html")
        self._view: Any = None
        self.fragments: dict[str, str] = {}
        self.traces: dict[int, bytes] = {}
        self.pages: set[LivePage] = set()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    @property
    def link(self) -> str:
        """The page's address for a person."""
        host = f"[{self._address.host}]" if ":" in self._address.host else self._address.host
        scheme = "https" if self._tls else "http"
        query = f"?{TOKEN}={quote(self.token)}" if self.token else ""
        return f"{scheme}://{host}:{self.port}/{query}"

    @property
    def origin(self) -> str:
        """Origin of this page in a browser's requests."""
        return self.link.rpartition("/")[0]

    def __enter__(self) -> Self:
        """Start to serve."""
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """End at once; open pages find out by themselves."""
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()

    def show(self, view: Any) -> None:
        """Let all pages show a view, as far as it is new."""
        self._loop.call_soon_threadsafe(self._show, view)

    def show_trace(self, record: int, trace: bytes, *, is_first: bool) -> None:
        """Let all pages show a hit's trace; `is_first`: those before are of another sample."""
        self._loop.call_soon_threadsafe(self._show_trace, record, trace, is_first)

    def render(self, answer: str, who: str) -> str:
        """Return the whole page."""
        return self._template.render(view=self._view, answer=answer, who=who)

    def _serve(self) -> None:
        asyncio.set_event_loop(self._loop)
        options: dict[str, Any] = {"server": self}
        handlers = [
            ("/", Page, options),
            ("/live", LivePage, options),
            (f"/({'|'.join(map(re.escape, STATIC))})", Static, options),
            ("/([a-z]+)", Acts, options),
        ]
        application = Application(
            handlers,
            default_handler_class=Nothing,
            default_handler_args=options,
            log_function=lambda _: None,
            websocket_max_message_size=LONGEST_FORM,
        )
        http = HTTPServer(
            application,
            ssl_options=self._tls,
            max_body_size=LONGEST_FORM,
            idle_connection_timeout=30.0,
        )
        http.add_sockets(self._sockets)
        self._loop.call_soon(self._beat)
        self._loop.run_forever()
        http.stop()
        for page in tuple(self.pages):
            page.close()
        self._loop.run_until_complete(http.close_all_connections())
        self._loop.close()

    def _beat(self) -> None:
        self._send({})
        self._loop.call_later(HEARTBEAT, self._beat)

    def _show(self, view: Any) -> None:
        self._view = view
        if view.hit is None:
            self.traces.clear()
        context = self._template.new_context({"view": view})
        fragments = {
            name: "".join(block(context)) for name, block in self._template.blocks.items()
        }
        news = {key: text for key, text in fragments.items() if self.fragments.get(key) != text}
        self.fragments = fragments
        if news:
            self._send(news)

    def _show_trace(self, record: int, trace: bytes, is_first: bool) -> None:  # noqa: FBT001
        if is_first:
            self.traces.clear()
        self.traces[record] = trace
        while len(self.traces) > KEPT_TRACES:
            del self.traces[next(iter(self.traces))]
        for page in tuple(self.pages):
            page.send_trace(trace)

    def _send(self, fragments: Mapping[str, str]) -> None:
        for page in tuple(self.pages):
            page.send(fragments)


class _Checked(RequestHandler):
    """Answers only who may ask: the right Host, the right Origin, the right token."""

    def initialize(self, server: PageServer) -> None:
        """Keep who serves."""
        self.server = server

    def prepare(self) -> None:
        """Refuse who may not ask."""
        if self.request.host != urlsplit(self.server.origin).netloc:
            raise HTTPError(421, reason=f"the page is at {self.server.origin}")
        origin = self.request.headers.get("Origin")
        is_safe = self.request.method in {"GET", "HEAD"} and not isinstance(self, LivePage)
        if origin != self.server.origin and not (is_safe and origin is None):
            raise HTTPError(403, reason="this request comes from another page")
        given = self.get_cookie(TOKEN) or self.get_query_argument(TOKEN, "")
        token = self.server.token
        if token and not hmac.compare_digest(given.encode(), token.encode()):
            raise HTTPError(403, reason="the link with its token is needed: see the terminal")

    def set_default_headers(self) -> None:
        """Let the browser run nothing but the page's own script."""
        self.set_header("Content-Security-Policy", POLICY)
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Referrer-Policy", "same-origin")
        self.set_header("Cache-Control", "no-store")
        self.clear_header("Server")

    def write_error(self, status_code: int, **_: Any) -> None:
        """Send the error as one sentence."""
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{self._reason}\n")

    def keep(self, name: str, value: str) -> None:
        """Keep a cookie in the browser."""
        secure = self.server.origin.startswith("https")
        self.set_cookie(name, quote(value), httponly=True, samesite="Strict", secure=secure)


class Nothing(_Checked):
    """Says that there is nothing at this address."""

    def prepare(self) -> None:
        """Refuse every address."""
        super().prepare()
        raise HTTPError(404, reason="there is nothing here: the page is at /")


class Static(_Checked):
    """Style and script."""

    def get(self, name: str) -> None:
        """Send one of them."""
        self.set_header("Content-Type", STATIC[name])
        self.finish((Path(__file__).parent / "templates" / name).read_bytes())


class Page(_Checked):
    """The page as a whole."""

    def get(self) -> None:
        """Show the page; a link with its token is kept as a cookie."""
        if self.get_query_argument(TOKEN, ""):
            self.keep(TOKEN, self.server.token)
            self.redirect("/")
            return
        self.finish(self.server.render(self.get_query_argument("answer", ""), read_who(self)))


class Acts(_Checked):
    """A person's acts. A browser with a script gets JSON, one without the page again."""

    async def post(self, name: str) -> None:
        """Do what a form asks for, and say what came of it."""
        fields = {key: tuple(self.get_body_arguments(key)) for key in self.request.body_arguments}
        form = Form(fields, read_who(self))
        too_long = [key for key, (text, *_) in fields.items() if len(text) > LONGEST_FIELD]
        if too_long:
            message = f"{too_long[0]} is longer than {LONGEST_FIELD} characters: write less"
            answer = Answer(done=False, message=message)
        elif name == WHO:
            self.keep(WHO, form[WHO][:60])
            answer = Answer(done=True, message="")
        elif name in self.server.acts:
            try:
                pending = asyncio.wrap_future(self.server.acts[name](form))
                answer = await asyncio.wait_for(pending, self.server.patience)
            except TimeoutError:
                answer = Answer(done=False, message=f"the rig did not answer to {name!r}")
            except RigError as error:
                answer = Answer(done=False, message=str(error))
        else:
            raise HTTPError(404, reason=f"nothing is called {name!r}")
        if "application/json" in self.request.headers.get("Accept", ""):
            self.finish({"done": answer.done, "message": answer.message})
        else:
            self.redirect(f"/?answer={quote(answer.message)}", status=303)


class LivePage(_Checked, WebSocketHandler):
    """One open page. A slow one skips what is old; it never holds up another."""

    def check_origin(self, origin: str) -> bool:
        """Return whether the page itself asks."""
        return origin == self.server.origin

    def open(self) -> None:
        """Show everything."""
        self.set_nodelay(value=True)
        self._is_busy = False
        self._news: dict[str, str] = {}
        self._traces: list[bytes] = list(self.server.traces.values())
        self.server.pages.add(self)
        self.send(self.server.fragments)

    def on_message(self, message: str | bytes) -> None:
        """Ignore it: acts are forms."""

    def on_close(self) -> None:
        """Forget the page."""
        self.server.pages.discard(self)

    def send(self, fragments: Mapping[str, str]) -> None:
        """Send fragments, or a sign of life."""
        self._news.update(fragments)
        if not self._is_busy:
            self._is_busy = True
            self._flushing = asyncio.ensure_future(self._flush())

    def send_trace(self, trace: bytes) -> None:
        """Send a trace; of many that wait the newest."""
        self._traces = [*self._traces[-KEPT_TRACES:], trace]
        self.send({})

    async def _flush(self) -> None:
        try:
            while True:
                news, self._news = self._news, {}
                traces, self._traces = self._traces, []
                now = round(time.time() * 1000)
                await self.write_message(json.dumps({"now": now, "fragments": news}))
                for trace in traces:
                    await self.write_message(trace, binary=True)
                if not (self._news or self._traces):
                    break
        except WebSocketClosedError:
            self.server.pages.discard(self)
        finally:
            self._is_busy = False


def read_who(handler: RequestHandler) -> str:
    """Return the name that the person at a page has given."""
    return unquote(handler.get_cookie(WHO) or "")[:60]
