"""A sound card that can be unplugged."""

import os
from collections.abc import Iterator

import pytest

from impact_rig.core.errors import DeviceError
from impact_rig.devices.peers.sound_card import SoundCardPeer
from impact_rig.devices.sound.port_audio import load_port_audio


@pytest.fixture
def card(monkeypatch: pytest.MonkeyPatch) -> Iterator[SoundCardPeer]:
    """Return a card that PortAudio finds in this process."""
    peer = SoundCardPeer()
    try:
        load_port_audio()
        peer.start()
    except DeviceError as error:
        pytest.skip(str(error))
    for key, value in peer.environment.items():
        monkeypatch.setitem(os.environ, key, value)
    yield peer
    peer.stop()
