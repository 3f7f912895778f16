"""A folder as rosbag2 writes it is one recording, in order, told once, whatever became of it."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml
from rosbags.rosbag2 import Reader

from impact_rig.core.errors import FileError
from impact_rig.recording.reading.mcap_file import McapFile
from impact_rig.recording.reading.mcap_reader import read_recording
from impact_rig.recording.reading.source import open_source

HITS = 11
FILES = [f"made_{number}.mcap" for number in range(HITS + 1)]


@pytest.fixture
def campaign(make_recording, tmp_path, tmp_path_factory) -> Path:
    """Return a recording that was split after each hit; it is made once, and copied."""
    made = tmp_path_factory.getbasetemp() / "campaign"
    if not made.exists():
        maker = make_recording("made", split_size=1)
        maker.writer.add_metadata("impact_rig", {"notes": "cold"})
        maker.writer.add_attachment("rig.toml", "application/toml", b"[rig]")
        maker.add_setup()
        for record in range(1, HITS + 1):
            maker.add_block(record)
            maker.writer.sync()
        maker.add_virtual_impact(HITS + 1)
        maker.close().rename(made)
    path = tmp_path / "session"
    shutil.copytree(made, path)
    assert sorted(path.glob("*.mcap")) == sorted(path / name for name in FILES)
    return path


def list_events(path: Path) -> list[int | str]:
    """Return the names of the set-ups and the record numbers of the blocks."""
    return [
        event.label.record if hasattr(event, "label") else event.name
        for event in read_recording(path).events()
    ]


def test_the_files_are_read_in_the_order_of_their_numbers(campaign):
    source = open_source(campaign)
    assert [path.name for path in source.files] == FILES
    assert (source.is_complete, source.warnings) == (True, ())
    assert list_events(campaign) == ["bench", *range(1, HITS + 1)]


def test_every_message_is_there_that_rosbags_reads_but_what_is_repeated(campaign):
    with Reader(campaign) as reader:
        expected = [(item.topic, time, data) for item, time, data in reader.messages()]
    found = [(item.channel.topic, item.log_time, item.data) for item in _read(campaign)]
    assert len(expected) == len(found) + HITS  # the set-up, in each file but the first
    assert [item for item in expected if item[0] != "/setup"] == [
        item for item in found if item[0] != "/setup"
    ]
    assert found[0] == expected[0]


def _read(path: Path, **times: int) -> list:
    return list(open_source(path).read_messages(**times))


def test_a_setup_is_told_once_wherever_the_reading_starts(campaign):
    times = [item.log_time for item in _read(campaign)]
    for first in (0, 1, 5):
        found = _read(campaign, start_time=times[first])
        assert [item.log_time for item in found] == times[first:]
    assert [item.log_time for item in _read(campaign, start_time=times[3], end_time=times[6])] == (
        times[3:6]
    )


def test_metadata_and_attachments_are_told_once(campaign):
    source = open_source(campaign)
    told = [item.fields for item in source.read_metadata() if item.name == "impact_rig"]
    assert told == [{"notes": "cold"}]
    assert [item.data for item in source.read_attachments()] == [b"[rig]"]


def test_another_setup_and_the_same_one_sent_again_are_new_campaigns(make_recording):
    maker = make_recording("session", split_size=1)
    for name in ("first", "second", "second"):
        maker.add_setup(name=name)
        maker.add_block(1)
        maker.writer.sync()
    assert list_events(maker.close()) == ["first", 1, "second", 1, "second", 1]


def test_a_topic_has_one_number_in_all_files(make_recording, tmp_path):
    (tmp_path / "session").mkdir()
    first = make_recording("session/session_0.mcap")
    first.add_setup()
    first.add_block(1)
    second = make_recording("session/session_1.mcap")
    second.add_virtual_impact(2)
    second.add_block(2)
    first.close()
    source = open_source(second.close().parent)
    numbers = {channel.topic: channel.id for channel in source.read_channels()}
    assert sorted(numbers) == ["/acceleration", "/setup", "/virtual_impact"]
    assert len(set(numbers.values())) == 3
    assert [item.channel.id for item in source.read_messages()] == [
        numbers[topic] for topic in ("/setup", "/acceleration", "/virtual_impact", "/acceleration")
    ]


def change_list(folder: Path, change: Callable[[dict], None]) -> None:
    path = folder / "metadata.yaml"
    content = yaml.safe_load(path.read_text())
    change(content["rosbag2_bagfile_information"])
    path.write_text(yaml.safe_dump(content))


def test_the_list_tells_the_order_whatever_the_names(campaign):
    for old, new in ((0, "z"), (1, "a")):
        (campaign / FILES[old]).rename(campaign / f"{new}.mcap")
    change_list(campaign, lambda info: info.update(relative_file_paths=["z.mcap", "a.mcap"]))
    assert list_events(campaign) == ["bench", 1, 2]


def test_names_in_lists_of_old_versions_and_of_malice_stay_in_the_folder(campaign):
    names = [f"session/{FILES[0]}", f"../../etc/{FILES[1]}", f"/{FILES[2]}"]
    change_list(campaign, lambda info: info.update(relative_file_paths=names))
    assert list_events(campaign)[:4] == ["bench", 1, 2, 3]


def test_files_that_a_killed_recorder_did_not_list_are_read(campaign):
    change_list(campaign, lambda info: info.update(relative_file_paths=FILES[:2]))
    assert list_events(campaign) == ["bench", *range(1, HITS + 1)]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "relative_file_paths: 7",
        "relative_file_paths: [lost.mcap, gone.mcap]",
        "a: [unclosed",
        "[" * 100_000,
        "relative_file_paths:\n- [" + "a, " * 1000 + "]",
        "a: &a [x, x]\nb: &b [*a, *a]\nrelative_file_paths: *b",
        "\x00",
        "# " + "x" * (17 << 20),
        "relative_file_paths:\n" + "  - x" * 1_000_000,
        "relative_file_paths:\n" + "  " * 1_000_000,
    ],
    ids=range(11),
)
def test_a_list_that_makes_no_sense_is_not_needed(campaign, text):
    (campaign / "metadata.yaml").write_text(text)
    assert list_events(campaign) == ["bench", *range(1, HITS + 1)]


def test_missing_files_are_named(campaign):
    for number in (2, 4, 5, 6, HITS):
        (campaign / FILES[number]).unlink()
    source = open_source(campaign)
    assert not source.is_complete
    assert [text.removeprefix(f"{campaign}/") for text in source.warnings] == [
        "made_2.mcap is missing: what it held is lost",
        "made_4.mcap to made_6.mcap is missing: what it held is lost",
        "made_11.mcap is missing: what it held is lost",
    ]
    assert list_events(campaign) == ["bench", 1, 2, 4, 8, 9, 10, 11]
    assert read_recording(campaign).warnings == source.warnings


def test_old_files_that_were_dropped_on_purpose_are_not_missed(campaign):
    for name in FILES[:3]:
        (campaign / name).unlink()
    change_list(campaign, lambda info: info.update(relative_file_paths=FILES[3:]))
    assert open_source(campaign).warnings == ()
    assert list_events(campaign)[:2] == ["bench", 4]


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n", b"\x89MCAP0\r\n\x01\x20\0"])
def test_a_last_file_that_was_only_begun_is_left_out_with_a_word(campaign, content):
    (campaign / FILES[-1]).write_bytes(content)
    source = open_source(campaign)
    assert not source.is_complete
    assert FILES[-1] in source.warnings[0]
    assert list_events(campaign) == ["bench", *range(1, HITS + 1)]


def test_a_file_in_the_middle_that_is_none_is_an_error(campaign):
    (campaign / FILES[3]).write_bytes(b"")
    with pytest.raises(FileError, match=f"{FILES[3]} is empty"):
        open_source(campaign)


def test_a_killed_recording_is_read_to_the_end_of_its_last_file(campaign):
    (campaign / "metadata.yaml").unlink()
    last = campaign / FILES[-2]
    (campaign / FILES[-1]).unlink()
    last.write_bytes(last.read_bytes()[:-100])
    assert not McapFile(last).is_complete
    source = open_source(campaign)
    assert not source.is_complete
    assert "never closed" in source.warnings[0]
    assert list_events(campaign) == ["bench", *range(1, HITS + 1)]


def test_a_recording_in_sqlite_is_named(tmp_path, campaign):
    folder = tmp_path / "old"
    folder.mkdir()
    (folder / "old_0.db3").write_bytes(b"SQLite format 3")
    with pytest.raises(FileError, match=r"old is a recording in SQLite.*ros2 bag convert"):
        open_source(folder)
    shutil.copy(campaign / "metadata.yaml", folder)
    change_list(folder, lambda info: info.update(relative_file_paths=["old_0.db3"]))
    with pytest.raises(FileError, match=r"old is a recording in SQLite"):
        open_source(folder)


def test_several_recordings_in_one_folder_must_be_named(campaign):
    shutil.copy(campaign / FILES[0], campaign / "other_0.mcap")
    assert list_events(campaign)[-1] == HITS  # the list tells which one is meant
    (campaign / "metadata.yaml").unlink()
    with pytest.raises(FileError, match="several recordings, made, other, and no metadata"):
        open_source(campaign)
