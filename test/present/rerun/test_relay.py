"""Web page and window: who looks at them gets everything, and holds up nobody else."""

import signal
import socket
import sys

import numpy as np
import psutil
import pytest

from impact_rig.present.rerun.addresses import make_viewer_address

from .onlookers import (
    NOISE,
    PATIENCE,
    Notices,
    find_free_port,
    has_hit,
    list_listeners,
    show_noise,
    wait_until,
)

pytest.importorskip("rerun", reason="rerun-sdk is not installed")


def test_file_viewer_and_web_page_at_once_and_only_this_host_reaches_them(
    tmp_path, viewer, start, open_all, read_recording
):
    port, announced = find_free_port(), Notices()
    viewer(port)
    path, kept = tmp_path / "view.rrd", tmp_path / "kept.rrd"
    file, live, relay = open_all(
        output=str(path),
        connect=make_viewer_address("127.0.0.1", port),
        web=True,
        announce=announced,
    )
    announced.wait_for("the view is at http://127.0.0.1:")
    assert {item.laddr.ip for item in list_listeners(psutil.Process().pid)} == {"127.0.0.1"}
    wait_until(lambda: not live.is_lost)
    for destination in (file, live, relay):
        show_noise(destination)
    # Who comes late to the relay gets everything.
    address = relay.name.removeprefix("the relay ")
    late = start(find_free_port(), "--save", kept, address)
    wait_until(lambda: has_hit(read_recording, kept))
    for destination in (file, live, relay):
        destination.close()
    late.send_signal(signal.SIGINT)
    late.wait(PATIENCE)

    assert [destination.dropped for destination in (file, live, relay)] == [0, 0, 0]
    for name in (path, kept):
        _, values = read_recording(name).find_traces("/hits/1")
        np.testing.assert_array_equal(values, NOISE.values)


def test_a_stuck_viewer_holds_up_the_page_until_it_goes_on(
    monkeypatch, tmp_path, start, open_all, read_recording
):
    monkeypatch.setattr("impact_rig.present.rerun.destination.FLUSH_TIMEOUT", 0.2)
    notices = Notices()
    (relay,) = open_all(web=True, announce=notices, notify=notices)
    address, kept = relay.name.removeprefix("the relay "), tmp_path / "kept.rrd"
    stuck = start(find_free_port(), "--save", kept, address)
    show_noise(relay)
    wait_until(lambda: has_hit(read_recording, kept))
    stuck.send_signal(signal.SIGSTOP)

    def is_held_up():
        for record in range(2, 20):
            show_noise(relay, record)
        return relay.is_lost

    wait_until(is_held_up)
    notices.wait_for("is held up by a viewer that takes no data")
    stuck.send_signal(signal.SIGCONT)
    notices.wait_for("goes on")
    wait_until(lambda: not relay.is_lost)
    # Who looks keeps the server from ending.
    stuck.kill()
    stuck.wait()

    assert sum("held up" in text for text in notices.texts) == 1


def test_whoever_wants_the_page_on_the_network_gets_it_there(open_all):
    announced = Notices()
    port = find_free_port()
    open_all(web=True, listen="0.0.0.0", web_port=port, announce=announced)
    announced.wait_for(f":{port}/?url=rerun%2Bhttp%3A%2F%2F{socket.gethostname()}%3A")

    listeners = {item.laddr for item in list_listeners(psutil.Process().pid)}
    assert ("0.0.0.0", port) in listeners
    assert {ip for ip, _ in listeners} == {"0.0.0.0"}


@pytest.mark.skipif(sys.platform != "linux", reason="screens are known by other means")
def test_a_window_that_is_closed_is_told_with_how_to_open_another(monkeypatch, open_all):
    # A screen that is not there: the viewer starts and gives up.
    monkeypatch.setenv("DISPLAY", ":31415")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    notices = Notices()
    (relay,) = open_all(spawn=True, notify=notices)
    show_noise(relay)
    notices.wait_for("the viewer has ended")

    assert "--connect rerun+http://127.0.0.1:" in notices.texts[0]
    assert not relay.is_lost
