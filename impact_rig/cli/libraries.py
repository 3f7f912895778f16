"""The libraries that the rig uses, and how to get them."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from impact_rig.core.given.errors import RigError


@dataclass(frozen=True)
class Library:
    """A library that the rig uses."""

    module: str  # what Python imports
    name: str  # what pip installs
    is_needed: bool = True  # the rig cannot do its main job without it
    is_ros: bool = False  # ROS 2 brings it: recordings and files are analysed without it

    @property
    def advice(self) -> str:
        """Return how to get it."""
        if self.is_ros:
            return (
                "analyze, export, import, info, report and view work without ROS 2, what runs a"
                " rig or plays a recording does not: source ROS 2 Jazzy and the rig built with"
                " it, or use `python3 launch_scripts/rig.py exec -- impact-rig ...`"
            )
        if not self.is_needed:
            return f'pip install "{self.name}"; everything else works without it'
        return (
            "use `python3 launch_scripts/rig.py exec -- impact-rig ...`, which installs it, or"
            " source ROS 2 Jazzy and the rig built with it"
        )


LIBRARIES = (
    Library("numpy", "numpy"),
    Library("scipy", "scipy"),
    Library("rclpy", "rclpy", is_ros=True),
    Library("impact_rig_msgs", "impact_rig_msgs", is_ros=True),
    Library("GTC", "GTC"),
    Library("pint", "pint"),
    Library("rosbags", "rosbags"),
    Library("mcap", "mcap"),
    Library("nptdms", "npTDMS", is_needed=False),
    Library("pyuff", "pyuff", is_needed=False),
    Library("h5py", "h5py", is_needed=False),
    Library("pyarrow", "pyarrow", is_needed=False),
    Library("python_calamine", "python-calamine", is_needed=False),
    Library("RigolWFM", "RigolWFM", is_needed=False),
    Library("mcap_protobuf", "mcap-protobuf-support", is_needed=False),
    Library("nidaqmx", "nidaqmx", is_needed=False),
    Library("pyvisa", "pyvisa", is_needed=False),
    Library("pyvisa_py", "pyvisa-py", is_needed=False),
    Library("serial", "pyserial", is_needed=False),
    Library("sounddevice", "sounddevice", is_needed=False),
    Library("opendaq", "opendaq", is_needed=False),
    Library("distributed", "distributed", is_needed=False),
    Library("matplotlib", "matplotlib", is_needed=False),
    Library("jinja2", "jinja2", is_needed=False),
    Library("rerun", "rerun-sdk", is_needed=False),
)


ROS_PACKAGES = ("_msgs", "_srvs", "_interfaces", "ament_index_python")
"""Endings of the names of modules that come with rclpy."""


def describe_missing(module: str) -> str | None:
    """Return which library a missing module belongs to, and how to get it; None: unknown."""
    top = module.partition(".")[0]
    top = "rclpy" if top.endswith(ROS_PACKAGES) and top != "impact_rig_msgs" else top
    found = next((item for item in LIBRARIES if item.module == top), None)
    return f"{found.name} is not installed: {found.advice}" if found else None


@contextmanager
def explain_missing() -> Iterator[None]:
    """Turn the error of a missing library into a `RigError` that says how to get it."""
    try:
        yield
    except ModuleNotFoundError as error:
        missing = describe_missing(error.name or "")
        if missing is None:
            raise
        raise RigError(missing) from None
