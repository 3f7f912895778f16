"""The live view goes to a file, to viewers of this host at any time, and to one elsewhere."""

import re
import signal
import subprocess
import sys

import numpy as np
import psutil
import pytest

from impact_rig.core.given.errors import DeviceError, FileError, ParameterError, RigError
from impact_rig.present.rerun import viewers
from impact_rig.present.rerun.viewers import (
    check_viewer_address,
    find_free_port,
    make_viewer_address,
)

from .onlookers import NOISE, PATIENCE, has_hit, list_listeners, show_noise, wait_until

rerun = pytest.importorskip("rerun", reason="rerun-sdk is not installed")


def find_server(announced):
    """Return the address of the server that a page shows."""
    (text,) = announced
    return text.split("url=")[1].replace("%2B", "+").replace("%3A", ":").replace("%2F", "/")


def test_who_comes_late_gets_everything_and_only_this_host_reaches_it(
    tmp_path, viewer, start, open_view, read_recording
):
    port, announced = find_free_port(), []
    viewer(port)
    path, kept = tmp_path / "view.rrd", tmp_path / "kept.rrd"
    view = open_view(
        output=str(path), connect=make_viewer_address(port), web=True, announce=announced.append
    )
    assert {item.laddr.ip for item in list_listeners(psutil.Process().pid)} == {"127.0.0.1"}
    view.log.log_setup("rig 7", ["steel small"])
    show_noise(view)
    assert view.flush()
    elsewhere = tmp_path / "elsewhere.rrd"
    late = [
        start(find_free_port(), "--save", kept, find_server(announced)),
        start(find_free_port(), "--save", elsewhere, make_viewer_address(port)),
    ]
    for file in (kept, elsewhere):
        wait_until(lambda file=file: has_hit(read_recording, file))
    view.close()
    for process in late:
        process.send_signal(signal.SIGINT)
        process.wait(PATIENCE)

    for name in (path, kept, elsewhere):
        shown = read_recording(name)
        np.testing.assert_array_equal(shown.find_traces("/hits/1")[1], NOISE.values)
        assert shown.read_blueprint()


WRITER = """
import sys
import numpy as np
from impact_rig.core.given.records import HitLabel
from impact_rig.present.rerun.delivery import LiveView
from impact_rig.results.traces import HitTraces
view = LiveView(output=sys.argv[1], web=True, announce=print, notify=print)
view.log.log_hit(HitTraces(HitLabel("a"), np.arange(3) / 1e6, np.full((3, 2), 7.0, np.float32)))
view.flush()
print("shown", flush=True)
sys.stdin.read()
"""


def test_after_kill_9_the_file_is_sound_and_the_page_ends(tmp_path, read_recording):
    path = tmp_path / "view.rrd"
    writer = subprocess.Popen(
        [sys.executable, "-c", WRITER, path],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert any(line == "shown\n" for line in writer.stdout)
    pages = psutil.Process(writer.pid).children(recursive=True)
    assert pages
    writer.kill()
    writer.communicate()
    gone, _ = psutil.wait_procs(pages, PATIENCE)

    assert len(gone) == len(pages)
    _, values = read_recording(path).find_traces("/hits/1")
    np.testing.assert_array_equal(values, np.full((3, 2), 7.0))


@pytest.mark.parametrize(
    ("plan", "told"),
    [
        ({"connect": make_viewer_address(9)}, r"no viewer answers at rerun\+http://127.0.0.1:9/"),
        pytest.param(
            {"spawn": True},
            r"no screen .* to a file",
            marks=pytest.mark.skipif(sys.platform != "linux", reason="screens have other names"),
        ),
    ],
)
def test_a_viewer_that_cannot_be_shown_is_named_and_the_rest_is_shown(
    monkeypatch, tmp_path, open_view, plan, told
):
    for name in viewers.SCREENS:
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(DeviceError, match=told):
        open_view(**plan)
    notices = []
    open_view(**plan, output=str(tmp_path / "view.rrd"), notify=notices.append)
    (notice,) = notices
    assert re.match(told, notice)


def test_a_file_that_cannot_be_written_is_named(tmp_path, open_view):
    (tmp_path / "taken").write_text("")
    with pytest.raises(FileError, match=r"taken.*cannot be written"):
        open_view(output=str(tmp_path / "taken" / "view.rrd"))


@pytest.mark.parametrize("address", ["localhost", "rerun+http://:9876/proxy", "rerun+http://h:1/"])
def test_a_wrong_address_is_named_with_a_right_one(address):
    with pytest.raises(ParameterError, match=r"rerun\+http://127\.0\.0\.1:9876/proxy") as caught:
        check_viewer_address(address)
    assert repr(address) in str(caught.value)


def test_what_is_not_installed_is_named_with_the_command_that_installs_it(monkeypatch):
    monkeypatch.setattr(viewers.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(RigError, match="pip install rerun-sdk"):
        viewers.find_viewer()
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(RigError, match=r"pip install 'rerun-sdk>=0\.41'"):
        viewers.import_rerun()
