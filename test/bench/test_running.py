"""The parts `start`, `demo`, `latency` and `stop`, on little, and what processes tell."""

from mcap.writer import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from bench import running
from bench.running import Chain

DEFINITIONS = {
    "/release": "uint32 record\nstring sample\nfloat64 swing_time",
    "/acceleration": "uint32 record\nbool last",
    "/recorder/stored": "uint32 record\nbool complete",
    "/impact": "uint32 record",
    "/estimate": "string name",
}
"""The fields that matter, of messages of these topics."""


def write_messages(path, messages):
    """Write messages as topic, publish time and fields, in this order."""
    store = get_typestore(Stores.EMPTY)
    names = {topic: f"test/msg/T{number}" for number, topic in enumerate(DEFINITIONS)}
    for topic, text in DEFINITIONS.items():
        store.register(get_types_from_msg(text, names[topic]))
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2", "test")
        channels = {}
        for topic, text in DEFINITIONS.items():
            schema = writer.register_schema(names[topic], "ros2msg", text.encode())
            channels[topic] = writer.register_channel(topic, "cdr", schema)
        for number, (topic, moment, fields) in enumerate(messages):
            content = store.types[names[topic]](**fields)
            data = bytes(store.serialize_cdr(content, names[topic]))
            writer.add_message(channels[topic], number, data, moment)
        writer.finish()


def test_each_hit_is_followed_from_release_to_estimate(tmp_path):
    path = tmp_path / "session.mcap"
    write_messages(
        path,
        [
            ("/release", 100, {"record": 1, "sample": "a", "swing_time": 1e-6}),
            ("/estimate", 900, {"name": "a"}),
            ("/acceleration", 1200, {"record": 1, "last": False}),
            ("/acceleration", 1300, {"record": 1, "last": True}),
            ("/recorder/stored", 1350, {"record": 1, "complete": False}),
            # Topics reach the recorder in any order.
            ("/impact", 1500, {"record": 1}),
            ("/recorder/stored", 1400, {"record": 1, "complete": True}),
            ("/estimate", 1700, {"name": "a"}),
            ("/estimate", 1600, {"name": "b"}),
            ("/release", 2000, {"record": 2, "sample": "a", "swing_time": 0.0}),
        ],
    )
    assert running.read_chains(path) == [Chain(1100, 1300, 1400, 1500, 1700)]
