"""The figures of the control sample from run to run."""

import warnings
from datetime import datetime, timedelta

import pytest

from impact_rig.core.given.quantity import Quantity
from impact_rig.present.trend_page import draw_trend
from impact_rig.results.numbers import CONTACT_TIME
from impact_rig.results.trend import TrendPoint

pytest.importorskip("matplotlib", reason="Matplotlib is not installed")


@pytest.mark.parametrize("days", [0.0, 0.003, 0.17, 3.0, 90.0, 4000.0])
def test_runs_at_any_distance_have_a_few_ticks_in_time(days):
    first = datetime(2026, 11, 26, 8, 32)
    points = [
        TrendPoint("run", "steel", f"{when:%Y-%m-%d %H:%M}", contact_time=Quantity(2e-4, 1e-6))
        for when in (first, first + timedelta(days=days))
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        panel = draw_trend(points, CONTACT_TIME)
        panel.canvas.draw()
    (axes,) = panel.axes
    assert 3 <= len(axes.get_xticklabels()) <= 7
