"""Recordings in the making."""

import pytest

from .text_recordings import Writer


@pytest.fixture
def make(tmp_path):
    """Return a function that begins a recording; what is still open at the end is closed."""
    made = []

    def begin(name: str = "session", **options) -> Writer:
        made.append(Writer(tmp_path / name, **options))
        return made[-1]

    yield begin
    for item in made:
        item.writer.close()
