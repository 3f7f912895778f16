"""`impact-rig info`: what a recording holds, and whether it is sound, at a glance."""

import json
from dataclasses import replace

import pytest

from impact_rig.core.given.sensors import Sensor
from impact_rig.core.given.setup import PAPER_SETUP
from impact_rig.devices.virtual.rig import VirtualRigSettings
from impact_rig.recordings.new_file import DiskFile
from impact_rig.recordings.records import OfferedQos
from impact_rig.recordings.schemas import MessageDefinition
from impact_rig.recordings.writer import RecordingWriter

from .conftest import record_campaigns

TEXT = MessageDefinition("std_msgs/msg/String", "string data\n", "")
TIME = 1_700_000_000_000_000_000
HELLO = b"\x00\x01\x00\x00\x06\x00\x00\x00hello\x00"


def write_notes(path, topic="/chatter", **options):
    """Write a recording without a rig: five texts and what a recorder adds."""
    with RecordingWriter(path, **options) as writer:
        channel = writer.add_channel(topic, TEXT, (OfferedQos(),))
        for number in range(5):
            time = TIME + number * 500_000_000
            writer.add_message(channel, HELLO, time, time)
        writer.add_metadata(
            "impact_rig",
            {"software_version": "9.8.7", "notes": "dusty", "libraries": '{"numpy": "2"}'},
        )
        writer.add_metadata("impact_rig/parameters", {"/hammer": "swing_time: 0.25\n"})
        writer.add_metadata("impact_rig/health", {"reason": "disk full", "gaps": "0"})
        for name in ("rig.toml", "../../escaped.toml", "/etc/passwd", "", "rig.toml"):
            writer.add_attachment(name, "application/toml", f"[{name}]".encode())
        writer.add_attachment("rig.toml", "application/toml", b"another")
    return path


def test_the_first_line_is_the_verdict(run, struck):
    outcome = run("info", struck)
    assert (outcome.exit_code, outcome.stderr) == (0, "")
    assert outcome.stdout.splitlines()[0] == "sound: 4 samples, 8 hits accepted, 4 rejected"
    assert "Rejected for weak (4)." in outcome.stdout
    assert max(map(len, outcome.stdout.splitlines())) <= 80
    for words in ("steel small", "/acceleration", "impact_rig_msgs/msg/RigSetup"):
        assert words in outcome.stdout


def test_a_cut_off_recording_is_damaged_and_says_what_helps(run, struck, tmp_path):
    path = tmp_path / "cut.mcap"
    path.write_bytes(struck.read_bytes()[:-30_000])
    outcome = run("info", path)
    assert outcome.exit_code == 1
    text = " ".join(outcome.stdout.split())
    assert text.startswith("damaged: it was never closed")
    command = f"`impact-rig export {path} -o sound.mcap`"
    assert command.replace(" ", "") in text.replace(" ", "")  # a long path is broken
    assert "last record is cut off" in text


def test_a_recording_that_is_written_is_live(run, struck, tmp_path):
    path = tmp_path / "session.mcap"
    writer = DiskFile(path)
    writer.write(struck.read_bytes()[:-30_000])
    outcome = run("info", path)
    assert outcome.exit_code == 0
    assert outcome.stdout.startswith("live, it is being recorded; so far: 4 samples, ")
    assert "damaged" not in outcome.stdout
    told = run("analyze", path)
    assert "is being recorded: it is read up to" in " ".join(told.stdout.split())
    writer.close()
    assert run("info", path).stdout.startswith("damaged: it was never closed")


def test_a_recording_that_was_cut_behind_its_last_words_did_not_end(run, tmp_path):
    path = write_notes(tmp_path / "notes.mcap")
    path.write_bytes(path.read_bytes()[:-20])
    assert "ended" not in run("info", path).stdout


def test_a_note_of_several_lines_is_shown_in_one(run, tmp_path):
    path = tmp_path / "notes.mcap"
    with RecordingWriter(path) as writer:
        channel = writer.add_channel("/note", TEXT, (OfferedQos(),))
        text = b"new\nbearing\0"
        writer.add_message(channel, b"\0\1\0\0" + bytes([len(text), 0, 0, 0]) + text, TIME, TIME)
    assert ": new bearing" in run("info", path).stdout


@pytest.mark.parametrize("time", [0, 2**64 - 1])
def test_a_time_that_rolled_over_is_said_first(run, tmp_path, time):
    path = tmp_path / "rolled.mcap"
    with RecordingWriter(path) as writer:
        channel = writer.add_channel("/chatter", TEXT, (OfferedQos(),))
        for moment in (TIME, time):
            writer.add_message(channel, HELLO, moment, moment)
    outcome = run("info", path)
    text = " ".join(outcome.stdout.split())
    assert text.startswith("sound: 2 messages, no hit; its times are wrong: its messages are 5")
    assert f"{abs(time - TIME) * 1e-9:.1f} s" not in text


def test_recordings_of_other_systems_are_shown_with_what_their_recorder_noted(run, tmp_path):
    path = write_notes(tmp_path / "notes.mcap", topic="/lab/note", library="another program")
    outcome = run("info", path)
    assert outcome.exit_code == 0
    assert outcome.stdout.splitlines()[0] == "sound: 5 messages, no hit"
    shown = "/lab/note", "2.0", "impact_rig 9.8.7", "numpy 2", "disk full", ": hello", "dusty"
    assert [words for words in shown if words not in outcome.stdout] == []
    content = json.loads(run("info", path, "--json").stdout)
    assert [note["text"] for note in content["notes"]] == ["hello"] * 5
    assert content["metadata"]["impact_rig/parameters"] == {"/hammer": "swing_time: 0.25\n"}


def test_attachments_are_extracted_and_lead_nowhere_else(run, tmp_path):
    path, folder = write_notes(tmp_path / "a.mcap"), tmp_path / "deep" / "er"
    outcome = run("info", path, "--extract", folder)
    assert outcome.exit_code == 0
    files = {item.name: item.read_text() for item in folder.iterdir()}
    assert files == {
        "rig.toml": "[rig.toml]",
        "rig-2.toml": "another",
        "escaped.toml": "[../../escaped.toml]",
        "passwd": "[/etc/passwd]",
        "attachment": "[]",
    }
    assert {item.name for item in tmp_path.iterdir()} == {"a.mcap", "deep"}
    again = run("info", path, "--extract", folder)
    assert (again.exit_code, "exists already" in again.stderr) == (2, True)


def test_one_bad_file_does_not_hide_the_others(run, struck, tmp_path):
    bad = tmp_path / "bad.mcap"
    bad.write_bytes(b"\x00" * 1000)
    outcome = run("info", bad, tmp_path / "none.mcap", struck, "--json")
    assert outcome.exit_code == 2
    assert [line.partition(":")[0] for line in outcome.stderr.splitlines()] == ["error"] * 2
    assert len(json.loads(outcome.stdout)) == 1


def test_the_sensors_are_told_of_and_calibrations_that_were_too_old(run, tmp_path):
    sensors = (
        Sensor("hammer", "force", "N", 2.25e-3, 2200.0, "LW 7", "2022-03-01"),
        Sensor("specimen", "acceleration", "g", 0.01),
    )
    path = tmp_path / "session.mcap"
    setup = replace(PAPER_SETUP, sensors=sensors)
    record_campaigns(path, VirtualRigSettings(), ["steel small"], 1, setup=setup)
    text = " ".join(run("info", path).stdout.split())
    assert "hammer: force, 2.25 mV per N, up to 2200 N, serial number LW 7" in text
    assert "warning: the hammer sensor LW 7 was calibrated on 2022-03-01, over a year" in text
    content = json.loads(run("info", path, "--json").stdout)
    assert [item["serial_number"] for item in content["sensors"]] == ["LW 7", ""]
    assert content["sound"] is True
