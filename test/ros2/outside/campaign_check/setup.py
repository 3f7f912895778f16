"""Build of a package that has tests alone."""

from setuptools import setup

setup(
    name="campaign_check",
    version="0.1.0",
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/campaign_check"]),
        ("share/campaign_check", ["package.xml"]),
    ],
    extras_require={"test": ["pytest"]},
)
