"""A contact as its law has it beside what was measured: pulse and force-indentation loop."""

from dataclasses import dataclass

import numpy as np

from impact_rig.core.contact_law import ContactLaw
from impact_rig.core.filtering import low_pass, respond
from impact_rig.core.law_pulses import LossForm, compute_pulses
from impact_rig.core.pulse_width import measure_pulse
from impact_rig.core.pulses import compute_pulse
from impact_rig.core.records import FloatArray
from impact_rig.core.setup import RigSetup
from impact_rig.results.sample_traces import SampleTraces

MARGIN = 0.5
"""What is shown before and after the contact [contact durations], our choice."""


@dataclass(frozen=True)
class LawCurves:
    """Pulse and loop of one contact."""

    time: FloatArray  # shape (n,), from the middle of the pulse [s]
    # Shape (n,): force on the hammer, both models behind sensor and low-pass of the trace [N]. The
    # versed-sine lasts tau_p and is as high as the pulse.
    measured: FloatArray
    law: FloatArray
    versed_sine: FloatArray
    # Shape (k,): measured over the contact, from both traces and the law's impact speed [m, N];
    # empty: there is one trace only.
    indentation: FloatArray
    loop_force: FloatArray
    # Shape (m,): the law's loop [m, N].
    law_indentation: FloatArray
    law_force: FloatArray


def compute_law_curves(law: ContactLaw, traces: SampleTraces, setup: RigSetup) -> LawCurves | None:
    """Return the curves of a law with masses; None: there is no such law.

    Parameters
    ----------
    setup : RigSetup
        With the hammer's mass and sensor, and the low-pass that the traces went through.
    """
    if not law.impact_speed.is_known:
        return None
    speed, exponent = law.impact_speed.value, law.exponent.value
    pulse = compute_pulses(np.array([exponent]), np.array([law.loss]), LossForm(law.form))
    unit = law.duration.value / float(pulse.duration[0])
    height = law.peak_force.value / float(pulse.compute_peak_force()[0])
    rate, time, hammer_mass = traces.sampling_rate, traces.time, setup.hammer_mass
    cutoff_frequency, response = setup.analysis.cutoff_frequency, setup.responses[0]
    upright = traces.mean * np.sign(traces.mean.sum(axis=1, keepdims=True))

    def filter_force(force: FloatArray) -> FloatArray:
        return low_pass(respond(force, response, rate), cutoff_frequency, rate)

    def compute_force(begin: float) -> FloatArray:
        return filter_force(height * pulse.compute_force((time - begin) / unit)[0])

    # The middle of the width at half amplitude is where the trace's is.
    begin = -law.duration.value / 2.0
    middle = measure_pulse(compute_force(begin)).middle
    begin -= middle / rate + float(time[0])
    contact_time = traces.contact_time
    versed = compute_pulse(time + contact_time / 2.0, contact_time)
    peak = float(upright[0].max())
    shown = np.abs(time) < (0.5 + MARGIN) * law.duration.value
    touching = (time >= begin) & (time <= begin + law.duration.value)
    loop = _integrate_loop(upright[:, touching], speed, rate, hammer_mass)
    return LawCurves(
        time=time[shown],
        measured=hammer_mass * upright[0, shown],
        law=compute_force(begin)[shown],
        versed_sine=hammer_mass * filter_force(peak * versed)[shown],
        indentation=loop[0],
        loop_force=loop[1],
        law_indentation=speed * unit * pulse.compression[0],
        law_force=height * pulse.compute_force(pulse.time)[0],
    )


def _integrate_loop(
    upright: FloatArray, speed: float, rate: float, hammer_mass: float
) -> tuple[FloatArray, FloatArray]:
    """Return indentation [m] and force [N] of the points in contact."""
    if len(upright) == 1:
        return np.zeros(0), np.zeros(0)
    changes = upright.sum(axis=0) / rate
    approach = speed - np.cumsum(changes) + changes / 2.0
    return np.asarray(np.cumsum(approach) / rate), hammer_mass * upright[0]
