"""What a run is made of: what is wrong with it is said before anything starts."""

import sys

import pytest

from impact_rig.configuration.run import choose_view
from impact_rig.core.errors import FileError


@pytest.fixture
def write_node(tmp_path):
    """Return a function that writes a node's executable for a Python."""

    def write(python):
        path = tmp_path / "visualizer"
        path.write_text(f"#!{python}\nimport rclpy\n")
        return path

    return write


@pytest.mark.parametrize(("rerun", "shown"), [("import sys", True), ("", False)])
def test_the_view_is_shown_where_the_node_s_python_has_rerun(write_node, tmp_path, rerun, shown):
    python = tmp_path / "a folder" / "python3"
    python.parent.mkdir()
    library = tmp_path / "libraries"
    library.mkdir()
    if rerun:
        (library / "rerun.py").write_text(rerun)
    python.write_text(f'#!/bin/sh\nPYTHONPATH="{library}" exec {sys.executable} -S "$@"\n')
    python.chmod(0o755)
    node = write_node(f'"{python}"')
    assert choose_view("auto", node) is shown
    assert not choose_view("false", node)
    if shown:
        assert choose_view("true", node)
    else:
        with pytest.raises(FileError, match=r"visualizer:=true: rerun-sdk is not installed"):
            choose_view("true", node)
