"""Who may see the page, and who may act."""

import asyncio
import http.client
import json
import logging
import socket
import stat
from concurrent.futures import Future
from types import SimpleNamespace

import pytest
from tornado.httpclient import HTTPRequest
from tornado.websocket import websocket_connect

from impact_rig.core.given.errors import DeviceError, ParameterError
from impact_rig.page import access
from impact_rig.page.access import Address, Connections, keep_token, make_link, read_host
from impact_rig.page.server import HEARTBEAT, REACTION, SELDOM, Answer, PageServer, Seldom
from impact_rig.page.view import make_view
from impact_rig.results.campaign import HitResults
from impact_rig.status.rig_status import RigStatus
from impact_rig.status.states import CampaignStatus, Disarming, HammerStatus, Step

LOCAL = Address()


class Page:
    """A server, what it was asked to do, and a browser's requests."""

    def __init__(self, address=LOCAL, token=""):
        self.done = []
        acts = {"stop": self._act, "arm": self._act, "never": lambda _: Future()}
        self.server = PageServer(address, acts, token, late=("arm",))
        self.server.__enter__()
        self.server.show(make_view(RigStatus()))

    def _act(self, form):
        self.done.append((form.by, dict(form.fields)))
        answer = Future()
        answer.set_result(Answer(done=True, message="stopped"))
        return answer

    def ask(self, method, path, body="", **headers):
        connection = http.client.HTTPConnection("127.0.0.1", self.server.port, timeout=20)
        given = {"Content-Type": "application/x-www-form-urlencoded"}
        given |= {name.replace("_", "-"): value for name, value in headers.items()}
        connection.request(method, path, body, given)
        answer = connection.getresponse()
        text = answer.read().decode()
        connection.close()
        return answer, text


@pytest.fixture
def page():
    opened = Page()
    yield opened
    opened.server.__exit__()


def test_the_page_itself_may_act(page):
    cookie = f"who_{page.server.port}=Anna; who_1=Bob"
    answer, _ = page.ask("POST", "/stop", "a=1&a=2", Origin=page.server.origin, Cookie=cookie)
    assert answer.status == 303
    assert answer.headers["Location"] == "/?answer=stopped"
    assert page.done == [("Anna at the page (127.0.0.1)", {"a": ("1", "2")})]
    # A script gets JSON.
    _, text = page.ask("POST", "/stop", Origin=page.server.origin, Accept="application/json")
    assert text == '{"done": true, "message": "stopped"}'


UPGRADE = {
    "Connection": "Upgrade", "Upgrade": "websocket", "Sec_WebSocket_Version": "13",
    "Sec_WebSocket_Key": "dGhlIHNhbXBsZSBub25jZQ==",
}  # fmt: skip


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 403),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Host": "evil.example", "Origin": "http://evil.example"}, 421),
    ],
)
def test_another_page_in_the_same_browser_may_not_act_nor_look(page, headers, status):
    for answer, text in (
        page.ask("POST", "/stop", **headers),
        page.ask("GET", "/live", **headers, **UPGRADE),
    ):
        assert answer.status == status
        assert text.count("\n") == 1
    assert not page.done


def test_nothing_changes_by_get_and_unknown_names_are_named(page):
    origin = {"Origin": page.server.origin}
    assert page.ask("GET", "/stop", **origin)[0].status == 404
    answer, text = page.ask("POST", "/explode", **origin)
    assert (answer.status, text) == (404, "nothing is called 'explode'\n")
    assert page.ask("GET", "/../server.py", **origin)[0].status == 404
    assert not page.done


def test_a_text_that_is_too_long_is_named(page):
    answer, text = page.ask(
        "POST",
        "/stop",
        "record=" + 5000 * "9",
        Origin=page.server.origin,
        Accept="application/json",
    )
    assert answer.status == 200
    assert "record is longer than 1000 characters: write less" in text
    assert not page.done


def test_another_host_does_not_see_the_page(page):
    assert page.ask("GET", "/", Host="evil.example")[0].status == 421
    answer, text = page.ask("GET", "/")
    assert answer.status == 200
    assert "unsafe" not in answer.headers["Content-Security-Policy"]
    assert "READY" in text or "WAIT" in text


@pytest.fixture
def elsewhere():
    """Return a page that is served to others; here by another address of this computer."""
    opened = Page(Address("0.0.0.0"), token="secret")
    yield opened
    opened.server.__exit__()


def test_others_need_the_token_of_the_link_which_counts_before_a_cookie(elsewhere):
    port, origin = elsewhere.server.port, f"http://127.0.0.1:{elsewhere.server.port}"
    assert elsewhere.ask("GET", "/")[0].status == 403
    assert elsewhere.ask("GET", "/?token=wrong")[0].status == 403
    old = {"Cookie": f"token_{port}=old"}
    assert elsewhere.ask("GET", "/", **old)[0].status == 403
    answer, _ = elsewhere.ask("GET", "/?token=secret", **old)
    cookie = answer.headers["Set-Cookie"]
    assert answer.status == 302
    assert cookie.startswith(f"token_{port}=secret; HttpOnly")
    assert "SameSite=Strict" in cookie
    kept = {"Cookie": f"token_1=other; {cookie.partition(';')[0]}"}
    assert elsewhere.ask("GET", "/", **kept)[0].status == 200
    assert elsewhere.ask("POST", "/stop", Origin=origin)[0].status == 403
    elsewhere.ask("POST", "/stop", Origin=origin, **kept)
    assert len(elsewhere.done) == 1


def test_a_restart_keeps_the_token_of_its_folder_for_its_user_alone(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    token, path = keep_token(tmp_path / "run")
    assert len(token) >= 32
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    path.chmod(0o644)
    assert keep_token(tmp_path / "run") == (token, path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert keep_token(tmp_path / "other")[0] != token


@pytest.mark.parametrize(
    ("address", "asked", "port", "is_served"),
    [
        (Address(), "LOCALHOST:8000", 8000, True),
        (Address("localhost"), "127.0.0.1:8000", 8000, True),
        (Address(), "127.0.0.1", 80, True),
        (Address(), "127.0.0.1", 8000, False),
        (Address(), f"{socket.gethostname()}:8000", 8000, False),
        (Address("Rig.Lab"), "rig.lab:8000", 8000, True),
        (Address("0.0.0.0"), "192.0.2.7:8000", 8000, True),
        (Address("0.0.0.0"), "192.0.2.8:8000", 8000, False),
        (Address("0.0.0.0"), f"{socket.gethostname().upper()}:8000", 8000, True),
        (Address("::"), "[::1]:8000", 8000, False),
    ],
)
def test_hosts_are_compared_as_browsers_write_them(address, asked, port, is_served):
    assert address.is_served(asked, "192.0.2.7", port) is is_served


def test_hosts_that_cannot_be_read_are_nobodys():
    assert read_host("a:b:c", 80) == read_host("[", 80) == ("", 0)


def test_a_page_for_every_network_has_a_link_for_each_of_them():
    hosts = Address("0.0.0.0").hosts
    assert hosts
    assert "0.0.0.0" not in hosts
    assert make_link("http", "fe80::1", 80, "a b") == "http://[fe80::1]:80/?token=a%20b"


def test_a_port_that_is_taken_gives_way_and_a_wrong_address_or_certificate_is_named(tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        sockets = Address(port=port).listen()
        assert port < sockets[0].getsockname()[1] < port + access.PORTS_TRIED
        sockets[0].close()
    for host in ("192.0.2.1", "no such host", "x" * 300):
        with pytest.raises(DeviceError, match=f"cannot listen at {host}:0"):
            Address(host).listen()
    path = tmp_path / "server.pem"
    path.write_text("no certificate")
    with pytest.raises(ParameterError, match=r"certificate .*server\.pem cannot be used"):
        PageServer(Address(certificate=path), {})
    with pytest.raises(ParameterError, match=r"key .*server\.pem has no certificate"):
        PageServer(Address(key=path), {})


# What an act is made from.


def test_an_act_that_is_late_or_from_another_sentence_is_not_done(page, monkeypatch):
    now = [1000.0]
    monkeypatch.setattr("impact_rig.page.server._read_clock", lambda: now[0])

    def arm(seen):
        origin = {"Origin": page.server.origin, "Accept": "application/json"}
        return json.loads(page.ask("POST", "/arm", f"seen={seen}", **origin)[1])

    page.ask("GET", "/")
    seen = page.server.seen.replace(" ", "+")
    now[0] += REACTION
    assert arm(seen)["done"]
    now[0] += 0.01
    assert "too late" in arm(seen)["message"]
    changed = make_view(RigStatus(hammer=HammerStatus(disarmed_by=Disarming.EMERGENCY_STOP)))
    seen = page.server.seen.replace(" ", "+")
    page.server.show(changed)
    assert "has changed since" in arm(seen)["message"]
    assert "does not say" in arm("")["message"]
    assert "too late" in arm(f"{page.server.seen.split()[0]}+nan")["message"]
    assert len(page.done) == 1


# The live channel.


def talk(page, conversation):
    """Run a conversation over the live channel."""

    async def run():
        url = f"ws://127.0.0.1:{page.server.port}/live"
        request = HTTPRequest(url, headers={"Origin": page.server.origin})
        channel = await websocket_connect(request)

        async def hear(shown):
            await channel.write_message(json.dumps({"shown": shown}))
            return json.loads(await asyncio.wait_for(channel.read_message(), 10.0))

        await conversation(channel, hear)
        channel.close()

    asyncio.run(run())


def test_a_browser_gets_the_newest_alone_when_it_has_shown_what_came_before(page):
    async def conversation(channel, hear):
        first = await hear(5)
        assert (first["answers"], first["all"]) == ("5", True)
        assert "READY" in first["fragments"]["say"] or "WAIT" in first["fragments"]["say"]
        stopped = [
            HammerStatus(stopped_by=f"person {n}", disarmed_by=Disarming.EMERGENCY_STOP)
            for n in range(50)
        ]
        for hammer in stopped:
            page.server.show(make_view(RigStatus(hammer=hammer)))
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(channel.read_message(), 3 * HEARTBEAT)
        newest = await hear(6)
        assert newest["answers"] == "6"
        assert "person 49" in newest["fragments"]["say"]

    talk(page, conversation)


def test_a_stop_over_the_live_channel_is_done_though_nothing_is_shown(page):
    async def conversation(channel, hear):
        await channel.write_message('{"stop": "one"}')
        while "one" not in (await hear(1))["stops"]:
            pass
        # It is done once: said again, after somebody's reset, it stops nothing.
        await channel.write_message('{"stop": "one"}')
        await channel.write_message('{"stop": "two"}')
        while "two" not in (await hear(1))["stops"]:
            pass

    talk(page, conversation)
    assert [fields["stop"] for _, fields in page.done] == [("one",), ("two",)]


def test_of_the_table_of_hits_only_what_is_new_is_sent(page):
    hits = [HitResults("steel small", n, 1, n, True) for n in range(1, 101)]

    def show(hits):
        status = RigStatus(campaign=CampaignStatus(state=Step.COUNTING))
        for hit in hits:
            status.add_hit(hit)
        page.server.show(make_view(status))

    async def conversation(channel, hear):
        show(hits)
        while "hit-100" not in (await hear(1))["fragments"]:
            pass
        show([*hits, HitResults("steel small", 101, 1, 101, True)])
        while not (news := (await hear(2))["fragments"]):
            pass
        rows = {name: row for name, row in news.items() if name.startswith("hit-")}
        assert set(rows) == {"hit-101", "hit-1"}  # the oldest leaves
        assert rows["hit-1"] is None
        assert len(json.dumps(news)) < 10_000

    talk(page, conversation)


# Strangers.


class Stream:
    """A connection."""

    def __init__(self):
        self.is_open = True

    def close(self):
        self.is_open = False

    def closed(self):
        return not self.is_open


def test_strangers_push_out_strangers_and_never_one_that_is_known():
    kept = Connections()
    known = [Stream() for _ in range(access.MOST_KNOWN)]
    for stream in known:
        kept.admit(stream, "192.0.2.1")
        assert kept.know(stream)
    late = Stream()
    kept.admit(late, "192.0.2.1")
    assert not kept.know(late)
    same = [Stream() for _ in range(access.MOST_STRANGERS_OF_ONE + 1)]
    for stream in same:
        kept.admit(stream, "192.0.2.2")
    assert [stream.is_open for stream in same] == [False] + [True] * access.MOST_STRANGERS_OF_ONE
    others = [Stream() for _ in range(access.MOST_STRANGERS)]
    for number, stream in enumerate(others):
        kept.admit(stream, f"192.0.2.{number + 3}")
    assert all(stream.is_open for stream in (*known, *others))
    assert not any(stream.is_open for stream in same)


def test_an_error_of_the_server_is_logged_once_a_second(monkeypatch):
    now, seldom = [10.0], Seldom()
    clock = SimpleNamespace(monotonic=lambda: now[0])
    monkeypatch.setattr("impact_rig.page.server.time", clock)
    record = logging.LogRecord("tornado.general", logging.ERROR, "", 0, "broken", (), None)
    told = []
    for moment in (10.0, 10.99, 11.0, 11.5):
        now[0] = moment
        told.append(seldom.filter(record))
    assert told == [True, False, True, False]
    assert SELDOM in logging.getLogger("asyncio").filters
