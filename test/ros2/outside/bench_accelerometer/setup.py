"""Build of a package with one node and a launch file."""

from setuptools import setup

NAME = "bench_accelerometer"
setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml", "bench.launch.py", "bench.toml"]),
    ],
    entry_points={"console_scripts": [f"samples = {NAME}.samples:main"]},
    options={"install": {"install_scripts": f"$base/lib/{NAME}"}},
)
