"""Recordings to measure with: campaigns that are run once, and what is made of them."""

from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from impact_rig.bench import recordings
from impact_rig.bench.recordings import COMPRESSIONS, Campaign, Campaigns, compress_anew
from impact_rig.core.errors import RigError


def read_all(path: Path) -> list[tuple[str, int, bytes]]:
    with path.open("rb") as file:
        return [
            (channel.topic, message.log_time, message.data)
            for _, channel, message in make_reader(file).iter_messages()
        ]


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_another_compression_holds_the_same_messages(
    recording: Path, tmp_path: Path, compression: str
) -> None:
    path = compress_anew(recording, tmp_path / "copy.mcap", compression)
    assert read_all(path) == read_all(recording)
    with path.open("rb") as file:
        chunks = make_reader(file).get_summary().chunk_indexes
    assert {chunk.compression for chunk in chunks} == {compression.replace("none", "")}


def test_a_copy_can_end_with_a_verdict(tmp_path: Path) -> None:
    source = tmp_path / "whole.mcap"
    with source.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2", "test")
        schema = writer.register_schema("a/msg/B", "ros2msg", b"uint8 x")
        channels = [writer.register_channel(name, "cdr", schema) for name in ("/other", "/impact")]
        for moment in range(10):
            writer.add_message(channels[moment % 2], moment, b"data", moment)
        writer.finish()
    part = compress_anew(source, tmp_path / "part.mcap", "lz4", verdicts=2)
    assert [moment for _, moment, _ in read_all(part)] == [0, 1, 2, 3]


def test_a_campaign_is_run_once_for_all_parts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folders: list[Path] = []

    def run(folder: Path, _: object) -> Campaign:
        folders.append(folder)
        if len(folders) == 2:
            raise RigError("the rig does not strike")
        return Campaign(folder / "session.mcap", 1.0)

    monkeypatch.setattr(recordings, "run_campaign", run)
    campaigns = Campaigns(tmp_path)
    first = campaigns.take(1)
    assert campaigns.take(1) == first
    with pytest.raises(RigError):
        campaigns.take(2)
    # What a campaign that failed has left behind is in nobody's way.
    assert campaigns.take(3)[:1] == first
    assert len(set(folders)) == len(folders) == 4


@pytest.mark.parametrize("words", [["--impacts", "0"], ["--no-such-option"]])
def test_a_campaign_that_cannot_be_run_says_why(tmp_path: Path, words: list[str]) -> None:
    with pytest.raises(RigError, match=r"no campaign to measure with could be run: .*--"):
        recordings.run_campaign(tmp_path / "run", words)
