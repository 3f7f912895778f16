"""What no node has, and what a parameter cannot mean, is refused by name before a node starts."""

import re

import pytest

from impact_rig.configuration.parameters import PARAMETERS, check_parameter_file, check_parameters
from impact_rig.configuration.processes import list_rig_processes
from impact_rig.core.given.errors import ParameterError

SOUND = """
/**/hammer: {ros__parameters: {swing_time: 0.2, qos_overrides: {/setup: {depth: 3}}}}
/bench/recorder: {ros__parameters: {notes: two words}}
bench: {campaign: {ros__parameters: {pause_timeout: 60.0}}}
/**: {ros__parameters: {rig_file: bench.toml, use_sim_time: false}}
"""


def test_the_parameters_of_all_nodes_are_taken(tmp_path):
    path = tmp_path / "sound.yaml"
    path.write_text(SOUND)
    check_parameter_file(path)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("hammer: {ros__parameters: {swing_tme: 0.3}}", "did you mean swing_time?"),
        ("/**: {ros__parameters: {swing_tme: 0.3}}", "no node of the rig has a parameter"),
        ("estimator: {ros__parameters: {swing_time: 0.3}}", "the node estimator has no parameter"),
        ("/b/hamer: {ros__parameters: {swing_time: 0.3}}", "the rig has no node 'hamer'"),
        ("hammer: {ros__parameters: {swing: {time: 0.3}}}", "'swing.time'"),
        ("/**: {ros__parameters: {swing_time: -1}}", "swing_time is -1: it must be a number"),
        ("swing_time: 0.3", "it must have sections"),
        ("hammer: {ros__parameters: [swing_time]}", "is ['swing_time']: it must be a section"),
        ("", "it must have sections"),
        ("a: [", "is not YAML"),
    ],
)
def test_what_no_node_has_is_refused(tmp_path, text, told):
    path = tmp_path / "params.yaml"
    path.write_text(text)
    with pytest.raises(ParameterError, match=re.escape(told)) as refused:
        check_parameter_file(path)
    assert str(path) in str(refused.value)


def test_a_file_that_does_not_exist_is_refused(tmp_path):
    with pytest.raises(ParameterError, match=r"nowhere\.yaml cannot be read: No such file"):
        check_parameter_file(tmp_path / "nowhere.yaml")


@pytest.mark.parametrize(
    ("place", "value", "wanted"),
    [
        ("hammer.swing_time", "abc", "a number from 0 to 60"),
        ("hammer.swing_time", -1, "a number from 0 to 60"),
        ("hammer.swing_time", True, "a number from 0 to 60"),
        ("hammer.confirm_return", 1, "true or false"),
        ("accelerometer.stream_block_size", 0, r"a whole number from 1 to 1e\+07"),
        ("accelerometer.stream_block_size", 2.5, "a whole number"),
        ("accelerometer.mode", "always", "one of triggered, continuous"),
        ("recorder.notes", 5, "a text"),
        ("estimator.autostart", "no", "true or false"),
    ],
)
def test_what_a_parameter_cannot_mean_is_refused(place, value, wanted):
    node, _, name = place.partition(".")
    with pytest.raises(ParameterError, match=f"{name} is .*: it must be {wanted}"):
        list_rig_processes("", overrides={node: {name: value}})


def test_a_whole_number_is_a_number():
    check_parameters({"swing_time": 1}, "hammer")
    assert PARAMETERS["hammer"]["swing_time"].convert("swing_time", 1) == 1.0
