"""Where the view goes, and that nobody waits for it."""

import socket
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from impact_rig.core.errors import DeviceError, FileError, ParameterError, RigError
from impact_rig.core.signals.record import HitLabel
from impact_rig.results.hit_traces import HitTraces
from impact_rig.visualization import rerun_sdk, sink
from impact_rig.visualization.destinations import check_viewer_address, open_destinations
from impact_rig.visualization.sink import Destination
from impact_rig.visualization.text import Verdict

rerun = pytest.importorskip("rerun", reason="rerun-sdk is not installed")

PATIENCE = 20.0
VERDICT = Verdict(HitLabel("steel small"), True)
NOISE = HitTraces(
    HitLabel("steel small"),
    np.arange(5000) / 2.5e6,
    np.random.default_rng(1).standard_normal((5000, 2)).astype(np.float32),
)


def fail(text):
    raise AssertionError(text)


def find_free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def make_address(port):
    return f"rerun+http://127.0.0.1:{port}/proxy"


class Notices:
    def __init__(self):
        self.texts = []
        self._told = threading.Event()

    def __call__(self, text):
        self.texts.append(text)
        self._told.set()

    def wait(self):
        assert self._told.wait(PATIENCE), "no notice came"
        return self.texts


@pytest.fixture
def viewer():
    """Start what a viewer has of a network, without its windows; return it and its address."""
    from rerun_cli.__main__ import __file__ as launcher

    binary = launcher.replace("__main__.py", "rerun")
    port = find_free_port()
    process = subprocess.Popen(
        [binary, "--serve-grpc", "--bind", "127.0.0.1", "--port", str(port)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    deadline = time.monotonic() + PATIENCE
    pause = threading.Event()
    while True:
        try:
            socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
            break
        except OSError:
            assert process.poll() is None
            assert time.monotonic() < deadline
            pause.wait(0.01)
    yield process, make_address(port)
    process.kill()
    process.wait()


def test_nothing_asked_for_is_an_error_that_says_what_to_set():
    with pytest.raises(ParameterError, match=r"output .* connect .* spawn"):
        open_destinations(notify=fail)


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
        open_destinations(connect=address, notify=fail)
    assert repr(address) in str(caught.value)


def test_the_port_of_an_address_is_reruns_own_unless_told():
    assert check_viewer_address("rerun+http://lab/proxy") == ("lab", 9876)
    assert check_viewer_address("rerun+https://lab:12/proxy") == ("lab", 12)


def test_a_file_must_be_named_rrd(tmp_path):
    with pytest.raises(FileError, match=r"\.rrd"):
        open_destinations(output=str(tmp_path / "view.txt"), notify=fail)
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "taken").write_text("")
    with pytest.raises(FileError, match=r"taken.*cannot be written"):
        open_destinations(output=str(tmp_path / "taken" / "view.rrd"), notify=fail)


def test_a_viewer_that_is_not_there_is_an_error_if_nothing_else_shows_the_view():
    address = make_address(find_free_port())
    with pytest.raises(DeviceError, match="no viewer answers at"):
        open_destinations(connect=address, notify=fail)


def test_the_file_is_written_though_the_viewer_is_not_there(tmp_path, read_recording):
    path = tmp_path / "new" / "view.rrd"
    notices = Notices()
    (destination,) = open_destinations(
        output=str(path), connect=make_address(find_free_port()), notify=notices
    )
    destination.put(lambda log: log.log_verdict(VERDICT, 0))
    destination.close()

    assert "no viewer answers at" in notices.texts[0]
    assert read_recording(path).entities >= {"/verdict", "/log"}


@pytest.mark.skipif(sys.platform != "linux", reason="screens are known by other means")
def test_a_viewer_needs_a_screen(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(DeviceError, match=r"no screen .* output"):
        open_destinations(spawn=True, notify=fail)


def test_a_missing_rerun_is_named_with_the_command_that_installs_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(RigError, match=r"pip install 'rerun-sdk>=0\.41'"):
        rerun_sdk.import_rerun()


def test_an_old_rerun_is_named(monkeypatch):
    monkeypatch.setattr(rerun, "__version__", "0.29.1")
    with pytest.raises(RigError, match=r"0\.29\.1 is too old"):
        rerun_sdk.import_rerun()


def test_file_and_viewer_at_once(tmp_path, viewer, read_recording):
    _, address = viewer
    path = tmp_path / "view.rrd"
    destinations = open_destinations(output=str(path), connect=address, notify=fail)
    for destination in destinations:
        destination.put(lambda log: log.log_hit(NOISE))
        destination.close()

    assert [destination.is_lost for destination in destinations] == [False, False]
    _, values = read_recording(path).find_traces("/hits/1")
    np.testing.assert_array_equal(values, NOISE.values)


def test_a_viewer_that_dies_is_told_once_and_the_file_goes_on(tmp_path, viewer, read_recording):
    process, address = viewer
    path = tmp_path / "view.rrd"
    notices = Notices()
    file, live = open_destinations(output=str(path), connect=address, notify=notices)
    process.kill()
    process.wait()
    deadline = time.monotonic() + PATIENCE
    count = 0
    while not live.is_lost:
        assert time.monotonic() < deadline
        for destination in (file, live):
            destination.put(lambda log: log.log_hit(NOISE))
        count += 1
        threading.Event().wait(0.01)
    for destination in (file, live):
        destination.put(lambda log: log.log_hit(NOISE))
        destination.close()

    assert len(notices.wait()) == 1
    assert "the rig goes on without it" in notices.texts[0]
    assert live.dropped >= 1
    assert f"/hits/{count + 1}" in read_recording(path).entities


def test_a_viewer_that_is_stuck_costs_views_and_no_time(tmp_path, monkeypatch, read_recording):
    # It accepts connections and never answers.
    monkeypatch.setattr(sink, "FLUSH_TIMEOUT", 0.2)
    with socket.socket() as stuck:
        stuck.bind(("127.0.0.1", 0))
        stuck.listen()
        address = make_address(stuck.getsockname()[1])
        notices = Notices()
        path = tmp_path / "view.rrd"
        file, live = open_destinations(output=str(path), connect=address, notify=notices)
        start = time.monotonic()
        for _ in range(1000):
            live.put(lambda log: log.log_hit(NOISE))
        file.put(lambda log: log.log_hit(NOISE))
        assert time.monotonic() - start < 1.0
        notices.wait()
        for destination in (file, live):
            destination.close()

    assert live.is_lost
    assert live.dropped > 0
    assert file.dropped == 0
    assert "/hits/1" in read_recording(path).entities


class StubbornStream:
    """A recording stream whose first flush waits until it is let go."""

    def __init__(self):
        self.reached = threading.Event()
        self.let_go = threading.Event()

    def flush(self, *, timeout_sec):
        self.reached.set()
        assert self.let_go.wait(PATIENCE)

    def disconnect(self):
        pass


def test_a_destination_that_is_behind_drops_views_and_counts_them():
    stream, done = StubbornStream(), []
    destination = Destination("slow", stream, 0.0, fail)
    destination.put(lambda _: None)
    assert stream.reached.wait(PATIENCE)
    for i in range(sink.QUEUE_LENGTH + 5):
        destination.put(lambda _, i=i: done.append(i))
    stream.let_go.set()
    destination.close()

    assert done == list(range(sink.QUEUE_LENGTH))
    assert destination.dropped == 5


def test_what_is_replaced_before_it_is_shown_is_not_shown_and_the_last_one_always_is():
    stream, done = StubbornStream(), []
    stream.let_go.set()
    destination = Destination("file", stream, 3600.0, fail)
    destination.put_latest("table", lambda _: done.append("first"))
    deadline = time.monotonic() + PATIENCE
    while not done:
        assert time.monotonic() < deadline
        threading.Event().wait(0.001)
    for text in ("second", "third"):
        destination.put_latest("table", lambda _, text=text: done.append(text))
    destination.put_latest("other", lambda _: done.append("other"))
    destination.close()

    assert done == ["first", "third", "other"]
    destination.close()


@pytest.mark.skipif(sys.platform != "linux", reason="screens are known by other means")
def test_a_viewer_of_our_own_that_ends_is_told_with_how_to_open_another(monkeypatch):
    # A screen that is not there: the viewer starts and gives up.
    monkeypatch.setenv("DISPLAY", ":31415")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    notices = Notices()
    (destination,) = open_destinations(spawn=True, notify=notices)
    destination.put(lambda log: log.log_hit(NOISE))
    (text,) = notices.wait()
    destination.close()

    assert "the viewer has ended" in text
    assert "--connect rerun+http://127.0.0.1:" in text
    assert not destination.is_lost
