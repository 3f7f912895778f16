"""The part `stream`: real processes stream, and what is lost is counted wherever it is lost."""

from dataclasses import replace

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from bench import stream
from bench.stream import read_flow

BLOCKS = "/acceleration/stream"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Return a stream that is slow enough for any computer."""
    pytest.importorskip("rclpy", reason="the nodes need ROS 2")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stream, "WARM_UP", 0.0)
        return stream.run_stream(tmp_path_factory.mktemp("run"), sampling_rate=1e6, seconds=1.5)


def test_a_slow_stream_reaches_estimator_and_recorder_whole(run):
    flow = read_flow(run.recording, run.begin, run.end)
    assert (flow.lost, flow.missed) == (0, 0)
    assert flow.blocks > 1
    assert flow.seen > 0
    assert set(run.shares) == {"accelerometer", "estimator", "recorder"}
    assert all(0.0 < share < 2.0 for share in run.shares.values())


def test_a_block_that_is_missing_is_counted(run, tmp_path):
    whole = read_flow(run.recording, run.begin, run.end)
    with run.recording.open("rb") as file, (tmp_path / "stream.mcap").open("wb") as copy:
        writer, channels, blocks = Writer(copy), {}, 0
        writer.start("ros2", "test")
        for schema, channel, message in make_reader(file).iter_messages():
            if channel.topic not in channels:
                kind = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, "cdr", kind)
            blocks += channel.topic == BLOCKS and run.begin <= message.publish_time <= run.end
            if channel.topic != BLOCKS or blocks != whole.blocks // 2:
                moments = (message.log_time, message.data, message.publish_time)
                writer.add_message(channels[channel.topic], *moments)
        writer.finish()
    found = read_flow(tmp_path / "stream.mcap", run.begin, run.end)
    assert found == replace(whole, blocks=whole.blocks - 1, lost=1)
