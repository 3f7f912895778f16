"""The stand-in for a sound card takes away what it made, and nothing else."""

import pytest

from impact_rig.core.errors import DeviceError
from impact_rig.testing.peers.sound_card import SoundCardPeer


def test_a_card_that_never_started_takes_nothing_away(tmp_path, monkeypatch):
    kept = tmp_path / "kept.txt"
    kept.write_text("mine")
    monkeypatch.chdir(tmp_path)
    SoundCardPeer().stop()
    assert kept.read_text() == "mine"


def test_a_card_that_cannot_start_takes_nothing_away(tmp_path, monkeypatch):
    kept = tmp_path / "kept.txt"
    kept.write_text("mine")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(tmp_path))
    card = SoundCardPeer()
    with pytest.raises(DeviceError, match="pulseaudio is not installed"):
        card.start()
    card.stop()
    assert kept.read_text() == "mine"
