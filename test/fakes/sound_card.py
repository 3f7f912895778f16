"""A stand-in for a sound card: a separate PulseAudio server that records what it plays.

A process with its environment finds the card in PortAudio, bit by bit as it was played.
"""

import contextlib
import os
import shutil
import subprocess
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

from impact_rig.devices.virtual.rig import CountArray

CHANNELS = 2
SAMPLING_RATE = 192_000  # [Hz]
STEP = 0.01  # [s], played at a time
PULSE_WIDTH = 2e-3  # [s]
START_TIMEOUT = 20.0  # [s], for PulseAudio
SYSTEM_CONFIG = Path("/usr/share/alsa/alsa.conf")
_CONFIG = """\
pcm.{name} {{
  type pulse
  server "unix:{socket}"
  device "{name}"
}}
"""


class FakeSoundCard:
    """A card with two channels of 32 bits.

    Attributes
    ----------
    name : str
        Of the card.
    environment : dict
        What a process needs to find the card.
    is_silent : bool
        It delivers nothing, as if its driver hung.
    """

    name = "rig_card"

    def __init__(self) -> None:
        self.is_silent = False
        self._folder = tempfile.TemporaryDirectory(prefix="card_", ignore_cleanup_errors=True)
        self._place = Path(self._folder.name)
        self._lock = threading.Lock()
        self._waiting: list[CountArray] = []
        self._start_server()
        self.plug()

    def _start_server(self) -> None:
        socket, config = self._place / "socket", self._place / "asound.conf"
        config.write_text(_CONFIG.format(name=self.name, socket=socket))
        self.environment = {"ALSA_CONFIG_PATH": f"{SYSTEM_CONFIG}:{config}"}
        # Nothing of the user's own PulseAudio is found.
        places = ("HOME", "XDG_RUNTIME_DIR", "XDG_CONFIG_HOME", "XDG_STATE_HOME")
        self._own_environment = {
            "PATH": os.environ["PATH"],
            "PULSE_SERVER": f"unix:{socket}",
            **dict.fromkeys(places, str(self._place)),
        }
        self._server = subprocess.Popen(
            ["pulseaudio", "-n", "--daemonize=no", "--use-pid-file=no", "--exit-idle-time=-1",
             "--high-priority=no", "--realtime=no", "--disable-shm=yes",
             f"--load=module-native-protocol-unix socket={socket} auth-anonymous=1"],
            env=self._own_environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )  # fmt: skip
        deadline = time.monotonic() + START_TIMEOUT
        while not socket.exists():
            assert self._server.poll() is None and time.monotonic() < deadline  # noqa: PT018
            time.sleep(0.01)

    def plug(self) -> None:
        """Let the card be there, and deliver."""
        pipe = self._place / "card"
        self._control("load-module", "module-pipe-source", f"source_name={self.name}",
                      f"file={pipe}", "format=s32le", f"rate={SAMPLING_RATE}",
                      f"channels={CHANNELS}")  # fmt: skip
        # Not to wait for a reader: there is one.
        writer = os.open(pipe, os.O_WRONLY | os.O_NONBLOCK)
        os.set_blocking(writer, True)
        self._is_plugged = True
        self._player = threading.Thread(target=self._play, args=(writer,), daemon=True)
        self._player.start()

    def unplug(self) -> None:
        """Let the card vanish for all who record it."""
        self._is_plugged = False
        self._control("unload-module", "module-pipe-source")
        self._player.join()

    def feed(self, counts: CountArray) -> None:
        """Set what the card records next: counts of 32 bits, shape (n, 2)."""
        with self._lock:
            self._waiting.append(np.ascontiguousarray(counts, dtype="<i4"))

    def stop(self) -> None:
        """Take everything away."""
        self._is_plugged = False
        self._server.terminate()
        self._server.wait()
        self._player.join()
        self._folder.cleanup()

    def _control(self, *words: str) -> None:
        subprocess.run(
            ["pactl", *words],
            env=self._own_environment, check=True, timeout=START_TIMEOUT,
            stdout=subprocess.DEVNULL,
        )  # fmt: skip

    def _play(self, writer: int) -> None:
        """Write silence and what is fed, at the card's rate."""
        silence = np.zeros((round(STEP * SAMPLING_RATE), CHANNELS), dtype="<i4")
        begin, played = time.monotonic(), 0
        # The reader is gone when the card is unplugged.
        with contextlib.suppress(BrokenPipeError), open(writer, "wb") as file:
            while self._is_plugged:
                with self._lock:
                    piece = self._waiting.pop(0) if self._waiting else silence
                if not self.is_silent:
                    file.write(piece.tobytes())
                    file.flush()
                played += len(piece)
                time.sleep(max(begin + played / SAMPLING_RATE - time.monotonic(), 0.0))


def is_installed() -> bool:
    """Return whether PulseAudio, its control and its plug-in for ALSA are there."""
    plugin = any(Path("/usr/lib").glob("*/alsa-lib/libasound_module_pcm_pulse.so"))
    return plugin and all(map(shutil.which, ("pulseaudio", "pactl")))


def make_pulse() -> CountArray:
    """Return a versed-sine of half of full scale, and half of it on the other channel."""
    count = round(PULSE_WIDTH * SAMPLING_RATE)
    pulse = 2**30 * np.sin(np.pi * np.arange(count) / count) ** 2
    return np.stack([pulse, 0.5 * pulse], axis=1).astype(np.int32)
