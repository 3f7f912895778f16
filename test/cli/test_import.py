"""`impact-rig import`: files of other instruments become recordings that `analyze` takes."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from impact_rig.cli import import_
from impact_rig.core.given.records import Block
from impact_rig.recordings.run import Run

DATA = Path(__file__).parents[1] / "data"
REAL_HITS = sorted((DATA / "pyfrf_hammer").glob("*.npy"))
REAL_SHOCKS = sorted((DATA / "repeat_shock").glob("acc_base*.txt"))
SLOW = ("--cutoff", "off")
ACCELERATION = ("--hammer-unit", "m/s^2")


@pytest.fixture
def save(tmp_path):
    """Return a function that saves rows of a versed-sine, sampled at 1 MHz, as a file."""

    def write(name, contact_time=200e-6, peak=500.0):
        time = np.arange(2000) / 1e6
        since = time - 300e-6
        inside = (since > 0) & (since < contact_time)
        hammer = np.where(inside, peak * np.sin(np.pi * since / contact_time) ** 2, 0.0)
        path = tmp_path / name
        np.save(path, np.stack([time, hammer, 0.5 * hammer]))
        return path

    return write


def read_blocks(path):
    return [event for event in Run(path).events() if isinstance(event, Block)]


def read_json(outcome):
    assert outcome.exit_code == 0, outcome.stderr
    return json.loads(outcome.stdout)


@pytest.mark.parametrize(
    ("files", "words", "text"),
    [
        pytest.param(REAL_HITS, ["--hammer-unit", "N", "--hammer-mass", "300g"], "", id="hammer"),
        pytest.param(
            REAL_HITS,
            [*ACCELERATION, "--hammer-mass=300g", "--sample-mass=300g"],
            "[specimen]\ncontrol = true",
            id="k",
        ),
        pytest.param(
            REAL_SHOCKS, ["--hammer-unit", "g"], 'columns = ["time", "hammer"]', id="shock"
        ),
    ],
)
def test_real_hits_give_the_same_numbers_from_the_recording_as_from_their_files(
    run, tmp_path, channels, files, words, text
):
    output = tmp_path / "hits.mcap"
    words = [*words, *channels(text)]
    assert run("import", *files, "-o", output, *SLOW, *words).exit_code == 0
    recorded = read_json(run("analyze", "--json", output))
    direct = read_json(run("analyze", "--json", *SLOW, *words, *files))
    assert direct["samples"][0]["impacts_accepted"] == len(files)
    for results in (recorded, direct):  # direct ones name options that bring in what is missing
        del results["samples"][0]["notes"]
    assert recorded["samples"] == direct["samples"]
    assert recorded["hammer"]["stiffness_n_per_m"] == direct["hammer"]["stiffness_n_per_m"]


def test_a_files_number_is_its_hits_record(run, save, tmp_path, channels):
    files = [save("b.npy"), save("a.npy", 210e-6)]
    output = tmp_path / "hits.mcap"
    words = ("-o", output, "--sample", "brass", *channels('[specimen]\nunit = "g"'))
    outcome = run("import", *files, *words, *ACCELERATION, "--show")
    assert outcome.exit_code == 0
    assert "2 hits on 'brass', from 2 of 2 files" in outcome.stdout
    # One choice of channels is drawn once: its first hit, both traces in eight lines each.
    drawn = re.findall(r"^(hammer|sample) '.*', as in the file: ", outcome.stdout, re.MULTILINE)
    assert drawn == ["hammer", "sample"]
    assert sum("█" in line for line in outcome.stdout.splitlines()) >= 9
    assert outcome.stderr == ""
    blocks = read_blocks(output)
    assert [block.label.record for block in blocks] == [1, 2]
    assert {block.label.sample for block in blocks} == {"brass"}
    found = read_json(run("analyze", "--json", "--reject", "1", output))["samples"][0]
    assert found["contact_time_s"] == pytest.approx(210e-6, rel=0.02)


def test_a_template_asks_for_what_its_file_does_not_say(run, save, tmp_path):
    assert '[hammer]\nchannel = "Acceleration_0"' in run("import", "--template").stdout
    path, bench = save("hit.npy"), tmp_path / "bench.toml"
    template = run("import", "--template", path).stdout
    assert 'columns = ["time", "hammer", "specimen"]' in template
    bench.write_text(template)
    words = (path, "-o", tmp_path / "hits.mcap", "--channels", bench)
    refused = run("import", *words)
    assert (refused.exit_code, "unit '?' is unknown" in refused.stderr) == (2, True)
    bench.write_text(template.replace('unit = "?"', 'unit = "g"'))
    assert run("import", *words).exit_code == 0
    # Files that state rates are told by the names of their channels.
    shock = run("import", "--template", DATA / "repeat_shock" / "Test_001_shock.lvm").stdout
    assert (
        "[hammer]  # 'Acceleration_0' (1200 points in m/s^2)\nchannel = \"Acceleration_0\""
        in shock
    )


def test_good_files_are_imported_whatever_the_others_are(run, save, tmp_path):
    good = save("good.npy")
    flat = save("flat.npy", peak=0.0)
    (tmp_path / "damaged.npy").write_bytes(good.read_bytes()[:1000])
    (tmp_path / "empty.csv").write_bytes(b"")
    (tmp_path / "copy.npy").write_bytes(good.read_bytes())
    files = [flat, "damaged.npy", "empty.csv", good, "copy.npy", "absent.npy", good]
    output = tmp_path / "hits.mcap"
    outcome = run("import", *(tmp_path / file for file in files), "-o", output, *ACCELERATION)
    assert outcome.exit_code == 2
    assert "1 of 7 files" in outcome.stdout
    told = [line for line in outcome.stderr.splitlines() if line.startswith("error: ")]
    assert len(told) == 6
    for name, why in (
        ("flat.npy", "no pulse"),
        ("damaged.npy", "no sound"),
        ("empty.csv", "empty"),
        ("copy.npy", "copy of"),
        ("absent.npy", "there is no file"),
        ("good.npy", "named twice"),
    ):
        assert any(name in line and why in line for line in told), name
    assert len(read_blocks(output)) == 1


def test_an_imported_hit_keeps_its_file_and_states_only_what_was_measured(
    run, save, tmp_path, channels
):
    files = [save(f"hit_{number}.npy", 200e-6 + number * 1e-7) for number in range(5)]
    recording, page = tmp_path / "hits.mcap", tmp_path / "hits.html"
    masses = ("--hammer-mass", "100 g", "--sample-mass", "100 g", *ACCELERATION)
    masses += channels("[specimen]\ncontrol = true")
    assert run("import", *files, "-o", recording, *masses).exit_code == 0
    content = read_json(run("analyze", recording, "--json"))
    assert content["origin"] == "imported"
    assert [hit["file"] for hit in content["hits"]] == list(map(str, files))
    assert {hit["place"] for hit in content["hits"]} == {
        "'column 2' and 'column 3', points 0 to 1999"
    }
    assert (content["setup"]["impact_speed_m_per_s"], content["setup"]["clock_u"]) == (None, 0.0)
    assert "when       not known" in run("info", recording).stdout
    told = read_json(run("info", recording, "--json"))
    assert (told["origin"], told["hits"][4]["origin"]["file"]) == ("imported", str(files[4]))
    assert run("report", recording, "-o", page).exit_code == 0
    text = page.read_text("utf-8")
    assert "Impact test report: imported" in text
    assert "hit_4.npy" in text
    assert "the unit of the sample&#39;s channel is not stated: m/s^2 is taken" in text
    for words in ("simulated", "8.19 cm/s", "58 ppm"):
        assert words not in text, words


def test_hits_that_are_cut_out_of_a_file_are_not_analyzed_to_be_written(
    run, save, tmp_path, monkeypatch
):
    """To judge 12 000 of them took twice the time and kept 1.7 GB, for advice on none."""
    trace = np.load(save("one.npy"))
    np.save(tmp_path / "many.npy", np.stack([np.arange(6000) / 1e6, *np.tile(trace[1:], 3)]))
    monkeypatch.setattr(import_, "judge", lambda *_: pytest.fail("they are judged"))
    output = tmp_path / "hits.mcap"
    window = ["--record-duration", "1 ms", *ACCELERATION]
    outcome = run("import", tmp_path / "many.npy", "-o", output, *window)
    assert outcome.exit_code == 0, outcome.stderr
    assert len(read_blocks(output)) == 3
