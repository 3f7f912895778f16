import numpy as np
import pytest

from impact_rig.present.figures.law_figure import draw_law_figure
from impact_rig.results.law_curves import compute_law_curves


@pytest.fixture(scope="module")
def figure(struck):
    sample, traces = struck.results.samples[0], struck.samples[0]
    curves = compute_law_curves(sample.contact_law, traces, struck.results.setup)
    return draw_law_figure(sample, curves)


def test_the_words_have_the_law_s_numbers(struck, figure):
    law = struck.results.samples[0].contact_law
    exponent = float(figure.title.split("n = ")[1].split()[0])
    assert exponent == pytest.approx(law.exponent.value, abs=1e-3)
    assert f"reaches {law.peak_force.value:.1f} N" in figure.alternative


def test_pulse_models_residuals_and_loops_are_drawn(figure, read):
    pulse, loop = read(figure)
    assert pulse.list_parts("model-") == ["model-law", "model-versed-sine"]
    assert pulse.list_parts("residual-") == ["residual-law", "residual-versed-sine"]
    assert loop.list_parts("loop-") == ["loop-mean", "loop-law"]
    width = np.ptp(loop.read_points("loop-law")[:, 0])
    assert np.ptp(loop.read_points("loop-mean")[:, 0]) == pytest.approx(width, rel=0.3)
