"""What results are held against: references, of which some cells are misprints, and limits."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from impact_rig.core.given.findings import Subject
from impact_rig.core.given.quantity import Comparable, Conformity, Quantity
from impact_rig.core.given.records import SIMULATED, Origin
from impact_rig.core.given.setup import (
    HAMMER_DAMPING_COEFFICIENT,
    HAMMER_STIFFNESS,
    MISPRINTS,
    PAPER_SETUP,
    Sample,
)
from impact_rig.results.campaign import Results
from impact_rig.results.numbers import (
    CONTACT_TIME,
    HAMMER_NAME,
    SAMPLE_MEASURANDS,
    Measurand,
    format_number,
)
from impact_rig.results.table import Column, Table, list_table, make_text_column

MASS_TOLERANCE = 1e-9
"""How alike the masses of a sample and of the paper's are [kg]: unit conversion, nothing more."""


@dataclass(frozen=True)
class Reference(Comparable):
    """Expected values of a body; NaN: none."""

    contact_time: float = math.nan  # tau_p [s]
    stiffness: float = math.nan  # k [N/m]
    damping_coefficient: float = math.nan  # c [N s/m]
    published: Sample | None = None  # the cell of the paper that these are from
    is_published: bool = False  # these values are the paper's

    @property
    def is_misprinted(self) -> bool:
        """Whether the paper prints another contact time than the one held against."""
        return self.published is not None and self.published.name in MISPRINTS


@dataclass(frozen=True)
class PlantTruth:
    """Truth of a plant of the virtual rig by construction."""

    description: str
    has_expected_values: bool = True  # those of the set-up are its own
    has_damping: bool = True  # the sample rings after the contact
    explained: frozenset[Subject] = frozenset()  # of the notes that the description makes needless


PLANTS = {
    "virtual rig, plant published": PlantTruth(
        "Bodies made from the paper's tables: agreement tests the software, not the paper."
        " Their pulse is the paper's versed-sine, which no contact law makes, and each hangs on"
        " its spring.",
        explained=frozenset({Subject.CONTACT_LAW, Subject.MOMENTA}),
    ),
    "virtual rig, plant dynamics": PlantTruth(
        "Equations (1) and (2), the sample driven by the force alone, k and c of the paper."
    ),
    "virtual rig, plant dynamics_printed": PlantTruth(
        "Equations (1) and (2) as printed, k and c of the paper."
    ),
    "virtual rig, plant contact": PlantTruth(
        "A contact law with loss between free bodies: no published values, and since nothing"
        " rings after the contact no damping c and no free decay.",
        explained=frozenset({Subject.C1, Subject.C2, Subject.FREE_DECAY}),
        has_expected_values=False,
        has_damping=False,
    ),
}
"""By the source of their hits."""


def find_plant(origin: Origin) -> PlantTruth | None:
    """Return the plant that all hits of an origin come from."""
    return PLANTS.get(origin.source) if origin.kind == SIMULATED else None


def find_expected(results: Results, name: str) -> Reference:
    """Return the expected values of a sample or the hammer: the paper's, or the set-up's.

    The hammer's is that of its control sample, which is alike. Nothing is expected where the plant
    has other values, nor at a sample's own release angle: values hold for the rig's impact speed.

    Raises
    ------
    ParameterError
        If the set-up has no such sample.
    """
    plant = find_plant(results.origin)
    samples = results.setup.samples
    body = samples.control_sample if name == HAMMER_NAME else name
    if not body or (plant is not None and not plant.has_expected_values):
        return Reference()
    sample = samples.find(body)
    if sample.has_angle:
        return Reference()
    published = next(filter(partial(_is_published, sample), PAPER_SETUP.samples.samples), None)
    if name != HAMMER_NAME:
        return Reference(
            contact_time=sample.reference_contact_time,
            stiffness=sample.reference_stiffness,
            damping_coefficient=sample.reference_damping_coefficient,
            published=published,
            is_published=published is not None,
        )
    if published is None:
        return Reference(stiffness=sample.reference_stiffness)
    return Reference(
        stiffness=HAMMER_STIFFNESS,
        damping_coefficient=HAMMER_DAMPING_COEFFICIENT,
        is_published=True,
    )


SCATTER_HITS = 4
"""Hits from which the t-distribution of their mean has a standard deviation (JCGM 101, 6.4.9.4):
fewer that lie near each other by chance show almost no scatter."""


def shows_scatter(results: Results, name: str, quantity: Measurand) -> bool:
    """Return whether what scatters from hit to hit is in the uncertainty of a value.

    It takes four hits and, for k and c, four on the control sample.
    """
    samples, needed = results.setup.samples, {name}
    # k1 may be that of an earlier control experiment.
    needs_control = quantity is not CONTACT_TIME and math.isnan(results.setup.hammer_stiffness)
    if needs_control and samples.control_sample:
        angle = math.nan if name == HAMMER_NAME else samples.find(name).release_angle
        needed.add(samples.find_control(angle))
    return all(
        sample.impacts_accepted >= SCATTER_HITS
        for sample in results.samples
        if sample.name in needed
    )


def _is_published(sample: Sample, cell: Sample) -> bool:
    """Return whether a sample is the paper's: same name, mass and contact time."""
    return (
        cell.name == sample.name
        and abs(cell.mass - sample.mass) <= MASS_TOLERANCE
        and math.isclose(cell.reference_contact_time, sample.reference_contact_time)
    )


def explain_misprint(cell: Sample) -> str:
    """Return the footnote of a misprinted cell."""
    return (
        f"* Table 2 of the paper prints {MISPRINTS[cell.name] * 1e6:.2f} µs for {cell.name},"
        f" a misprint: the masses and {cell.reference_stiffness / 1e6:.2f} MN/m in Table 3 need"
        f" {cell.reference_contact_time * 1e6:.1f} µs, which stands here instead."
    )


Limits = Mapping[str, tuple[float, float]]
"""Smallest and largest value of a quantity, by its field [SI units]; infinite: there is none."""
DECISION_RULE = (
    "Decision rule: non-binary statement with the guard band U (ILAC-G8:09/2019, 4.2.3). Passed:"
    " the interval of 95 % lies within the limits; failed: outside; each is wrong with a"
    " probability of 2.5 % at most for each limit. Undecided: a limit lies in it (conditional pass"
    " or conditional fail), or the value is not known, or of fewer than four hits."
)


@dataclass(frozen=True)
class JudgedValue:
    """A value of a sample with its limits."""

    sample: str
    quantity: Measurand
    found: Quantity
    low: float  # [SI unit]; infinite: there is none
    high: float
    has_scatter: bool = True  # of hits, in the uncertainty
    method: str = "versed-sine"  # that it is by

    @property
    def conformity(self) -> Conformity:
        """Statement of conformity, with the expanded uncertainty as guard band."""
        if not self.has_scatter:
            return Conformity.UNDECIDED
        return self.found.judge(self.low, self.high)

    @property
    def statement(self) -> str:
        """The conformity, with the reason where no limit decides it."""
        reason = ""
        if not self.found.is_known:
            reason = ": not determined"
        elif not self.has_scatter:
            reason = f": fewer than {SCATTER_HITS} hits"
        return f"{self.conformity.value}{reason}"


def judge_values(results: Results, limits: Mapping[str, Limits]) -> list[JudgedValue]:
    """Return the values that have limits, by the names of the samples without release angles."""
    return [
        JudgedValue(
            sample.name,
            item,
            item.read(sample),
            *stated[item.field],
            shows_scatter(results, sample.name, item),
            item.find_method(sample),
        )
        for sample in results.samples
        if (stated := limits.get(results.setup.samples.find(sample.name).body, {}))
        for item in SAMPLE_MEASURANDS
        if item.field in stated
    ]


def tabulate_conformity(values: Sequence[JudgedValue]) -> list[Table]:
    """Return the statements of conformity with their rule; nothing without limits."""
    columns = [
        make_text_column("Sample", [item.sample for item in values]),
        make_text_column(
            "Quantity",
            [f"{item.quantity.sample_symbol} [{item.quantity.unit}]" for item in values],
        ),
        make_text_column("Method", [item.method for item in values]),
        Column("Minimum", [_format_limit(item, item.low) for item in values]),
        Column("Measured", [item.quantity.format(item.found) for item in values]),
        Column("Maximum", [_format_limit(item, item.high) for item in values]),
        make_text_column("Statement", [item.statement for item in values]),
    ]
    marked = [
        place for place, item in enumerate(values) if item.conformity is not Conformity.PASSED
    ]
    return list_table("Conformity with the limits", columns, [DECISION_RULE], marked)


def _format_limit(item: JudgedValue, value: float) -> str:
    return format_number(value * item.quantity.scale, item.quantity.digits)
