"""Interface packages and messages for the tests of recordings, without ROS."""

import functools
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from impact_rig.recordings.records import OfferedQos
from impact_rig.recordings.schemas import find_message_definition
from impact_rig.recordings.writer import RecordingWriter

from .damaged import write_original

OUR_MESSAGES = Path(__file__).parents[2] / "msg_config" / "msg"
STANDARD_MESSAGES = {
    ("std_msgs", "Header"): "# Stamp.\nbuiltin_interfaces/Time stamp\n\nstring frame_id\n",
    ("builtin_interfaces", "Time"): "int32 sec\n\nuint32 nanosec\n",
    ("std_msgs", "String"): "string data\n",
    ("unique_identifier_msgs", "UUID"): "uint8[16] uuid\n",
}
NAN = float("nan")


Install = Callable[[str, str, str], None]
Make = Callable[..., "RecordingMaker"]


@pytest.fixture(autouse=True)
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Install the interface packages in two folders, as overlays have them.

    Returns a function that installs another message type, or replaces one.
    """

    def write(prefix: str, package: str, name: str, text: str) -> None:
        path = tmp_path / prefix / "share" / package / "msg" / f"{name}.msg"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)

    for message in OUR_MESSAGES.glob("*.msg"):
        write("overlay", "impact_rig_msgs", message.stem, message.read_text())
    for (package, name), text in STANDARD_MESSAGES.items():
        write("underlay", package, name, text)
    prefixes = [str(tmp_path / "overlay"), str(tmp_path / "underlay")]
    monkeypatch.setenv("AMENT_PREFIX_PATH", os.pathsep.join(prefixes))
    return functools.partial(write, "overlay")


@pytest.fixture
def make_recording(tmp_path: Path) -> Iterator[Make]:
    """Return a function that begins a recording; what is still open at the end is closed."""
    makers = []

    def make(name: str = "session.mcap", namespace: str = "/", **options: Any) -> RecordingMaker:
        makers.append(RecordingMaker(tmp_path / name, namespace, **options))
        return makers[-1]

    yield make
    for maker in makers:
        maker.writer.close()


def setup_fields(**changes: Any) -> dict[str, Any]:
    """Return the fields of a rig's set-up with two samples."""
    sample = {
        "name": "steel, large",
        "material": "steel",
        "mass": 0.5,
        "release_angle": NAN,
        "reference_contact_time": 2e-4,
        "reference_stiffness": NAN,
        "reference_damping_coefficient": NAN,
    }
    analysis = {
        "cutoff_frequency": 50e3,
        "pulse_factor": 2.0,
        "pre_trigger": 2e-4,
        "record_duration": 2e-3,
        "detection_level": 0.03,
        "minimum_peak": 0.15,
        "maximum_peak": 0.95,
        "double_hit_level": 0.05,
    }
    fields = {
        "header": {"stamp": {"sec": 1_700_000_000, "nanosec": 250}},
        "name": "bench",
        "hammer_mass": 0.3,
        "hammer_stiffness": NAN,
        "accelerometer_mass": 0.003,
        "impact_speed": 0.0819,
        "release_angle": NAN,
        "control_sample": "steel, large",
        "samples": [sample, {**sample, "name": "brass", "mass": 0.25}],
        "analysis": analysis,
    }
    return fields | changes


def block_fields(number: int, points: int = 100, **changes: Any) -> dict[str, Any]:
    """Return the fields of a block whose counts tell record and channel."""
    counts = np.arange(points, dtype=np.int32)
    channel = {"scale": 0.25, "offset": -1.5, "full_scale": 512.0}
    fields = {
        "record": number,
        "sample": "brass",
        "impact": 3,
        "attempt": 2,
        "first_sample": 0,
        "sampling_rate": 2.5e6,
        "triggered": True,
        "last": True,
        "hammer": {"counts": (counts + number).tolist(), "values": [], **channel},
        "specimen": {"counts": (-counts - number).tolist(), "values": [], **channel},
    }
    return fields | changes


def encode(type_name: str, fields: dict[str, Any]) -> bytes:
    """Serialise by mcap-ros2-support, which shares no code with the readers under test."""
    from mcap_ros2._dynamic import serialize_dynamic

    definition = find_message_definition(type_name)
    return serialize_dynamic(type_name, definition.text)[type_name](fields)


OURS = "impact_rig_msgs/msg/"


class RecordingMaker:
    """Writes a recording of a rig in a namespace, message by message."""

    def __init__(self, path: Path, namespace: str = "/", **options: Any) -> None:
        self.path = path
        self.writer = RecordingWriter(path, **options)
        self._prefix = namespace.rstrip("/") + "/"
        self._channels: dict[str, int] = {}
        self._time = 1_700_000_000_000_000_000

    def add(self, topic: str, type_name: str, fields: dict[str, Any]) -> bytes:
        """Add a message, a millisecond after the one before; return its bytes."""
        if topic not in self._channels:
            name = topic if topic.startswith("/") else self._prefix + topic
            is_state = type_name == OURS + "RigSetup"
            offer = OfferedQos(durability="transient_local", depth=1) if is_state else OfferedQos()
            self._channels[topic] = self.writer.add_channel(
                name, find_message_definition(type_name), (offer,)
            )
        data = encode(type_name, fields)
        self._time += 1_000_000
        self.writer.add_message(self._channels[topic], data, self._time, self._time - 1000)
        return data

    def add_setup(self, topic: str = "setup", **changes: Any) -> None:
        """Add a set-up."""
        self.add(topic, OURS + "RigSetup", setup_fields(**changes))

    def add_block(
        self, number: int, points: int = 100, topic: str = "acceleration", **changes: Any
    ) -> None:
        """Add a block."""
        self.add(topic, OURS + "AccelerationBlock", block_fields(number, points, **changes))

    def add_virtual_impact(self, record: int, *faults: str) -> None:
        """Add the truth behind a simulated hit."""
        label = {"record": record, "sample": "brass", "impact": 3, "attempt": 2}
        self.add("virtual_impact", OURS + "VirtualImpact", {**label, "faults": list(faults)})

    def close(self) -> Path:
        """Finish the file and return its path."""
        self.writer.close()
        return self.path


@pytest.fixture
def original(make_recording: Make) -> Path:
    """Return a sound recording of four hits, a chunk for each and one for the set-up."""
    return write_original(make_recording)
