"""What can be read from a mean hit: pulse, peaks, and how uncertain they are."""

from collections.abc import Mapping
from dataclasses import dataclass

from impact_rig.core.damping.log_decrement import LogDecrement, estimate_log_decrement
from impact_rig.core.errors import NotDeterminedError, RigError
from impact_rig.core.hits.averaging import MeanHit
from impact_rig.core.hits.pulse_uncertainty import find_quantisation_error
from impact_rig.core.hits.pulse_width import PulseWidth, measure_pulse
from impact_rig.core.setup.samples import RigSetup
from impact_rig.core.uncertainty.contact import (
    ContactNumbers,
    estimate_contact_numbers,
)
from impact_rig.core.uncertainty.inputs import RigNumbers, find_rig_numbers

DAMPING_NAMES = ("c1", "c2")
"""Of hammer and sample, for what is said about them."""


@dataclass(frozen=True)
class MeanReading:
    """A mean hit, read once: pulse, peaks of its traces, and what is known of their uncertainty.

    Attributes
    ----------
    mean : MeanHit
        What was read.
    pulse : PulseWidth
        Of the hammer.
    decrements : mapping of int to LogDecrement
        By channel, where determined.
    notes : mapping of int to str
        By channel, where not: why.
    rig : RigNumbers
        Masses and clock.
    numbers : ContactNumbers or None
        None: the uncertainty is not determined.
    reason : str
        Why not.
    """

    mean: MeanHit
    pulse: PulseWidth
    decrements: Mapping[int, LogDecrement]
    notes: Mapping[int, str]
    rig: RigNumbers
    numbers: ContactNumbers | None
    reason: str


def read_mean_hit(mean: MeanHit, setup: RigSetup, sample: str) -> MeanReading:
    """Read pulse and peaks of the mean hit on `sample`, with their uncertainty.

    The same mean hit and set-up always give the same uncertain inputs.

    Raises
    ------
    SignalError
        If the mean hammer trace has no whole pulse.
    """
    pulse = measure_pulse(mean.traces[0])
    # The hits on the control sample say something of both bodies, correlated; those on another
    # sample are asked for that sample alone.
    channels = (0, 1) if sample == setup.samples.control_sample else (1,)
    decrements: dict[int, LogDecrement] = {}
    notes: dict[int, str] = {}
    for channel in channels:
        if channel >= mean.traces.shape[0]:
            notes[channel] = "c2: the sample's trace was not measured"
            continue
        # Steps that no noise smooths make peaks of their own.
        step = find_quantisation_error(
            float(mean.summary.largest_step[channel]),
            float(mean.summary.least_noise[channel]),
        )
        try:
            decrements[channel] = estimate_log_decrement(
                mean.traces[channel], max(float(mean.noise[channel]), step)
            )
        except RigError as error:
            notes[channel] = f"{DAMPING_NAMES[channel]}: {error}"
    numbers, reason = None, ""
    try:
        numbers = estimate_contact_numbers(
            mean, pulse, decrements, setup.analysis, setup.clock_uncertainty, sample
        )
    except NotDeterminedError as error:
        reason = str(error)
    rig = find_rig_numbers(setup, sample)
    return MeanReading(mean, pulse, decrements, notes, rig, numbers, reason)
