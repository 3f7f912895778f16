"""A node's name belongs to one process of this computer, as long as that lives."""

import os
import signal
import subprocess
import sys

import pytest
from click.testing import CliRunner

from impact_rig.cli.main import cli
from impact_rig.configuration.node_claim import check_free, claim_node, join_names
from impact_rig.core.given.errors import RigError

HOLD = "import sys; from impact_rig.configuration.node_claim import claim_node;"
HOLD += "claim = claim_node('/rig1/hammer'); print('held', flush=True); sys.stdin.read()"


@pytest.fixture(autouse=True)
def _domain(monkeypatch):
    # None that a rig could have: names are of the computer, not of a test.
    monkeypatch.setenv("ROS_DOMAIN_ID", f"test {os.getpid()}")


def test_full_names_lie_in_the_namespace():
    assert join_names("", ["hammer"]) == ["/hammer"]
    for namespace in ("a/b", "/a/b/"):
        assert join_names(namespace, ["hammer", "recorder"]) == ["/a/b/hammer", "/a/b/recorder"]


def test_a_second_one_is_refused_by_name_and_process_until_the_first_is_killed(monkeypatch):
    first = subprocess.Popen([sys.executable, "-c", HOLD], stdin=-1, stdout=-1, text=True)
    assert first.stdout.readline() == "held\n"
    for refused in (claim_node, lambda name: check_free(["/rig1/recorder", name])):
        with pytest.raises(RigError, match=rf"process {first.pid} is /rig1/hammer of ROS domain"):
            refused("/rig1/hammer")
    check_free(["/hammer", "/rig2/hammer"])
    with monkeypatch.context() as other:
        other.setenv("ROS_DOMAIN_ID", f"other {os.getpid()}")
        claim_node("/rig1/hammer").close()
    first.send_signal(signal.SIGKILL)
    first.communicate()
    claim_node("/rig1/hammer").close()


def test_a_second_rig_is_refused_before_it_starts_anything(tmp_path):
    folder = tmp_path / "run"
    with claim_node("/bench/estimator"):
        outcome = CliRunner().invoke(cli, ["up", "--namespace", "bench", "--output", str(folder)])
    assert f"process {os.getpid()} is /bench/estimator" in outcome.stderr
    assert not folder.exists()
