"""Figures are drawn in the report's style."""

from collections.abc import Iterator

import pytest

from impact_rig.present.picture import drawing_style


@pytest.fixture(autouse=True)
def style() -> Iterator[None]:
    """Draw as `make_picture` does."""
    with drawing_style():
        yield
