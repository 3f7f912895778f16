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


NEEDED = ("numpy", "scipy", "GTC", "pint", "rosbags", "mcap")
OF_ROS = ("rclpy", "impact_rig_msgs")
OPTIONAL = {
    "nptdms": "npTDMS", "pyuff": "pyuff", "h5py": "h5py", "pyarrow": "pyarrow",
    "python_calamine": "python-calamine", "RigolWFM": "RigolWFM",
    "mcap_protobuf": "mcap-protobuf-support", "nidaqmx": "nidaqmx", "pyvisa": "pyvisa",
    "pyvisa_py": "pyvisa-py", "serial": "pyserial", "sounddevice": "sounddevice",
    "opendaq": "opendaq", "distributed": "distributed", "matplotlib": "matplotlib",
    "jinja2": "jinja2", "rerun": "rerun-sdk",
}  # fmt: skip
LIBRARIES = (
    *(Library(name, name) for name in NEEDED),
    *(Library(name, name, is_ros=True) for name in OF_ROS),
    *(Library(module, name, is_needed=False) for module, name in OPTIONAL.items()),
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
