"""Build of the ROS 2 package `impact_rig` (ament_python); colcon runs it."""

import re
from pathlib import Path

from setuptools import find_packages, setup

NAME = "impact_rig"
NODES = (
    "hammer",
    "accelerometer",
    "estimator",
    "recorder",
    "campaign",
    "visualizer",
    "replayer",
)
SOURCES = {
    "virtual": "virtual.drivers:VirtualSource",
    "recording": "recording:RecordingSource",
    "nidaqmx": "nidaqmx.drivers:NidaqmxSource",
    "scpi": "scpi.source:ScpiSource",
    "sound": "sound:SoundSource",
}
HOLDERS = {
    "virtual": "virtual.drivers:VirtualHolder",
    "manual": "manual:ManualHolder",
    "serial": "serial_relay:SerialRelay",
    "nidaqmx": "nidaqmx.drivers:NidaqmxHolder",
    "gpio": "gpio:GpioHolder",
}
"""Drivers of devices, by the names that rig files use."""
EXECUTABLES = f"$base/lib/{NAME}"  # where `ros2 run` and `ros2 launch` look

version = re.findall(r'__version__ = "(.+)"', Path(NAME, "__init__.py").read_text("utf-8"))[0]

setup(
    name=NAME,
    version=version,
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={
        NAME: ["py.typed", "configuration/*.toml", "present/report/templates/*"],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"launch_scripts/resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (
            f"share/{NAME}/launch",
            ["launch_scripts/rig.launch.py", "launch_scripts/replay.launch.py"],
        ),
        ("bin", ["launch_scripts/impact-rig"]),
    ],
    entry_points={
        "console_scripts": [
            *(f"{node} = {NAME}.nodes.__main__:{node}" for node in NODES),
            f"impact-rig = {NAME}.cli.main:main",
        ],
        "impact_rig.acceleration_sources": [
            f"{name} = {NAME}.devices.{place}" for name, place in SOURCES.items()
        ],
        "impact_rig.hammer_holders": [
            f"{name} = {NAME}.devices.{place}" for name, place in HOLDERS.items()
        ],
    },
    options={
        "develop": {"script_dir": EXECUTABLES},
        "install": {"install_scripts": EXECUTABLES},
    },
    extras_require={
        "formats": ["h5py>=3.10", "npTDMS>=1.9", "pyarrow>=15", "pyuff>=2.4"],
        "batch": ["dask>=2024.5", "distributed>=2024.5"],
        "simulators": ["mujoco>=4.0", "drake>=1.51", "pybullet>=3.2.7"],
        "testing": ["pytest>=8"],
        "nidaqmx": ["nidaqmx[grpc]>=1.0,<1.1"],
        "serial": ["pyserial>=3.5"],
        "sound": ["sounddevice>=0.5"],
        "gpio": ["gpiod>=2.1"],
    },
    python_requires=">=3.11",
    zip_safe=False,
    license="Apache-2.0",
    description="Contact time, stiffness and damping of metal samples from hammer impacts.",
    maintainer="Impact rig maintainers",
    maintainer_email="maintainers@impact-rig.example",
)
