"""Where the view goes, and that nobody waits for it."""

import contextlib
import signal
import socket
import subprocess
import sys
import threading
import time
from dataclasses import replace

import numpy as np
import psutil
import pytest

from impact_rig.core.errors import DeviceError, FileError, ParameterError, RigError
from impact_rig.core.signals.record import HitLabel
from impact_rig.results.hit_traces import HitTraces
from impact_rig.visualization import rerun_sdk
from impact_rig.visualization.destinations import connection
from impact_rig.visualization.destinations.addresses import make_viewer_address
from impact_rig.visualization.destinations.opening import DestinationPlan, open_destinations
from impact_rig.visualization.destinations.program import find_viewer

rerun = pytest.importorskip("rerun", reason="rerun-sdk is not installed")

PATIENCE = 20.0
NOISE = HitTraces(
    HitLabel("steel small"),
    np.arange(5000) / 2.5e6,
    np.random.default_rng(1).standard_normal((5000, 2)).astype(np.float32),
)


def fail(text):
    raise AssertionError(text)


def show_noise(destination, record=1):
    hit = replace(NOISE, label=HitLabel("steel small", record))
    destination.put(lambda log: log.log_hit(hit), hit.values.nbytes)


def find_free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def wait_until(condition):
    deadline = time.monotonic() + PATIENCE
    pause = threading.Event()
    while not condition():
        assert time.monotonic() < deadline, "it never came true"
        pause.wait(0.01)


class Notices:
    """Keeps what it is told, and waits for it."""

    def __init__(self):
        self.texts = []

    def __call__(self, text):
        self.texts.append(text)

    def wait_for(self, part):
        wait_until(lambda: any(part in text for text in self.texts))


@pytest.fixture
def open_all():
    """Return a function that opens destinations, which are closed at the end."""
    opened = []

    def run(*, announce=fail, notify=fail, **plan):
        opened.extend(open_destinations(DestinationPlan(**plan), announce=announce, notify=notify))
        return opened

    yield run
    for destination in opened:
        destination.close()
    # A server goes after its stream: none is to be found by the next test.
    own = psutil.Process()
    wait_until(lambda: all(item.status != psutil.CONN_LISTEN for item in own.net_connections()))


@pytest.fixture
def start():
    """Return a function that starts Rerun's program and returns once a port of it is open."""
    processes = []

    def run(port, *arguments):
        process = subprocess.Popen(
            [find_viewer(), "--bind", "127.0.0.1", "--port", str(port), *map(str, arguments)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        processes.append(process)

        def is_open():
            assert process.poll() is None
            return any(item.laddr.port == port for item in list_listeners(process.pid))

        wait_until(is_open)
        return process

    yield run
    for process in processes:
        process.kill()
        process.wait()


@pytest.fixture
def viewer(start):
    """Return a function that starts what a viewer has of a network, without its windows."""
    return lambda port: start(port, "--serve-grpc")


def has_hit(read_recording, path):
    """Return whether the first hit has come to a file that is being written."""
    with contextlib.suppress(OSError, RuntimeError, ValueError):
        return "/hits/1" in read_recording(path).entities
    return False


def list_listeners(pid):
    """Return the sockets that a process and those below it listen on."""
    process = psutil.Process(pid)
    return [
        item
        for each in (process, *process.children(recursive=True))
        for item in each.net_connections("inet")
        if item.status == psutil.CONN_LISTEN
    ]


def test_nothing_asked_for_is_an_error_that_says_what_to_set():
    with pytest.raises(ParameterError, match=r"output .* connect .* spawn or web"):
        DestinationPlan()


@pytest.mark.parametrize("address", ["here", "", "127.0.0.1:80", "256.0.0.1"])
def test_an_address_to_listen_on_must_be_one(address):
    with pytest.raises(ParameterError, match=r"listen is .* 127\.0\.0\.1 for itself"):
        DestinationPlan(web=True, listen=address)


def test_an_address_of_another_host_cannot_be_listened_on(open_all):
    # Of the block that is kept for documentation: nobody's.
    with pytest.raises(DeviceError, match=r"192\.0\.2\.1, port 0 cannot be listened on"):
        open_all(web=True, listen="192.0.2.1")


def test_a_file_must_be_named_rrd(tmp_path, open_all):
    with pytest.raises(FileError, match=r"\.rrd"):
        open_all(output=str(tmp_path / "view.txt"))
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_cannot_be_written_is_named(tmp_path, open_all):
    (tmp_path / "taken").write_text("")
    with pytest.raises(FileError, match=r"taken.*cannot be written"):
        open_all(output=str(tmp_path / "taken" / "view.rrd"))


@pytest.mark.skipif(sys.platform != "linux", reason="screens are known by other means")
def test_a_window_needs_a_screen_and_without_one_the_rest_is_shown(
    monkeypatch, tmp_path, open_all
):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(DeviceError, match=r"no screen .* to a file"):
        open_all(spawn=True)
    notices = Notices()
    (file,) = open_all(spawn=True, output=str(tmp_path / "view.rrd"), notify=notices)

    assert "no screen" in notices.texts[0]
    assert not file.is_lost


def test_a_missing_rerun_is_named_with_the_command_that_installs_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(RigError, match=r"pip install 'rerun-sdk>=0\.41'"):
        rerun_sdk.import_rerun()


def test_an_old_rerun_is_named(monkeypatch):
    monkeypatch.setattr(rerun, "__version__", "0.29.1")
    with pytest.raises(RigError, match=r"0\.29\.1 is too old"):
        rerun_sdk.import_rerun()


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
    monkeypatch.setattr("impact_rig.visualization.destinations.destination.FLUSH_TIMEOUT", 0.2)
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


def test_the_web_page_ends_with_its_destination(open_all):
    announced = Notices()
    (relay,) = open_all(web=True, announce=announced)
    announced.wait_for("the view is at")
    relay.close()

    wait_until(lambda: not list_listeners(psutil.Process().pid))


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
    monkeypatch.setattr("impact_rig.visualization.destinations.destination.FLUSH_TIMEOUT", 0.2)
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
    with socket.create_server(("127.0.0.1", 0)) as stranger:

        def hang_up():
            with contextlib.suppress(OSError):
                while True:
                    stranger.accept()[0].close()
                    asked.release()

        threading.Thread(target=hang_up, daemon=True).start()
        notices = Notices()
        address = make_viewer_address("127.0.0.1", stranger.getsockname()[1])
        (live,) = open_all(connect=address, notify=notices)
        show_noise(live)
        for _ in range(6):
            assert asked.acquire(timeout=PATIENCE)
        live.close()
        stranger.shutdown(socket.SHUT_RDWR)

    (text,) = notices.texts
    assert f"{address} takes no data" in text
    assert live.is_lost


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
