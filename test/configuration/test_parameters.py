"""A parameter that no node has is refused by name, in a file and elsewhere."""

import re

import pytest

from impact_rig.configuration.parameters import check_parameter_file, check_parameters
from impact_rig.configuration.processes import list_rig_processes
from impact_rig.core.errors import ParameterError

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
        ("swing_time: 0.3", "it must have sections"),
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


def test_a_setting_of_the_command_line_is_refused_too():
    with pytest.raises(ParameterError, match="did you mean swing_time"):
        list_rig_processes("", overrides={"hammer": {"swing_tme": 0.3}})
    check_parameters(["swing_time"], "hammer")
