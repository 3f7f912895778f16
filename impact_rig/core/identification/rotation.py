"""A least-squares problem in as few numbers as it has parameters, and one more.

With R of the QR decomposition of all derivatives and the residual, the last column stands for the
residual and the others for the derivatives: lengths and angles are what they were, and a search
knows nothing else of them.
"""

from collections.abc import Callable

import numpy as np

from impact_rig.core.signals.record import FloatArray


class RotatedProblem:
    """What a search sees of a problem.

    Parameters
    ----------
    evaluate : callable
        Takes parameters, shape (p,), and returns the derivatives in them and, as the last row,
        the residual: shape (p + 1, m).
    """

    def __init__(self, evaluate: Callable[[FloatArray], FloatArray]) -> None:
        self._evaluate = evaluate
        self._parameters: FloatArray = np.empty(0)
        self._rotated: FloatArray = np.empty((0, 0))

    def find_residual(self, parameters: FloatArray) -> FloatArray:
        """Return the residual, shape (p + 1,)."""
        return self._rotate(parameters)[:, -1]

    def find_jacobian(self, parameters: FloatArray) -> FloatArray:
        """Return its derivatives, shape (p + 1, p)."""
        return self._rotate(parameters)[:, :-1]

    def _rotate(self, parameters: FloatArray) -> FloatArray:
        """Return R; the last one is kept, since residual and derivatives are asked for apart."""
        if not np.array_equal(self._parameters, parameters):
            rows = self._evaluate(parameters)
            self._rotated = np.asarray(np.linalg.qr(rows.T, mode="r"))
            self._parameters = parameters.copy()
        return self._rotated
