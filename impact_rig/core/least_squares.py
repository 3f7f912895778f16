"""Least squares of several models at once."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impact_rig.core.records import FloatArray

Evaluation = tuple[FloatArray, FloatArray]
"""Residuals of k models, shape (k, n), and their derivatives, shape (k, p, n)."""


@dataclass(frozen=True)
class Limits:
    """Of a search; all are our choices."""

    damping: float = 1e-3  # [-] of the first step, over the squared length of each derivative
    step: float = 3e-3  # [-] over what noise makes of the parameters: a smaller one ends it
    evaluations: int = 50  # [-] at most: a pulse needs four to seven, noise never ends


LIMITS = Limits()


def minimise(
    evaluate: Callable[[FloatArray], Evaluation],
    start: FloatArray,
    bounds: FloatArray,
    most: float = np.inf,
) -> tuple[FloatArray, Evaluation, NDArray[np.bool_]]:
    """Search the least sum of squares of each of k models (Marquardt 1963).

    Parameters
    ----------
    evaluate : callable
        Takes parameters, shape (k, p).
    start : ndarray, shape (k, p)
        Where to begin.
    bounds : ndarray, shape (2, k, p), or one that is broadcast to it
        Least and largest parameters; equal for one that is not varied.
    most : float
        Sum of squares of a model that is still of use: one that stays above it is given up.

    Returns
    -------
    tuple
        Parameters, the evaluation there, and which searches ended at a minimum.
    """
    found = np.clip(start, *bounds)
    residual, jacobian = evaluate(found)
    squares = np.sum(residual**2, axis=-1)
    damping, is_found = np.full(len(found), LIMITS.damping), np.zeros(len(found), dtype=bool)
    for _ in range(LIMITS.evaluations):
        gradient = np.sum(jacobian * residual[:, np.newaxis], axis=-1)
        # A parameter stays at its bound where less would be left beyond it.
        is_held = np.where(gradient > 0.0, found <= bounds[0], found >= bounds[1])
        free = np.where(is_held[..., np.newaxis], 0.0, jacobian)
        lengths = np.linalg.norm(free, axis=-1)
        lengths[lengths == 0.0] = 1.0
        normal = free @ free.swapaxes(1, 2) / (lengths[:, :, np.newaxis] * lengths[:, np.newaxis])
        normal += np.eye(start.shape[1]) * (damping[:, np.newaxis] + is_held)[:, np.newaxis]
        ahead = np.linalg.solve(normal, (gradient / lengths * ~is_held)[..., np.newaxis])[..., 0]
        wanted = found - ahead / lengths
        moved = np.clip(wanted, *bounds)
        step = moved - found
        change = np.sum(jacobian * step[..., np.newaxis], axis=1)
        gain = -2.0 * np.sum(gradient * step, axis=1) - np.sum(change**2, axis=1)
        # A bound in the way of a step says nothing: the next one is shorter, and then along it.
        is_whole = np.all(moved == wanted, axis=1)
        is_found |= is_whole & (gain <= LIMITS.step**2 * squares / residual.shape[1])
        is_done = is_found | (is_whole & (squares - 2.0 * gain > most))
        if is_done.all():
            break
        moved[is_done] = found[is_done]
        tried, derivatives = evaluate(moved)
        left = np.sum(tried**2, axis=-1)
        is_better = left < squares
        found[is_better], squares[is_better] = moved[is_better], left[is_better]
        residual[is_better], jacobian[is_better] = tried[is_better], derivatives[is_better]
        damping = np.where(is_better, damping / 10.0, 10.0 * np.maximum(damping, LIMITS.damping))
    return found, (residual, jacobian), is_found
