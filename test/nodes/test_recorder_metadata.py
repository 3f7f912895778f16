"""A recording tells where it comes from: versions, notes, parameters, attached files."""

import json
from contextlib import suppress

import numpy as np
import pytest
import yaml
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Metadata
from mcap.stream_reader import StreamReader
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rosbags.highlevel import AnyReader
from std_msgs.msg import String

from impact_rig import __version__
from impact_rig.nodes import interfaces
from impact_rig.nodes.hammer import HammerNode
from impact_rig.nodes.recorder import RecorderNode

PARAMETERS = "impact_rig/parameters"


@pytest.fixture
def recorder(harness, tmp_path):
    """Return a function that starts a recorder."""

    def start(**parameters):
        states = harness.listen(interfaces.RECORDER_STATE)
        node = harness.add(
            RecorderNode, output=str(tmp_path / "session.mcap"), required_topics="", **parameters
        )
        states.wait(lambda messages: messages and messages[-1].recording)
        return node

    return start


@pytest.fixture
def metadata(tmp_path):
    """Return a function that reads all metadata of one name, also while the file grows."""

    def read(name):
        found = []
        with (tmp_path / "session.mcap").open("rb") as stream, suppress(McapError):
            found.extend(
                record.metadata
                for record in StreamReader(stream).records
                if isinstance(record, Metadata) and record.name == name
            )
        return found

    return read


def stop(harness):
    request = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_DEACTIVATE))
    assert harness.call(ChangeState, "recorder/change_state", request).success


def set_parameter(harness, node, name, kind, **value):
    parameter = ParameterMessage(name=name, value=ParameterValue(type=kind, **value))
    request = SetParameters.Request(parameters=[parameter])
    (result,) = harness.call(SetParameters, f"{node}/set_parameters", request).results
    assert result.successful


def test_software_and_notes_go_into_the_file_and_notes_may_change(harness, recorder, metadata):
    recorder(notes="bench 3")
    set_parameter(
        harness, "recorder", "notes", ParameterType.PARAMETER_STRING,
        string_value="bench 3, new tip, 21 °C",
    )  # fmt: skip
    stop(harness)
    first, second = metadata("impact_rig")
    assert first["software_version"] == __version__
    assert json.loads(first["libraries"])["numpy"] == np.__version__
    assert first["notes"] == "bench 3"
    assert second["notes"] == "bench 3, new tip, 21 °C"


def test_the_parameters_of_all_nodes_go_into_the_file_and_again_when_they_change(
    harness, recorder, metadata
):
    recorder(compression="lz4")
    harness.add(HammerNode, swing_time=0.3)

    def find_swing_time():
        texts = [item["/hammer"] for item in metadata(PARAMETERS) if "/hammer" in item]
        return yaml.safe_load(texts[-1])["swing_time"] if texts else None

    harness.wait_until(lambda: find_swing_time() == 0.3)
    set_parameter(
        harness, "hammer", "swing_time", ParameterType.PARAMETER_DOUBLE, double_value=0.4
    )
    harness.wait_until(lambda: find_swing_time() == 0.4)
    own = yaml.safe_load(metadata(PARAMETERS)[-1]["/recorder"])
    assert own["compression"] == "lz4"


def test_files_are_attached_and_what_an_operator_says_is_recorded(harness, recorder, tmp_path):
    rig_file = tmp_path / "my, own rig.toml"
    rig_file.write_text("name = 'bench 3'", "utf-8")
    recorder(attachments=str(rig_file))
    notes = harness.advertise(interfaces.NOTE)
    harness.wait_until(lambda: notes.get_subscription_count() > 0)
    notes.publish(String(data="the tip is loose"))
    assert notes.wait_for_all_acked()
    stop(harness)
    with (tmp_path / "session.mcap").open("rb") as stream:
        (attachment,) = make_reader(stream).iter_attachments()
    assert (attachment.name, attachment.media_type) == (rig_file.name, "application/toml")
    assert attachment.data == rig_file.read_bytes()
    with AnyReader([tmp_path / "session.mcap"]) as reader:
        said = [
            reader.deserialize(data, connection.msgtype).data
            for connection, _, data in reader.messages()
            if connection.topic == "/note"
        ]
    assert said == ["the tip is loose"]


def test_a_recorder_that_is_not_started_says_so_to_those_who_would_wait_for_it(harness):
    states = harness.listen(interfaces.RECORDER_STATE)
    harness.add(RecorderNode, autostart=False)
    (state,) = states.wait_for_count(1)
    assert (state.recording, state.waiting) == (False, False)
    assert "not active" in state.message
