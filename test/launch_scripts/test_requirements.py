"""What is installed is what was chosen, and pip checks every file of it by its hash."""

import re
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "launch_scripts" / "requirements"
PIN = re.compile(r"^([\w.-]+==[^\s;\\]+)", re.MULTILINE)
HASHED_PIN = re.compile(
    r"^([\w.-]+==[^\s;\\]+)[^\n]*\\\n +--hash=sha256:[0-9a-f]{64}", re.MULTILINE
)


def normalize(pin):
    """Return a pin with the name as package indexes have it."""
    name, _, version = pin.partition("==")
    return f"{re.sub(r'[-_.]+', '-', name).lower()}=={version}"


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.txt")), ids=lambda path: path.stem)
def test_every_pin_is_locked_with_a_hash(path):
    chosen = [normalize(pin) for pin in PIN.findall(path.read_text("utf-8"))]
    locked = (FOLDER / "locked" / path.name).read_text("utf-8")
    assert chosen
    assert sorted(HASHED_PIN.findall(locked)) == sorted(chosen), (
        "launch_scripts/lock_requirements.sh brings the hashes up to date"
    )
    assert len(HASHED_PIN.findall(locked)) == len(PIN.findall(locked))
