"""`impact-rig view`: recordings and results in Rerun, in whatever shows them."""

import signal
import sys
import textwrap
import urllib.request
from pathlib import Path

import psutil
import pytest

from impact_rig.devices.virtual.rig import VirtualRigSettings
from impact_rig.present.rerun import viewers as program
from impact_rig.results.results_file import write_results

from ..present.rerun.onlookers import list_listeners
from .conftest import PATIENCE, finish, start_command, start_python

rerun = pytest.importorskip("rerun", reason="rerun-sdk is not installed")

HITS = 2
"""Of each of the two recorded campaigns."""
ROS_FREE = """
import sys
sys.modules["rclpy"] = sys.modules["impact_rig_msgs"] = None
from impact_rig.cli.main import main
main()
"""


def read_view(path):
    """Return how many recordings and blueprints a file has, and its entities."""
    from rerun.chunk import RrdReader

    reader = RrdReader(str(path))
    entities = {
        chunk.entity_path
        for entry in reader.recordings()
        for chunk in reader.stream(store=entry).to_chunks()
    }
    return len(reader.recordings()), len(reader.blueprints()), entities


def count_hits(entities):
    return sum(path.startswith("/hits/") for path in entities)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory, record):
    """Record two campaigns of two hits on one sample."""
    path = tmp_path_factory.mktemp("run") / "session.mcap"
    return record(path, VirtualRigSettings(seed=3), ["aluminium large"], 2, campaigns=2)


@pytest.fixture
def fake_viewer(tmp_path, monkeypatch):
    """Put a program in the viewer's place; return a function that says what it is to do."""
    viewer = tmp_path / "viewer"
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(program, "find_viewer", lambda: viewer)

    def make(code):
        viewer.write_text(f"#!{sys.executable}\nimport sys, time\n{textwrap.dedent(code)}")
        viewer.chmod(0o755)

    return make


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """Return the folder in which temporary files are made."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    return folder


def test_a_recording_becomes_a_file_that_rerun_reads_without_ros(recorded, tmp_path, temporary):
    view = tmp_path / "new" / "view.rrd"
    words = ("-c", ROS_FREE, "view", recorded.path.parent, "-o", view)
    code, _, errors = finish(start_python(*words, env={"TMPDIR": str(temporary)}))
    assert code == 0, errors
    assert f"view: {view}" in errors
    recordings, blueprints, entities = read_view(view)
    assert (recordings, blueprints) == (2, 2)
    assert count_hits(entities) == HITS
    assert {"/results", "/log", "/verdict"} <= entities
    assert list(temporary.iterdir()) == []


def test_each_campaign_and_each_path_is_a_recording_of_its_own(run, recorded, tmp_path):
    results = tmp_path / "results.json"
    write_results(results, recorded.results)
    view = tmp_path / "view.rrd"
    outcome = run("view", recorded.path, results, "-o", view)

    assert outcome.exit_code == 0, outcome.stderr
    assert "results hold no traces: only tables and figures are shown" in outcome.stderr
    assert read_view(view)[:2] == (3, 3)


def test_nothing_is_overwritten(run, recorded, tmp_path):
    view = tmp_path / "view.rrd"
    view.write_text("mine")
    outcome = run("view", recorded.path, "-o", view)

    assert outcome.exit_code == 2
    assert f"{view} exists already" in outcome.stderr
    assert view.read_text() == "mine"


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["x.mcap", "-o", "view.rrd", "--web"], "choose one of"),
        (["x.mcap", "-o", "view.txt"], "must end in .rrd"),
        (["x.mcap", "-o", "view.rrd"], "there is no file x.mcap"),
    ],
)
def test_what_cannot_be_meant_is_named(run, words, expected, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    outcome = run("view", *words)

    assert outcome.exit_code == 2
    assert expected in outcome.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_bad_file_does_not_keep_the_others_from_being_shown(run, recorded, tmp_path):
    newer = tmp_path / "results.json"
    newer.write_text('{"format": {"name": "impact-rig results", "version": 99}}')
    view = tmp_path / "view.rrd"
    outcome = run("view", newer, recorded.path, "-o", view)

    assert outcome.exit_code == 2
    assert "version 99" in outcome.stderr
    assert count_hits(read_view(view)[2]) == HITS


def test_a_window_gets_the_view_until_it_is_closed(
    run, recorded, tmp_path, temporary, fake_viewer
):
    seen = tmp_path / "seen.rrd"
    fake_viewer(
        f"""
        from pathlib import Path
        *options, _first, last = sys.argv[1:]
        assert options == ["--bind", "127.0.0.1", "--port", "auto"]
        Path({str(seen)!r}).write_bytes(Path(last).read_bytes())
        """
    )
    outcome = run("view", recorded.path)

    assert outcome.exit_code == 0, outcome.stderr
    assert count_hits(read_view(seen)[2]) == HITS
    assert not list(temporary.iterdir())


def test_a_web_page_is_served_to_this_host_until_ctrl_c(recorded, tmp_path):
    words = ("view", recorded.path, "--web")
    process = start_command(*words, stdout=None, env={"TMPDIR": str(tmp_path)})
    try:
        line = next(line for line in process.stderr if "the view is at" in line)
        address = line.split("the view is at ")[1].split(";")[0]
        with urllib.request.urlopen(address, timeout=PATIENCE) as page:
            assert b"<canvas" in page.read()
        running = psutil.Process(process.pid)
        family = [running, *running.children(recursive=True)]
        assert {item.laddr.ip for item in list_listeners(process.pid)} == {"127.0.0.1"}
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 0
        gone, _ = psutil.wait_procs(family, PATIENCE)
        assert len(gone) == len(family)
    finally:
        process.kill()
        process.communicate()
    assert [path for path in Path(tmp_path).iterdir() if "view" in path.name] == []
