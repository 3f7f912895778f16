"""`impact-rig analyze` on plain traces of other laboratories."""

import json
from pathlib import Path

import numpy as np
import pytest

RATE = 1e6
CONTACT_TIME = 200e-6
REAL_HITS = Path(__file__).parents[1] / "data" / "pyfrf_hammer"


def make_pulse(contact_time=CONTACT_TIME, peak=500.0):
    """Return rows of time, hammer (a versed-sine) and sample (a decaying oscillation)."""
    time = np.arange(2000) / RATE
    since = time - 300e-6
    inside = (since > 0) & (since < contact_time)
    hammer = np.where(inside, peak * np.sin(np.pi * since / contact_time) ** 2, 0.0)
    decay = np.exp(-4e3 * since) * np.sin(2 * np.pi * 5e3 * since)
    return np.stack([time, hammer, np.where(since > 0, 0.5 * peak * decay, 0.0)])


@pytest.fixture
def save(tmp_path):
    """Return a function that saves rows as a trace file."""

    def write(name, rows):
        path = tmp_path / name
        np.save(path, rows)
        return path

    return write


def read_json(outcome):
    assert outcome.exit_code == 0, outcome.stderr
    return json.loads(outcome.stdout)


def test_a_rig_file_gives_masses_and_settings(run, save, tmp_path):
    rig = tmp_path / "rig.toml"
    rig.write_text(
        """
        [hammer]
        mass = "100 g"
        impact_speed = "8 cm/s"
        [analysis]
        cutoff_frequency = "80 kHz"
        pulse_factor = 1.5
        [samples]
        control = "twin"
        [[sample]]
        name = "twin"
        mass = "100 g"
        [[sample]]
        name = "other"
        mass = "50 g"
        """
    )
    path = save("hit.npy", make_pulse())
    twin = read_json(run("analyze", "--rig-file", rig, "--sample", "twin", "--json", path))
    assert twin["hammer"]["control_sample"] == "twin"
    assert twin["samples"][0]["contact_time_s"] == pytest.approx(0.75 * CONTACT_TIME, rel=0.01)
    assert twin["samples"][0]["printed_mse_sample_percent"] is not None
    other = run("analyze", "--rig-file", rig, "--sample", "other", path)
    assert "the control sample 'twin' has no accepted hit" in " ".join(other.stdout.split())
    unknown = run("analyze", "--rig-file", rig, "--sample", "tin", path)
    assert unknown.exit_code == 2
    assert "unknown sample 'tin'" in unknown.stderr


@pytest.mark.parametrize(
    ("rows", "words", "sentence"),
    [
        pytest.param(make_pulse(peak=0.0), (), "no pulse", id="flat"),
        pytest.param(make_pulse(), ("--cutoff", "5 kg"), "is no Hz", id="wrong unit"),
        pytest.param(make_pulse(), ("--rig-file", "none.toml"), "none.toml", id="no rig file"),
    ],
)
def test_bad_input_gets_one_sentence(run, save, rows, words, sentence):
    outcome = run("analyze", *words, save("hit.npy", rows))
    assert outcome.exit_code == 2
    assert outcome.stdout == ""
    assert outcome.stderr.startswith("error: ")
    assert len(outcome.stderr.splitlines()) == 1
    assert sentence in outcome.stderr


REAL_SHOCKS = REAL_HITS.parent / "repeat_shock"
SHOCK_OPTIONS = ("--cutoff", "off", "--hammer-unit", "g", "--json")


def test_a_real_clipped_shock_is_rejected_with_the_rail_that_its_readme_states(run, channels):
    # It rings down from the rail as far as the first peak, which makes it no double hit. Three
    # equal points stand at the upper rail, seven at the lower one.
    words = (*SHOCK_OPTIONS, *channels('columns = ["time", "hammer"]'))
    outcome = run("analyze", *words, REAL_SHOCKS / "acc_pcb_a1_start.txt")
    (hit,) = json.loads(outcome.stdout)["hits"]
    told = "7 points in a row of the hammer at the rail of 5360 m/s^2 (546.6 g)"
    assert hit["reasons"] == [{"reason": "overload", "explanation": told}]


def test_a_record_of_many_impacts_is_a_double_hit_and_says_how_to_cut_it(run, save, tmp_path):
    rows = np.tile(make_pulse(), 4)
    rows[0] = np.arange(rows.shape[1]) / RATE
    many = save("many.npy", rows)
    shown = " ".join(run("analyze", many).stdout.split())
    assert "no hit was accepted: double_hit (1)" in shown
    advice = "--record-duration 20ms makes one of each"
    assert advice in shown
    imported = run("import", "--hammer-unit", "g", many, "-o", tmp_path / "many.mcap")
    assert imported.exit_code == 0
    assert advice in imported.stderr


def test_a_folder_of_measured_files_says_how_to_name_them(run, tmp_path):
    (tmp_path / "hit.csv").touch()
    outcome = run("analyze", tmp_path)
    assert outcome.exit_code == 2
    assert "name other files one by one" in outcome.stderr


def test_the_first_line_says_which_channel_was_taken_as_what(run, tmp_path):
    path = tmp_path / "hit.csv"
    time = np.arange(2000) / 1e6
    pulse = np.sin(np.pi * np.clip((time - 5e-4) / 2e-4, 0.0, 1.0)) ** 2
    noise = np.random.default_rng(1).normal(0.0, 1e-3, (2, 2000))
    rows = np.stack([time, 20 * pulse + noise[0], 100 * pulse + noise[1]]).T
    np.savetxt(path, rows, delimiter=",", header="time (s),Acc (g),Force (N)", comments="")
    line = "Channels: hammer 'Force' [N], sample 'Acc' [g]."
    assert run("analyze", path).stdout.startswith(f"{line}\n")
    aside = run("analyze", "--json", path)
    assert json.loads(aside.stdout)["samples"]
    assert aside.stderr.startswith(f"{line}\n")
    words = (path, "-o", tmp_path / "hit.mcap", "--hammer-mass", "100g")
    assert run("import", *words).stdout.startswith(f"{line}\n")
    for option, value in (("--hammer-mass", "100"), ("--cutoff", "20"), ("--rate", "1e6")):
        refused = run("analyze", path, option, value)
        assert refused.exit_code == 2
        assert f'{option} is "{value}", which has no unit: write it like' in refused.stderr
