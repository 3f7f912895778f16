"""Every line of a budget is needed: without it the truth lies outside."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from study.laboratories import Cause, Laboratory, draw_laboratory, read, run_series

from impact_rig.core.given.findings import join_findings
from impact_rig.core.given.quantity import Quantity

run = cache(run_series)
QUIET = Laboratory(
    noise=5e-5,
    bits=16,
    scatter=1e-3,
    losses=((1.5, 0.2),),
    gain_uncertainty=1e-5,
    rate=1e6,
    seed=1,
)
"""All that is not told is right, and known well."""
UNSTATED = replace(QUIET, gain_uncertainty=0.0)
WEIGHED = replace(QUIET, mass_uncertainty=0.0)
LEFT = "what the free decay leaves"
AMPLITUDE = "damping that depends on the amplitude"
HAMMER_MASS, SAMPLE_MASS = "mass of the hammer, assumed", "mass of struck, assumed"
HAMMER_GAIN = "gain of the hammer's channel, assumed"
SAMPLE_GAIN = "gain of the sample's channel, assumed"
FAST = replace(QUIET, clock=0.01, clock_uncertainty=0.007)
HELD = replace(QUIET, spring=(3e3, 0.01), record=6e-3)
SPRUNG = replace(HELD, clock=0.01, clock_uncertainty=0.007)
LIGHT = replace(HELD, mass_uncertainty=0.0, stated_sample=1.009)
STRONG = replace(UNSTATED, gains=(1.05, 1.0))
HASTY = replace(QUIET, stated_speed=1.05)
MIXED = draw_laboratory(Cause.LAW, np.random.default_rng((3, 7)))
"""Two losses at once, through sensors of some kind."""


def hold(found: Quantity, truth: float, source: str) -> None:
    """Hold a number against the truth with all lines of its budget, and without one."""
    away = abs(found.value - truth)
    assert away <= 1.1 * found.expanded
    line = math.sqrt(sum(it.contribution**2 for it in found.budget if it.source == source))
    rest = math.sqrt(max(found.standard**2 - line**2, 0.0))
    assert away > 2.0 * rest


@pytest.mark.parametrize(
    ("lab", "name", "source"),
    [
        (STRONG, "checks.impulse", HAMMER_GAIN),
        (STRONG, "paper.peak_force", HAMMER_GAIN),
        (STRONG, "contact_law.impact_speed", HAMMER_GAIN),
        (replace(UNSTATED, gains=(1.0, 1.075)), "checks.momentum_ratio", SAMPLE_GAIN),
        (replace(WEIGHED, stated_sample=1.0126), "checks.momentum_ratio", SAMPLE_MASS),
        (replace(WEIGHED, stated_sample=1.0126), "checks.momentum_ratio", HAMMER_MASS),
        (LIGHT, "free_decay.stiffness", SAMPLE_MASS),
        (LIGHT, "free_decay.damping_coefficient", SAMPLE_MASS),
        (HASTY, "checks.stated_restitution", "impact speed, assumed"),
        (HASTY, "checks.separation_restitution", "impact speed, assumed"),
        (replace(QUIET, warming=0.05), "checks.impulse", "trend of the peaks"),
        (replace(QUIET, warming=0.05), "paper.peak_force", "trend of the peaks"),
        (replace(QUIET, warming=0.05), "contact_law.impact_speed", "trend of the peaks"),
        (replace(QUIET, slowing=0.03), "contact_law.duration", "trend of the widths"),
        (FAST, "contact_law.duration", "sampling clock"),
        (FAST, "checks.impulse", "sampling clock"),
        (SPRUNG, "free_decay.stiffness", "sampling clock"),
        (QUIET, "paper.contact_time", "shape of the pulse"),
        (replace(HELD, air=1000.0), "free_decay.damping_ratio", AMPLITUDE),
        (replace(HELD, mount=(12e3, 0.01)), "free_decay.damping_ratio", LEFT),
        (replace(HELD, friction=2.0), "free_decay.damping_ratio", AMPLITUDE),
        (MIXED, "contact_law.duration", "scatter of the hits on struck"),
        (MIXED, "contact_law.restitution", "form of the loss"),
    ],
    ids=lambda item: item if isinstance(item, str) else "",
)  # fmt: skip
def test_a_line_is_needed(lab, name, source):
    estimate, truth, _ = run(lab)
    for bound in truth.figures[name]:
        hold(read(estimate, name), bound, source)


@pytest.mark.parametrize(
    ("lab", "told"),
    [
        (replace(QUIET, warming=0.05), "trend: the peak changes by +5.1 % over the series"),
        (replace(QUIET, slowing=0.03), "trend: the width w50 changes by +3 % over the series"),
        (replace(HELD, air=1000.0), "ζ falls as the motion dies, as by air, from 0.011 in"),
        (replace(HELD, friction=2.0), "ζ rises as the motion dies, as by dry friction"),
        (replace(HELD, window=700.0), "a window of an analyser is in it"),
        (UNSTATED, "the gains of hammer and specimen within 3 %, standard"),
        (WEIGHED, "the mass of the hammer and struck within 0.5 %, standard"),
    ],
)
def test_what_is_assumed_and_what_changes_is_named(lab, told):
    assert told in join_findings(run(lab)[2])
