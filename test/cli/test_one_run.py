"""The same hits give the same bytes, in whatever files they are and whatever reads them."""

import json

import pytest

from impact_rig.core.given.setup import CONTROL_SAMPLE

HITS = {CONTROL_SAMPLE: 3, "steel small": 4}
SPLIT = 4
"""Record with which the run was resumed."""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Return a recording of a campaign, and the folder of the same one, resumed once."""
    from ..nodes.replays import make_hits, write_recording

    folder = tmp_path_factory.mktemp("recorded")
    events = make_hits(HITS)
    (folder / "run").mkdir()
    for name, records in (("session", range(SPLIT)), ("session-2", range(SPLIT, 8))):
        # Each recording has the set-up of its campaign.
        part = [item for item in events if getattr(item[2], "record", records[0]) in records]
        write_recording(folder / "run" / f"{name}.mcap", part)
    return write_recording(folder / "whole.mcap", events), folder / "run"


@pytest.fixture
def quiet_ros(monkeypatch):
    """Keep ROS on this host."""
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)


def test_the_same_hits_give_the_same_bytes(run, quiet_ros, recorded, tmp_path):
    whole, folder = recorded
    copy, results = tmp_path / "copy.mcap", tmp_path / "results.json"
    copied = run("export", folder / "session.mcap", "-o", copy)
    assert copied.exit_code == 0
    assert "7 hits" in copied.stdout
    run("export", folder, "-o", results)
    ways = [
        ("analyze", whole),
        ("analyze", folder),
        ("analyze", folder / "session.mcap"),
        ("analyze", folder / "session-2.mcap"),
        ("analyze", copy),
        ("analyze", results),
        ("replay", "--estimate", whole),
        ("replay", "--estimate", folder),
    ]
    found = {way: run(*way, "--json").stdout for way in ways}
    assert len(json.loads(found[ways[0]])["hits"]) == sum(HITS.values())
    assert [way for way in ways if found[way] != found[ways[0]]] == []


def test_a_file_of_a_resumed_run_says_that_all_of_it_is_read(run, recorded, tmp_path):
    _, folder = recorded
    told = "session-2.mcap is part of a run that was resumed"
    for words in (("analyze",), ("info",), ("export", "-o", tmp_path / "hits.csv")):
        outcome = run(*words, folder / "session-2.mcap")
        assert told in " ".join((outcome.stdout + outcome.stderr).split())


def test_where_the_run_is_and_how_to_report_it_names_its_folder(run, recorded):
    _, folder = recorded
    told = run("analyze", folder / "session-2.mcap").stderr
    assert told.splitlines()[-2:] == [
        f"recording: {folder}",
        f"report:    impact-rig report {folder}",
    ]


def test_the_recordings_of_a_run_named_one_by_one_are_one_run(run, recorded):
    _, folder = recorded
    named = run("analyze", *sorted(folder.glob("*.mcap")), "--json")
    assert named.exit_code == 0
    (campaign,) = json.loads(named.stdout)
    assert len(campaign["results"]["hits"]) == sum(HITS.values())
    (told,) = json.loads(run("info", *sorted(folder.glob("*.mcap")), "--json").stdout)
    assert {hit["campaign"] for hit in told["hits"]} == {1}
    assert [len(told["hits"]), len(told["files"])] == [sum(HITS.values()), 2]
