"""Recordings come back as they were: in file order, from any namespace, however they ended."""

import pickle
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import mcap.writer
import pytest

from impact_rig.core.given.errors import FileError
from impact_rig.core.given.records import Block, HitLabel
from impact_rig.core.given.setup import RigSetup
from impact_rig.recordings.contents import inspect_run
from impact_rig.recordings.run import Run
from impact_rig.recordings.scan import Scan
from impact_rig.recordings.writer import RecordingWriter

OURS = "impact_rig_msgs/msg/"


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_events_come_in_file_order_over_many_chunks(make_recording, compression):
    maker = make_recording(compression=compression, chunk_size=2000)
    maker.add_setup()
    for record in (1, 2, 5, 3, 4):
        maker.add_block(record)
    maker.add_setup(name="second")
    maker.add_block(6)
    recording = Run(maker.close())
    told = [
        event.name if isinstance(event, RigSetup) else event.label.record
        for event in recording.events()
    ]
    assert told == ["bench", 1, 2, 5, 3, 4, "second", 6]
    assert recording.warnings == ()


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 2, 1, 0), (0, 2, 3, 1)])
@pytest.mark.parametrize("chunk_size", [1, 1 << 20])
def test_messages_and_chunks_in_another_order_are_put_in_that_of_time(
    make_recording, tmp_path, order, chunk_size
):
    maker = make_recording("original.mcap")
    maker.add_setup()
    for first in (0, 100, 200):
        maker.add_block(1, first_sample=first, last=first == 200)
    messages = [*Scan(maker.close()).read_messages()]
    with RecordingWriter(tmp_path / "other.mcap", library="tool", chunk_size=chunk_size) as writer:
        channels = [writer.announce(message.channel) for message in messages]
        for place in order:
            item = messages[place]
            writer.add_message(channels[place], item.data, item.log_time, item.publish_time)
    setup, *blocks = Run(tmp_path / "other.mcap").events()
    assert isinstance(setup, RigSetup)
    assert [block.first_sample for block in blocks] == [0, 100, 200]


@pytest.mark.parametrize("order", [(0, 2, 4, 1, 3, 5), (5, 4, 3, 2, 1, 0)])
@pytest.mark.parametrize(
    "options",
    [
        {"chunk_size": 2500},
        {"use_chunking": False},
        {
            "chunk_size": 2500,
            "index_types": mcap.writer.IndexType.NONE,
            "use_statistics": False,
            "repeat_channels": False,
        },
    ],
)
def test_what_another_program_wrote_topic_by_topic_is_put_in_the_order_of_time(
    make_recording, tmp_path, order, options
):
    maker = make_recording("original.mcap")
    maker.add_setup()
    for first in (0, 100, 200, 300, 400):
        maker.add_block(1, first_sample=first, last=first == 400)
    messages = [*Scan(maker.close()).read_messages()]
    writer = mcap.writer.Writer(str(tmp_path / "other.mcap"), **options)
    writer.start("ros2", "tool")
    numbers = {}
    for place in order:
        channel = messages[place].channel
        if channel.topic not in numbers:
            schema = writer.register_schema(channel.type_name, "ros2msg", channel.schema.encode())
            numbers[channel.topic] = writer.register_channel(channel.topic, "cdr", schema)
        time = messages[place].log_time
        writer.add_message(numbers[channel.topic], time, messages[place].data, time)
    writer.finish()
    setup, *blocks = Run(tmp_path / "other.mcap").events()
    assert isinstance(setup, RigSetup)
    assert [block.first_sample for block in blocks] == [0, 100, 200, 300, 400]
    (hit,) = inspect_run(Run(tmp_path / "other.mcap")).hits
    (original,) = inspect_run(Run(tmp_path / "original.mcap")).hits
    assert (hit.state, hit.missing_points) == (original.state, 0)


def test_the_first_setup_precedes_blocks_that_overtook_it(make_recording):
    maker = make_recording()
    maker.add_block(1)
    maker.add_setup()
    events = list(Run(maker.close()).events())
    assert [type(event) for event in events] == [RigSetup, Block]


def test_injected_faults_are_those_of_the_campaign_that_is_read(make_recording):
    maker = make_recording()
    maker.add_setup()
    maker.add_virtual_impact(1)
    maker.add_virtual_impact(2, "double_hit", "overload")
    maker.add_block(1)
    maker.add_setup()
    maker.add_virtual_impact(1, "weak")
    maker.add_block(1, first_sample=5)
    recording = Run(maker.close())
    for _ in range(2):
        reading = recording.events()
        truths = [reading.truths for event in reading if isinstance(event, Block)]
        assert [{label: truth.faults for label, truth in each.items()} for each in truths] == [
            {
                HitLabel("brass", 1, 3, 2): (),
                HitLabel("brass", 2, 3, 2): ("double_hit", "overload"),
            },
            {HitLabel("brass", 1, 3, 2): ("weak",)},
        ]


def describe_events(reading):
    """Return all that a reading yields, with the truths that hold at each place."""
    return [
        (event.name if isinstance(event, RigSetup) else repr(event), [*reading.truths])
        for event in reading
    ]


def test_many_threads_read_one_run_at_once_and_it_can_be_pickled(make_recording):
    maker = make_recording(chunk_size=2000)
    for name in ("first", "second"):
        maker.add_setup(name=name)
        for record in range(1, 20):
            maker.add_virtual_impact(record)
            maker.add_block(record)
    run = Run(maker.close())
    copies = [pickle.loads(pickle.dumps(run))]
    alone = describe_events(run.events())
    assert len(alone) == 2 + 2 * 19
    readings = [iter(run.events()) for _ in range(2)]
    for _ in alone:  # in turn
        assert repr(next(readings[0])) == repr(next(readings[1]))
    copies.append(pickle.loads(pickle.dumps(run)))
    for each in copies:
        assert describe_events(each.events()) == alone
    with ThreadPoolExecutor(8) as pool:
        for found in pool.map(lambda _: describe_events(run.events()), range(64)):
            assert found == alone


def test_the_files_of_a_run_that_was_resumed_are_one_recording(make_recording, tmp_path):
    (tmp_path / "run").mkdir()
    one, other = {"uuid": [1] * 16}, {"uuid": [2] * 16}
    for name, campaign, records in (
        ("session", one, (1, 2)),
        ("session-2", one, (3,)),
        ("session-3", other, (1,)),
    ):
        maker = make_recording(f"run/{name}.mcap")
        maker.add_setup(campaign_id=campaign)
        for record in records:
            maker.add_block(record)
        maker.close()
    recording = Run(tmp_path / "run")
    told = [
        "setup" if isinstance(event, RigSetup) else event.label.record
        for event in recording.events()
    ]
    assert told == ["setup", 1, 2, 3, "setup", 1]


@pytest.mark.parametrize("namespace", ["/", "/hall_2", "/hall_2/rig_a"])
def test_namespace_and_remapped_topics_are_found_by_the_types(make_recording, namespace):
    maker = make_recording(namespace=namespace)
    maker.add_setup("table")
    maker.add_block(1)
    maker.add("/rosout", "std_msgs/msg/String", {"data": "hello"})
    recording = Run(maker.close())
    assert recording.namespace == namespace
    assert len(list(recording.events())) == 2


def test_of_two_rigs_in_one_file_one_is_chosen(make_recording):
    """One of them may lie around the other."""
    maker = make_recording()
    maker.add_setup(name="outer")
    maker.add_setup("/b/setup", name="inner")
    maker.add_block(9, topic="/b/acceleration")
    maker.add_block(1)
    path = maker.close()
    with pytest.raises(FileError, match=r"several rigs, in the namespaces /, /b: .*--namespace"):
        list(Run(path).events())
    for namespace, name, record in (("/", "outer", 1), ("/b", "inner", 9), ("b", "inner", 9)):
        setup, block = Run(path, namespace).events()
        assert (setup.name, block.label.record) == (name, record)
        (hit,) = inspect_run(Run(path, namespace)).hits
        assert hit.record == record
    with pytest.raises(FileError, match=r"holds no rig in namespace /c: it has /, /b"):
        list(Run(path, "c").events())
    assert {hit.rig for hit in inspect_run(Run(path)).hits} == {"/", "/b"}


def test_blocks_that_are_there_twice_are_used_once(make_recording):
    """Two recorders were merged."""
    maker = make_recording()
    maker.add_setup()
    for record in (1, 1, 2, 2, 1):
        maker.add_block(record)
    maker.add_block(2, first_sample=100)
    run = Run(maker.close())
    reading = run.events()
    blocks = [event for event in reading if isinstance(event, Block)]
    assert [(block.label.record, block.first_sample) for block in blocks] == [
        (1, 0),
        (2, 0),
        (2, 100),
    ]
    (warning,) = reading.warnings
    assert warning.endswith("holds 3 blocks twice: each is used once")
    contents = inspect_run(run)
    assert contents.repeated == 3
    assert [hit.blocks for hit in contents.hits] == [1, 2]


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"", "is empty"),
        (b"time,hammer\n0,1\n", "is no MCAP recording"),
        (b"\x89MCAP0\r\n", "header is cut off"),
        (b"\x89MCAP0\r\n\x01\xff\xff\xff\xff\xff\xff\xff\x7f", "header is cut off"),
    ],
)
def test_what_is_no_recording_is_named(tmp_path, content, told):
    path = tmp_path / "session.mcap"
    path.write_bytes(content)
    with pytest.raises(FileError, match=f"session.mcap .*{told}"):
        list(Run(path).events())


def write_foreign(path: Path, **changes: str) -> None:
    """Write a file as another tool would, with one message."""
    names = {
        "schema": OURS + "RigSetup",
        "schema_encoding": "ros2msg",
        "encoding": "cdr",
    } | changes
    text = changes.get("text", "float64 hammer_mass\n")
    with path.open("wb") as file:
        writer = mcap.writer.Writer(file)
        writer.start("ros2")
        schema = writer.register_schema(names["schema"], names["schema_encoding"], text.encode())
        channel = writer.register_channel("/setup", names["encoding"], schema)
        writer.add_message(channel, 1, b"\0\1\0\0" + bytes(8), 1)
        writer.finish()


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"encoding": "ros1", "schema_encoding": "ros1msg"}, "'ros1'.*'cdr' and 'ros2msg'"),
        ({"encoding": "json"}, "'json'.*'cdr' and 'ros2msg'"),
        ({"schema": "sensor_msgs/msg/Imu"}, "holds no set-up of a rig"),
        ({}, "another version of the interfaces: .*no attribute"),
        ({"text": "other_msgs/Lost analysis\n"}, "schema of .*RigSetup on /setup cannot be"),
        ({"text": "float64[3] samples\n"}, "does not fit its schema"),
    ],
)
def test_foreign_recordings_are_refused_by_name(tmp_path, changes, told):
    path = tmp_path / "foreign.mcap"
    write_foreign(path, **changes)
    with pytest.raises(FileError, match=rf"foreign\.mcap.*{told}"):
        list(Run(path).events())


def test_a_block_that_contradicts_itself_is_named(make_recording):
    maker = make_recording()
    maker.add_setup()
    maker.add_block(1, sampling_rate=-1.0)
    with pytest.raises(FileError, match=r"/acceleration: sampling rate is -1\.0 Hz"):
        list(Run(maker.close()).events())
