"""Build of the ROS 2 package `impact_rig` (ament_python); colcon runs it."""

import os
import re
import sys
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
    "page",
    "replayer",
)
SOURCES = {
    "virtual": "virtual.drivers:VirtualSource",
    "nidaqmx": "nidaqmx:NidaqmxSource",
    "scpi": "scpi:ScpiSource",
    "sound": "sound:SoundSource",
    "opendaq": "opendaq:OpenDaqSource",
}
HOLDERS = {
    "virtual": "virtual.drivers:VirtualHolder",
    "manual": "manual:ManualHolder",
    "serial": "serial_relay:SerialRelay",
    "nidaqmx": "nidaqmx:NidaqmxHolder",
}
"""Drivers of devices, by the names that rig files use."""
EXECUTABLES = f"$base/lib/{NAME}"  # where `ros2 run` and `ros2 launch` look
FOR_PIP = bool({"sdist", "dist_info", "bdist_wheel", "editable_wheel"} & set(sys.argv))
"""Whether pip builds it: names like `recorder` are for ROS 2's own folder, not for a PATH."""
INTERFACES = f"{NAME}.interfaces"
"""Definitions of messages, by which recordings are written without ROS."""
MESSAGES = Path("share", "impact_rig_msgs", "package.xml")
prefixes = [Path(part) for part in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)]

if not FOR_PIP and not any((prefix / MESSAGES).exists() for prefix in prefixes):
    # With --symlink-install colcon runs a link to this file, in its build folder.
    here = Path(__file__).resolve().parent
    print(
        f"{NAME}: its messages are not built: colcon does not look inside of a package. Build both"
        f" with `colcon build --base-paths {here} {here / 'msg_config'}`.",
        file=sys.stderr,
    )

version = re.findall(r'__version__ = "(.+)"', Path(NAME, "version.py").read_text("utf-8"))[0]

setup(
    name=NAME,
    version=version,
    packages=find_packages(include=[NAME, f"{NAME}.*"]) + [INTERFACES] * FOR_PIP,
    package_dir={INTERFACES: "msg_config/msg"},
    package_data={
        INTERFACES: ["*.msg"],
        NAME: [
            "py.typed",
            "configuration/*.toml",
            "devices/examples/*.toml",
            "files/*.toml",
            "nodes/*.xml",
            "page/templates/*",
            "present/report/templates/*",
        ],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", [f"launch_scripts/resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (
            f"share/{NAME}/launch",
            ["launch_scripts/rig.launch.py", "launch_scripts/replay.launch.py"],
        ),
        (
            f"share/{NAME}/config",
            [
                "launch_scripts/rig_parameters.yaml",
                "launch_scripts/diagnostics.yaml",
                "launch_scripts/foxglove_layout.json",
            ],
        ),
        *([] if FOR_PIP else [("bin", ["launch_scripts/impact-rig"])]),
    ],
    entry_points={
        "console_scripts": [
            *(f"{node} = {NAME}.nodes.__main__:main" for node in NODES if not FOR_PIP),
            f"impact-rig = {NAME}.cli.start:main",
        ],
        "pytest11": [f"impact_rig = {NAME}.pytest_plugin"],
        "impact_rig.acceleration_sources": [
            *(f"{name} = {NAME}.devices.{place}" for name, place in SOURCES.items()),
            f"topic = {NAME}.nodes.topic_source:TopicSource",
        ],
        "impact_rig.hammer_holders": [
            f"{name} = {NAME}.devices.{place}" for name, place in HOLDERS.items()
        ],
    },
    options={}
    if FOR_PIP
    else {
        "develop": {"script_dir": EXECUTABLES},
        "install": {"install_scripts": EXECUTABLES},
    },
    install_requires=[
        "GTC>=1.5",
        "click>=8.1",
        "jinja2>=3.1",
        "lz4>=4.0",
        "matplotlib>=3.6",
        "mcap>=1.2",
        "numpy>=1.26",
        "pint>=0.20",
        "pyyaml>=6.0",
        "rich>=13.7",
        "rosbags>=0.10",
        "scipy>=1.11",
        "segno>=1.6",
        "threadpoolctl>=3.1",
        "tornado>=6.4",
        "zstandard>=0.22",
    ],
    extras_require={
        "formats": [
            "RigolWFM>=1.6",
            "h5py>=3.10",
            "mcap-protobuf-support>=0.5",
            "npTDMS>=1.9",
            "pyarrow>=15",
            "python-calamine>=0.5",
            "pyuff>=2.4",
        ],
        "batch": ["dask>=2024.5", "distributed>=2024.5"],
        "testing": ["pytest>=8"],
        "scpi": ["pyvisa>=1.14", "pyvisa-py>=0.7"],
        "nidaqmx": ["nidaqmx>=1.0,<2"],
        "serial": ["pyserial>=3.5"],
        "sound": ["sounddevice>=0.5"],
        "opendaq": ["opendaq>=3.40,<3.50"],
    },
    python_requires=">=3.11",
    zip_safe=False,
    license="Apache-2.0",
    description="Contact time, stiffness and damping of metal samples from hammer impacts.",
    long_description=Path(__file__).resolve().with_name("README.md").read_text("utf-8"),
    long_description_content_type="text/markdown",
    maintainer="Impact rig maintainers",
    classifiers=[
        "Development Status :: 4 - Beta",
        "Framework :: Pytest",
        "Intended Audience :: Science/Research",
        "Operating System :: OS Independent",
        "Programming Language :: Python :: 3.11",
        "Programming Language :: Python :: 3.12",
        "Programming Language :: Python :: 3.13",
        "Topic :: Scientific/Engineering :: Physics",
        "Typing :: Typed",
    ],
)
