"""A viewer elsewhere: it may come late, die, stop or be none at all, and nobody waits for it."""

import contextlib
import signal
import socket
import threading
import time

import numpy as np
import pytest

from impact_rig.present.rerun import connection
from impact_rig.present.rerun.addresses import make_viewer_address
from impact_rig.present.rerun.connection import History
from impact_rig.present.rerun.destination import QUEUE_LENGTH, QUEUE_SIZE

from .onlookers import NOISE, PATIENCE, Notices, find_free_port, has_hit, show_noise, wait_until

pytest.importorskip("rerun", reason="rerun-sdk is not installed")


def test_a_viewer_may_come_late_and_gets_everything_so_far(
    tmp_path, viewer, start, open_all, read_recording
):
    port, notices = find_free_port(), Notices()
    address = make_viewer_address("127.0.0.1", port)
    (live,) = open_all(connect=address, announce=notices, notify=notices)
    notices.wait_for("no viewer answers at")
    live.begin(lambda log: log.log_setup("rig 7", ["steel small"]))
    show_noise(live)
    kept = tmp_path / "kept.rrd"
    viewer(port)
    late = start(find_free_port(), "--save", kept, address)
    notices.wait_for("is there and shows the campaign so far")
    wait_until(lambda: has_hit(read_recording, kept))
    live.close()
    late.send_signal(signal.SIGINT)
    late.wait(PATIENCE)

    assert (len(notices.texts), live.dropped) == (2, 0)
    view = read_recording(kept)
    np.testing.assert_array_equal(view.find_traces("/hits/1")[1], NOISE.values)
    assert view.read_blueprint()


def test_a_viewer_that_dies_is_told_once_and_the_file_goes_on_until_it_is_back(
    tmp_path, viewer, open_all, read_recording
):
    port, notices = find_free_port(), Notices()
    first = viewer(port)
    path = tmp_path / "view.rrd"
    file, live = open_all(
        output=str(path),
        connect=make_viewer_address("127.0.0.1", port),
        announce=notices,
        notify=notices,
    )
    wait_until(lambda: not live.is_lost)
    first.kill()
    first.wait()
    count = 0

    def is_missed():
        nonlocal count
        count += 1
        for destination in (file, live):
            show_noise(destination, count)
        return live.is_lost

    wait_until(is_missed)
    notices.wait_for("is gone or takes no data: the rig goes on without it")
    viewer(port)
    notices.wait_for("is there and shows the campaign so far")
    wait_until(lambda: not live.is_lost)
    for destination in (file, live):
        destination.close()

    assert len(notices.texts) == 2
    assert (file.dropped, live.dropped) == (0, 0)
    assert f"/hits/{count}" in read_recording(path).entities


def test_a_viewer_that_is_stopped_costs_nobody_any_time_and_is_shown_all_when_it_goes_on(
    monkeypatch, viewer, open_all, tmp_path
):
    monkeypatch.setattr("impact_rig.present.rerun.destination.FLUSH_TIMEOUT", 0.2)
    port, notices = find_free_port(), Notices()
    stopped = viewer(port)
    file, live = open_all(
        output=str(tmp_path / "view.rrd"),
        connect=make_viewer_address("127.0.0.1", port),
        announce=notices,
        notify=notices,
    )
    wait_until(lambda: not live.is_lost)
    stopped.send_signal(signal.SIGSTOP)
    start = time.monotonic()
    for record in range(1000):
        show_noise(live, record)
    show_noise(file)
    assert time.monotonic() - start < 1.0
    notices.wait_for("is gone or takes no data")
    assert live.is_lost
    assert live.dropped > 0  # a thousand are more than are kept
    file.close()
    stopped.send_signal(signal.SIGCONT)
    notices.wait_for("is there and shows the campaign so far")

    assert file.dropped == 0
    assert len(notices.texts) == 2


def test_somebody_who_answers_and_is_no_viewer_is_told_once_and_asked_ever_less(
    monkeypatch, open_all
):
    monkeypatch.setattr(connection, "RETRY_PERIOD", 0.01)
    asked = threading.Semaphore(0)
    with socket.create_server(("127.0.0.1", 0)) as server:

        def hang_up():
            with contextlib.suppress(OSError):
                while True:
                    server.accept()[0].close()
                    asked.release()

        threading.Thread(target=hang_up, daemon=True).start()
        announced, notices = Notices(), Notices()
        address = make_viewer_address("127.0.0.1", server.getsockname()[1])
        (live,) = open_all(connect=address, announce=announced, notify=notices)
        show_noise(live)
        for _ in range(6):
            assert asked.acquire(timeout=PATIENCE)
        live.close()
        server.shutdown(socket.SHUT_RDWR)

    # Once, but that Rerun may take who hangs up for a viewer where the machine is slow.
    assert 1 <= len(notices.texts) <= len(announced.texts) + 1
    assert all(address in text for text in notices.texts)
    assert live.is_lost


def list_names(history):
    return [work for work, _ in history.list_works()]


def test_the_set_up_is_kept_first_then_the_hits_then_the_newest_of_each_table():
    history = History("set-up")
    history.put("table", key="table")
    history.put("hit 1")
    history.put("new table", key="table")
    history.put("hit 2")

    assert list_names(history) == ["set-up", "hit 1", "hit 2", "new table"]


def test_the_oldest_hits_are_forgotten_first_and_counted():
    history = History("set-up")
    for i in range(QUEUE_LENGTH + 3):
        history.put(i)
    assert history.forgotten == 3
    assert list_names(history) == ["set-up", *range(3, QUEUE_LENGTH + 3)]


def test_large_hits_are_kept_up_to_a_size():
    history = History()
    for i in range(5):
        history.put(i, QUEUE_SIZE // 2)
    assert list_names(history) == [3, 4]
