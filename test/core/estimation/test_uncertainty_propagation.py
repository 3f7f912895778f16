"""From fitted parameters to results: against closed forms and against Monte Carlo."""

from collections.abc import Sequence

import numpy as np
import pytest

from impact_rig.core.errors import ParameterError
from impact_rig.core.estimation.uncertainty_arithmetic import UncertainNumber, find_square_root
from impact_rig.core.estimation.uncertainty_inputs import RigNumbers, find_rig_numbers
from impact_rig.core.estimation.uncertainty_propagation import propagate_parameters
from impact_rig.core.setup.paper import PAPER_SETUP
from impact_rig.core.setup.samples import RigSetup, Sample, SampleSet

RIG = find_rig_numbers(PAPER_SETUP, "steel medium")
DECAY, FREQUENCY = 3456.0, 15900.0


def find_body(parameters: Sequence[UncertainNumber], rig: RigNumbers) -> list[UncertainNumber]:
    """Free decay (a, omega_d) to zeta, c = 2 m a, k = m (a^2 + omega_d^2)."""
    decay, frequency = (rate / rig.clock for rate in parameters)
    square = decay * decay + frequency * frequency
    return [
        decay / find_square_root(square),
        2.0 * rig.moving_mass * decay,
        rig.moving_mass * square,
    ]


def draw_hits(count: int) -> np.ndarray:
    errors = np.random.default_rng(5).standard_normal((count, 2)) @ [[40.0, 60.0], [0.0, 80.0]]
    return np.array([DECAY, FREQUENCY]) + errors


def test_a_free_decay_gives_what_monte_carlo_gives() -> None:
    hits = draw_hits(200)
    found = propagate_parameters("hits", hits, find_body, RIG)
    generator = np.random.default_rng(6)
    trials = 400_000
    mean = generator.multivariate_normal(
        hits.mean(axis=0), np.cov(hits, rowvar=False) / 200, trials
    )
    clock = 1.0 + PAPER_SETUP.clock_uncertainty * generator.standard_normal(trials)
    mass = (
        0.16691
        + 0.0029e-3 * generator.standard_normal(trials)
        + 3e-3
        + 0.29e-3 * generator.standard_normal(trials)
    )
    a, w = mean.T / clock
    drawn = (a / np.hypot(a, w), 2 * mass * a, mass * (a**2 + w**2))
    for uncertainty, values in zip(found, drawn, strict=True):
        # 400 000 trials know a standard deviation to 0.11 %; four of those.
        assert uncertainty.standard == pytest.approx(values.std(), rel=5e-3)
        # 199 degrees of freedom: k = 1.972.
        half = np.diff(np.quantile(values, [0.025, 0.975]))[0] / 2
        assert uncertainty.expanded == pytest.approx(half, rel=2e-2)


def test_every_result_has_its_budget() -> None:
    ratio, damping, stiffness = propagate_parameters("hits", draw_hits(10), find_body, RIG)
    # zeta is dimensionless: masses and clock cancel.
    assert [line.source for line in ratio.budget] == ["hits"]
    assert ratio.degrees_of_freedom == pytest.approx(9.0)
    for found in (damping, stiffness):
        assert {line.source for line in found.budget} == {
            "hits",
            "mass of the accelerometer",
            "mass of steel medium",
            "sampling clock",
        }
    shares = {line.source: line for line in stiffness.budget}
    value = 0.16991 * (draw_hits(10).mean(axis=0) ** 2).sum()
    assert shares["sampling clock"].contribution == pytest.approx(2 * 5.8e-5 * value)
    assert shares["mass of the accelerometer"].contribution == pytest.approx(
        value * 0.29e-3 / 0.16991
    )


def test_the_mean_of_one_parameter_has_the_textbook_uncertainty() -> None:
    values = np.array([[3.0], [5.0], [4.0], [8.0]])
    (found,) = propagate_parameters("hits", values, lambda x, _: [x[0]], RIG)
    assert found.standard == pytest.approx(np.std(values, ddof=1) / 2)
    assert found.expanded == pytest.approx(3.182 * found.standard, rel=1e-3)  # t(3), GUM G.2


def test_what_the_scatter_does_not_show_is_added() -> None:
    values = np.array([[3.0], [5.0], [4.0], [8.0]])
    (found,) = propagate_parameters(
        "hits", values, lambda x, _: [x[0]], RIG, noise_covariance=np.array([[4.0]])
    )
    assert found.standard == pytest.approx(np.sqrt(np.var(values, ddof=1) / 4 + 4.0))
    assert {(line.source, line.kind) for line in found.budget} == {
        ("hits", "A"),
        ("noise of the fit", "B"),
    }


def test_hits_that_agree_to_the_last_bit_have_no_scatter() -> None:
    found = propagate_parameters("hits", np.full((2, 2), [[DECAY, FREQUENCY]]), find_body, RIG)
    assert found[0].standard < 1e-15  # zeta: clock and masses cancel but for rounding
    assert all(line.source != "hits" for item in found for line in item.budget)


def test_one_hit_determines_no_uncertainty_and_says_so() -> None:
    found = propagate_parameters("hits", draw_hits(1), find_body, RIG)
    assert len(found) == 3
    for item in found:
        assert not item.is_determined
        assert item.budget == ()
        assert "one accepted hit shows no scatter" in item.notes[0]


def test_the_best_estimate_may_be_another_than_the_mean() -> None:
    hits = draw_hits(10)
    (at_mean,) = propagate_parameters("hits", hits, lambda x, _: [x[0] * x[0]], RIG)
    (doubled,) = propagate_parameters(
        "hits", hits, lambda x, _: [x[0] * x[0]], RIG, estimates=2.0 * hits.mean(axis=0)
    )
    assert doubled.standard == pytest.approx(2.0 * at_mean.standard)


@pytest.mark.parametrize("bad", [np.array([[1.0, np.nan]] * 3), np.zeros((0, 2)), np.ones(3)])
def test_what_are_no_parameters_is_refused(bad: np.ndarray) -> None:
    with pytest.raises(ParameterError, match="parameters of the hits"):
        propagate_parameters("hits", bad, find_body, RIG)


def test_masses_without_a_stated_uncertainty_are_named() -> None:
    setup = RigSetup(SampleSet((Sample("oak", 0.1),), "oak", 3e-3, 1e-4), 0.1, 0.3)
    rig = find_rig_numbers(setup, "oak")
    assert rig.notes == (
        "uncertainty of k and c: none is stated for the mass of the hammer and oak",
    )
    assert RIG.notes == ()
    found = propagate_parameters("hits", draw_hits(5), find_body, rig)
    assert found[2].notes == rig.notes
