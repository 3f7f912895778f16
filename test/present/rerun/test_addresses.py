"""Addresses of viewers, and of what listens for them."""

import socket

import pytest

from impact_rig.core.errors import DeviceError, ParameterError
from impact_rig.present.rerun.addresses import (
    check_listen_address,
    check_viewer_address,
    choose_loopback,
    choose_port,
    choose_reachable_name,
    is_answering,
    is_local,
    make_page_address,
    make_viewer_address,
)


@pytest.mark.parametrize(
    "address",
    [
        "localhost",
        "http://127.0.0.1:9876/proxy",
        "rerun+http://:9876/proxy",
        "rerun+http://h:x/proxy",
        "rerun+http://h:1/",
    ],
)
def test_a_wrong_address_is_named_with_a_right_one(address):
    with pytest.raises(ParameterError, match=r"rerun\+http://127\.0\.0\.1:9876/proxy") as caught:
        check_viewer_address(address)
    assert repr(address) in str(caught.value)


def test_the_port_of_an_address_is_reruns_own_unless_told():
    assert check_viewer_address("rerun+http://lab/proxy") == ("lab", 9876)
    assert check_viewer_address("rerun+https://lab:12/proxy") == ("lab", 12)


@pytest.mark.parametrize(("host", "port"), [("127.0.0.1", 9876), ("::1", 80), ("lab", 1)])
def test_an_address_that_is_made_is_one(host, port):
    assert check_viewer_address(make_viewer_address(host, port)) == (host, port)


def test_a_page_is_told_where_its_data_is():
    page = make_page_address("::1", 80, "rerun+http://[::1]:81/proxy")
    assert page == "http://[::1]:80/?url=rerun%2Bhttp%3A%2F%2F%5B%3A%3A1%5D%3A81%2Fproxy"


@pytest.mark.parametrize(
    ("listen", "local", "reachable", "loopback"),
    [
        ("127.0.0.1", True, "127.0.0.1", "127.0.0.1"),
        ("0.0.0.0", False, socket.gethostname(), "127.0.0.1"),
        ("::", False, socket.gethostname(), "::1"),
        ("10.1.2.3", False, "10.1.2.3", "10.1.2.3"),
    ],
)
def test_what_listens_is_reached_from_here_and_from_there(listen, local, reachable, loopback):
    assert check_listen_address(listen) == listen
    assert is_local(listen) is local
    assert choose_reachable_name(listen) == reachable
    assert choose_loopback(listen) == loopback


def test_a_port_that_is_taken_is_named():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert is_answering("127.0.0.1", port)
        with pytest.raises(DeviceError, match=rf"127\.0\.0\.1, port {port} .* 0 for any free one"):
            choose_port("127.0.0.1", port)
    assert choose_port("127.0.0.1", port) == port
    assert not is_answering("127.0.0.1", port)
