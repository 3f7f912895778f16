"""The libraries that the rig uses: what each is for, and how to get it."""

from dataclasses import dataclass

SET_UP = "use `python3 launch_scripts/rig.py exec -- impact-rig ...`, which installs it"


@dataclass(frozen=True)
class Library:
    """A library that the rig uses.

    Attributes
    ----------
    module : str
        What Python imports.
    name : str
        Under which it is installed.
    purpose : str
        What does not work without it.
    oldest : tuple of int
        Oldest version that will do; empty: any.
    is_needed : bool
        The rig cannot do its main job without it.
    advice : str
        How to get it.
    """

    module: str
    name: str
    purpose: str
    oldest: tuple[int, ...] = ()
    is_needed: bool = True
    advice: str = SET_UP


_OPTIONAL = (
    ("nptdms", "npTDMS", "importing and exporting .tdms"),
    ("pyuff", "pyuff", "importing and exporting .uff"),
    ("h5py", "h5py", "importing and exporting .h5 and .mat of version 7.3"),
    ("pyarrow", "pyarrow", "importing and exporting .parquet"),
    ("nidaqmx", "nidaqmx[grpc]", "devices of National Instruments"),
    ("serial", "pyserial", "relays on a serial port"),
    ("sounddevice", "sounddevice", "sound cards"),
    ("gpiod", "gpiod", "GPIO lines"),
    ("distributed", "distributed", "many recordings at once"),
    ("matplotlib", "matplotlib", "the figures of `study` and `report`"),
    ("jinja2", "jinja2", "`report`"),
    ("rerun", "rerun-sdk", "the visualizer"),
    ("psutil", "psutil", "`bench`"),
)
"""Module, what pip installs, purpose."""
LIBRARIES = (
    Library("numpy", "numpy", "every computation", (1, 26)),
    Library("scipy", "scipy", "every computation", (1, 11)),
    Library("rclpy", "rclpy", "every node", advice=f"{SET_UP}, or source ROS 2 Jazzy"),
    Library(
        "impact_rig_msgs.msg",
        "impact_rig_msgs",
        "every node",
        advice=f"{SET_UP}, or build and source the workspace with colcon",
    ),
    Library("domain_coordinator", "domain-coordinator", "`demo`"),
    Library("GTC", "GTC", "every uncertainty"),
    Library("honcho", "honcho", "`up`"),
    Library("pint", "pint", "rig files"),
    Library("rosbags", "rosbags", "reading recordings"),
    Library("mcap", "mcap", "reading and writing recordings"),
    *(
        Library(
            module,
            wanted.partition("[")[0],
            purpose,
            is_needed=False,
            advice=f'pip install "{wanted}"; all else works without it',
        )
        for module, wanted, purpose in _OPTIONAL
    ),
)


PARTS = {"dask": "distributed", "grpc": "nidaqmx"}
"""Modules that come with another library, by that library's module."""


def find_library(module: str) -> Library | None:
    """Return the library that a module is of; None: it is none of `LIBRARIES`."""
    top = module.partition(".")[0]
    top = PARTS.get(top, top)
    return next((item for item in LIBRARIES if item.module.partition(".")[0] == top), None)
