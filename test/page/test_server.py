"""Who may see the page, and who may act."""

import http.client
import socket
from concurrent.futures import Future

import pytest

from impact_rig.core.given.errors import DeviceError, ParameterError
from impact_rig.page.server import Address, Answer, PageServer
from impact_rig.page.view import make_view
from impact_rig.status.rig_status import RigStatus

LOCAL = Address()


class Page:
    """A server, what it was asked to do, and a browser's requests."""

    def __init__(self, address=LOCAL):
        self.done = []
        self.server = PageServer(address, {"stop": self._act, "never": lambda _: Future()})
        self.server.__enter__()
        self.server.show(make_view(RigStatus()))

    def _act(self, form):
        self.done.append((form.who, dict(form.fields)))
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
    answer, _ = page.ask("POST", "/stop", "a=1&a=2", Origin=page.server.origin, Cookie="who=Anna")
    assert answer.status == 303
    assert answer.headers["Location"] == "/?answer=stopped"
    assert page.done == [("Anna", {"a": ("1", "2")})]


def test_a_script_gets_json(page):
    _, text = page.ask("POST", "/stop", Origin=page.server.origin, Accept="application/json")
    assert text == '{"done": true, "message": "stopped"}'


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 403),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Host": "evil.example", "Origin": "http://evil.example"}, 421),
    ],
)
def test_another_page_in_the_same_browser_may_not_act(page, headers, status):
    answer, text = page.ask("POST", "/stop", **headers)
    assert answer.status == status
    assert text.count("\n") == 1
    assert not page.done


def test_nothing_changes_by_get_and_unknown_names_are_named(page):
    origin = {"Origin": page.server.origin}
    assert page.ask("GET", "/stop", **origin)[0].status == 405
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


def test_a_live_channel_is_for_the_page_alone(page):
    upgrade = {
        "Connection": "Upgrade", "Upgrade": "websocket", "Sec_WebSocket_Version": "13",
        "Sec_WebSocket_Key": "dGhlIHNhbXBsZSBub25jZQ==",
    }  # fmt: skip
    assert page.ask("GET", "/live", **upgrade)[0].status == 403
    assert page.ask("GET", "/live", Origin="http://evil.example", **upgrade)[0].status == 403


@pytest.fixture
def elsewhere():
    """Return a page that is served to others; here by another address of this computer."""
    opened = Page(Address("0.0.0.0"))
    yield opened
    opened.server.__exit__()


def test_others_need_the_token_of_the_link(elsewhere):
    host = {"Host": f"0.0.0.0:{elsewhere.server.port}"}
    assert elsewhere.ask("GET", "/", **host)[0].status == 403
    assert elsewhere.ask("GET", "/?token=wrong", **host)[0].status == 403
    answer, _ = elsewhere.ask("GET", f"/?token={elsewhere.server.token}", **host)
    cookie = answer.headers["Set-Cookie"]
    assert answer.status == 302
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    kept = {"Cookie": cookie.partition(";")[0], **host}
    assert elsewhere.ask("GET", "/", **kept)[0].status == 200
    refused, _ = elsewhere.ask("POST", "/stop", Origin=elsewhere.server.origin, **host)
    assert refused.status == 403
    elsewhere.ask("POST", "/stop", Origin=elsewhere.server.origin, **kept)
    assert len(elsewhere.done) == 1


def test_a_port_that_is_taken_and_a_wrong_certificate_are_named(tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(DeviceError, match=rf"cannot listen at 127\.0\.0\.1:{port}"):
            PageServer(Address(port=port), {})
    path = tmp_path / "server.pem"
    path.write_text("no certificate")
    with pytest.raises(ParameterError, match=r"certificate .*server\.pem cannot be used"):
        PageServer(Address(certificate=path), {})
