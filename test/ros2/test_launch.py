"""Launch files to their ends: a campaign at once, Ctrl-C in the middle, a replay."""

from pathlib import Path

IMPACT = "impact_rig_msgs/msg/Impact"


def test_every_argument_is_shown(tools):
    for name in ("rig", "replay"):
        text = tools.run("ros2", "launch", "impact_rig", f"{name}.launch.py", "--show-args")
        assert "'visualizer'" in text


def test_beside_another_rig_one_runs_its_campaign_and_ends(rig, tools, swing_file):
    folder = tools.folder / "other"
    with tools.launch(folder, swing_file, "namespace:=other", "impacts:=1") as terminal:
        assert terminal.wait() == 0, terminal.text
    assert "Contact time, stiffness, damping" in terminal.text
    assert "exit code" not in terminal.text  # launch says so of a process that failed
    info = tools.run("ros2", "bag", "info", "-s", "mcap", folder / "session.mcap")
    assert "/other/acceleration" in info
    assert "/bench/" not in info
    sound = tools.run("impact-rig", "info", folder)
    assert "steel small" in sound


TWO_RIGS = """
from launch import LaunchDescription
from launch.actions import GroupAction, IncludeLaunchDescription
from launch.substitutions import PathJoinSubstitution
from launch_ros.actions import PushRosNamespace
from launch_ros.substitutions import FindPackageShare

RIG = PathJoinSubstitution([FindPackageShare("impact_rig"), "launch", "rig.launch.py"])


def include(namespace, **arguments):
    rig = IncludeLaunchDescription(RIG, launch_arguments=arguments.items())
    return GroupAction([PushRosNamespace(namespace), rig])


def generate_launch_description():
    return LaunchDescription(
        [
            include("left", visualizer="false"),
            include("right", visualizer="false", seed="7", impacts="1"),
        ]
    )
"""
"""As the README has it, but for the visualizer, which Ubuntu's numpy does not go with."""


def test_two_rigs_in_pushed_namespaces_run_beside_each_other(tools, swing_file):
    path = tools.folder / "two_rigs.launch.py"
    path.write_text(TWO_RIGS)
    with tools.start("ros2", "launch", path) as terminal:
        assert terminal.wait() == 0, terminal.text
    assert "Contact time, stiffness, damping" in terminal.text
    assert "exit code" not in terminal.text
    runs = sorted((tools.folder / "runs").glob("*/session.mcap"))
    texts = [tools.run("ros2", "bag", "info", "-s", "mcap", run) for run in runs]
    assert ["/left/setup" in text for text in texts] == [
        "/right/setup" not in text for text in texts
    ]
    assert len(texts) == 2


def test_an_example_of_the_readme_is_what_is_tested():
    page = (Path(__file__).parents[2] / "launch_scripts" / "README.md").read_text("utf-8")
    example = page.partition("```python\n")[2].partition("```")[0]
    assert (
        example.strip()
        == TWO_RIGS.replace(' visualizer="false",', "").replace(', visualizer="false"', "").strip()
    )


def test_a_parameter_file_with_a_name_that_no_node_has_is_refused(tools):
    path = tools.folder / "wrong.yaml"
    path.write_text("/**/hammer: {ros__parameters: {swing_tme: 0.2}}")
    for file, told in ((path, "did you mean swing_time"), ("/nowhere.yaml", "No such file")):
        text = tools.run(
            "ros2", "launch", "impact_rig", "rig.launch.py", f"params_file:={file}", code=1
        )
        assert told in text
    text = tools.run(
        "ros2", "run", "impact_rig", "hammer", "--ros-args", "-p", "swing_tme:=0.2", code=2
    )
    assert "did you mean swing_time" in text


def test_ctrl_c_in_a_campaign_closes_the_recording(tools, swing_file):
    folder = tools.folder / "interrupted"
    with tools.launch(folder, swing_file, "namespace:=third", "impacts:=100") as terminal:
        terminal.wait_for("recording to ")
        tools.run("ros2", "topic", "echo", "--once", "/third/impact", IMPACT)
        code = terminal.interrupt()
    assert code == 0, terminal.text
    assert "Traceback" not in terminal.text
    assert "escalating" not in terminal.text
    tools.run("impact-rig", "info", folder)


def test_what_is_wrong_with_an_argument_is_said(tools):
    for argument in ("seed:=many", "rig_file:=/nowhere/rig.toml", "only:=hamer", "faults:=2"):
        text = tools.run(
            "ros2", "launch", "impact_rig", "rig.launch.py", "visualizer:=false", argument, code=1
        )
        assert argument.partition(":=")[2] in text


def test_a_recording_that_is_not_there_ends_the_replay(tools):
    text = tools.run("ros2", "launch", "impact_rig", "replay.launch.py", "file:=/no.mcap", code=1)
    assert text.count("/no.mcap") == 1


def test_a_replay_without_rerun_goes_on_without_the_view(bags, tools):
    text = tools.run(
        "ros2", "launch", "impact_rig", "replay.launch.py", f"file:={bags.ours}", "rate:=5.0",
        "exit_when_done:=true", "namespace:=replayed", f"view:={tools.folder}/replay.rrd",
    )  # fmt: skip
    assert "rerun-sdk is not installed" in text or (tools.folder / "replay.rrd").exists()
