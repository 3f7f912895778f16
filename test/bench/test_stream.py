"""The part `stream`: real processes stream, and what is lost is counted wherever it is lost."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from bench import stream
from bench.stream import Flow, read_flow
from impact_rig.recordings.schemas import find_message_definition

BLOCK = "impact_rig_msgs/msg/StreamBlock"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
POINTS = 10


class StreamFile:
    """Writes a recording of a stream by other people's libraries."""

    def __init__(self, path: Path) -> None:
        self._store = get_typestore(Stores.ROS2_JAZZY)
        text = find_message_definition(BLOCK).text
        self._store.register(get_types_from_msg(text, BLOCK))
        self._file = path.open("wb")
        self._writer = Writer(self._file)
        self._writer.start("ros2", "test")
        self._channels = {
            name: self._writer.register_channel(
                topic, "cdr", self._writer.register_schema(name, "ros2msg", definition.encode())
            )
            for topic, name, definition in (
                ("/acceleration/stream", BLOCK, text),
                ("/diagnostics", DIAGNOSTICS, find_message_definition(DIAGNOSTICS).text),
            )
        }

    def _make(self, kind: str, /, **fields: Any) -> Any:
        return self._store.types[kind](**fields)

    def _add(self, name: str, moment: int, **fields: Any) -> None:
        stamp = self._make("builtin_interfaces/msg/Time", sec=0, nanosec=moment)
        header = self._make("std_msgs/msg/Header", stamp=stamp, frame_id="")
        data = self._store.serialize_cdr(self._make(name, header=header, **fields), name)
        self._writer.add_message(self._channels[name], moment, bytes(data), moment)

    def add_block(self, moment: int, first_sample: int) -> None:
        channel = self._make(
            "impact_rig_msgs/msg/Channel",
            counts=np.zeros(POINTS, np.int32), values=np.empty(0), scale=1.0, offset=0.0,
            full_scale=1.0, overload=False,
        )  # fmt: skip
        origin = self._make(
            "impact_rig_msgs/msg/Origin", kind="measured", source="", file="", place=""
        )
        self._add(
            BLOCK, moment, first_sample=first_sample, sampling_rate=1e6, record=0, sample="",
            impact=0, attempt=0, last=False, hammer=channel, specimen=channel, origin=origin,
        )  # fmt: skip

    def add_diagnostics(self, moment: int, node: str, **values: int) -> None:
        pairs = [
            self._make("diagnostic_msgs/msg/KeyValue", key=key.replace("_", " "), value=str(value))
            for key, value in values.items()
        ]
        status = self._make(
            "diagnostic_msgs/msg/DiagnosticStatus",
            level=0, name=node, message="", hardware_id="", values=pairs,
        )  # fmt: skip
        self._add(DIAGNOSTICS, moment, status=[status])

    def close(self) -> None:
        self._writer.finish()
        self._file.close()


def test_blocks_are_counted_from_one_moment_to_another(tmp_path: Path) -> None:
    path = tmp_path / "stream.mcap"
    file = StreamFile(path)
    file.add_diagnostics(50, "/estimator", stream_blocks=3, stream_points_missing=70)
    for moment, number in ((90, 0), (100, 5), (110, 6), (120, 9), (130, 10), (140, 15)):
        file.add_block(moment, POINTS * number)
    file.add_diagnostics(125, "/recorder", stream_blocks=9999, stream_points_missing=9999)
    file.add_diagnostics(150, "/estimator", stream_blocks=8, stream_points_missing=90)
    file.close()
    assert read_flow(path, 100, 130) == Flow(blocks=4, lost=2, points=60, seen=5, missed=20)


def test_a_slow_stream_reaches_estimator_and_recorder_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("rclpy", reason="the nodes need ROS 2")
    monkeypatch.setattr(stream, "WARM_UP", 0.0)
    run = stream.run_stream(tmp_path, sampling_rate=1e6, seconds=2.5)
    flow = read_flow(run.recording, run.begin, run.end)
    assert (flow.lost, flow.missed) == (0, 0)
    assert flow.blocks > 1
    assert flow.seen > 0
    assert set(run.shares) == {"accelerometer", "estimator", "recorder"}
    assert all(0.0 < share < 2.0 for share in run.shares.values())
