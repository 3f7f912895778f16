"""Recordings to damage."""

from pathlib import Path
from typing import Any

import pytest

from .damaged import write_original


@pytest.fixture(params=["zstd", "lz4", "none"])
def compression(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def original(make_recording: Any) -> Path:
    """Return a sound recording of four hits, a chunk for each and one for the set-up."""
    return write_original(make_recording)
