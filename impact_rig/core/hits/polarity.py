"""Which way round the sensors are: the same in all hits of a sample, or the mean is of neither."""

import math
from dataclasses import replace

import numpy as np

from impact_rig.core.hits.averaging import HitSum
from impact_rig.core.hits.hit import FilteredHit, JudgedHit
from impact_rig.core.hits.pulse_width import measure_pulse
from impact_rig.core.hits.reasons import Reason, Rejection
from impact_rig.core.hits.verdict import CHANNELS

LEAST_LIKENESS = 0.5
"""Correlation with the hits before over the contact, signs apart, from which on a channel tells
its polarity [-], our choice: good hits have 0.95 and more."""


def match_polarity(hit: JudgedHit, before: HitSum, *, turns: bool) -> JudgedHit:
    """Return an accepted hit with its polarity held against the hits in the mean so far.

    Parameters
    ----------
    hit : JudgedHit
        Accepted as far as it is judged alone.
    before : HitSum
        Of the hits in the mean; none: the hit says how the sensors are.
    turns : bool
        Turn a channel of the other sign; False: reject the hit.
    """
    filtered = hit.filtered
    if filtered is None or not before.summary.count:
        return hit
    turned = _find_turned(filtered, before)
    if not turned:
        return hit
    names = " and ".join(CHANNELS[channel] for channel in turned)
    if not turns:
        why = f"{names} of the other sign than in the hits before; --polarity auto turns them"
        return replace(hit, rejections=(Rejection(Reason.POLARITY, why),))
    signs = np.ones((len(filtered.traces), 1))
    signs[turned] = -1.0
    traces = signs * filtered.traces
    traces.setflags(write=False)
    found = Rejection(Reason.POLARITY, f"{names} of the other sign than in the hits before")
    return replace(
        hit,
        filtered=replace(filtered, traces=traces, pulse=measure_pulse(traces[0])),
        findings=(*hit.findings, found),
    )


def _find_turned(hit: FilteredHit, before: HitSum) -> list[int]:
    """Return the channels of the other sign."""
    middle, reach = round(hit.pulse.middle), math.ceil(hit.pulse.half_amplitude_width)
    reach = min(
        reach,
        middle,
        before.origin,
        hit.traces.shape[1] - middle,
        before.total.shape[1] - before.origin,
    )
    turned = []
    for channel, (ours, theirs) in enumerate(zip(hit.traces, before.total, strict=False)):
        one = ours[middle - reach : middle + reach]
        other = theirs[before.origin - reach : before.origin + reach]
        scale = math.sqrt(float(one @ one) * float(other @ other))
        if float(one @ other) < -LEAST_LIKENESS * scale:
            turned.append(channel)
    return turned
