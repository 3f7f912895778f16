"""`impact-rig export`: what other tools read is what the recording holds, bit by bit."""

import csv
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from impact_rig.core.given.records import Block
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.rig import FaultPlan, VirtualRigSettings, scheduled_fault_from_text
from impact_rig.files.formats.registry import WRITABLE, read_measurement
from impact_rig.recordings.run import Run
from impact_rig.results.results_file import results_to_json, write_results
from impact_rig.results.wire import format_json


@pytest.fixture(scope="module")
def recorded(record, tmp_path_factory):
    """Return a campaign of two samples with faulty hits among the good ones."""
    path = tmp_path_factory.mktemp("export") / "session.mcap"
    ordered = ("steel small/1:double_hit", "aluminium large/2:missed_trigger")
    plan = FaultPlan(scheduled=tuple(map(scheduled_fault_from_text, ordered)))
    settings = VirtualRigSettings(seed=7, faults=plan)
    return record(path, settings, ("aluminium large", "steel small"), 2)


def read_hit(path):
    """Return the first block of the first hit of a recording, and its traces [m/s^2]."""
    blocks = [event for event in Run(path).events() if isinstance(event, Block)]
    parts = [block for block in blocks if block.label.record == blocks[0].label.record]
    return blocks[0], [
        np.concatenate([channel.acceleration for channel in channels]).tolist()
        for channels in zip(*((part.hammer, part.specimen) for part in parts), strict=True)
    ]


def test_one_file_holds_hits_and_means_under_names_that_tell(run, recorded, tmp_path):
    output = tmp_path / "session.mat"
    outcome = run("export", recorded.path, "-o", output, "--accepted-only")
    assert outcome.exit_code == 0, outcome.stderr
    channels = {channel.name: channel for channel in read_measurement(output).channels}
    hits = ("aluminium large/1.1", "aluminium large/2.2", "steel small/1.2", "steel small/2.1")
    means = ("aluminium large/mean", "steel small/mean")
    bodies = ("hammer", "specimen")
    assert set(channels) == {f"{name} {body}" for name in (*hits, *means) for body in bodies}
    assert {channel.sampling_rate for channel in channels.values()} == {2.5e6}
    # Its hits are of two samples: what a question about it proposes reads those of the first.
    asked = run("analyze", output)
    assert "analyze the recording itself" in asked.stderr
    assert len(asked.stderr) < 600
    of_one = [f"aluminium large/*.* {body}" for body in bodies]
    for option, pattern in zip(("--hammer-channel", "--sample-channel"), of_one, strict=True):
        assert f"{option} '{pattern}'" in asked.stderr
    chosen = ("--hammer-channel", of_one[0], "--sample-channel", of_one[1])
    assert "2 hits accepted" in run("analyze", output, *chosen).stdout


def test_the_means_are_those_that_the_results_were_estimated_from(run, recorded, tmp_path):
    output = tmp_path / "means.csv"
    words = ("--what", "means", "--sample", "steel small")
    assert run("export", recorded.path, "-o", output, *words).exit_code == 0
    hammer, specimen = read_measurement(output).channels
    assert (hammer.name, hammer.unit) == ("steel small/mean hammer", "m/s^2")
    (sample,) = (item for item in recorded.results.samples if item.name == "steel small")
    assert np.abs(hammer.values).max() == sample.paper.hammer_peak
    assert np.abs(specimen.values).max() == sample.paper.specimen_peak
    # Time 0 is the middle of the pulse, near which its peak lies.
    time = hammer.start + np.arange(hammer.values.size) / hammer.sampling_rate
    assert abs(time[np.abs(hammer.values).argmax()]) < 0.1 * sample.paper.contact_time.value


def test_hits_are_exported_as_recorded_or_filtered(run, recorded, tmp_path):
    raw, filtered = tmp_path / "raw.csv", tmp_path / "filtered.csv"
    words = ("--accepted-only", "--sample", "steel small")
    assert run("export", recorded.path, "-o", raw, *words).exit_code == 0
    assert run("export", recorded.path, "-o", filtered, "--filtered", *words).exit_code == 0
    before, after = (read_measurement(path).channels for path in (raw, filtered))
    assert [channel.name for channel in before] == [channel.name for channel in after]
    assert len(before) == 4
    for one, other in zip(before, after, strict=True):
        # The low-pass takes the steps of the converter away, not the pulse.
        assert np.diff(other.values).std() < np.diff(one.values).std()
        assert np.abs(other.values).max() == pytest.approx(np.abs(one.values).max(), rel=0.2)


def test_results_are_those_of_the_live_run_and_keep_every_digit_in_columns(
    run, recorded, tmp_path
):
    content = results_to_json(recorded.results)
    assert run("export", recorded.path, "-o", tmp_path / "results.json").exit_code == 0
    assert (tmp_path / "results.json").read_text("utf-8") == format_json(content)
    output = tmp_path / "results.csv"
    assert run("export", recorded.path, "-o", output, "--what", "results").exit_code == 0
    with output.open(newline="", encoding="utf-8") as file:
        rows = {row["name"]: row for row in csv.DictReader(file)}
    assert len(rows) == len(content["samples"]) == 2
    assert {row["origin"] for row in rows.values()} == {"simulated"}
    for sample in content["samples"]:
        row = rows[sample["name"]]
        numbers = {key: value for key, value in sample.items() if isinstance(value, float)}
        assert numbers
        assert all(float(row[key]) == value for key, value in numbers.items())
        decay = sample["free_decay"]["damping_ratio"]
        assert row["free_decay_damping_ratio"] == ("" if decay is None else repr(decay))
        assert float(row["hammer_stiffness_n_per_m"]) == content["hammer"]["stiffness_n_per_m"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["-o", "x.xyz"], "traces are not written to .xyz"),
        (["-o", "x.mat", "--what", "results"], "results are not written to .mat: choose one of"),
        (["-o", "x.json", "--what", "hits"], "traces are not written to .json"),
        (["-o", "x.csv", "--sample", "tin"], "there is no hit on 'tin'"),
        (["-o", "x.csv", "--hit", "999"], "there is no hit '999'"),
    ],
)  # fmt: skip
def test_what_cannot_be_meant_gets_one_sentence_and_leaves_nothing(
    run, recorded, tmp_path, monkeypatch, words, told
):
    monkeypatch.chdir(tmp_path)
    outcome = run("export", recorded.path, *words)
    assert outcome.exit_code == 2
    assert told in " ".join(outcome.stderr.split())
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", WRITABLE)
def test_export_and_import_keep_every_value_and_its_origin(run, recorded, tmp_path, suffix):
    folder, again = tmp_path / "hits", tmp_path / "again.mcap"
    words = ("--one-file-per-hit", suffix.removeprefix("."), "--what", "hits", "--hit", "1")
    assert run("export", recorded.path, "-o", folder, *words).exit_code == 0
    (file,) = folder.iterdir()
    assert {item.origin for item in read_measurement(file).channels} == {
        "simulated (virtual rig, plant published)"
    }
    outcome = run("import", file, "-o", again)
    assert (outcome.exit_code, outcome.stderr) == (0, "")  # units are stated in every format
    (sent, values), (block, found) = map(read_hit, (recorded.path, again))
    assert (block.origin.kind, block.origin.file) == ("simulated", str(file))
    # A record begins at its pre-trigger.
    assert len(found[0]) > 4900
    assert found == [trace[-len(found[0]) :] for trace in values]
    assert block.sampling_rate == sent.sampling_rate


@pytest.fixture(scope="module")
def law(record, tmp_path_factory):
    """Return a campaign of one sample whose contact has a law: 158 us, n = 3/2, e = 0.95."""
    path = tmp_path_factory.mktemp("contact") / "session.mcap"
    return record(path, VirtualRigSettings(plant=Plant.CONTACT, seed=7), ("steel small",), 3)


def test_a_simulator_gets_the_contact_that_the_virtual_rig_struck_with(run, law, tmp_path):
    write_results(tmp_path / "results.json", law.results)
    outputs = tmp_path / "a.sdf", tmp_path / "b.sdf"
    for source, output in zip((law.path, tmp_path / "results.json"), outputs, strict=True):
        assert run("export", source, "--for", "sdf", "-o", output).exit_code == 0
    first, again = (output.read_bytes() for output in outputs)
    assert first == again
    kp, kd = (float(ET.fromstring(first).find(f".//{name}").text) for name in ("kp", "kd"))
    # A spring of 158.1 us between 100.0 g and 59.3 g, whose damper takes 5 % of the speed.
    assert kp == pytest.approx(2.0 * 1.440e7, rel=0.01)
    assert kd == pytest.approx(12.1, rel=0.03)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("-o", "x.sdf"), "x.sdf is not a file of MuJoCo: it has .xml"),
        (("-o", "x.xml", "--filtered"), "--filtered is not for simulators"),
        (("-o", "x.xml", "--sample", "a", "--sample", "b"), "for one sample"),
    ],
)
def test_what_no_simulator_can_get_is_refused(run, law, tmp_path, monkeypatch, words, sentence):
    monkeypatch.chdir(tmp_path)
    done = run("export", law.path, "--for", "mujoco", *words)
    assert done.exit_code != 0
    assert sentence in " ".join(done.stderr.split())
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def damaged(struck, tmp_path):
    """Return a campaign whose last 20 kB never reached the disk."""
    path = tmp_path / "session.mcap"
    path.write_bytes(struck.read_bytes()[:-20_000])
    return path


def test_what_is_sound_of_a_damaged_recording_is_saved_and_the_loss_is_told(run, damaged):
    before, sound = damaged.read_bytes(), damaged.with_name("sound.mcap")
    outcome = run("export", damaged, "-o", sound)
    assert outcome.exit_code == 1
    assert f"{damaged}: it was never closed" in outcome.stderr
    assert "lost: " in outcome.stdout
    assert damaged.read_bytes() == before
    assert run("info", sound).exit_code == 0
    assert sum(isinstance(event, Block) for event in Run(sound).events()) > 40
    again = run("export", sound, "-o", damaged.with_name("again.mcap"))
    assert (again.exit_code, "lost: nothing" in again.stdout) == (0, True)
    assert run("export", damaged, "-o", sound).exit_code == 2
