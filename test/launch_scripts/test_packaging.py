"""What pip gets: an sdist, and from it a wheel that lacks nothing."""

import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def build(folder, kind):
    command = [sys.executable, "setup.py", "-q", kind]
    subprocess.run(command, check=True, cwd=folder, capture_output=True)
    (built,) = (folder / "dist").iterdir()
    return built


def test_a_wheel_of_the_sdist_has_every_file_of_the_package_and_its_messages(tmp_path):
    pytest.importorskip("setuptools")
    command = ["git", "ls-files"]
    done = subprocess.run(command, check=False, capture_output=True, text=True, cwd=ROOT)
    if done.returncode:
        pytest.skip("this is no clone")
    source = tmp_path / "Höhe und Länge"
    for name in done.stdout.splitlines():
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, source / name)
    with tarfile.open(build(source, "sdist")) as sdist:
        sdist.extractall(tmp_path / "from sdist", filter="data")
    (unpacked,) = (tmp_path / "from sdist").iterdir()
    assert (unpacked / "CITATION.cff").exists()
    with zipfile.ZipFile(build(unpacked, "bdist_wheel")) as wheel:
        held = set(wheel.namelist())
        (metadata,) = (name for name in held if name.endswith("dist-info/METADATA"))
        assert "# Impact rig" in wheel.read(metadata).decode()
    wanted = {name for name in done.stdout.splitlines() if name.startswith("impact_rig/")}
    documents = {name for name in wanted if name.endswith((".md", ".ipynb"))}
    assert wanted - documents <= held
    messages = (ROOT / "msg_config/msg").glob("*.msg")
    assert {f"impact_rig/interfaces/{path.name}" for path in messages} <= held
