"""What the tests of the bench measure with: little, quickly."""

import pytest

from bench.campaigns import Campaigns
from bench.measure import Bench, Extent


@pytest.fixture
def bench(tmp_path):
    """Return what a part works with."""
    extent = Extent(demos=1, seconds=1.0, kills=1, mutations=6, repeats=2)
    return Bench(tmp_path, extent, Campaigns(tmp_path / "campaigns"))
