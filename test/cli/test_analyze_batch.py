"""`impact-rig analyze` on many recordings, side by side."""

import contextlib
import json
import shutil
import signal
import subprocess

import psutil
import pytest

from impact_rig.analysis.batch import connect_to_workers
from impact_rig.core.given.errors import RigError
from impact_rig.core.given.setup import CONTROL_SAMPLE
from impact_rig.devices.virtual.rig import VirtualRigSettings
from impact_rig.results.results_file import results_to_json

from .conftest import PATIENCE, finish, start_command, start_python

SAMPLES = (CONTROL_SAMPLE,)


@pytest.fixture(scope="module")
def runs(tmp_path_factory, record):
    """Return three recordings, each in the folder of its run."""
    folder = tmp_path_factory.mktemp("runs")
    recorded = []
    for seed in (1, 2, 3):
        run_folder = folder / f"2025-01-0{seed}"
        run_folder.mkdir()
        path = run_folder / "session.mcap"
        recorded.append(record(path, VirtualRigSettings(seed=seed), SAMPLES, 2))
    return recorded


@pytest.fixture
def folders(runs):
    """Return the folders of the runs, the last first."""
    return [recorded.path.parent for recorded in reversed(runs)]


@pytest.fixture
def expected(runs):
    """Return the JSON for `folders`: what each live run found."""
    return [
        {
            "recording": str(recorded.path),
            "campaign": 1,
            "results": results_to_json(recorded.results),
        }
        for recorded in reversed(runs)
    ]


@pytest.fixture(scope="module")
def cluster():
    """Return another user's Dask cluster, whose worker takes several recordings at once."""
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=1, threads_per_worker=3, dashboard_address=":0", silence_logs=50
    ) as running:
        yield running


def test_the_control_sample_is_followed_from_run_to_run(run, folders, runs, tmp_path):
    outcome = run("analyze", *folders, "--trend", "--json")
    assert outcome.exit_code == 0
    found = json.loads(outcome.stdout)
    assert [point["sample"] for point in found] == [CONTROL_SAMPLE] * 3
    times = {point["run"]: point["contact_time_s"] for point in found}
    assert times == {
        recorded.path.parent.name: recorded.results.samples[0].paper.contact_time.value
        for recorded in runs
    }
    told = run("analyze", *folders, "--trend").stdout
    assert f"Control sample from run to run: {CONTROL_SAMPLE}" in told
    assert "it takes two runs with 4 hits" in told
    page, broken = tmp_path / "trend.html", tmp_path / "broken.mcap"
    broken.write_bytes(b"nothing")
    outcome = run("analyze", *folders, broken, "-o", page)
    assert outcome.exit_code == 2
    assert f"error: {broken}" in outcome.stderr
    text = page.read_text("utf-8")
    assert str(broken) in text
    assert text.count("data:image/svg+xml;base64,") == 3
    assert "Origin: simulated." in text


def test_workers_without_the_software_are_refused(run, folders, tmp_path):
    script = tmp_path / "cluster.py"
    script.write_text(
        "import sys\n"
        "from distributed import LocalCluster\n"
        "sys.modules['impact_rig'] = None\n"
        "with LocalCluster(n_workers=1, processes=False, protocol='tcp',\n"
        "                  dashboard_address=':0') as cluster:\n"
        "    print(cluster.scheduler_address, flush=True)\n"
        "    sys.stdin.read()\n"
    )
    with start_python(script, stdin=subprocess.PIPE, stderr=None) as process:
        outcome = run("analyze", *folders, "--scheduler", process.stdout.readline().strip())
        process.stdin.close()
    assert outcome.exit_code == 2
    (line,) = outcome.stderr.splitlines()
    assert "install the same version on every worker" in line


def test_each_recording_gives_what_its_live_run_found_in_the_order_given(run, folders, expected):
    outcome = run("analyze", *folders, "--json", "--workers", 1)
    assert outcome.exit_code == 0
    assert json.loads(outcome.stdout) == expected


def test_a_cluster_that_is_there_already_gives_the_same(
    run, folders, expected, cluster, monkeypatch
):
    # Paths that are relative here mean nothing to workers elsewhere.
    monkeypatch.chdir(folders[0].parent)
    names = [folder.name for folder in folders]
    outcome = run("analyze", *names, "--json", "--scheduler", cluster.scheduler_address)
    assert outcome.exit_code == 0
    assert [entry["results"] for entry in json.loads(outcome.stdout)] == [
        entry["results"] for entry in expected
    ]


def test_broken_and_repeated_recordings_are_named_and_the_others_analyzed(
    run, folders, expected, tmp_path
):
    bad, empty, copy = (tmp_path / name for name in ("bad.mcap", "empty", "copy.mcap"))
    bad.write_bytes((folders[0] / "session.mcap").read_bytes()[:1000])
    empty.mkdir()
    shutil.copy(folders[0] / "session.mcap", copy)
    again = folders[1] / "session.mcap"
    paths = (folders[0], bad, empty, folders[1], copy, again, "x" * 300)
    outcome = run("analyze", *paths, "--workers", 2, "--json")
    assert outcome.exit_code == 2
    assert json.loads(outcome.stdout) == expected[:2]
    errors = [line for line in outcome.stderr.splitlines() if line.startswith("error: ")]
    assert len(errors) == 5
    assert str(bad) in outcome.stderr
    assert str(empty) in outcome.stderr
    assert f"error: {copy} is left out: it is a copy of" in outcome.stderr
    assert f"error: {again} is named twice" in outcome.stderr
    assert "xxx cannot be read: File name too long" in outcome.stderr


def test_a_scheduler_that_is_not_there_is_one_sentence_soon():
    address = "tcp://127.0.0.1:1"
    with (
        pytest.raises(RigError, match=f"^no Dask scheduler answers at '{address}'"),
        connect_to_workers(address, 0.5),
    ):
        pass


def test_ctrl_c_ends_all_processes_at_once(runs, tmp_path):
    # Bytes missing at the end make different recordings of one.
    paths = [tmp_path / f"{number}.mcap" for number in range(150)]
    for number, path in enumerate(paths):
        path.write_bytes(runs[0].path.read_bytes()[: -8 - number])
    process = start_command("analyze", *paths, "--workers", 2, start_new_session=True)
    process.stderr.readline()  # the first recording is done, the next are being analyzed
    helpers = psutil.Process(process.pid).children(recursive=True)
    assert helpers
    # As a terminal does: to all processes of the foreground.
    for each in (psutil.Process(process.pid), *helpers):
        with contextlib.suppress(psutil.NoSuchProcess):
            each.send_signal(signal.SIGINT)
    code, stdout, stderr = finish(process)
    assert (code, stdout) == (130, "")
    assert "Traceback" not in stderr
    assert psutil.wait_procs(helpers, timeout=PATIENCE)[1] == []


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--reject", "1"], "analyze recordings one by one"),
        (["--sample", "steel"], "a recording explains itself"),
    ],
)
def test_what_means_nothing_for_many_recordings_is_refused(run, folders, words, message):
    outcome = run("analyze", *folders, *words)
    assert outcome.exit_code == 2
    assert message in outcome.stderr
