"""Model against measurement: normalised, shifted, and what is then left."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from impact_rig.core.comparison import (
    compare_trace,
    compare_with_model,
)
from impact_rig.core.filtering import low_pass
from impact_rig.core.hits import MeanHit
from impact_rig.core.model import Body, ImpactModel, ModelVariant, simulate_impact

from .blocks import make_plain_mean

RATE = 2.5e6
MODEL = ImpactModel(Body(0.1, 22.5e6, 1909.0), Body(0.17, 45e6, 1170.0), 203.2e-6, 0.0819, 60.0)


def make_bell(middle: float, width: float = 30.0, count: int = 600) -> np.ndarray:
    return np.exp(-(((np.arange(count) - middle) / width) ** 2))


class TestCompareTrace:
    """One body's two traces."""

    def test_errors_are_what_their_names_say(self):
        measured = make_bell(300.0)
        model = make_bell(300.0, width=45.0)
        contact = slice(250, 350)
        result = compare_trace(measured, model, RATE, contact, 100)
        assert result.shift == pytest.approx(0.0, abs=1e-6 / RATE)
        error = model - measured
        assert result.mse_percent == pytest.approx(100 * np.mean(error**2), rel=1e-6)
        assert result.contact_error_percent == pytest.approx(
            100 * np.sqrt(np.mean(error[contact] ** 2)), rel=1e-6
        )


class TestCompareWithModel:
    """A mean hit and the model."""

    def make_mean(self, model: ImpactModel, variant: ModelVariant, origin: int = 754) -> MeanHit:
        start = model.contact_time / 2 - origin / RATE
        traces = np.stack(simulate_impact(model, RATE, 5000, start=start, variant=variant))
        return make_plain_mean(low_pass(traces, 50e3, RATE), RATE, origin)

    @pytest.mark.parametrize("variant", ModelVariant)
    def test_of_the_model_itself_is_perfect(self, variant):
        result = compare_with_model(self.make_mean(MODEL, variant), MODEL, variant, 50e3)
        for body in (result.hammer, result.specimen):
            # What has not died away at the end of the record moves the best shift by 1e-4 points.
            assert body.mse_percent < 1e-9
            assert body.contact_error_percent < 1e-3
            assert abs(body.shift) < 1e-3 / RATE
            assert np.abs(body.measured).max() == 1.0
        # Half a contact before the middle, which lies at point 754.
        assert result.start_time == pytest.approx(MODEL.contact_time / 2 - 754 / RATE)

    @given(delay=st.integers(-200, 200))
    @settings(max_examples=30)
    def test_reports_a_delay_of_the_sample_as_shift(self, delay):
        mean = self.make_mean(MODEL, ModelVariant.DRIVEN, origin=1000)
        hammer, specimen = mean.traces
        late = replace(mean, traces=np.stack([hammer, ndimage.shift(specimen, delay)]))
        result = compare_with_model(late, MODEL, ModelVariant.DRIVEN, 50e3)
        assert result.specimen.shift * RATE == pytest.approx(delay, abs=1e-3)
        # An earlier sample lacks its end, where 0.3 % of the peak was left.
        assert result.specimen.mse_percent < 1e-4
        assert abs(result.hammer.shift) < 1e-3 / RATE
