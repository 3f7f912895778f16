"""Hits with and without faults of sensors and converters: which are found, by their size.

Contacts of the law, of other materials, n and e each, through sensors that ring, by a converter
with noise and hum. Every fault is what physics makes of it: a second contact is slower, lower and
wider than the first, a zero shifts with the momentum or at once, a low corner droops.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from core.struck import COUNT, RATE, SETUP, SPEED, START, Impact

from impact_rig.core.given.findings import Reason
from impact_rig.core.given.records import HitLabel
from impact_rig.core.session import Session

SERIES_HITS = 10
"""Good hits of a series [-], as in a campaign."""
EXPONENTS, RESTITUTIONS = (1.3, 1.5, 1.7), (0.7, 0.8, 0.9)
"""Of the contacts [-]: what metals show, more or less like Hertz."""
DURATIONS = (145e-6, 244e-6)
"""Of the contacts [s], as in the paper's Table 2."""
RESONANCES = (40e3, 100e3)
"""Of mounted sensors [Hz]."""
LARGEST_HUM = 2e-4
"""Its amplitude over full scale [-], our choice."""
SHORTEST_DELAY = 1.3
"""Of a second contact from touch to touch, in durations [-]: before, it is the first."""
RECOVERIES = (1e-3, 1.0)
"""In which a zero shift goes [s]: milliseconds to seconds."""


@dataclass(frozen=True)
class Fault:
    """What may be wrong with a hit, in several sizes."""

    reason: Reason  # by which it is to be found
    sizes: tuple[float, ...]  # [%] of the peak, but for the corner [Hz]
    sure: float  # size from which on 99 % are to be found; NaN: none is asked for
    text: str

    def name(self, size: float) -> str:
        """Return the name of one size."""
        return self.text.format(size)


SECOND = Fault(Reason.DOUBLE_HIT, (1.5, 2.0, 3.0, 5.0), 5.0, "second contact of {:g} %")
STEP = Fault(Reason.ZERO_SHIFT, (0.2, 0.5, 1.0, 2.0, 5.0), 2.0, "zero shift of {:g} %")
DROOP = Fault(Reason.DROOP, (1.0, 3.0, 5.0, 10.0, 50.0), 50.0, "lower corner of {:g} Hz")
CLIPPED = Fault(Reason.OVERLOAD, (99.8, 99.5, 99.0, 97.0), 97.0, "clipped at {:g} % of the peak")
DROPOUT = Fault(Reason.DROPOUT, (3.0, 5.0, 10.0, 50.0), 10.0, "one point lost {:g} % into it")
TURNED = Fault(Reason.POLARITY, (1.0, 2.0), 1.0, "{:g} of 2 channels turned")
CABLE = Fault(Reason.UNSTEADY_ZERO, (1.0, 2.0, 3.0, 5.0), math.nan, "cable noise of {:g} % RMS")
FAULTS = (SECOND, STEP, DROOP, CLIPPED, DROPOUT, TURNED, CABLE)
SURE = tuple(
    fault.name(size)
    for fault in FAULTS
    if not math.isnan(fault.sure)
    for size in fault.sizes[fault.sizes.index(fault.sure) :]
)
"""Names of what is to be found."""


def strike_good_hits(seed: int, number: int) -> int:
    """Strike a series of good hits and return how many were left out."""
    session, hits = Session(SETUP), _draw_hits(np.random.default_rng((seed, number)))
    for impact in range(1, SERIES_HITS + 1):
        session.feed(next(hits).make_block(HitLabel("struck", impact, impact)))
    return len(session.get_selection("struck").left_out)


def strike_fault(fault: Fault, seed: int, number: int) -> dict[str, bool]:
    """Strike one fault in all its sizes; return by their names which were rightly named."""
    random = np.random.default_rng((seed, number))
    hits, found = _draw_hits(random), {}
    for impact, size in enumerate(fault.sizes, start=2):
        session = Session(SETUP)
        if fault is TURNED:
            session.feed(next(hits).make_block(HitLabel("struck")))
        hit = next(hits)
        faulty = replace(hit, **_spoil(hit, fault, size, random))
        (judged,) = session.feed(faulty.make_block(HitLabel("struck", impact, impact)))
        reasons = {item.reason for item in judged.rejections + judged.findings}
        found[fault.name(size)] = fault.reason in reasons
    return found


def _draw_hits(random: np.random.Generator) -> Iterator[Impact]:
    """Yield the hits of one contact, its sensors and their converter, all drawn."""
    first = Impact(
        duration=random.uniform(*DURATIONS),
        exponent=float(random.choice(EXPONENTS)),
        restitution=float(random.choice(RESTITUTIONS)),
        resonance=random.uniform(*RESONANCES),
        hum=LARGEST_HUM * random.uniform(),
        stated_scale=bool(random.integers(2)),
    )
    while True:
        yield replace(
            first,
            duration=first.duration * (1.0 + 3e-3 * random.standard_normal()),
            speed=SPEED * (1.0 + 0.02 * random.standard_normal()),
            seed=int(random.integers(2**31)),
        )


def _spoil(hit: Impact, fault: Fault, size: float, random: np.random.Generator) -> dict[str, Any]:
    """Return what a fault of one size changes of a hit."""
    part = size / 100.0
    # Without loss F goes with v^(2n / (n + 1)).
    slower = part ** ((hit.exponent + 1.0) / (2.0 * hit.exponent))
    last = COUNT / RATE - START - hit.duration
    at_once = random.uniform(0.2, 0.8) if random.integers(2) else math.nan
    return {
        SECOND: {"second": (slower, random.uniform(SHORTEST_DELAY * hit.duration, last))},
        STEP: {
            "zero_shift": part * random.choice((-1.0, 1.0)),
            "shifts_at": at_once,
            "recovery": math.exp(random.uniform(*np.log(RECOVERIES))),
        },
        DROOP: {"corner": size},
        CLIPPED: {"clip": part},
        DROPOUT: {"dropout": part},
        TURNED: {"signs": (-1, -1) if size == 1.0 else (-1, 1)},
        CABLE: {"cable_noise": part},
    }[fault]
