"""Where the view can go, and what is said when it cannot go there."""

import sys

import pytest

from impact_rig.core.errors import DeviceError, FileError, RigError
from impact_rig.present.rerun import rerun_sdk

from .onlookers import Notices

rerun = pytest.importorskip("rerun", reason="rerun-sdk is not installed")


def test_an_address_of_another_host_cannot_be_listened_on(open_all):
    # Of the block that is kept for documentation: nobody's.
    with pytest.raises(DeviceError, match=r"192\.0\.2\.1, port 0 cannot be listened on"):
        open_all(web=True, listen="192.0.2.1")


def test_a_file_that_cannot_be_written_is_named(tmp_path, open_all):
    (tmp_path / "taken").write_text("")
    with pytest.raises(FileError, match=r"taken.*cannot be written"):
        open_all(output=str(tmp_path / "taken" / "view.rrd"))


@pytest.mark.skipif(sys.platform != "linux", reason="screens are known by other means")
def test_a_window_needs_a_screen_and_without_one_the_rest_is_shown(
    monkeypatch, tmp_path, open_all
):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(DeviceError, match=r"no screen .* to a file"):
        open_all(spawn=True)
    notices = Notices()
    (file,) = open_all(spawn=True, output=str(tmp_path / "view.rrd"), notify=notices)

    assert "no screen" in notices.texts[0]
    assert not file.is_lost


def test_a_missing_rerun_is_named_with_the_command_that_installs_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(RigError, match=r"pip install 'rerun-sdk>=0\.41'"):
        rerun_sdk.import_rerun()


def test_an_old_rerun_is_named(monkeypatch):
    monkeypatch.setattr(rerun, "__version__", "0.29.1")
    with pytest.raises(RigError, match=r"0\.29\.1 is too old"):
        rerun_sdk.import_rerun()
