"""The page's web server: fragments of the page out by WebSocket, acts in as plain forms.

It knows neither ROS nor the rig: it is given what to show, and functions that act. It runs in a
thread of its own; `PageServer.show` and `show_trace` may be called from any thread.
"""

import asyncio
import hmac
import json
import logging
import math
import re
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Self, TypeAlias
from urllib.parse import quote, unquote, urlsplit

from tornado.httpserver import HTTPServer
from tornado.web import Application, HTTPError, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from impact_rig.core.given.errors import RigError
from impact_rig.page.access import TOKEN, Address, Connections, make_link, read_host
from impact_rig.page.view import LONGEST_LIST, TEXTS

STATIC = {"page.css": "text/css; charset=utf-8", "page.js": "text/javascript; charset=utf-8"}
MACROS = ("act", "note", "strength", "numbers", "hit_row")
HEARTBEAT = 0.25
"""How often each page hears that the server is there, and what its acts are made from [s]."""
PING = 10.0
"""How often a browser must show that it is there [s]."""
REACTION = 2.0
"""How old what was shown may be when an act arrives that was made from it [s]."""
LONGEST_FORM = 20_000
"""Largest form of an act [bytes]."""
LONGEST_FIELD = 1000
"""Longest text of a person [characters], as in the templates."""
LONGEST_NAME = 60
KEPT_TRACES = 10
"""How many traces of a sample a page gets that opens late, and draws at each hit [-]."""
KEPT_STOPS = 50
"""How many stops that are done are remembered for the pages that asked for them [-]."""
STOP = "stop"
WHO = "who"
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self';"
    " img-src data:; form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)


class Seldom(logging.Filter):
    """Lets one message a second pass: a stranger fills no disk."""

    _passed = -math.inf  # when one did [s]

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a message is logged."""
        now = time.monotonic()
        if now - self._passed < 1.0:
            return False
        self._passed = now
        return True


SELDOM = Seldom()


@dataclass(frozen=True)
class Answer:
    """Outcome of an act."""

    done: bool
    message: str  # what was done, or why not


@dataclass(frozen=True)
class Form:
    """A form as a person has filled it in, with the person's name and address."""

    fields: Mapping[str, tuple[str, ...]]
    who: str
    address: str

    @property
    def by(self) -> str:
        """Who acts, and where."""
        return f"{self.who or 'somebody'} at the page ({self.address})"

    def __getitem__(self, name: str) -> str:
        """Return the first value of a field; empty: it is not there."""
        return self.fields.get(name, ("",))[0].strip()


Act: TypeAlias = Callable[[Form], "Future[Answer]"]


class _Door(HTTPServer):
    """Takes connections as far as there is room."""

    connections: Connections

    def handle_stream(self, stream: Any, address: tuple[Any, ...]) -> None:
        """Count a connection before anything is read from it."""
        self.connections.admit(stream, str(address[0]))
        super().handle_stream(stream, address)


class PageServer:
    """Serves the page to any number of browsers; use it in a ``with`` statement.

    Parameters
    ----------
    address : Address
        Where to listen.
    acts : mapping of str to callable
        What a person can do, by the name of its form. Called in the server's thread; a `RigError`
        says why it is not done.
    token : str, optional
        Who does not have it is refused; empty: everybody may ask.
    late : collection of str, optional
        Acts that are refused when they come late, or made from another sentence than the one
        that is shown now.

    Raises
    ------
    DeviceError
        If the address cannot be listened at.
    ParameterError
        If the certificate cannot be used.
    """

    patience = 10.0  # [s], how long the rig may take to answer

    def __init__(
        self,
        address: Address,
        acts: Mapping[str, Act],
        token: str = "",
        late: tuple[str, ...] = (),
    ) -> None:
        self.address = address
        self.token = token
        self._tls = address.make_tls()
        self._sockets = address.listen()
        self.port: int = self._sockets[0].getsockname()[1]
        self.acts = acts
        self.late = late
        self.connections = Connections()
        self.done_stops: deque[str] = deque(maxlen=KEPT_STOPS)
        from jinja2 import Environment, PackageLoader, StrictUndefined

        environment = Environment(
            loader=PackageLoader("impact_rig.page"), autoescape=True, undefined=StrictUndefined
        )
        self._rendered = ""  # what the forms say that is being rendered
        environment.globals |= {"seen": lambda: self._rendered, **TEXTS}
        parts: Any = environment.get_template("parts.html").module
        environment.globals |= {name: getattr(parts, name) for name in MACROS}
        self._template = environment.get_template("page.html")
        # Of the table of hits; what was rendered is not rendered again.
        self._make_row = lru_cache(2 * LONGEST_LIST)(parts.hit_row)
        self._view: Any = None
        self._sentence = 0  # number of the one that is shown
        self.fragments: dict[str, str | None] = {}
        self.traces: dict[int, bytes] = {}
        self.pages: set[LivePage] = set()
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    @property
    def links(self) -> list[str]:
        """The page's addresses for a person."""
        hosts, scheme = self.address.hosts, self.address.scheme
        return [make_link(scheme, host, self.port, self.token) for host in hosts]

    @property
    def origin(self) -> str:
        """Its first address, without the token."""
        return self.links[0].rpartition("/")[0]

    @property
    def seen(self) -> str:
        """What an act is made from: the sentence, when it was shown, and the rig's states."""
        state = "" if self._view is None else self._view.seen
        return f"{self._sentence} {_read_clock():.3f} {state}"

    def refuse_late(self, seen: str) -> str | None:
        """Return why an act is not done, by what it was made from; None: it may be."""
        try:
            number, shown = map(float, seen.split()[:2])
        except ValueError:
            return "not done: the form does not say what was shown; load the page again"
        if number != self._sentence:
            return "not done: what was shown has changed since; look, then do it again"
        late = _read_clock() - shown - REACTION
        if not late <= 0.0:
            return f"not done: it came {late:.1f} s too late; look, then do it again"
        return None

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
        """Let all pages show a hit's trace; `is_first`: it is the first of its sample."""
        self._loop.call_soon_threadsafe(self._show_trace, record, trace, is_first)

    def render(self, answer: str, who: str) -> str:
        """Return the whole page, whose forms say what they are made from."""
        self._rendered = self.seen
        try:
            return self._template.render(view=self._view, answer=answer, who=who)
        finally:
            self._rendered = ""

    async def do(self, name: str, form: Form) -> Answer:
        """Do what a form asks for; return what came of it."""
        try:
            if name in self.late and (refusal := self.refuse_late(form["seen"])):
                return Answer(done=False, message=refusal)
            if name == STOP and form[STOP] in self.done_stops:
                return Answer(done=True, message="stopped")
            pending = asyncio.wrap_future(self.acts[name](form))
            answer = await asyncio.wait_for(pending, self.patience)
        except TimeoutError:
            return Answer(done=False, message="the rig does not answer: look what it does")
        except RigError as error:
            return Answer(done=False, message=str(error))
        if name == STOP and answer.done:
            self.done_stops.append(form[STOP])
            self._send({})
        return answer

    def _serve(self) -> None:
        asyncio.set_event_loop(self._loop)
        for name in ("tornado.application", "tornado.general", "asyncio"):
            logging.getLogger(name).addFilter(SELDOM)
        options: dict[str, Any] = {"server": self}
        handlers = [
            ("/", Page, options),
            ("/live", LivePage, options),
            (f"/({'|'.join(map(re.escape, STATIC))})", Static, options),
            ("/(.*)", Acts, options),
        ]
        application = Application(
            handlers,
            log_function=lambda _: None,
            websocket_max_message_size=LONGEST_FORM,
            websocket_ping_interval=PING,
        )
        http = _Door(
            application,
            ssl_options=self._tls,
            max_body_size=LONGEST_FORM,
            idle_connection_timeout=30.0,
            body_timeout=10.0,
        )
        http.connections = self.connections
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
        before, self._view = self._view, view
        if before is None or view.sentence.key != before.sentence.key:
            self._sentence += 1
        if view.hit is None:
            self.traces.clear()
        context = self._template.new_context({"view": view})
        fragments: dict[str, str | None] = {
            name: "".join(block(context)).strip() for name, block in self._template.blocks.items()
        }
        fragments |= {f"hit-{hit.record}": str(self._make_row(hit)) for hit in view.hits}
        news = {key: text for key, text in fragments.items() if self.fragments.get(key) != text}
        news |= dict.fromkeys(self.fragments.keys() - fragments.keys())
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

    def _send(self, fragments: Mapping[str, str | None]) -> None:
        for page in tuple(self.pages):
            page.send(fragments)


class _Checked(RequestHandler):
    """Answers only who may ask: the right Host, the right Origin, the right token."""

    def initialize(self, server: PageServer) -> None:
        """Keep who serves."""
        self.server = server

    def prepare(self) -> None:
        """Refuse who may not ask."""
        server, connection = self.server, self.request.connection
        stream = connection.stream  # type: ignore[union-attr] # of HTTP/1, the only one
        local = stream.socket.getsockname()[0]
        if not server.address.is_served(self.request.host, local, server.port):
            raise HTTPError(421, reason=f"the page is at {server.origin}")
        is_safe = self.request.method in {"GET", "HEAD"} and not isinstance(self, LivePage)
        origin = self.request.headers.get("Origin")
        if not self._is_own(origin) and not (is_safe and origin is None):
            raise HTTPError(403, reason="this request comes from another page")
        given = self.get_query_argument(TOKEN, "") or self.read_cookie(TOKEN)
        if server.token and not hmac.compare_digest(given.encode(), server.token.encode()):
            raise HTTPError(403, reason="the link with its token is needed: see the terminal")
        if not server.connections.know(stream):
            raise HTTPError(503, reason="too many pages are open: close some")

    def _is_own(self, origin: str | None) -> bool:
        """Return whether a request comes from a page that was asked for by the same Host."""
        scheme, port = self.server.address.scheme, 443 if self.server.address.certificate else 80
        given = urlsplit(origin or "")
        asked = read_host(self.request.host, port)
        return given.scheme.lower() == scheme and read_host(given.netloc, port) == asked

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

    def keep_cookie(self, name: str, value: str) -> None:
        """Keep a cookie in the browser, beside those of pages at other ports."""
        secure = self.server.address.certificate is not None
        name = f"{name}_{self.server.port}"
        self.set_cookie(name, quote(value), httponly=True, samesite="Strict", secure=secure)

    def read_cookie(self, name: str) -> str:
        """Return the value of a cookie; empty: there is none."""
        return unquote(self.get_cookie(f"{name}_{self.server.port}") or "")

    def read_form(self, fields: Mapping[str, tuple[str, ...]]) -> Form:
        """Return a form with who has filled it in."""
        return Form(fields, self.read_cookie(WHO)[:LONGEST_NAME], self.request.remote_ip or "")


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
            self.keep_cookie(TOKEN, self.server.token)
            self.redirect("/")
            return
        answer = self.get_query_argument("answer", "")[:LONGEST_FIELD]
        self.finish(self.server.render(answer, self.read_cookie(WHO)[:LONGEST_NAME]))


class Acts(_Checked):
    """A person's acts. A browser with a script gets JSON, one without the page again."""

    def get(self, _: str) -> None:
        """Change nothing."""
        raise HTTPError(404, reason="there is nothing here: the page is at /")

    async def post(self, name: str) -> None:
        """Do what a form asks for, and say what came of it."""
        fields = {key: tuple(self.get_body_arguments(key)) for key in self.request.body_arguments}
        form = self.read_form(fields)
        too_long = [key for key, (text, *_) in fields.items() if len(text) > LONGEST_FIELD]
        if too_long:
            message = f"{too_long[0]} is longer than {LONGEST_FIELD} characters: write less"
            answer = Answer(done=False, message=message)
        elif name == WHO:
            self.keep_cookie(WHO, form[WHO][:LONGEST_NAME])
            answer = Answer(done=True, message="")
        elif name in self.server.acts:
            answer = await self.server.do(name, form)
        else:
            raise HTTPError(404, reason=f"nothing is called {name!r}")
        if "application/json" in self.request.headers.get("Accept", ""):
            self.finish({"done": answer.done, "message": answer.message})
        else:
            self.redirect(f"/?answer={quote(answer.message)}", status=303)


class LivePage(_Checked, WebSocketHandler):
    """One open page. It says what it has put on the screen, and then gets the newest.

    Each message of the browser carries its time, and the answer brings it back: so a browser that
    was asleep sees that an answer is old.
    """

    def check_origin(self, origin: str) -> bool:
        """Return whether the page itself asks."""
        return self._is_own(origin)

    def open(self) -> None:
        """Wait for its first word."""
        self.set_nodelay(value=True)
        self._has_shown = ""  # by the browser's clock, when it had shown all; empty: it has not
        self._news: dict[str, str | None] = dict(self.server.fragments)
        self._traces: list[bytes] = list(self.server.traces.values())
        self._is_new = True
        self.server.pages.add(self)

    def on_message(self, message: str | bytes) -> None:
        """Take that the newest message is shown, or a stop."""
        try:
            said = json.loads(message)
            shown, stop = str(said.get("shown", ""))[:40], str(said.get(STOP, ""))[:40]
        except (ValueError, AttributeError):
            self.close()
            return
        if stop:
            work = self.server.do(STOP, self.read_form({STOP: (stop,)}))
            asyncio.get_running_loop().create_task(work)
        if shown:
            self._has_shown = shown
            if self._news or self._traces:
                self._send()

    def on_close(self) -> None:
        """Forget the page."""
        self.server.pages.discard(self)

    def send(self, fragments: Mapping[str, str | None]) -> None:
        """Send fragments, or a sign of life, once what was sent before is shown."""
        self._news.update(fragments)
        self._send()

    def send_trace(self, trace: bytes) -> None:
        """Send a trace, once what was sent before is shown."""
        self._traces = [*self._traces[1 - KEPT_TRACES :], trace]
        self._send()

    def _send(self) -> None:
        if not self._has_shown:
            return
        message = json.dumps(
            {
                "answers": self._has_shown,
                "now": time.time() * 1e3,
                "seen": self.server.seen,
                "stops": list(self.server.done_stops),
                "all": self._is_new,
                "fragments": self._news,
            }
        )
        pending: list[str | bytes] = [*self._traces, message]
        self._traces, self._news = [], {}
        self._has_shown, self._is_new = "", False
        try:
            for data in pending:
                done = self.write_message(data, binary=isinstance(data, bytes))
                # That it goes nowhere is found out by the ping.
                done.add_done_callback(lambda it: it.exception())
        except WebSocketClosedError:
            self.server.pages.discard(self)


def _read_clock() -> float:
    """Return a time that cannot be set, and that goes on while the computer sleeps [s]."""
    return time.clock_gettime(time.CLOCK_BOOTTIME)
