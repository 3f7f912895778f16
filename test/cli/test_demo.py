"""The demo: real processes from hammer release to the table, and the recording they leave."""

import json
import math
import os
import signal
import subprocess
import sys

import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from terminal import run_program

from impact_rig.configuration.rig_file import read_template
from impact_rig.devices.virtual.rig import FaultPlan, VirtualRigSettings
from impact_rig.results.results_file import read_results, results_to_json
from impact_rig.results.wire import format_json

from .conftest import finish, start_command

SAMPLES = ("steel small", "aluminium large")
CHOSEN = tuple(word for name in SAMPLES for word in ("--sample", name))


def start_demo(*words, **options):
    return start_command("demo", *words, env={"ROS_DOMAIN_ID": None}, **options)


@pytest.fixture
def viewer():
    """Start what a viewer has of a network, without its windows."""
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    from impact_rig.present.rerun.viewers import find_free_port, find_viewer

    port = find_free_port()
    process = subprocess.Popen(
        [find_viewer(), "--serve-grpc", "--bind", "127.0.0.1", "--port", str(port)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    process.address = f"rerun+http://127.0.0.1:{port}/proxy"
    yield process
    process.kill()
    process.wait()


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    """Run one small demo with two faults, for the tests that look at what it left."""
    folder = tmp_path_factory.mktemp("demo")
    words = ("--impacts", 3, "--seed", 7, "--faults", 0.2, "--output", "run")
    code, output, errors = finish(start_demo(*CHOSEN, *words, cwd=folder))
    assert code == 0, errors
    return folder / "run", output, errors


def test_prints_one_screen_and_says_where_everything_is(demo):
    folder, output, errors = demo
    for word in ("τp", "steel small", "aluminium large", "hammer", "rejected"):
        assert word in output
    assert len(output.splitlines()) <= 40
    assert output.startswith("Origin: simulated (virtual rig, plant published).\nBodies made from")
    assert errors.endswith(
        "results:   run/results.json\nrecording: run/session.mcap\n"
        "report:    impact-rig report run\n"
    )
    assert {"session.mcap", "session.rrd", "results.json", "nodes.log"} <= {
        path.name for path in folder.iterdir()
    }


def test_the_analysis_of_the_recording_gives_the_same_results_bit_for_bit(demo, run):
    folder, _, _ = demo
    outcome = run("analyze", folder / "session.mcap", "--json")
    assert outcome.exit_code == 0, outcome.stderr
    live = json.loads((folder / "results.json").read_text("utf-8"))
    assert json.loads(outcome.stdout) == live
    assert [sample["impacts_accepted"] for sample in live["samples"]] == [3, 3]
    rejections = [hit for hit in live["hits"] if not hit["accepted"]]
    assert rejections, "every sixth hit or so should be bad"
    assert all(hit["reasons"] and hit["injected_faults"] for hit in rejections)


def test_the_numbers_are_those_of_the_virtual_rig_struck_in_one_process(demo, record, tmp_path):
    folder, _, _ = demo
    settings = VirtualRigSettings(seed=7, faults=FaultPlan(0.2))
    struck = record(tmp_path / "session.mcap", settings, SAMPLES, 3)
    assert (folder / "results.json").read_text("utf-8") == format_json(
        results_to_json(struck.results)
    )


def test_contact_laws_are_found_at_every_angle_whatever_a_viewer_does(tmp_path, run, viewer):
    process = start_demo(
        "--plant", "contact", *CHOSEN, "--angles", "3.7,10", "--impacts", 2,
        "--seed", 7, "--output", "run", "--notes", "bench 3", "--full",
        "--viewer", viewer.address, cwd=tmp_path,
    )  # fmt: skip
    told = []
    for line in process.stderr:
        told.append(line)
        if "sample 1 of 4" in line:
            viewer.send_signal(signal.SIGSTOP)
        if "sample 3 of 4" in line:
            viewer.kill()
            break
    code, output, errors = finish(process)
    errors = "".join(told) + errors
    assert code == 0, errors
    folder = tmp_path / "run"
    assert "Contact over impact speed" in output
    found = json.loads((folder / "results.json").read_text("utf-8"))
    assert [sample["name"] for sample in found["samples"]] == [
        f"{body} {angle}"
        for body in ("aluminium large", "steel small")
        for angle in ("3.7°", "10°")
    ]
    assert all(abs(item["contact_law"]["exponent"] - 1.5) < 0.02 for item in found["samples"])
    outcome = run("analyze", folder, "--json")
    assert outcome.stdout == (folder / "results.json").read_text("utf-8")
    recording = folder / "session.mcap"
    assert "recording: run/session.mcap" in errors
    with recording.open("rb") as stream:
        metadata = list(make_reader(stream).iter_metadata())
    origin = [item for item in metadata if item.name == "impact_rig"]
    assert origin[-1].metadata["notes"] == "bench 3"
    assert (folder / "session.rrd").stat().st_size > 0


def test_a_hit_that_weighs_less_than_nothing_costs_a_campaign_no_results(tmp_path):
    source = 'driver = "virtual"\nrecord_duration = "1.2 ms"\nscheduled_faults = "1:lost_block"'
    (tmp_path / "rig.toml").write_text(f"{read_template()}\n[source]\n{source}\n", "utf-8")
    words = ("--rig-file", "rig.toml", *CHOSEN[:2], "--impacts", 2, "--output", "run")
    code, _, errors = finish(start_demo(*words, cwd=tmp_path))
    assert code == 0, errors
    lost, *others = read_results(tmp_path / "run" / "results.json").hits
    assert "the sample moves as -" in str(lost.findings[0])
    assert math.isnan(lost.sample_mass)
    assert [hit.accepted for hit in (lost, *others)] == [False, True, True]


def test_ctrl_c_in_the_middle_ends_everything_and_leaves_a_stream_that_reads(tmp_path):
    words = ("--continuous", "--record-stream", "--impacts", 2, "--output", "run")
    process = start_demo(*words, cwd=tmp_path, start_new_session=True)
    log = tmp_path / "run" / "nodes.log"
    told = []
    for line in process.stderr:
        told.append(line)
        if "sample 2 of 12" in line:
            break
    os.killpg(process.pid, signal.SIGINT)
    code, _, errors = finish(process)
    assert code == 130, "".join(told) + errors
    assert "session.mcap" in errors
    recording = tmp_path / "run" / "session.mcap"
    with AnyReader([recording]) as reader:
        found = [
            (connection.topic, reader.deserialize(data, connection.msgtype))
            for connection, _, data in reader.messages()
        ]
    # Impacts are found in the running stream, all of which is there.
    assert [topic for topic, _ in found].count("/impact") >= 2
    blocks = [message for topic, message in found if topic == "/acceleration/stream"]
    # The end of an arming, and of the stream, may be a block without points.
    firsts = [block.first_sample for block in blocks if len(block.hammer.counts)]
    assert firsts == list(range(firsts[0], firsts[-1] + 1, 25_000))
    assert {block.record for block in blocks} >= {1, 2}
    for number in (
        int(line.rpartition("pid=")[2].rstrip(")\n"))
        for line in log.read_text("utf-8").splitlines()
        if "started (pid=" in line
    ):
        with pytest.raises(ProcessLookupError):
            os.kill(number, 0)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("demo", "--sample", "tin"), "unknown sample 'tin'"),
        (("demo", "--rig-file", "absent.toml"), "there is no rig file absent.toml"),
        (("up", "--set", "hammer=3"), "write NODE.PARAMETER=VALUE"),
        (("up", "--set", "crane.speed=3"), "no node 'crane'"),
    ],
)
def test_bad_input_gets_one_sentence_and_leaves_nothing(
    run, tmp_path, monkeypatch, arguments, word
):
    monkeypatch.chdir(tmp_path)
    outcome = run(*arguments)
    assert outcome.exit_code == 2
    assert word in outcome.stderr
    assert outcome.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_demonstration_never_reaches_the_hammer_that_a_rig_file_names(
    run, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    text = (
        read_template() + '\n[holder]\ndriver = "serial"\nport = "/dev/ttyUSB0"\n'
    ).splitlines()
    (tmp_path / "rig.toml").write_text("\n".join(text), "utf-8")
    outcome = run("demo", "--rig-file", "rig.toml")
    assert outcome.exit_code == 2
    line = text.index('driver = "serial"') + 1
    assert f"line {line}: the demo strikes the virtual rig only" in outcome.stderr
    assert not (tmp_path / "runs").exists()


def test_a_folder_that_holds_a_run_is_never_written_again(demo, run):
    folder, _, _ = demo
    before = (folder / "session.mcap").read_bytes()
    outcome = run("demo", "--output", folder)
    assert outcome.exit_code == 2
    assert "already holds a run" in outcome.stderr
    assert (folder / "session.mcap").read_bytes() == before


def test_where_too_few_files_may_be_open_one_sentence_says_so(tmp_path):
    limit = ["bash", "-c", 'ulimit -n 30; exec "$@"', "bash"]
    words = [*limit, sys.executable, "-m", "impact_rig.cli.main", "demo", "-o", tmp_path / "run"]
    done = run_program(words)
    assert done.returncode == 2
    told = "error: at most 30 files may be open here, and a rig needs 100: raise the limit"
    (line,) = done.stderr.splitlines()
    assert line.startswith(told)
    assert not (tmp_path / "run").exists()
