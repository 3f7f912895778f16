"""The parts `write`, `read` and `batch`, on little."""

from mcap.reader import make_reader

from bench import recording as recording_part
from bench.campaigns import COMPRESSIONS, compress_anew


def read_all(path):
    with path.open("rb") as file:
        return [
            (channel.topic, message.log_time, message.data)
            for _, channel, message in make_reader(file).iter_messages()
        ]


def test_reading_is_compared_in_each_compression(bench):
    figures = list(recording_part.measure_reading(bench))
    assert [figure.name.split(",")[0] for figure in figures] == list(COMPRESSIONS)
    for figure in figures:
        assert len(figure.values) == bench.extent.repeats
        assert str(figure.goal) == "at most 2"


def test_both_writers_are_compared_in_each_compression(bench, monkeypatch):
    monkeypatch.setattr(recording_part, "MESSAGES", 20)
    figures = list(recording_part.measure_writing(bench))
    assert [figure.name.split(",")[0] for figure in figures] == list(COMPRESSIONS)
    for figure in figures:
        assert len(figure.values) == bench.extent.repeats
        assert str(figure.goal) == "at least 0.8"
    assert list(bench.folder.iterdir()) == []


def test_both_writers_write_the_same_messages_and_another_compression_holds_them(tmp_path):
    ours, bare = tmp_path / "ours.mcap", tmp_path / "bare.mcap"
    messages = [bytes([number]) * 8 for number in range(20)]
    recording_part.write_as_recorder(ours, messages, "lz4")
    recording_part.write_bare(bare, messages, "lz4")
    assert read_all(ours) == read_all(bare)
    assert [data for _, _, data in read_all(ours)] == messages
    for compression in COMPRESSIONS:
        other = compress_anew(ours, tmp_path / f"{compression}.mcap", compression)
        assert read_all(other) == read_all(ours)
        with other.open("rb") as file:
            chunks = make_reader(file).get_summary().chunk_indexes
        assert {chunk.compression for chunk in chunks} == {compression.replace("none", "")}
