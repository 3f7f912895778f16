"""How the model's traces change with its parameters, in closed form."""

from dataclasses import dataclass

from impact_rig.core.checks import check_positive
from impact_rig.core.errors import ParameterError
from impact_rig.core.model.driven_sensitivities import compute_driven_sensitivities
from impact_rig.core.model.impact import ImpactModel, ModelVariant
from impact_rig.core.model.printed_sensitivities import compute_printed_sensitivities
from impact_rig.core.signals.record import FloatArray

DRIVEN_PARAMETERS = ("tau_p", "t0", "k2", "c2", "F0")
PRINTED_PARAMETERS = ("tau_p", "t0", "k2", "c2", "F0", "k1", "c1")


@dataclass(frozen=True)
class Sensitivities:
    """Accelerations of both bodies and their derivatives.

    Attributes
    ----------
    names : tuple of str
        Parameters: contact time tau_p [s], start of the contact t0 [s], k2 [N/m], c2 [N s/m],
        F0 [N]; for the printed model also k1 [N/m] and c1 [N s/m].
    traces : ndarray, shape (2, n)
        x1'' and x2'' [m/s^2].
    derivatives : ndarray, shape (2, parameters, n)
        Of the traces [m/s^2 per unit of the parameter]. For t0: the contact moves later.
    """

    names: tuple[str, ...]
    traces: FloatArray
    derivatives: FloatArray


def find_parameter_names(variant: ModelVariant) -> tuple[str, ...]:
    """Return the parameters of a model variant, in the order of the derivatives."""
    return DRIVEN_PARAMETERS if variant is ModelVariant.DRIVEN else PRINTED_PARAMETERS


def compute_sensitivities(
    model: ImpactModel,
    sampling_rate: float,
    count: int,
    *,
    start: float = 0.0,
    variant: ModelVariant = ModelVariant.DRIVEN,
) -> Sensitivities:
    """Compute both accelerations on a uniform time grid and their derivatives.

    The arguments are those of `simulate_impact`. The driven traces are equal to its. The printed
    model steps at t = 0 and at tau_p; there the two points beside each step carry its place
    between them, with the step's area and centre kept, so that what a low-pass leaves of the
    traces is differentiable in tau_p and t0. All other points are equal.

    Raises
    ------
    ParameterError
        If the sampling rate is no positive number, or there is no point.
    """
    check_positive("sampling rate", sampling_rate, "Hz")
    if count < 1:
        raise ParameterError(f"count is {count} points: it must be 1 or more")
    if variant is ModelVariant.PRINTED:
        traces, derivatives = compute_printed_sensitivities(model, sampling_rate, count, start)
    else:
        traces, derivatives = compute_driven_sensitivities(model, sampling_rate, count, start)
    return Sensitivities(find_parameter_names(variant), traces, derivatives)
