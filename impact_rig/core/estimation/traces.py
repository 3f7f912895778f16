"""What the mean traces of a sample say whatever the hammer is: pulse shape and free decay."""

from dataclasses import dataclass

from impact_rig.core.errors import RigError
from impact_rig.core.estimation.fits import FreeDecayEstimate, estimate_decay
from impact_rig.core.estimation.pulse_shape import PulseShapeEstimate, estimate_pulse_shape
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.hits.pulse_width import measure_pulse
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.setup.settings import AnalysisSettings


@dataclass(frozen=True)
class TraceEstimates:
    """What the mean traces of a sample say whatever the hammer's stiffness is.

    Attributes
    ----------
    shape : PulseShapeEstimate or None
        Of the hammer's mean pulse; None: not determined.
    free_decay : FreeDecayEstimate or None
        Of the sample after the contact; None: not determined.
    notes : tuple of str
        Why not.
    """

    shape: PulseShapeEstimate | None
    free_decay: FreeDecayEstimate | None
    notes: tuple[str, ...]


def estimate_traces(name: str, mean: MeanHit, setup: RigSetup) -> TraceEstimates:
    """Estimate pulse shape and free decay of one sample from its mean hit.

    Raises
    ------
    SignalError
        If the hammer's mean trace has no whole pulse.
    """
    width = measure_pulse(mean.traces[0]).half_amplitude_width / mean.sampling_rate
    contact_time = setup.analysis.pulse_factor * width
    shape, shape_notes = look_at_shape(mean, setup.analysis)
    decay, decay_notes = _look_at_decay(mean, setup, name, contact_time)
    return TraceEstimates(shape, decay, shape_notes + decay_notes)


def look_at_shape(
    mean: MeanHit, settings: AnalysisSettings
) -> tuple[PulseShapeEstimate | None, tuple[str, ...]]:
    """Return the pulse's shape, or why it is not determined."""
    try:
        return estimate_pulse_shape(mean, settings.cutoff_frequency), ()
    except RigError as error:
        return None, (str(error),)


def _look_at_decay(
    mean: MeanHit, setup: RigSetup, name: str, contact_time: float
) -> tuple[FreeDecayEstimate | None, tuple[str, ...]]:
    """Return the free decay, or why it is not determined."""
    if mean.traces.shape[0] <= 1:
        return None, ()
    try:
        return estimate_decay(mean, setup, name, contact_time), ()
    except RigError as error:
        return None, (str(error),)
