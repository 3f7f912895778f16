"""A file is read as the library `mcap` reads it, message by message, however it was written."""

import io
import os
import zlib
from dataclasses import replace
from pathlib import Path

import mcap.reader
import mcap.records
import mcap.stream_reader
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.writer import CompressionType, IndexType, Writer

from impact_rig.core.given.errors import FileError
from impact_rig.recordings.contents import inspect_run
from impact_rig.recordings.records import RawMessage
from impact_rig.recordings.run import Run
from impact_rig.recordings.scan import MAGIC, Scan

SCHEMA = b"uint8[] data\n"
TOPICS = ("/a", "/b", "/c")


def write(path: Path, messages=(), type_name="test_msgs/msg/Bytes", **options) -> Path:
    """Write messages, (topic, log time, data) each, by the library."""
    with path.open("wb") as file:
        writer = Writer(file, **options)
        writer.start("ros2", "test")
        schema = writer.register_schema(type_name, "ros2msg", SCHEMA)
        channels = {}
        for number, (topic, log_time, data) in enumerate(messages):
            if topic not in channels:
                channels[topic] = writer.register_channel(topic, "cdr", schema, {"key": topic})
            writer.add_message(channels[topic], log_time, data, log_time + 7, number)
        writer.add_metadata("first", {"a": "1"})
        writer.add_attachment(5, 6, "rig.toml", "application/toml", b"[rig]")
        writer.add_metadata("second", {})
        writer.finish()
    return path


def describe(channel, message) -> tuple:
    """Return all that a message is."""
    return (channel.topic, message.sequence, message.log_time, message.publish_time, message.data)


def read(path: Path, topics=TOPICS) -> list[tuple]:
    found = Scan(path).read_messages(lambda channel: channel.topic in topics)
    return [describe(message.channel, message) for message in found]


message_lists = st.lists(
    st.tuples(st.sampled_from(TOPICS), st.integers(0, 100), st.binary(max_size=60)), max_size=25
)


@given(
    messages=message_lists,
    compression=st.sampled_from(CompressionType),
    chunk_size=st.sampled_from([50, 300, 5000]),
    use_chunking=st.booleans(),
    index_types=st.sampled_from([IndexType.ALL, IndexType.NONE, IndexType.CHUNK]),
    use_statistics=st.booleans(),
    repeat_channels=st.booleans(),
    enable_crcs=st.booleans(),
    topics=st.sets(st.sampled_from(TOPICS)),
)
def test_any_file_of_the_library_is_read_as_the_library_reads_it(
    tmp_path_factory, messages, topics, **options
):
    path = write(tmp_path_factory.getbasetemp() / "any.mcap", messages, **options)
    with path.open("rb") as file:
        records = list(mcap.stream_reader.StreamReader(file).records)
    channels = {item.id: item for item in records if isinstance(item, mcap.records.Channel)}
    expected = [
        describe(channels[item.channel_id], item)
        for item in records
        if isinstance(item, mcap.records.Message)
    ]
    assert len(expected) == len(messages)
    assert read(path) == expected
    assert read(path, topics) == [item for item in expected if item[0] in topics]
    assert {
        (item.id, item.topic, item.metadata["key"]) for item in Scan(path).read_channels()
    } == {(item.id, item.topic, item.topic) for item in channels.values()}


MESSAGES = [(TOPICS[number // 20], number, bytes([number]) * 100) for number in range(60)]
"""Twenty of each topic, one after the other."""


@pytest.fixture(params=[CompressionType.ZSTD, CompressionType.LZ4, CompressionType.NONE])
def path(request, tmp_path) -> Path:
    return write(tmp_path / "file.mcap", MESSAGES, compression=request.param, chunk_size=1000)


def read_beside(path):
    """Return what stands between the chunks."""
    return [item for item in Scan(path).read() if not isinstance(item, RawMessage)]


def find_first_chunk(path: Path) -> mcap.records.ChunkIndex:
    with path.open("rb") as file:
        return mcap.reader.make_reader(file).get_summary().chunk_indexes[0]


def damage_first_chunk(path: Path) -> None:
    """Flip a bit near its end."""
    chunk = find_first_chunk(path)
    content = bytearray(path.read_bytes())
    content[chunk.chunk_start_offset + chunk.chunk_length - 5] ^= 1
    path.write_bytes(content)


def cut_off_summary(path: Path) -> None:
    """Leave only the data, as of a recorder that was killed."""
    with path.open("rb") as file:
        file.seek(-28, os.SEEK_END)  # the footer, but for its head, and the last bytes
        start = int.from_bytes(file.read(8), "little")
    path.write_bytes(path.read_bytes()[: start - 13])  # and without the record that ends the data


def test_without_its_end_a_file_gives_the_same(path):
    good = Scan(path)
    expected = (read(path), good.read_channels(), read_beside(path), good.read_time_range())
    cut_off_summary(path)
    cut = Scan(path)
    assert "never closed" in cut.warnings[0]
    assert expected == (
        read(path), cut.read_channels(), read_beside(path), cut.read_time_range()
    )  # fmt: skip


def test_zeros_that_a_power_cut_left_at_the_end_are_no_damage(path):
    whole = read(path)
    cut_off_summary(path)
    path.write_bytes(path.read_bytes() + bytes(10_000))
    assert read(path) == whole
    content = path.read_bytes().rstrip(b"\0")
    path.write_bytes(content[:-300] + bytes(10_300))  # the last chunk never reached the disk
    found = read(path)
    assert found == whole[: len(found)]
    assert len(found) >= 40


def test_damage_before_the_end_of_a_file_never_closed_is_named(path):
    damage_first_chunk(path)
    cut_off_summary(path)
    with pytest.raises(
        FileError,
        match=r"file\.mcap is damaged: .*`impact-rig export .*file\.mcap -o sound\.mcap`",
    ):
        read(path)


def rename_in_summary(path, old, new):
    """Change names in the index at the end, and let its checksum fit."""
    data = path.read_bytes()
    start = mcap.records.Footer.read(ReadDataStream(io.BytesIO(data[-28:-8]))).summary_start
    content = data[start:-12].replace(old, new)
    path.write_bytes(data[:start] + content + zlib.crc32(content).to_bytes(4, "little") + MAGIC)


def test_an_index_with_a_right_checksum_that_contradicts_the_data_is_damage(path):
    whole = read(path)
    rename_in_summary(path, b"/b", b"/b")
    assert read(path) == whole
    assert list_damages(path) == []
    rename_in_summary(path, b"/b", b"/x")
    assert list_damages(path)
    with pytest.raises(FileError, match="is damaged"):
        read(path, {"/b"})


def list_damages(path):
    reading = Scan(path, is_strict=False).read()
    list(reading)
    return reading.damages


def test_an_index_whose_checksum_does_not_fit_is_not_believed(path):
    content = path.read_bytes()
    first = find_first_chunk(path)
    numbers = (first.chunk_start_offset, first.chunk_length)
    place = b"".join(number.to_bytes(8, "little") for number in numbers)
    assert content.count(place) == 1
    path.write_bytes(content.replace(place, bytes(8) + place[8:]))
    assert len(read(path)) == 60
    assert len(Scan(path).read_channels()) == 3
    assert [item.reason for item in list_damages(path)] == ["the index at the end cannot be used"]
    bare = write(path.with_name("bare.mcap"), MESSAGES, enable_crcs=False)
    assert (Scan(bare).statistics, len(Scan(bare).read_channels())) == (None, 3)


@pytest.mark.parametrize("shift", [0, 1])
def test_an_index_that_names_a_chunk_elsewhere_is_told(path, shift):
    first = find_first_chunk(path)
    place, length = first.chunk_start_offset, first.chunk_length.to_bytes(8, "little")
    old, new = (number.to_bytes(8, "little") + length for number in (place, place + shift))
    rename_in_summary(path, old, new)
    contents = inspect_run(Run(path))
    chunks = len(contents.passes[0].chunks)
    told = f"its index names {chunks - 1} of {chunks} chunks rightly"
    assert contents.lost == 0
    assert [text.partition(":")[0] for text in contents.problems] == [told] * shift


@pytest.mark.parametrize(
    ("count", "is_none", "uncounted"),
    [
        (lambda counts: counts, False, 0),
        (lambda counts: {}, False, 0),  # not told, which the format allows
        (lambda counts: dict.fromkeys(counts, 0), True, 60),
    ],
)
def test_an_index_that_does_not_count_leaves_nothing_out(path, count, is_none, uncounted):
    with path.open("rb") as file:
        statistics = mcap.reader.make_reader(file).get_summary().statistics
    told = []
    for counts in (statistics.channel_message_counts, count(statistics.channel_message_counts)):
        builder = RecordBuilder()
        replace(statistics, channel_message_counts=counts).write(builder)
        told.append(builder.end())
    rename_in_summary(path, *told)
    assert Scan(path).counts_none(lambda _: True) is is_none
    problems = [f"its index leaves {uncounted} messages uncounted"] * bool(uncounted)
    assert [text.partition(":")[0] for text in inspect_run(Run(path)).problems] == problems


@pytest.mark.parametrize(("numbers", "lost"), [((2, 0, 1), 0), ((3, 0, 1), 1), ((1, 0), 0)])
def test_messages_in_another_order_are_not_missing(tmp_path, numbers, lost):
    path = tmp_path / "file.mcap"
    with path.open("wb") as file:
        writer = Writer(file, use_statistics=False)
        writer.start("ros2", "impact_rig 0.1.0")
        schema = writer.register_schema("test_msgs/msg/Bytes", "ros2msg", SCHEMA)
        channel = writer.register_channel("/a", "cdr", schema)
        for number in numbers:
            writer.add_message(channel, number, b"", number, number)
        writer.finish()
    assert inspect_run(Run(path)).lost == lost


def replace_chunk(path: Path, **changes) -> None:
    """Write a file with one chunk that claims something else."""
    chunk = {
        "compression": "", "data": bytes(50), "message_start_time": 0, "message_end_time": 0,
        "uncompressed_crc": 0, "uncompressed_size": 50,
    } | changes  # fmt: skip
    builder = mcap.records.RecordBuilder()
    mcap.records.Header("ros2", "test").write(builder)
    mcap.records.Chunk(**chunk).write(builder)
    mcap.records.DataEnd(0).write(builder)
    path.write_bytes(b"\x89MCAP0\r\n" + builder.end() + b"\x89MCAP0\r\n")


def make_bomb() -> dict:
    import zstandard

    size = 70 << 20
    return {
        "compression": "zstd",
        "data": zstandard.compress(bytes(size)),
        "uncompressed_size": size,
    }


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"uncompressed_size": 10 << 30}, "a chunk of 50 byte claims to hold 10737418240"),
        (make_bomb(), "claims to hold 73400320"),
        ({"uncompressed_size": 51}, "a chunk holds 50 byte: it should hold 51"),
        ({"uncompressed_crc": 1}, "does not fit its checksum"),
        ({"compression": "zstd"}, "cannot be decompressed"),
        ({"compression": "lz4"}, "cannot be decompressed"),
        ({"compression": "bz2"}, "compressed by 'bz2': it must be zstd or lz4"),
        ({}, "what is no message"),
        ({"data": b"\5" + b"\xff" * 49}, "a record is longer than what it is in"),
        ({"data": b"\x05\x16" + bytes(29), "uncompressed_size": 31}, "is not announced"),
        ({"data": b"\x03\x29" + bytes(7) + b"\xff" * 41}, "a type is damaged"),
    ],
)
def test_what_a_chunk_claims_and_is_not_is_named(tmp_path, changes, told):
    path = tmp_path / "file.mcap"
    replace_chunk(path, **changes)
    with pytest.raises(FileError, match=rf"file\.mcap is damaged: .*{told}"):
        read(path)


def test_a_chunk_as_other_writers_make_it_is_read(tmp_path):
    """Without a checksum, and without its size in the frame, as by the writer in Rust."""
    import zstandard

    messages = write(tmp_path / "plain.mcap", MESSAGES, compression=CompressionType.NONE)
    with messages.open("rb") as file:
        (chunk,) = [
            item
            for item in mcap.stream_reader.StreamReader(file, emit_chunks=True).records
            if isinstance(item, mcap.records.Chunk)
        ]
    engine = zstandard.ZstdCompressor(write_content_size=False).compressobj()
    path = tmp_path / "file.mcap"
    replace_chunk(
        path,
        compression="zstd",
        data=engine.compress(chunk.data) + engine.flush(),
        uncompressed_size=len(chunk.data),
    )
    assert read(path) == read(messages)


def test_records_of_later_versions_of_the_format_are_passed_over(tmp_path):
    path = write(tmp_path / "file.mcap", MESSAGES)
    content = path.read_bytes()
    place = len(b"\x89MCAP0\r\n") + 9 + int.from_bytes(content[9:17], "little")
    private = b"\x99" + (5).to_bytes(8, "little") + b"hello"
    path.write_bytes(content[:place] + private + content[place:-37] + content[-8:])
    assert len(read(path)) == 60


def test_a_damaged_attachment_is_named_and_harms_nothing_else(tmp_path):
    path = write(tmp_path / "file.mcap", MESSAGES)
    content = path.read_bytes()
    path.write_bytes(content.replace(b"[rig]", b"[rag]"))
    assert len(read(path)) == 60
    with pytest.raises(FileError, match=r"is damaged: an attachment is damaged: .*at byte \d+"):
        read_beside(path)


def test_an_attachment_larger_than_the_memory_is_left_on_the_disk(tmp_path):
    """It has a hole, so that it takes no room there either."""
    path = tmp_path / "file.mcap"
    builder = mcap.records.RecordBuilder()
    mcap.records.Header("ros2", "test").write(builder)
    size = 20 << 30
    head = builder.end() + b"\x09" + size.to_bytes(8, "little")
    with path.open("wb") as file:
        file.write(b"\x89MCAP0\r\n" + head)
        file.seek(size, io.SEEK_CUR)
        file.write(b"\x0f\x04" + bytes(11) + b"\x89MCAP0\r\n")
    assert read(path) == []
    with pytest.raises(FileError, match="claims to have 21474836489 byte"):
        read_beside(path)


@pytest.mark.parametrize(("false", "found"), [(3, 60), (4, 0)])
def test_a_file_is_searched_four_times_over_and_no_more(tmp_path, false, found):
    """Each beginning of a chunk that claims most of the file is looked at as a whole."""
    path = write(tmp_path / "file.mcap", MESSAGES, compression=CompressionType.NONE)
    content, place = path.read_bytes(), find_first_chunk(path)
    begin, end = place.chunk_start_offset, place.chunk_start_offset + place.chunk_length
    claim = b"" + (place.chunk_length - 9).to_bytes(8, "little")
    path.write_bytes(content[:begin] + bytes(9) + false * claim + content[begin:end])
    assert sum(1 for _ in Scan(path, is_strict=False).read_messages()) == found


@pytest.mark.parametrize("name", ["/a\x1b[2J", "/a\nb", "/" + 600 * "a"])
def test_names_that_cannot_be_shown_are_no_names(tmp_path, name):
    for topic, type_name in ((name, "test_msgs/msg/Bytes"), ("/a", name)):
        path = write(tmp_path / "file.mcap", [(topic, 1, b"")], type_name)
        with pytest.raises(FileError, match="name of a topic") as caught:
            Scan(path).read_channels()
        assert str(caught.value).isprintable()


def test_a_topic_without_schema_does_not_disturb_the_others(tmp_path):
    path = tmp_path / "file.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2", "test")
        schema = writer.register_schema("test_msgs/msg/Bytes", "ros2msg", SCHEMA)
        writer.add_message(writer.register_channel("/a", "cdr", schema), 1, b"x", 1)
        writer.add_message(writer.register_channel("/web", "json", 0), 2, b"{}", 2)
        writer.finish()
    assert [item[0] for item in read(path, {"/a"})] == ["/a"]
    assert [item.topic for item in Scan(path).read_channels()] == ["/a", "/web"]
    with pytest.raises(FileError, match="'/web' is in 'json'"):
        read(path, {"/web"})
