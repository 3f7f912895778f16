"""The bound against numerical differentiation; an estimator reaches it: `test_identification`."""

from dataclasses import replace

import numpy as np
import pytest

from impact_rig.core.errors import NotDeterminedError, ParameterError
from impact_rig.core.identification.cramer_rao import compute_model_bound
from impact_rig.core.model.impact import Body, ImpactModel, ModelVariant, simulate_impact

RATE = 2.5e6
COUNT = 3000
START = 0.2e-3
TAU = 203.2e-6
MODEL = ImpactModel(Body(0.1, 22.54e6, 1900.0), Body(0.17, 45.29e6, 1170.0), TAU, 0.08, 100.0)
NOISE = (1.0, 0.7)


def test_equals_the_inverse_of_a_numerical_fisher_matrix():
    truth = {
        "tau_p": TAU, "t0": START, "k2": 45.29e6, "c2": 1170.0, "F0": 100.0, "sample gain": 1.0,
        "hammer offset": 0.0, "sample offset": 0.0,
    }  # fmt: skip

    def simulate(values: dict[str, float]) -> np.ndarray:
        body = Body(0.17, values["k2"], values["c2"])
        model = replace(
            MODEL, contact_time=values["tau_p"], specimen=body, peak_force=values["F0"]
        )
        traces = simulate_impact(
            model, RATE, COUNT, start=-values["t0"], variant=ModelVariant.DRIVEN
        )
        return np.concatenate(
            [
                (traces[0] + values["hammer offset"]) / NOISE[0],
                (values["sample gain"] * traces[1] + values["sample offset"]) / NOISE[1],
            ]
        )

    columns = []
    for name, value in truth.items():
        step = 1e-5 * (value or 1.0)
        up, down = (simulate({**truth, name: value + s * step}) for s in (1, -1))
        columns.append((up - down) / (2 * step))
    derivatives = np.stack(columns, axis=1)
    lengths = np.linalg.norm(derivatives, axis=0)
    scaled = derivatives / lengths
    expected = np.linalg.inv(scaled.T @ scaled) / np.outer(lengths, lengths)
    bound = compute_model_bound(MODEL, RATE, COUNT, START, NOISE)
    assert bound.names == tuple(truth)
    sizes = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(
        bound.covariance / np.outer(sizes, sizes), expected / np.outer(sizes, sizes), atol=1e-4
    )


def test_what_cannot_be_known_has_no_bound():
    with pytest.raises(NotDeterminedError, match="not determined"):
        compute_model_bound(MODEL, RATE, 100, 1.0, NOISE)
    with pytest.raises(ParameterError, match="sample noise is 0"):
        compute_model_bound(MODEL, RATE, COUNT, START, (1.0, 0.0))
