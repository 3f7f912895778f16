"""`impact-rig recover`: a damaged recording becomes a good one, and the loss is told."""

import json
import os

import pytest
from mcap.reader import make_reader

from impact_rig.core.signals.record import Block
from impact_rig.recordings.reader import read_recording


@pytest.fixture
def damaged(struck, tmp_path):
    """Return a campaign whose last 20 kB never reached the disk."""
    path = tmp_path / "session.mcap"
    path.write_bytes(struck.read_bytes()[:-20_000])
    return path


def test_the_recovered_recording_lies_beside_and_can_be_read(run, damaged):
    before = damaged.read_bytes()
    outcome = run("recover", damaged)
    assert (outcome.exit_code, outcome.stderr) == (1, "")
    good = damaged.with_name("session.recovered.mcap")
    assert f"{good.name}" in outcome.stdout
    assert "lost:" in outcome.stdout
    assert damaged.read_bytes() == before
    assert sorted(path.name for path in damaged.parent.iterdir()) == [
        "session.mcap",
        "session.recovered.mcap",
    ]
    assert run("info", good).exit_code == 0
    assert sum(isinstance(event, Block) for event in read_recording(good).events()) > 40
    again = run("recover", good)
    assert again.exit_code == 0
    assert "nothing is wrong with it" in again.stdout
    assert run("recover", damaged).exit_code == 2


def test_json_tells_what_was_lost_by_topic_and_by_hit(run, struck, tmp_path):
    spoilt, damaged = bytearray(struck.read_bytes()), tmp_path / "session.mcap"
    with struck.open("rb") as file:
        chunk = make_reader(file).get_summary().chunk_indexes[5]
    spoilt[chunk.chunk_start_offset + chunk.chunk_length - 100] ^= 1
    damaged.write_bytes(spoilt)
    content = json.loads(run("recover", damaged, "--json").stdout)
    assert content["complete"] is False
    assert content["messages_written"] == content["found"]["messages"]
    assert content["found"]["files"][0]["damages"][0]["size_bytes"] > 0
    states = {hit["record"]: hit["state"] for hit in content["found"]["hits"]}
    assert states == {**dict.fromkeys(range(1, 13), "saved"), 6: "lost"}
    topics = content["found"]["topics"]
    lost = {topic["name"]: topic["lost"] for topic in topics}
    assert lost == {
        "/acceleration": 5,
        "/impact": 1,
        "/recorder/stored": 1,
        "/release": 1,
        "/setup": 0,
    }


def test_several_are_recovered_one_by_one(run, damaged, struck):
    other = damaged.with_name("other.mcap")
    other.write_bytes(b"")
    outcome = run("recover", damaged, other, struck)
    assert outcome.exit_code == 2
    assert "is empty" in outcome.stderr
    assert damaged.with_name("session.recovered.mcap").is_file()
    refused = run("recover", damaged, struck, "-o", "one.mcap")
    assert (refused.exit_code, "--output" in refused.stderr) == (2, True)


def test_a_full_disk_leaves_nothing_behind(run, damaged, monkeypatch):
    def refuse(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", refuse)
    outcome = run("recover", damaged)
    assert outcome.exit_code == 2
    assert "No space left on device" in outcome.stderr
    assert list(damaged.parent.iterdir()) == [damaged]
