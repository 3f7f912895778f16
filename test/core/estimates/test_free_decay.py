"""Damping by peaks and by free decay: found again, and what the tail does not tell is named."""

from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import StateSpace, find_peaks, impulse

from impact_rig.core.estimates.damping import (
    FreeDecay,
    check_window,
    estimate_free_decay,
    estimate_log_decrement,
)
from impact_rig.core.estimates.equations import estimate_damping_ratio
from impact_rig.core.given.errors import NotDeterminedError
from impact_rig.core.given.filtering import low_pass
from impact_rig.core.given.records import FloatArray
from impact_rig.core.hit.judging import FilteredHit
from impact_rig.core.hit.pulse_width import measure_pulse
from impact_rig.core.mean.mean_hit import MeanHit

from ..blocks import average_hits

RATE = 2.5e6
COUNT = 5000
ORIGIN = 750
TAU = 200e-6
CUTOFF = 50e3
NATURAL = 2.0 * np.pi * 4e3
PEAK = 1000.0
REAL_DATA = Path(__file__).parents[2] / "data" / "repeat_shock"


@dataclass(frozen=True)
class Oscillation:
    """A body that swings freely from the middle of the pulse on."""

    ratio: float
    natural: float = NATURAL
    phase: float = 0.4
    amplitude: float = PEAK
    offset: float = 0.0

    def compute(self, time: FloatArray) -> FloatArray:
        damped = self.natural * np.sqrt(1.0 - self.ratio**2)
        late = np.maximum(time, 0.0)
        wave = np.exp(-self.ratio * self.natural * late) * np.cos(damped * late + self.phase)
        return self.offset + np.where(time > 0.0, self.amplitude * wave, 0.0)


def make_mean(
    specimen: FloatArray,
    *,
    noise: float = 0.0,
    cutoff: float = CUTOFF,
    hits: int = 1,
    rate: float = RATE,
    origin: int = ORIGIN,
    seed: int = 1,
) -> MeanHit:
    """Average hits with a versed-sine on the hammer and white noise of their own."""
    phase = (np.arange(specimen.size) - origin) / rate / TAU + 0.5
    pulse = np.where((phase > 0) & (phase < 1), PEAK * np.sin(np.pi * phase) ** 2, 0.0)
    clean = low_pass(np.stack([pulse, specimen]), cutoff, rate)
    generator = np.random.default_rng(seed)
    middle = replace(measure_pulse(clean[0]), rise=float(origin), fall=float(origin))
    made = []
    for _ in range(hits):
        traces, levels = clean, np.zeros(2)
        if noise:
            raw = noise * generator.standard_normal((2, specimen.size))
            disturbance = low_pass(raw, cutoff, rate)
            traces, levels = clean + disturbance, disturbance.std(axis=1)
        made.append(
            FilteredHit(traces, rate, middle, levels, np.full(2, noise), np.zeros(2), origin)
        )
    return average_hits(made)


def swing(oscillation: Oscillation, count: int = COUNT) -> FloatArray:
    return oscillation.compute((np.arange(count) - ORIGIN) / RATE)


def describe(found: FreeDecay) -> tuple[float, float]:
    """Return the damping ratio and the natural angular frequency."""
    natural = float(np.hypot(found.decay_rate, found.angular_frequency))
    return found.decay_rate / natural, natural


def fit(mean: MeanHit, cutoff: float = CUTOFF) -> FreeDecay:
    return estimate_free_decay(mean, 1, 0.55 * TAU, cutoff)


@given(
    ratio=st.floats(0.005, 0.75),
    frequency=st.floats(1.2e3, 15e3),
    phase=st.floats(-3.14, 3.14),
    offset=st.floats(-20.0, 20.0),
)
@settings(max_examples=100, deadline=None)
def test_any_decay_is_found_from_nothing(ratio, frequency, phase, offset):
    natural = 2.0 * np.pi * frequency / np.sqrt(1.0 - ratio**2)
    # Something must be left of it where the tail begins.
    if ratio * natural * TAU > 12.0:
        return
    true = Oscillation(ratio, natural, phase, PEAK, offset)
    found = fit(make_mean(swing(true), cutoff=0.0), 0.0)
    assert describe(found) == pytest.approx((ratio, natural), rel=1e-5)
    assert found.r_squared == pytest.approx(1.0, abs=1e-8)


def test_a_real_ringing_gives_the_decrement_of_its_peaks():
    time, board = np.loadtxt(REAL_DATA / "acc_pcb_a0_ringing.txt").T
    rate = 1.0 / np.mean(np.diff(time))
    # Its noise before the drop, which is not in the extract: 0.17 g.
    noise = np.full(2, 0.17)
    pulse = replace(measure_pulse(np.hanning(board.size)), rise=0.0, fall=0.0)
    hit = FilteredHit(np.stack([board, board]), float(rate), pulse, noise, noise, noise, 1)
    found = estimate_free_decay(average_hits([hit]), 1, 1e-5, 0.0)
    peaks, _ = find_peaks(board, distance=40, height=20.0)
    times = np.polyfit(np.arange(peaks.size), time[peaks], 1)[0]
    decrements = -np.polyfit(np.arange(peaks.size), np.log(board[peaks]), 1)[0]
    assert found.frequency == pytest.approx(1.0 / times, rel=0.01)
    assert 2 * np.pi * found.decay_rate / found.angular_frequency == pytest.approx(
        decrements, rel=0.1
    )
    assert found.frequency == pytest.approx(806.0, rel=0.01)
    # It is no single oscillation of constant damping, and the uncertainty says so.
    assert found.residual_over_noise > 3.0


@pytest.mark.parametrize(
    ("oscillation", "count", "noise", "sentence"),
    [
        (Oscillation(0.02, natural=2 * np.pi * 400), COUNT, 0.1, r"0.\d+ periods of the tail"),
        (Oscillation(0.3), 1300, 0.1, r"µs of tail after the contact are"),
        (Oscillation(0.97), COUNT, 0.02, r"damping ratio 0.9\d, stand out"),
        (Oscillation(0.3, amplitude=1.0), COUNT, 5.0, "is in the noise"),
        (Oscillation(0.3, amplitude=0.0), COUNT, 0.0, "is flat"),
        (Oscillation(-0.01), COUNT, 0.5, "does not decay"),
        (Oscillation(0.0005), 2500, 10.0, r"standard uncertainty of|does not decay"),
    ],
)
def test_what_the_tail_does_not_tell_is_named(oscillation, count, noise, sentence):
    with pytest.raises(NotDeterminedError, match=sentence):
        fit(make_mean(swing(oscillation, count), noise=noise))


@pytest.mark.parametrize(("ratio", "noise"), [(1.0, 0.01), (1.5, 1.0), (3.0, 1.0)])
def test_over_critical_damping_is_never_given_a_ratio(ratio, noise):
    time = np.maximum((np.arange(COUNT) - ORIGIN) / RATE, 0.0)
    slow, fast = (NATURAL * (ratio - s * np.sqrt(ratio**2 - 0.999)) for s in (1, -1))
    specimen = PEAK * (np.exp(-slow * time) + 0.5 * np.exp(-fast * time))
    specimen[:ORIGIN] = 0.0
    with pytest.raises(NotDeterminedError, match=r"tail|oscillation|damping ratio"):
        fit(make_mean(specimen, noise=noise))


def test_two_modes_are_not_called_one():
    specimen = swing(Oscillation(0.02)) + swing(Oscillation(0.02, natural=2.7 * NATURAL))
    assert fit(make_mean(specimen, noise=1.0)).has_many_modes
    assert not fit(make_mean(swing(Oscillation(0.02)), noise=1.0)).has_many_modes


@pytest.mark.parametrize("side", [0.98, 1.02], ids=["below", "above"])
def test_halves_differ_beyond_twice_both_standard_uncertainties(side):
    # No low-pass: the tail begins where the contact ends, and its halves are known to a point.
    first, ratios, errors = ORIGIN + round(0.55 * TAU * RATE), (0.02, 0.023), []
    half = (COUNT - first) // 2
    points, start, swung = np.arange(half), complex(PEAK), [np.zeros(first)]
    for ratio in ratios:
        rate = NATURAL / RATE * (-ratio + 1j * np.sqrt(1.0 - ratio**2))
        wave = start * np.exp(rate * points)
        start *= np.exp(rate * half)
        swung.append(wave.real)
        # By a, omega, cosine, sine and offset.
        rows = points * wave.real, points * wave.imag, wave.real, wave.imag, np.ones(half)
        jacobian = np.stack(rows)
        errors.append(np.sqrt(np.linalg.inv(jacobian @ jacobian.T)[0, 0]) / rate.imag)
    noise = np.full(2, (ratios[1] - ratios[0]) / (2.0 * sum(errors)) / side)
    mean = make_mean(np.concatenate(swung), cutoff=0.0)
    halves = fit(replace(mean, noise=noise, raw_noise=noise), 0.0).halves
    assert halves == (pytest.approx(ratios, rel=1e-5) if side > 1.0 else ())


@pytest.mark.parametrize(("points", "is_refused"), [(10, False), (12, True)])
def test_a_window_is_seen_beside_six_points_of_a_half_baseline(points, is_refused):
    trace = swing(Oscillation(0.02, amplitude=1e-3))
    trace[:ORIGIN] = np.random.default_rng(1).standard_normal(ORIGIN)
    mean = replace(make_mean(trace, cutoff=0.0), baseline_points=points)
    told = pytest.raises(NotDeterminedError, match="a window of an analyser is in it")
    with told if is_refused else nullcontext():
        check_window(mean, 1, 0.0)


def make_decay(ratio: float, frequency: float = 5e3, count: int = 6000) -> np.ndarray:
    """Return a rise to 1 over 200 points, then the free decay from rest at that peak."""
    natural = 2 * np.pi * frequency
    # x'' = -2 zeta w x' - w^2 x released at x = 1 is the impulse response of (s + 2 zeta w) over
    # the characteristic polynomial.
    system = StateSpace(
        [[0, 1], [-(natural**2), -2 * ratio * natural]], [[1], [0]], [[1, 0]], [[0]]
    )
    _, decay = impulse(system, T=np.arange(count - 200) / RATE)
    rise = np.sin(np.pi / 2 * np.arange(200) / 200) ** 2
    return np.concatenate([rise, decay])


@given(ratio=st.floats(0.02, 0.65), sign=st.sampled_from([1, -1]), height=st.floats(1e-3, 1e4))
def test_a_free_decay_gives_its_damping_ratio(ratio, sign, height):
    trace = sign * height * make_decay(ratio)
    peaks = estimate_log_decrement(trace, noise=0.0)
    # Peaks are read on points, 500 per period: at most (pi / 500)^2 / 2 low.
    assert estimate_damping_ratio(peaks.log_decrement) == pytest.approx(ratio, abs=1e-5)
    period = RATE / (5e3 * np.sqrt(1 - ratio**2))
    assert peaks.second_index - peaks.first_index == pytest.approx(period, abs=1)
    assert peaks.first_peak == pytest.approx(height, rel=1e-6)


@pytest.mark.parametrize(("ratio", "noise"), [(0.7, 0.01), (1.0, 1e-6), (1.5, 1e-6)])
def test_a_second_peak_within_the_noise_is_not_invented(ratio, noise):
    # Of 0.7, the second peak is 0.002 of the first; the others have none.
    with pytest.raises(NotDeterminedError, match="no second peak stands out of the noise"):
        estimate_log_decrement(make_decay(ratio), noise=noise)


def test_a_wave_that_does_not_decay_has_no_decrement():
    wave = np.sin(2 * np.pi * np.arange(1000) / 100)
    with pytest.raises(NotDeterminedError, match="as high as the first, so that nothing decays"):
        estimate_log_decrement(np.tile(wave[:100], 10), noise=0.0)
