"""A rig under `ros2 launch`, asked and told everything by the `ros2` command line."""

import re

from .conftest import NODES

STATE = "impact_rig_msgs/msg/RecorderState"
RUN = "impact_rig_msgs/action/RunCampaign"


OTHERS = ("/other/", "/third/", "/replayed/")
"""Namespaces of rigs that other tests have stopped: discovery may list one for a while yet."""


def list_until(tools, wanted: str, kind: str) -> list[str]:
    """List topics, services or actions until this one is there: discovery takes a while."""
    text = tools.run_until(lambda text: wanted in text.splitlines(), "ros2", kind, "list", "-t")
    return text.splitlines()


def wait_for_state(tools, state: str) -> None:
    """Ask the estimator until it is in a state; the middleware may print lines of its own."""
    wanted = re.compile(rf"^{state} \[", re.MULTILINE)
    tools.run_until(wanted.search, "ros2", "lifecycle", "get", "/bench/estimator")


def test_every_node_has_a_life_cycle_and_is_active(rig, tools):
    found = tools.run_until(lambda text: set(text.split()) >= NODES, "ros2", "lifecycle", "nodes")
    assert {name for name in found.split() if not name.startswith(OTHERS)} == NODES
    wait_for_state(tools, "active")


def test_all_names_lie_in_the_namespace(rig, tools):
    topics = list_until(
        tools, "/bench/acceleration [impact_rig_msgs/msg/AccelerationBlock]", "topic"
    )
    strange = [line for line in topics if not line.startswith(("/bench/", *OTHERS))]
    assert {line.split()[0] for line in strange} <= {
        "/clock", "/diagnostics", "/events/write_split", "/parameter_events", "/rosout",
    }  # fmt: skip
    list_until(tools, "/bench/hammer/arm [impact_rig_msgs/srv/Act]", "service")
    actions = list_until(tools, f"/bench/campaign/run [{RUN}]", "action")
    assert len([line for line in actions if not line.startswith(OTHERS)]) == 1


def test_parameters_come_from_the_file_and_are_checked(rig, tools):
    assert "0.2" in tools.run("ros2", "param", "get", "/bench/hammer", "swing_time")
    assert "swing_time: 0.2" in tools.run("ros2", "param", "dump", "/bench/hammer")
    refused = tools.run("ros2", "param", "set", "/bench/hammer", "swing_time", "-1.0", code=None)
    assert "fail" in refused.lower()


def test_what_is_dumped_is_loaded_again(rig, tools):
    dump = tools.folder / "hammer.yaml"
    dump.write_text(tools.run("ros2", "param", "dump", "/bench/hammer"))
    told = tools.run("ros2", "param", "load", "/bench/hammer", dump)
    assert told.count("successful") == len(told.splitlines()) > 4


def test_a_late_subscriber_receives_the_latched_state(rig, tools):
    state = tools.run("ros2", "topic", "echo", "--once", "/bench/recorder/state", STATE)
    assert "recording: true" in state
    assert f"uri: {rig.folder}" in state


def test_a_campaign_runs_to_its_end_as_an_action(rig, tools):
    goal = '{samples: ["aluminium large", "steel small"], impacts: 3}'
    text = tools.run("ros2", "action", "send_goal", "--feedback", "/bench/campaign/run", RUN, goal)
    assert "Goal finished with status: SUCCEEDED" in text
    assert "sample: aluminium large" in text.partition("Result:")[0]
    assert re.search(r"success: true", text)
    answer = tools.call("/bench/estimator/get_results", "impact_rig_msgs/srv/GetResults")
    assert answer.count("impact_rig_msgs.msg.SampleEstimate(") == 2


def test_the_operator_s_enable_is_given_and_taken_by_services(rig, tools):
    for service, answer in (("disarm", "success=True"), ("arm", "success=True")):
        call = tools.call(f"/bench/hammer/{service}", "impact_rig_msgs/srv/Act")
        assert answer in call


def test_a_node_goes_through_its_life_cycle(rig, tools):
    for transition, state in (("deactivate", "inactive"), ("activate", "active")):
        said = tools.run("ros2", "lifecycle", "set", "/bench/estimator", transition)
        assert "successful" in said, f"{said}\n{rig.terminal.text}"
        wait_for_state(tools, state)


def test_a_node_runs_by_itself_until_ctrl_c(tools):
    with tools.start(
        "ros2", "run", "impact_rig", "hammer", "--ros-args",
        "-r", "__ns:=/alone", "-r", "__node:=one",
    ) as terminal:  # fmt: skip
        tools.run_until(lambda text: "/alone/one" in text.split(), "ros2", "node", "list")
        assert terminal.interrupt() == 0, terminal.text
    assert "Traceback" not in terminal.text


def test_an_impossible_parameter_ends_a_node_in_a_sentence(tools):
    text = tools.run(
        "ros2", "run", "impact_rig", "hammer", "--ros-args", "-p", "swing_time:=fast", code=2
    )
    assert "swing_time" in text
    assert "Traceback" not in text
