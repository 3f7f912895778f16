"""`impact-rig report`: a file to hand over, whatever it is made of."""

import json
import shutil
from datetime import UTC, datetime
from pathlib import Path

import pytest

from impact_rig.configuration.particulars import SAMPLE, TABLES
from impact_rig.configuration.rig_file import read_template
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.rig import VirtualRigSettings
from impact_rig.results.results_file import write_results

SAMPLES = ("aluminium large", "brass medium")


@pytest.fixture(scope="module")
def recorded(record, tmp_path_factory):
    """Return the folder of a run of two samples, two hits each."""
    folder = tmp_path_factory.mktemp("runs") / "monday"
    folder.mkdir()
    settings = VirtualRigSettings(seed=3, plant=Plant.DYNAMICS)
    campaign = record(folder / "session.mcap", settings, SAMPLES, 2)
    write_results(folder / "results.json", campaign.results)
    return folder


@pytest.fixture
def folder(recorded, tmp_path):
    """Return a copy of it that a test may write into."""
    return Path(shutil.copytree(recorded, tmp_path / "monday"))


def read_text(path):
    return path.read_text(encoding="utf-8")


def test_the_report_of_a_run_lies_in_its_folder_and_is_never_overwritten(run, folder):
    outcome = run("report", folder)
    assert (outcome.exit_code, outcome.stdout) == (0, "")
    path = folder / "report.html"
    assert outcome.stderr == f"report: {path}\n"
    text = read_text(path)
    assert "session.mcap" in text
    assert str(folder) not in text  # the folder's path here is private
    for words in ("Paper", "[µs]", "brass medium *", "Fig. 3", "data:image/svg+xml", "2500"):
        assert words in text

    again = run("report", folder)
    assert again.exit_code == 2
    assert f"error: {path} exists already: name another file with -o" in again.stderr
    assert read_text(path) == text

    # The same input gives the same bytes, also under another name of the recording.
    other = folder / "new" / "other.html"
    assert run("report", folder / "session.mcap", "-o", other).exit_code == 0
    assert other.read_bytes() == path.read_bytes()


def test_what_is_set_is_in_the_report_and_what_is_missing_is_listed(run, folder):
    lacking = run("report", folder, "--check")
    assert lacking.exit_code == 1
    assert "Measured hits are lacking: these are simulated" in lacking.stdout
    assert "Report number (7.8.2.1 d): number in [report]" in lacking.stdout
    assert not (folder / "report.html").exists()
    number = ("--set", "report.number=4711")
    assert "Report number" not in run("report", folder, "--check", *number).stdout
    assert run("report", folder, *number).exit_code == 0
    assert "End of the report 4711." in read_text(folder / "report.html")
    wrong = run("report", folder, "-o", folder / "x.html", "--set", "report.nummer=1")
    assert wrong.exit_code == 2
    assert "'report.nummer=1' sets nothing: write it like report.number=TEXT" in wrong.stderr


ENTRIES = {**TABLES, f"sample.{SAMPLES[0]}": SAMPLE, f"sample.{SAMPLES[1]}": SAMPLE}


def test_a_final_report_is_refused_while_anything_lacks(run, folder):
    whole = {
        f"{table}.{entry.key}": "2020-01-01" if entry.is_date else "x"
        for table, entries in ENTRIES.items()
        for entry in entries
    } | {"report.number": "2", "report.issued": datetime.now(UTC).date().isoformat()}
    path = folder / "final.html"

    def write(*words, **changed):
        texts = whole | {name.replace("__", "."): text for name, text in changed.items()}
        sets = [word for item in texts.items() for word in ("--set", "=".join(item))]
        return run("report", folder / "results.json", "--final", "-o", path, *sets, *words)

    asked = {
        f"{table}.{entry.key}": entry.clause
        for table, entries in ENTRIES.items()
        for entry in entries
        if entry.clause
    }
    assert len(asked) > 16
    for name, clause in asked.items():
        outcome = write(**{name: ""})
        assert (outcome.exit_code, path.exists()) == (2, False), name
        assert f"({clause})" in outcome.stderr
    for name, told in (
        ("report__tested", "(7.8.2.1 i)"),
        ("report__changes", "(7.8.8.2)"),
        ("report__issued", "Date of issue (7.8.2.1 j)"),
    ):
        assert told in write(**{name: ""}).stderr
    outcome = write("--for", "laboratory", report__opinions_by="")
    assert "(7.8.7.1)" in outcome.stderr
    limit = ("--set", f"sample.{SAMPLES[0]}.maximum_contact_time=1 ms")
    assert "(7.8.6.2 b)" in write(*limit, report__specification="").stderr
    assert not path.exists()
    assert write("--data").exit_code == 0
    stated = json.loads(read_text(path.with_suffix(".json")))
    (first, *_) = stated["results"]
    assert (stated["report"], first["sample"], first["unit"]) == ("2", SAMPLES[0], "s")
    assert f"<si:value>{first['value']!r}</si:value>" in read_text(path.with_suffix(".xml"))
    assert "replaces itself" in write("-o", folder / "x.html", report__replaces="2").stderr


def test_a_file_with_a_laboratory_alone_says_what_the_recording_does_not(run, folder):
    rig = folder / "lab.toml"
    rig.write_text(
        '[laboratory]\nname = "Lab 7"\n[report]\nissued = 2020-01-01\n'
        '[hammer]\nmass = "200 g"\n'
        '[[sample]]\nname = "brass medium"\nmaximum_contact_time = "100 us"\n'
        '[[sample]]\nname = "brass mediun"\ndimensions = "30 mm"\n'
    )
    told = "facts or limits are stated of 'brass mediun', and the run has no such sample"
    early = "the report was issued on 2020-01-01, before the tests ended on"
    outcome = run("report", folder, "--rig-file", rig)
    assert outcome.exit_code == 0
    assert f"warning: of the rig file {rig} only texts, instruments and limits" in outcome.stderr
    assert "are taken: hammer.mass as recorded" in outcome.stderr
    for text in (told, early):
        assert f"warning: {text}" in outcome.stderr
        checked = run("report", folder, "--check", "--rig-file", rig).stdout
        assert text[1:] in checked
    text = read_text(folder / "report.html")
    assert "Lab 7" in text
    assert "of 1 value with limits 1 undecided" in text


def test_a_recording_brings_its_rig_file_and_what_a_person_decided(run, folder):
    from impact_rig_msgs.msg import Overrule

    from impact_rig.nodes import interfaces, messages

    from ..nodes.replays import write_recording

    decided = Overrule(record=2, verdict=Overrule.REJECT, reason="loose cable", who="Ann")
    decided.header.stamp = messages.stamp_to_msg(1_700_000_000_000_000_000)
    rig = read_template() + '[laboratory]\nname = "Lab 7"\n'
    write_recording(
        folder / "session-2.mcap",
        [(9.0, interfaces.OVERRULE, decided)],
        attachment=("rig.toml", "application/toml", rig.encode()),
    )
    assert run("report", folder).exit_code == 0
    text = read_text(folder / "report.html")
    told = ("left out by hand", "loose cable", "Ann", "2023-11-14 22:13:20 UTC")
    for words in ("Lab 7", *told):
        assert words in text
    # Who decides otherwise later takes nothing away.
    again = folder / "again.html"
    asked = ("--accept", "2", "--reason", "it was fast", "--who", "Bob", "-o", again)
    assert run("report", folder, *asked).exit_code == 0
    text = read_text(again)
    assert "Hits on which a person decided: 1" in text
    for words in (*told, "accepted by hand", "it was fast", "Bob"):
        assert words in text


def test_a_recorded_rig_file_that_cannot_be_read_leaves_what_is_named(run, folder):
    from ..nodes.replays import write_recording

    bad = ("rig.toml", "application/toml", b"[report")
    write_recording(folder / "session-2.mcap", [], attachment=bad)
    outcome = run("report", folder, "--set", "report.number=4711")
    assert outcome.exit_code == 0
    assert "the rig file rig.toml in the recording is not used: this is not TOML" in outcome.stderr
    assert "4711" in read_text(folder / "report.html")


def test_a_hit_is_left_out_with_reason_and_name(run, folder):
    asked = ("report", folder, "--reject", "brass medium/1")
    assert 'add --reason "TEXT" --who "NAME"' in run(*asked, "--reason", "loose cable").stderr
    assert "add --reason" in run(*asked, "--reason", "  ", "--who", "A. Berg").stderr
    assert "belong to --accept or --reject" in run("report", folder, "--who", "A").stderr
    assert run(*asked, "--reason", "loose cable", "--who", "A. Berg").exit_code == 0
    text = read_text(folder / "report.html")
    assert "Hits on which a person decided: 1" in text
    assert "Rejected hits" not in text
    today = datetime.now(UTC).date().isoformat()
    shown = "left out by hand", "loose cable", "A. Berg", f'<td class="text">{today} ', "(✗) ✓"
    assert [words for words in shown if words not in text] == []
    said = ("--reason", "x", "--who", "A", "-o", "x.html")
    results = run("report", folder / "results.json", *asked[2:], *said)
    assert "has no traces: --accept and --reject need them" in results.stderr


def test_results_that_contradict_themselves_are_refused_in_one_sentence(run, folder):
    (folder / "session.mcap").unlink()
    path = folder / "results.json"
    path.write_text(path.read_text().replace('"name": "brass medium"', '"name": "other"', 1))
    outcome = run("report", folder)
    assert outcome.exit_code == 2
    assert outcome.stderr.startswith(f"error: results {path}: ")
    assert "brass medium" in outcome.stderr


def test_a_recording_that_is_lost_is_told_of_by_the_results_beside_it(run, folder):
    (folder / "session.mcap").write_bytes(b"\x89MCAP0\r\nlost")
    outcome = run("report", folder)
    assert outcome.exit_code == 0
    text = read_text(folder / "report.html")
    assert "this is the results.json beside it" in text
    assert "Table 2." in text


def test_every_campaign_of_a_recording_has_its_part(run, record, tmp_path):
    path = tmp_path / "two.mcap"
    record(path, VirtualRigSettings(), ("aluminium large",), 2, campaigns=2)
    assert run("report", path).exit_code == 0
    text = read_text(tmp_path / "report.html")
    assert text.index("two, campaign 1") < text.index("two, campaign 2")
    assert text.count("0.9765625") == 2  # each has its calibration
