"""What is varied: every case of the study, and how many campaigns it gets."""

import itertools
import math
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

from impact_rig.core.checks import check_between
from impact_rig.core.errors import ParameterError
from impact_rig.core.model.pulses import PULSE_SHAPES
from impact_rig.devices.virtual.choices import Plant
from impact_rig.devices.virtual.rig import DigitizerSettings, VirtualRigSettings


class Part(Enum):
    """Parts of the study."""

    COVERAGE = "coverage"
    EFFICIENCY = "efficiency"
    BIAS = "bias"
    SELECTION = "selection"


FULL_CAMPAIGNS = 2000
"""Campaigns of one coverage case [-], our choice: they tell 95 % from 93.6 %."""
QUICK_CAMPAIGNS = 60
"""The same for a quick look [-], our choice."""
MOST_CAMPAIGNS = 1_000_000
EFFICIENCY_PART = 0.5
"""Hits of one noise level, part of the campaigns [-], our choice: 1000 tell a ratio within 2 %."""
BIAS_PART = 0.1
"""Campaigns of one bias case, part of the campaigns [-], our choice: 200 tell a bias of a
fifth of the spread."""
SELECTION_PART = 4.032
"""Series of the selection part, part of the campaigns [-]: in the full study 1008 of each of seven
faults in all its sizes, and of good hits; 1000 that are found show 99 %."""
SHARES = {
    Part.COVERAGE: 1.0,
    Part.EFFICIENCY: EFFICIENCY_PART,
    Part.BIAS: BIAS_PART,
    Part.SELECTION: SELECTION_PART,
}
CAMPAIGN_HITS = 10
"""Accepted hits of a campaign [-], the paper's."""

PAPER = "paper"
FREE_DECAY = "free_decay"
IDENTIFICATION = "identification"
CONTACT_LAW = "contact_law"
ESTIMATORS = (PAPER, FREE_DECAY, IDENTIFICATION)
"""Of what the paper asks for."""
LAW_ESTIMATORS = (PAPER, CONTACT_LAW)
"""Of free bodies under a contact law: no k2 or c2 is true of them."""

NOISES = (0.0, 3e-4, 1e-3, 3e-3, 1e-2)
"""Of the sensors, part of full scale [-]."""
BITS = (8, 10, 12, 14, 16)
SAMPLING_RATES = (125e3, 250e3, 500e3, 1e6, 2.5e6)
"""[Hz]; the lowest is the least that the 50 kHz low-pass works at."""
DAMPING_RATIOS = (0.01, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7)
"""Of every sample [-]."""
NOISE_LEVELS = (2e-4, 5e-4, 1e-3, 3e-3, 1e-2)
"""Of the efficiency part, white, part of each trace's peak [-]."""
LAWS = tuple(itertools.product((1.0, 1.5, 2.0), (1.0, 0.9, 0.7, 0.5)))
"""Exponents and restitutions of contact laws [-]."""
FINEST_BITS = 31
"""A digitizer without quantisation, for what the study can tell."""


@dataclass(frozen=True)
class Configuration:
    """What is asked of a study.

    Attributes
    ----------
    parts : tuple of Part
        In the order of the enumeration.
    campaigns : int
        Of one coverage case; everything else goes with it.
    seed : int
        The same seed gives the same campaigns.
    """

    parts: tuple[Part, ...] = tuple(Part)
    campaigns: int = FULL_CAMPAIGNS
    seed: int = 1

    def __post_init__(self) -> None:
        """Refuse a study of nothing."""
        if not self.parts:
            raise ParameterError("the study has no part: it needs at least one")
        object.__setattr__(self, "parts", tuple(part for part in Part if part in self.parts))
        check_between("number of campaigns", self.campaigns, 1, MOST_CAMPAIGNS)
        check_between("seed", self.seed, 0, 2**63 - 1)

    def count_campaigns(self, part: Part) -> int:
        """Return how many campaigns each case of a part gets."""
        return math.ceil(SHARES[part] * self.campaigns)


@dataclass(frozen=True)
class Case:
    """One condition under which campaigns are simulated.

    Attributes
    ----------
    part : Part
        It belongs to.
    axis : str
        What is varied.
    value : str
        Its value here, as it is printed.
    rig : VirtualRigSettings
        Physics and disturbances; the seed is each campaign's own.
    hits : int
        Accepted hits of a campaign.
    damping_ratio : float
        zeta of every sample [-]; NaN: that of its reference.
    noise_of_peak : float
        White noise as part of each trace's peak [-], in place of the digitizer's; NaN: not used.
    is_exact : bool
        Whether masses and clock are what is stated; else they are drawn about it.
    has_control : bool
        Whether the control sample is struck too, which k and c by the paper's method need.
    estimators : tuple of str
        Those that are asked.
    varies_law : bool
        Whether campaigns take every contact law of `LAWS` in turn, instead of the rig's.
    """

    part: Part
    axis: str
    value: str
    rig: VirtualRigSettings
    hits: int = CAMPAIGN_HITS
    damping_ratio: float = math.nan
    noise_of_peak: float = math.nan
    is_exact: bool = False
    has_control: bool = True
    estimators: tuple[str, ...] = ESTIMATORS
    varies_law: bool = False

    @property
    def key(self) -> str:
        """Unique in the study."""
        return f"{self.part.value}/{self.axis}/{self.value}"


def _list_bias_cases() -> list[Case]:
    default = VirtualRigSettings(plant=Plant.DYNAMICS)

    def digitize(**values: Any) -> VirtualRigSettings:
        return replace(default, digitizer=replace(default.digitizer, **values))

    shapes = {shape.name: replace(default, pulse_shape=shape) for shape in PULSE_SHAPES}
    axes = {
        "noise": {f"{100 * noise:g} %": digitize(noise=noise) for noise in NOISES},
        "bits": {str(bits): digitize(bits=bits) for bits in BITS},
        "sampling rate": {
            f"{rate / 1e3:g} kHz": digitize(sampling_rate=rate) for rate in SAMPLING_RATES
        },
        "damping ratio": {f"{ratio:g}": default for ratio in DAMPING_RATIOS},
        "pulse shape": shapes,
        "contact law": {
            f"n = {n:g}, e = {e:g}": VirtualRigSettings(
                plant=Plant.CONTACT, contact_exponent=n, restitution=e
            )
            for n, e in LAWS
        },
        # What the law makes of a contact that is none of its own.
        "read as a law": shapes,
    }
    return [
        Case(
            Part.BIAS,
            axis,
            value,
            rig,
            damping_ratio=float(value) if axis == "damping ratio" else math.nan,
            is_exact=True,
            has_control="law" not in axis,
            estimators=LAW_ESTIMATORS if "law" in axis else ESTIMATORS,
        )
        for axis, rigs in axes.items()
        for value, rig in rigs.items()
    ]


def _list_coverage_cases() -> list[Case]:
    # The published traces are none of the model's, which therefore is not asked there.
    plants = (
        (Plant.PUBLISHED, (PAPER, FREE_DECAY)),
        (Plant.DYNAMICS, ESTIMATORS),
        (Plant.CONTACT, LAW_ESTIMATORS),
    )
    return [
        Case(
            Part.COVERAGE,
            "plant",
            plant.value,
            VirtualRigSettings(plant=plant),
            estimators=estimators,
            has_control=CONTACT_LAW not in estimators,
        )
        for plant, estimators in plants
    ]


def _list_efficiency_cases() -> list[Case]:
    rig = VirtualRigSettings(
        plant=Plant.DYNAMICS,
        contact_time_scatter=0.0,
        amplitude_scatter=0.0,
        asymmetry=0.0,
        digitizer=DigitizerSettings(
            bits=FINEST_BITS, offset=0.0, coupling_frequency=0.0, trigger_jitter=0.0
        ),
    )
    return [
        Case(
            Part.EFFICIENCY,
            axis,
            f"{100 * level:g} %",
            replace(rig, plant=plant),
            hits=1,
            noise_of_peak=level,
            is_exact=True,
            has_control=False,
            estimators=estimators,
            varies_law=plant is Plant.CONTACT,
        )
        for axis, plant, estimators in (
            ("noise of peak", Plant.DYNAMICS, ESTIMATORS),
            ("noise of peak, contact", Plant.CONTACT, (CONTACT_LAW,)),
        )
        for level in NOISE_LEVELS
    ]


def list_cases(part: Part) -> tuple[Case, ...]:
    """Return the cases of a part that simulates campaigns, in the order they are shown."""
    if part is Part.COVERAGE:
        return tuple(_list_coverage_cases())
    if part is Part.EFFICIENCY:
        return tuple(_list_efficiency_cases())
    if part is Part.BIAS:
        return tuple(_list_bias_cases())
    return ()


def find_case(key: str) -> Case:
    """Return the case of a key; raises `ParameterError` for an unknown one."""
    for part in Part:
        for case in list_cases(part):
            if case.key == key:
                return case
    raise ParameterError(f"unknown case {key!r}: the study has no such condition")
