"""Recordings of other ROS nodes, written by rosbags and by Foxglove's libraries."""

import json
from dataclasses import dataclass

import mcap.writer
import numpy as np
import pytest
from files.formats.foreign import read_channels
from google.protobuf import wrappers_pb2
from mcap_protobuf.writer import Writer as ProtobufWriter
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from impact_rig.core.given.errors import FileError
from impact_rig.files.formats.registry import read_measurement

BEGIN = 1_700_000_000_000_000_000
STEP = 1_000_000
"""Of the nodes here [ns]: 1 kHz."""
VALUES = np.sin(np.arange(200) / 7) * np.exp(-(((np.arange(200) - 60) / 20) ** 2))
STORE = get_typestore(Stores.ROS2_JAZZY)


def make(name, **fields):
    return STORE.types[name](**fields)


def make_header(stamp):
    time = make("builtin_interfaces/msg/Time", sec=stamp // 10**9, nanosec=stamp % 10**9)
    return make("std_msgs/msg/Header", stamp=time, frame_id="tip")


def make_vector(z):
    return make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=float(z))


def make_wrench(stamp, z):
    wrench = make("geometry_msgs/msg/Wrench", force=make_vector(z), torque=make_vector(0.1 * z))
    return make("geometry_msgs/msg/WrenchStamped", header=make_header(stamp), wrench=wrench)


def make_imu(stamp, z):
    turn = make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    return make(
        "sensor_msgs/msg/Imu",
        header=make_header(stamp),
        orientation=turn,
        orientation_covariance=np.zeros(9),
        angular_velocity=make_vector(0.0),
        angular_velocity_covariance=np.zeros(9),
        linear_acceleration=make_vector(z),
        linear_acceleration_covariance=np.zeros(9),
    )


def make_accel(stamp, z):
    accel = make("geometry_msgs/msg/Accel", linear=make_vector(z), angular=make_vector(0.0))
    return make("geometry_msgs/msg/AccelStamped", header=make_header(stamp), accel=accel)


def make_array(values, *sizes):
    dimensions = [
        make("std_msgs/msg/MultiArrayDimension", label="", size=size, stride=1) for size in sizes
    ]
    layout = make("std_msgs/msg/MultiArrayLayout", dim=dimensions, data_offset=0)
    return make("std_msgs/msg/Float64MultiArray", layout=layout, data=np.asarray(values, float))


@dataclass
class Bag:
    """What `ros2 bag record` writes: topics, each with messages and their log times."""

    folder: object

    def write(self, plugin=StoragePlugin.MCAP, **topics):
        with Writer(self.folder, version=9, storage_plugin=plugin) as writer:
            for topic, messages in topics.items():
                kind = messages[0][1].__msgtype__
                connection = writer.add_connection(f"/{topic}", kind, typestore=STORE)
                for logged, message in messages:
                    writer.write(connection, logged, STORE.serialize_cdr(message, kind))
        return next(self.folder.glob("*.[md][cb]*"))


@pytest.fixture
def bag(tmp_path):
    return Bag(tmp_path / "bag")


def send(make_one, values=VALUES, delay=0):
    """Return messages at 1 kHz with headers, logged at uneven times."""
    late = np.random.default_rng(1).integers(0, STEP // 2, values.size)
    stamps = BEGIN + delay + STEP * np.arange(values.size)
    return [
        (int(stamp + wait), make_one(int(stamp), value))
        for stamp, wait, value in zip(stamps, late, values, strict=True)
    ]


@pytest.mark.parametrize(
    ("make_one", "name", "unit"),
    [
        (make_wrench, "/tip.wrench.force.z", "N"),
        (make_imu, "/tip.linear_acceleration.z", "m/s^2"),
        (make_accel, "/tip.accel.linear.z", "m/s^2"),
    ],
)
def test_a_field_is_a_channel_with_the_unit_of_its_type_at_the_rate_of_its_headers(
    bag, make_one, name, unit
):
    channel = read_channels(bag.write(tip=send(make_one)))[name]
    assert (channel.values.tolist(), channel.unit) == (VALUES.tolist(), unit)
    assert (channel.sampling_rate, channel.time_flaw) == (1000.0, None)
    assert channel.stamp == BEGIN


def test_what_never_changes_is_no_channel(bag):
    assert list(read_channels(bag.write(imu=send(make_imu)))) == ["/imu.linear_acceleration.z"]


def test_what_never_changes_is_shown_where_nothing_does(bag):
    channels = read_channels(bag.write(imu=send(make_imu, np.zeros(20))))
    assert {"/imu.orientation.w", "/imu.linear_acceleration_covariance[8]"} <= channels.keys()


def test_topics_keep_how_much_later_they_begin(bag):
    channels = read_channels(
        bag.write(tip=send(make_wrench, delay=3 * STEP), body=send(make_accel))
    )
    assert channels["/tip.wrench.force.z"].start == 0.003
    assert channels["/body.accel.linear.z"].start == 0.0


def test_messages_that_were_logged_in_another_order_are_in_that_of_their_headers(bag):
    messages = send(make_wrench)
    messages[10:12] = messages[11:9:-1]
    channel = read_channels(bag.write(tip=messages))["/tip.wrench.force.z"]
    assert channel.values.tolist() == VALUES.tolist()


def test_uneven_stamps_are_told_with_their_topic(bag):
    messages = send(make_wrench)
    del messages[100:103]
    channel = read_channels(bag.write(tip=messages))["/tip.wrench.force.z"]
    assert "0.004 s" in channel.time_flaw
    assert "/tip, by the times of their headers" in channel.time_flaw


def test_without_headers_the_times_are_those_of_the_log(bag):
    even = [(BEGIN + STEP * at, make_array([value, 1.0])) for at, value in enumerate(VALUES)]
    channel = read_channels(bag.write(daq=even))["/daq.data[0]"]
    assert (channel.values.tolist(), channel.sampling_rate) == (VALUES.tolist(), 1000.0)


def test_numbers_of_a_long_array_follow_each_other(bag):
    pieces = np.split(VALUES, 4)
    messages = [(BEGIN + 50 * STEP * at, make_array(piece)) for at, piece in enumerate(pieces)]
    channel = read_channels(bag.write(daq=messages))["/daq.data"]
    assert (channel.values.tolist(), channel.sampling_rate) == (VALUES.tolist(), 1000.0)


def test_uneven_times_of_long_arrays_ask_for_the_rate_of_their_points(bag):
    late = [0, STEP, -STEP, 2 * STEP]
    messages = [
        (BEGIN + 50 * STEP * at + late[at], make_array(piece))
        for at, piece in enumerate(np.split(VALUES, 4))
    ]
    channel = read_channels(bag.write(daq=messages))["/daq.data"]
    assert "messages come 0.048 to 0.053 s after each other" in channel.time_flaw
    assert "give --rate, about " in channel.time_flaw
    assert not channel.has_gap


@pytest.mark.parametrize(("lost", "has_gap"), [((), False), ((1000,), True)])
def test_late_messages_of_a_log_are_no_gap_but_lost_ones_are(bag, lost, has_gap):
    """The recorder stood still for 6 ms, as one did beside a real `ros2 bag record`."""
    sent = STEP * np.array([at for at in range(2000) if at not in lost])
    late = np.random.default_rng(3).integers(0, STEP // 2, sent.size)
    logged = np.where((sent > 500 * STEP) & (sent < 506 * STEP), 506 * STEP + sent // 1000, sent)
    messages = [
        (int(BEGIN + time), make_array([np.sin(at / 7)]))
        for at, time in enumerate(np.sort(logged + late))
    ]
    channel = read_channels(bag.write(daq=messages))["/daq.data[0]"]
    assert channel.has_gap is has_gap
    if not lost:
        assert "give --rate, about 1000" in channel.time_flaw
        assert "by the times of the log" in channel.time_flaw


def test_a_lost_message_of_a_long_array_is_a_gap(bag):
    values = np.sin(np.arange(4000) / 7)
    messages = [
        (BEGIN + 50 * STEP * at, make_array(piece))
        for at, piece in enumerate(np.split(values, 80))
        if at != 40
    ]
    assert read_channels(bag.write(daq=messages))["/daq.data"].has_gap


@pytest.mark.parametrize("sizes", [(2, 50), (50, 2)], ids=["channels first", "points first"])
def test_the_layout_of_a_long_array_parts_its_channels(bag, sizes):
    two = np.stack([VALUES, 2.0 * VALUES])
    pieces = np.split(two if sizes[0] == 2 else two.T, 4, axis=1 if sizes[0] == 2 else 0)
    messages = [
        (BEGIN + 50 * STEP * at, make_array(piece.ravel(), *sizes))
        for at, piece in enumerate(pieces)
    ]
    channels = read_channels(bag.write(daq=messages))
    assert channels["/daq.data[0]"].values.tolist() == VALUES.tolist()
    assert channels["/daq.data[1]"].values.tolist() == (2.0 * VALUES).tolist()


def test_arrays_of_different_lengths_state_no_rate(bag):
    messages = [(BEGIN, make_array(VALUES[:80])), (BEGIN + 80 * STEP, make_array(VALUES[80:]))]
    channel = read_channels(bag.write(daq=messages))["/daq.data"]
    assert channel.values.tolist() == VALUES.tolist()
    assert np.isnan(channel.sampling_rate)


def write_foxglove(path, encoding, schema_encoding, messages):
    with path.open("wb") as file:
        writer = mcap.writer.Writer(file)
        writer.start()
        schema = writer.register_schema("Force", schema_encoding, b'{"type": "object"}')
        channel = writer.register_channel("/force", encoding, schema)
        for at, message in enumerate(messages):
            writer.add_message(channel, BEGIN + at, message, BEGIN + at)
        writer.finish()
    return path


def test_json_is_read_at_the_rate_of_its_timestamps(tmp_path):
    messages = [
        json.dumps({
            "timestamp": {"sec": 1_700_000_000, "nsec": at * STEP},
            "force": value,
            "note": "no number",
            "on": True,
        }).encode()
        for at, value in enumerate(VALUES)
    ]  # fmt: skip
    path = write_foxglove(tmp_path / "force.mcap", "json", "jsonschema", messages)
    ((name, channel),) = read_channels(path).items()
    assert (name, channel.values.tolist()) == ("/force.force", VALUES.tolist())
    assert channel.sampling_rate == 1000.0


def test_protobuf_is_read_by_its_schema(tmp_path):
    path = tmp_path / "force.mcap"
    with path.open("wb") as file, ProtobufWriter(file) as writer:
        for at, value in enumerate(VALUES):
            message = wrappers_pb2.DoubleValue(value=value)
            writer.write_message("/force", message, BEGIN + at * STEP, BEGIN + at * STEP)
    channel = read_channels(path)["/force.value"]
    assert (channel.values.tolist(), channel.sampling_rate) == (VALUES.tolist(), 1000.0)


@pytest.mark.parametrize(
    ("encoding", "schema_encoding", "messages", "told"),
    [
        ("json", "jsonschema", [b'{"force": 1'], "/force is no JSON"),
        ("json", "jsonschema", [b'{"on": true}'], r"no message with a number.*/force \(Force"),
        ("cbor", "", [b"1"], r"no message with a number.*/force \(Force, cbor\)"),
        ("cdr", "ros2msg", [b"1"], "schema of Force on /force cannot be understood"),
    ],
)
def test_what_cannot_be_read_is_named(tmp_path, encoding, schema_encoding, messages, told):
    path = write_foxglove(tmp_path / "force.mcap", encoding, schema_encoding, messages)
    with pytest.raises(FileError, match=told):
        read_measurement(path)


def test_sqlite_is_converted_first(bag):
    path = bag.write(StoragePlugin.SQLITE3, tip=send(make_wrench))
    with pytest.raises(FileError, match="rosbags-convert --src"):
        read_measurement(path)


def test_a_topic_in_another_encoding_is_left_out_and_named(tmp_path):
    path = tmp_path / "force.mcap"
    with path.open("wb") as file:
        writer = mcap.writer.Writer(file)
        writer.start()
        topics = [writer.register_channel(f"/{name}", name, 0) for name in ("json", "cbor")]
        for at, topic in ((at, topic) for at in range(20) for topic in topics):
            writer.add_message(topic, BEGIN + at, b'{"force": %d}' % at, BEGIN + at)
        writer.finish()
    measurement = read_measurement(path)
    assert [channel.name for channel in measurement.channels] == ["/json.force"]
    assert measurement.remarks == ("topic /cbor is in 'cbor', which is not read: it is left out",)
