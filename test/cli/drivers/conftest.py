"""A package of somebody else that brings drivers, good and bad."""

from pathlib import Path

import pytest

MODULE = '''
import os, signal, threading
from impact_rig.core.errors import DeviceError
from impact_rig.devices.acceleration_source import Acquisition
from impact_rig.devices.found_device import FoundDevice
from impact_rig.devices.hammer_holder import HolderState

class Good:
    description = "a digitizer of somebody else"
    example = """[source]\\ndriver = "good"\\nport = 7   # its own key\\n"""
    is_by_hand = False

    def __init__(self, options):
        options.check_keys("port")
        self.port = options.take_whole("port", 1, 9, 7)

    @classmethod
    def find_devices(cls):
        print("what a vendor's library says")
        return (FoundDevice("here", "digitizer 3000"), FoundDevice("there"))

    def configure(self, plan=None):
        if self.port == 8:
            raise DeviceError("the digitizer at port 8 does not answer: switch it on")
        if self.port == 9:
            import library_of_nobody
        return Acquisition("digitizer 3000", 0.5 * plan.sampling_rate) if plan else "holder 3000"

    def read_state(self):
        return HolderState.RELEASED if self.port == 6 else HolderState.HOLDING

    def release(self):
        raise AssertionError("nobody asked for that")

    def close(self):
        open(f"closed", "a").write(f"{self.port}")

class Crashing(Good):
    @classmethod
    def find_devices(cls):
        os.kill(os.getpid(), signal.SIGSEGV)

class Hanging(Good):
    @classmethod
    def find_devices(cls):
        threading.Event().wait()

class Failing(Good):
    @classmethod
    def find_devices(cls):
        raise KeyError("vendor")

class Bare(Good):
    @classmethod
    def find_devices(cls):
        import serial.nothing_of_the_kind

class Silent(Good):
    @classmethod
    def find_devices(cls):
        raise DeviceError("the vendor's service is not running: start it")
'''
SOURCES = ("good", "crashing", "hanging", "failing", "bare", "silent")


@pytest.fixture
def foreign_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Install the package for this process and those that it starts."""
    folder = tmp_path / "site"
    info = folder / "bench_drivers-1.0.dist-info"
    info.mkdir(parents=True)
    (folder / "bench_drivers.py").write_text(MODULE)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: bench-drivers\nVersion: 1.0\n")
    lines = [f"{name} = bench_drivers:{name.title()}" for name in SOURCES]
    gone = "gone = bench_drivers:NotThere"
    (info / "entry_points.txt").write_text(
        "\n".join(["[impact_rig.acceleration_sources]", *lines, gone,
                   "[impact_rig.hammer_holders]", "good = bench_drivers:Good",
                   "hanging = bench_drivers:Good"])
    )  # fmt: skip
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.setenv("PYTHONPATH", str(folder), prepend=":")
    monkeypatch.chdir(tmp_path)
    return folder
