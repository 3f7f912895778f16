"""Least squares of one damped oscillation and an offset, when nothing is known of it.

The model is e^(-a t) (C cos(omega t) + S sin(omega t)) + offset: C, S and the offset by linear
least squares for every (a, omega), and these two by Levenberg-Marquardt on what is left (variable
projection: Golub and Pereyra, SIAM J. Numer. Anal. 10 (1973) 413, with the Jacobian of Kaufman,
BIT 15 (1975) 49, whose gradient is exact).

It starts from the best of several candidates, found in two ways, each good where the other fails:
a spectrum of the tail, weighted with falling exponentials, finds light damping and many periods;
an integral equation, solved by linear least squares over the first part of the tail, finds heavy
damping and few periods.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft
from scipy.optimize import leastsq

from impact_rig.core.signals.record import FloatArray

TRIED_DECAYS = (0.3, 1.0, 3.0, 10.0, 30.0, 100.0)
"""Decay over the whole tail, a T, of the spectrum's weights [-], our choice: from nearly undamped
to gone after a few per cent of it."""
TRIED_PARTS = (1.0, 0.3, 0.1, 0.03)
"""Parts of the tail over which the integral equation is solved [-], our choice."""
PADDING = 2
"""Length of the spectrum over that of the tail [-], our choice: half a line is near enough."""
LEAST_PERIODS = 0.5
"""Slowest oscillation looked for in the spectrum, in periods of the tail [-]: slower ones are
offset."""
UNKNOWNS = 5
"""Of the integral equation."""
ENOUGH_POINTS = 400
"""On about so many points of a longer tail the fit is found, before it is finished on all [-], our
choice."""
TOLERANCE = 1e-6
"""Relative change of sum of squares and of parameters that ends the fit [-], our choice: of some
hundred points, a hundredth of what noise makes of the parameters."""
MOST_EVALUATIONS = 50
"""Of the model [-], our choice: a decay needs fewer than ten, noise never comes to rest."""


class DecayFit:
    """The least-squares problem of one tail in (a, omega), both per point.

    Parameters
    ----------
    measured : ndarray, shape (n,)
        The tail, equidistant.
    stride : int
        Fit every so many points only; a and omega stay per point of `measured`.

    Attributes
    ----------
    residual : ndarray, shape (n,)
        Measured minus fitted, where last evaluated.
    oscillation : ndarray, shape (n,)
        The fit without its offset.
    amplitude : float
        Of the envelope at the first point.
    """

    def __init__(self, measured: FloatArray, stride: int = 1) -> None:
        self._measured = measured = measured[::stride]
        self._points = stride * np.arange(measured.size, dtype=np.float64)
        self._at: tuple[float, float] | None = None
        self.residual = measured
        self.oscillation = self._quadrature = np.zeros_like(measured)
        self._orthonormal = np.zeros((measured.size, 3))
        self.amplitude = 0.0

    def solve(self, relative_cutoff: float) -> FloatArray:
        """Return the best (a, omega), and stay there; see `find_decay_candidates`."""
        candidates = find_decay_candidates(self._measured, relative_cutoff)
        stride = max(1, self._measured.size // ENOUGH_POINTS)
        sparse = DecayFit(self._measured, stride) if stride > 1 else self
        solution = sparse.descend(candidates[int(np.argmin(sparse.find_errors(candidates)))])
        return self.descend(solution) if stride > 1 else solution

    def descend(self, start: FloatArray) -> FloatArray:
        """Return the least-squares (a, omega) next to `start`, and stay there."""
        # MINPACK itself: what `least_squares` puts around it takes longer than this fit.
        found = leastsq(
            self.find_residual,
            start,
            Dfun=self.find_jacobian,
            full_output=True,
            ftol=TOLERANCE,
            xtol=TOLERANCE,
            maxfev=MOST_EVALUATIONS,
            diag=1.0 / (np.abs(start) + np.finfo(float).tiny),
        )[0]
        solution = np.array([found[0], abs(found[1])])
        self._evaluate(solution)
        return solution

    def find_errors(self, candidates: FloatArray) -> FloatArray:
        """Return the sums of squares, shape (m,), that pairs (a, omega), shape (m, 2), leave."""
        orthonormal, _ = np.linalg.qr(_make_basis(self._find_wave(candidates)))
        onto = np.tensordot(self._measured, orthonormal, axes=(0, 1))
        return np.asarray(self._measured @ self._measured - np.square(onto).sum(axis=1))

    def find_residual(self, parameters: FloatArray) -> FloatArray:
        """Return measured minus fitted, shape (n,)."""
        self._evaluate(parameters)
        return self.residual

    def find_jacobian(self, parameters: FloatArray) -> FloatArray:
        """Return the derivatives of the residual in a and omega, shape (n, 2)."""
        self._evaluate(parameters)
        slopes = self._points[:, np.newaxis] * np.stack(
            (self.oscillation, self._quadrature), axis=1
        )
        return np.asarray(slopes - self._orthonormal @ (self._orthonormal.T @ slopes))

    def _find_wave(self, parameters: FloatArray) -> NDArray[np.complex128]:
        """Return e^((-a + i omega) t), shape (..., n), of pairs (a, omega), shape (..., 2)."""
        # A growing trial step must not overflow.
        decay = np.maximum(parameters[..., 0], -1.0 / (self._points[-1] + 1.0))
        rates = -decay + 1j * parameters[..., 1]
        return np.asarray(np.exp(rates[..., np.newaxis] * self._points))

    def _evaluate(self, parameters: FloatArray) -> None:
        decay, frequency = parameters.tolist()
        if self._at == (decay, frequency):
            return
        self._at = decay, frequency
        wave = self._find_wave(parameters)
        self._orthonormal, triangle = np.linalg.qr(_make_basis(wave))
        onto = self._measured @ self._orthonormal
        cosine, sine = _find_amplitudes(triangle.tolist(), onto.tolist())
        self.residual = self._measured - self._orthonormal @ onto
        self.oscillation = cosine * wave.real + sine * wave.imag
        self._quadrature = cosine * wave.imag - sine * wave.real
        self.amplitude = math.hypot(cosine, sine)


def _make_basis(wave: NDArray[np.complex128]) -> FloatArray:
    """Return cosine, sine and offset as columns, shape (..., n, 3), offset first."""
    return np.stack((np.ones(wave.shape), wave.real, wave.imag), axis=-1)


def _find_amplitudes(triangle: list[list[float]], onto: list[float]) -> tuple[float, float]:
    """Solve for cosine and sine; 0 for what cannot be told from the columns before it."""
    least = np.finfo(float).eps * len(onto) * max(abs(triangle[i][i]) for i in range(3))
    sine = onto[2] / triangle[2][2] if abs(triangle[2][2]) > least else 0.0
    rest = onto[1] - triangle[1][2] * sine
    return rest / triangle[1][1] if abs(triangle[1][1]) > least else 0.0, sine


def find_decay_candidates(tail: FloatArray, relative_cutoff: float) -> FloatArray:
    """Find candidates for decay rate and angular frequency.

    Parameters
    ----------
    tail : ndarray, shape (n,)
        Damped oscillation, offset and noise, equidistant.
    relative_cutoff : float
        Highest frequency that can be there, over the sampling rate [-]; 0: one half.

    Returns
    -------
    ndarray, shape (m, 2)
        a and omega, per point.
    """
    candidates = _search_spectrum(tail, relative_cutoff or 0.5)
    for part in TRIED_PARTS:
        count = round(part * tail.size)
        if count > 2 * UNKNOWNS:
            candidates += _solve_integral_equation(tail[:count])
    return np.array(candidates)


def _search_spectrum(tail: FloatArray, highest: float) -> list[tuple[float, float]]:
    count = tail.size
    # What the oscillation has come down to is the offset.
    signal = tail - tail[count // 2 :].mean()
    decays = np.array(TRIED_DECAYS) / count
    weights = np.exp(-decays[:, np.newaxis] * np.arange(count))
    length = next_fast_len(PADDING * count, real=True)
    first = int(LEAST_PERIODS * length / count)
    last = max(first + 1, int(min(highest, 0.5) * length))
    lines = np.argmax(np.abs(rfft(weights * signal, length))[:, first:last], axis=1) + first
    return [
        (float(decay), float(2.0 * np.pi * line / length))
        for decay, line in zip(decays, lines, strict=True)
    ]


def _solve_integral_equation(tail: FloatArray) -> list[tuple[float, float]]:
    """Return one pair, or none where the solution is no decay.

    y'' + 2 a y' + w^2 (y - offset) = 0, integrated twice: y = -2 a I y - w^2 I^2 y + a quadratic
    in t. Nothing is differentiated, so that noise matters little.
    """
    count = tail.size
    time = np.arange(count) / count
    once = _integrate(tail)
    columns = np.stack((once, _integrate(once), np.ones(count), time, time**2), axis=1)
    some = slice(None, None, max(1, count // ENOUGH_POINTS))
    solution = np.linalg.lstsq(columns[some], tail[some], rcond=None)[0]
    decay, stiffness = -solution[0] / 2.0, -solution[1]
    if decay <= 0.0 or stiffness <= 0.0:
        return []
    # Over-critical: the fit shall start, and find out, near critical damping.
    frequency = np.sqrt(max(stiffness - decay**2, 0.01 * stiffness))
    return [(float(decay) / count, float(frequency) / count)]


def _integrate(values: FloatArray) -> FloatArray:
    integral = np.zeros_like(values)
    np.cumsum((values[1:] + values[:-1]) / (2.0 * values.size), out=integral[1:])
    return integral
