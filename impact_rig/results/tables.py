"""Every table of results, once: terminal, report and Rerun set the same tables."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from impact_rig.core.estimates.contact_law import NO_LAW
from impact_rig.core.estimates.paper_method import FREE_DECAY, NO_NUMBERS, HammerEstimate
from impact_rig.core.estimates.pulse_shape import ShapeFit
from impact_rig.core.estimates.sample import SampleEstimate
from impact_rig.core.estimates.speed_exponents import (
    ALL_SAMPLES,
    HERTZ_SPEED_EXPONENTS,
    SPRING_SPEED_EXPONENTS,
    SpeedExponents,
)
from impact_rig.core.given.findings import Note
from impact_rig.core.given.quantity import UNKNOWN, BudgetLine, Quantity, list_fields
from impact_rig.core.hit.momenta import Hold
from impact_rig.core.hit.pulses import PULSE_NAME
from impact_rig.results.campaign import Results
from impact_rig.results.numbers import (
    CONTACT_TIME,
    DAMPING_COEFFICIENT,
    HAMMER_MEASURANDS,
    HAMMER_NAME,
    MEGA,
    ONE_HIT,
    SAMPLE_MEASURANDS,
    SCALES,
    STIFFNESS,
    Measurand,
    format_coverage,
    format_error,
    format_freedom,
    format_number,
    format_quantity,
    format_relative,
    is_beyond_rounding,
)
from impact_rig.results.references import (
    SCATTER_HITS,
    Reference,
    explain_misprint,
    find_expected,
    shows_scatter,
)
from impact_rig.results.table import (
    Column,
    Table,
    list_table,
    make_optional,
    make_table,
    make_text_column,
    read_column,
    read_optional,
)

LARGE_SHARE = 0.2
"""Share of the variance from which a contribution stands in the short list [-], our choice."""
SMALLEST_SHARE = 5e-4
"""Share of the variance below which a contribution is named only [-], our choice."""


APART = "!"
DEVIATION = (
    f"±: 95 %. Δ/U: measured minus expected, over ±; {APART}: beyond 1, where ± does not explain"
    " it."
)


@dataclass(frozen=True)
class _Row:
    """One body of a table."""

    name: str
    body: SampleEstimate | HammerEstimate
    reference: Reference
    unscattered: frozenset[Measurand]  # whose uncertainty lacks what scatters from hit to hit

    @property
    def marked_name(self) -> str:
        """The name with a star where the paper misprints its contact time."""
        return f"{self.name} *" if self.reference.is_misprinted else self.name

    def read(self, quantity: Measurand) -> Quantity:
        """Return what was found; the hammer as a body has no contact time."""
        is_without = self.name == HAMMER_NAME and quantity not in HAMMER_MEASURANDS
        return UNKNOWN if is_without else quantity.read(self.body)

    def compute_deviation(self, quantity: Measurand) -> float:
        """Return the difference from the expected value, over the measured uncertainty.

        NaN: the uncertainty is not known, or not all of it.
        """
        found = self.read(quantity)
        # What is expected is by the paper's definition.
        is_other = getattr(self.body, "paper", NO_NUMBERS).damping_method == FREE_DECAY
        if quantity in self.unscattered or (is_other and quantity is DAMPING_COEFFICIENT):
            return math.nan
        expected = quantity.read_reference(self.reference)
        is_uncertain = is_beyond_rounding(found.expanded, found.value)
        width = found.compute_half_width(expected) if is_uncertain else math.nan
        return (found.value - expected) / width

    def is_apart(self, quantity: Measurand) -> bool:
        """Return whether the uncertainty does not explain the difference from what is expected."""
        return abs(self.compute_deviation(quantity)) > 1.0

    def format(self, quantity: Measurand) -> str:
        """Return what was found, with a mark where it is apart from what is expected."""
        found = self.read(quantity)
        is_lone = found.is_known and getattr(self.body, "impacts_accepted", 0) == 1
        text = quantity.format(found) + ONE_HIT * is_lone
        return f"{text} {APART}" if self.is_apart(quantity) else text


def _make_rows(results: Results, *, with_hammer: bool) -> list[_Row]:
    bodies: list[tuple[str, SampleEstimate | HammerEstimate]] = [
        (sample.name, sample) for sample in results.samples
    ]
    if with_hammer:
        bodies.append((HAMMER_NAME, results.hammer))
    return [_make_row(results, name, body) for name, body in bodies]


def _make_row(results: Results, name: str, body: SampleEstimate | HammerEstimate) -> _Row:
    unscattered = (item for item in SAMPLE_MEASURANDS if not shows_scatter(results, name, item))
    return _Row(name, body, find_expected(results, name), frozenset(unscattered))


def _explain_few_hits(rows: Sequence[_Row], *quantities: Measurand) -> list[str]:
    """Return what is not known of values by few hits; empty where there are none."""
    known = {row.name: [item for item in quantities if row.read(item).is_known] for row in rows}
    found = [row.name for row in rows if row.unscattered.intersection(known[row.name])]
    if not found:
        return []
    is_of_some = len(found) < sum(map(bool, known.values()))
    names = f"{', '.join(found)}: by" if is_of_some else "By"
    few = f"{names} fewer than {SCATTER_HITS} hits: how hits scatter is hardly known"
    return [f"{few}, so ± may be too small (JCGM 101, 6.4.9.4)."]


def _make_deviations(rows: Sequence[_Row], quantity: Measurand) -> Column:
    return Column("Δ/U", [format_number(row.compute_deviation(quantity), 1) for row in rows])


def _mark(rows: Sequence[_Row], quantity: Measurand) -> list[int]:
    """Return the rows whose difference from what is expected exceeds the uncertainty."""
    return [place for place, row in enumerate(rows) if row.is_apart(quantity)]


def tabulate_contact_times(results: Results) -> Table:
    """Return Table 2, with the pulse's width ratio, hits and spread."""
    samples, rejected = results.samples, [item.impacts_rejected for item in results.samples]
    force = "Fmax: largest force on the hammer: measured, or its mass times its peak."
    peaks = "Peaks: scatter of the hammer's peaks."
    rise = "Rise: of the hammer's pulse, from a tenth to nine tenths."
    base = "Above 1 %: time that the hammer's pulse is above a hundredth of its peak."
    columns = [
        read_optional("w50 [µs]", samples, "paper.half_amplitude_width", 2),
        read_optional("Above 1 % [µs]", samples, "paper.base_width", 2, note=base),
        read_optional("w10/w50", samples, "paper.width_ratio", 3),
        read_optional("Spread [µs]", samples, "paper.contact_time_spread", 2),
        make_optional("Hits", [str(item.impacts_accepted) for item in samples]),
        make_optional("Rejected", [str(count) if any(rejected) else "" for count in rejected]),
        read_optional("Fmax [N]", samples, "paper.peak_force", 1, note=force),
        read_optional("Peaks [%]", samples, "paper.hammer_peak_spread_percent", 2, note=peaks),
        read_optional("Rise [µs]", samples, "paper.rise_time", 1, note=rise),
    ]
    note = (
        "w10/w50: width at a tenth of the peak over that at half of it, which differs between"
        " pulse shapes: versed-sine 1.59, Hertz 1.55, half-sine 1.40. Spread:"
        " standard deviation over the hits in the mean."
    )
    return _tabulate_bodies("Table 2. Contact time τp", results, CONTACT_TIME, columns, [note])


def tabulate_stiffness(results: Results) -> list[Table]:
    """Return Table 3, the hammer below the samples; nothing if no stiffness is known."""
    has_equivalent = any(item.paper.equivalent_stiffness.is_known for item in results.samples)
    if not (has_equivalent or _is_known(results, STIFFNESS)):
        return []
    equivalent = [
        format_quantity(item.paper.equivalent_stiffness, 3, MEGA) for item in results.samples
    ]
    notes = []
    if results.hammer.control_sample:
        control = results.hammer.control_sample
        notes.append(f"Hammer: k1 = 2 k_eq of the control sample, {control}.")
        if results.setup.samples.find(control).has_angle:
            notes.append("k2 at another release angle: by k1 at that angle.")
    columns = [make_optional("k_eq [MN/m]", [*equivalent, ""]), _make_hit_column(results)]
    return [_tabulate_bodies("Table 3. Stiffness k", results, STIFFNESS, columns, notes)]


def tabulate_damping(results: Results) -> list[Table]:
    """Return Table 4, and by which method, the hammer below the samples.

    Nothing if no damping is known.
    """
    if not _is_known(results, DAMPING_COEFFICIENT):
        return []
    bodies = (*(sample.paper for sample in results.samples), results.hammer)
    columns = [
        read_optional("ζ", bodies, "damping_ratio", 3),
        read_optional("Δ", bodies, "log_decrement", 3),
        make_optional("By", [*(item.paper.damping_method for item in results.samples), ""]),
        _make_hit_column(results),
    ]
    caption = "Table 4. Damping coefficient c"
    return [_tabulate_bodies(caption, results, DAMPING_COEFFICIENT, columns, [])]


def count_expected(results: Results) -> tuple[int, int]:
    """Return how many values agree with what is expected, within U, and how many do not."""
    rows = _make_rows(results, with_hammer=results.hammer.stiffness.is_known)
    deviations = [row.compute_deviation(item) for row in rows for item in SAMPLE_MEASURANDS]
    found = [abs(item) <= 1.0 for item in deviations if math.isfinite(item)]
    return found.count(True), found.count(False)


def _is_known(results: Results, quantity: Measurand) -> bool:
    return any(quantity.read(body).is_known for body in (*results.samples, results.hammer))


def _make_hit_column(results: Results) -> Column:
    hits = (str(item.impacts_accepted) for item in results.samples)
    return make_optional("Hits", [*hits, ""])


def _tabulate_bodies(
    caption: str,
    results: Results,
    quantity: Measurand,
    more: Sequence[Column],
    notes: Sequence[str],
) -> Table:
    """Return one quantity, expected and measured, of the samples and, if it has it, the hammer."""
    has_hammer = quantity in HAMMER_MEASURANDS and quantity.read(results.hammer).is_known
    rows = _make_rows(results, with_hammer=has_hammer)
    expected = {row.name: quantity.read_reference(row.reference) for row in rows}
    known = [row for row in rows if math.isfinite(expected[row.name])]
    is_whole = all(expected[row.name] * quantity.scale % 1.0 == 0.0 for row in known)
    source = "Paper" if all(row.reference.is_published for row in known) else "Reference"
    columns = [
        make_text_column("Sample", [row.marked_name for row in rows]),
        Column(
            f"{source} [{quantity.unit}]",
            [
                format_number(value * quantity.scale, 0 if is_whole else quantity.digits)
                for value in expected.values()
            ],
        ),
        Column(f"Measured [{quantity.unit}]", [row.format(quantity) for row in rows]),
        _make_deviations(rows, quantity),
        *(replace(column, cells=column.cells[: len(rows)]) for column in more),
    ]
    if quantity is CONTACT_TIME:
        has_deviation = any(math.isfinite(row.compute_deviation(quantity)) for row in rows)
        notes = [*[DEVIATION] * has_deviation, *notes]
    notes = [*_explain_few_hits(rows, quantity), *notes]
    misprints = [
        row.reference.published
        for row in rows
        if row.reference.published and row.reference.is_misprinted
    ]
    if misprints:
        first = "* Its contact time is misprinted in the paper, see Table 2."
        told = map(explain_misprint, misprints) if quantity is CONTACT_TIME else [first]
        notes = [*told, *notes]
    return make_table(caption, columns, notes, _mark(rows, quantity))


def tabulate_summary(results: Results) -> list[Table]:
    """Return tau_p, k and c of every body, with the difference from what is expected."""
    rows = _make_rows(results, with_hammer=results.hammer.stiffness.is_known)
    if not rows:
        return []
    columns = [make_text_column("Sample", [row.marked_name for row in rows])]
    for item in SAMPLE_MEASURANDS:
        columns.append(Column(f"{item.symbol} [{item.unit}]", [row.format(item) for row in rows]))
        columns.append(replace(_make_deviations(rows, item), is_optional=True))
    if not any(row.read(STIFFNESS).is_known for row in rows):
        papers = [getattr(row.body, "paper", NO_NUMBERS) for row in rows]
        columns.append(read_column("k_eq [MN/m]", papers, "equivalent_stiffness", 2))
    # A remark may recommend them in place of those before.
    laws = [
        row.body.contact_law if isinstance(row.body, SampleEstimate) else NO_LAW for row in rows
    ]
    columns += [
        read_column("τ, law [µs]", laws, "duration", 2),
        read_optional("k_eq, law [MN/m]", laws, "equivalent_stiffness", 2),
    ]
    marked = [place for item in SAMPLE_MEASURANDS for place in _mark(rows, item)]
    table = make_table("Contact time, stiffness, damping", columns, (), marked)
    note = "±: 95 %."
    if any(law.is_known for law in laws):
        note += (
            " Law: duration by the contact law, and the linear spring between free bodies with it."
        )
    if any(column.header == "Δ/U" for column in table.columns):
        note += DEVIATION.removeprefix("±: 95 %.")
        if any(row.reference.is_misprinted for row in rows):
            note += " * Its τp is misprinted in the paper, see Table 2."
    return [replace(table, notes=(note, *_explain_few_hits(rows, *SAMPLE_MEASURANDS)))]


def tabulate_results(results: Results) -> list[Table]:
    """Return the tables of a campaign, sample by sample."""
    samples = results.samples
    if not samples:
        return []
    return [
        tabulate_contact_times(results),
        *tabulate_stiffness(results),
        *tabulate_damping(results),
        *tabulate_errors(samples),
        *tabulate_checks(samples),
        *tabulate_speed_exponents(results.speed_exponents),
    ]


def tabulate_checks(samples: Sequence[SampleEstimate]) -> list[Table]:
    """Return what stands beside the paper's numbers: shape, law, free decay."""
    return [
        *tabulate_pulse_shapes(samples),
        *tabulate_contact_laws(samples),
        *tabulate_momenta(samples),
        *tabulate_free_decays(samples),
    ]


def tabulate_errors(samples: Sequence[SampleEstimate]) -> list[Table]:
    """Return how far model and measurement lie apart; nothing if no sample was compared."""
    errors = {
        "MSE hammer [%]": "mse_hammer_percent",
        "MSE sample [%]": "mse_sample_percent",
        "Contact hammer [%]": "contact_error_hammer_percent",
        "Contact sample [%]": "contact_error_sample_percent",
        "Printed hammer [%]": "printed_mse_hammer_percent",
        "Printed sample [%]": "printed_mse_sample_percent",
    }
    columns = [
        make_text_column("Sample", [sample.name for sample in samples]),
        *(
            Column(header, [format_error(getattr(sample.errors, name)) for sample in samples])
            for header, name in errors.items()
        ),
        read_column("Shift hammer [µs]", samples, "errors.shift_hammer", 1),
        read_column("Shift sample [µs]", samples, "errors.shift_sample", 1),
    ]
    note = (
        "MSE: mean square error over the record, with the force of equation (4) alone driving the"
        " sample, traces normalised and shifted as in the paper. Contact: RMS error of the same"
        " over the contact alone, which the MSE is too long to show. Printed: MSE of equations (1)"
        " and (2) as printed. Shift: applied to the model of MSE, later is positive."
    )
    return list_table("Model against measurement", columns, [note])


def tabulate_pulse_shapes(samples: Sequence[SampleEstimate]) -> list[Table]:
    """Return the pulses' shapes, and tau_p and k2 under the best shape."""
    known = [sample for sample in samples if sample.pulse_shape.best_fit is not None]
    shapes = [sample.pulse_shape for sample in known]
    versed = [shape.find_fit(PULSE_NAME) or ShapeFit("") for shape in shapes]
    columns = [
        make_text_column("Sample", [sample.name for sample in known]),
        make_text_column(
            "Best shape",
            [shape.best_shape + ("" if shape.is_clear else " ?") for shape in shapes],
        ),
        read_column("It leaves [%]", shapes, "best_fit.residual_percent", 2),
        read_column("Versed-sine leaves [%]", versed, "residual_percent", 2),
        read_optional("τp, paper [µs]", known, "paper.contact_time", 2),
        read_column("τp, shape [µs]", shapes, "best_fit.contact_time", 2),
        read_optional("k2, paper [MN/m]", known, "paper.stiffness", 2),
        read_column("k2, shape [MN/m]", shapes, "best_fit.stiffness", 2),
        read_optional("Fall/rise", shapes, "fall_over_rise", 3),
    ]
    note = (
        "Shapes fitted to the mean hammer pulse. It leaves: RMS of the rest, over the peak. Paper:"
        " by τp = 2 w50, right for a versed-sine; shape: with the factor of the best shape."
        " ?: the next best fits as well."
    )
    return list_table("Pulse shape of the hammer", columns, [note])


def tabulate_contact_laws(samples: Sequence[SampleEstimate]) -> list[Table]:
    """Return the contact laws with what is to be said of them."""
    known = [sample for sample in samples if sample.contact_law.is_known]
    owners: dict[Note, list[str]] = {}
    for sample in known:
        for item in sample.contact_law.notes:
            owners.setdefault(item, []).append(sample.name)
    remarks = [
        f"{'All samples' if len(names) == len(samples) else ', '.join(names)}: {item.explanation}."
        for item, names in owners.items()
    ]
    laws = [sample.contact_law for sample in known]

    shown = (
        ("n", "exponent", 3),
        ("Duration [µs]", "duration", 2),
        ("e", "restitution", 3),
        ("v [cm/s]", "impact_speed", 2),
        ("Force [N]", "peak_force", 1),
        ("Indentation [µm]", "peak_indentation", 2),
        ("Energy lost [µJ]", "energy_loss", 1),
        ("k_eq [MN/m]", "equivalent_stiffness", 2),
        ("It leaves [%]", "residual_percent", 2),
    )
    columns = [
        make_text_column("Sample", [sample.name for sample in known]),
        *(read_optional(header, laws, name, digits) for header, name, digits in shown),
        make_text_column("Loss", [law.form for law in laws]),
    ]
    note = (
        "F = k δⁿ and a loss between two free bodies, fitted to the mean hammer pulse; n = 3/2 is"
        " Hertz, 1 a linear spring; duration: first touch to separation; e: restitution;"
        " k_eq: of the linear spring with this duration. v, force, indentation and energy go with"
        " the gain of the hammer's channel, within 3 %, standard, where nothing states it."
        " It leaves: RMS of the rest, over the peak."
    )
    return list_table("Contact law", columns, [note, *remarks])


def tabulate_momenta(samples: Sequence[SampleEstimate]) -> list[Table]:
    """Return the checks by momenta, without a contact law."""
    known = [sample for sample in samples if sample.checks.impulse.is_known]
    checks = [sample.checks for sample in known]
    ratio = "m2Δv2/m1Δv1: 1 for free bodies, right masses and gains."
    by_speed = (
        "e, by v1: J / (m_eq v1) - 1, with the hammer's speed v1 as measured at the hits, else as"
        " stated."
    )
    both = "e, both bodies: (Δv1 + Δv2) / v1 - 1."
    columns = [
        make_text_column("Sample", [sample.name for sample in known]),
        read_optional("J [mN s]", checks, "impulse", 2),
        read_column("m2Δv2/m1Δv1", checks, "momentum_ratio", 3, ratio),
        read_column("m2, traces [g]", checks, "traced_mass", 1),
        read_column("m2, stated [g]", checks, "stated_mass", 1),
        read_optional("v1 [cm/s]", checks, "impact_speed", 2),
        read_column("e, by v1", checks, "stated_restitution", 3, by_speed),
        read_optional("e, both bodies", checks, "separation_restitution", 3, both),
        make_text_column("Sample is", [HELD.get(item.hold, "") for item in checks]),
    ]
    note = (
        "By integrating both traces over the contact, whatever its law is. J: impulse."
        " m2: with the accelerometer; on a spring by Newton's law over the contact."
    )
    return list_table("Momenta", columns, [note])


HELD = {Hold.FREE.value: "free", Hold.SPRING.value: "on a spring", Hold.UNCLEAR.value: "neither"}
"""What holds the sample, as it is printed; not known: nothing."""


def tabulate_speed_exponents(
    found: Sequence[SpeedExponents], caption: str = "Contact over impact speed"
) -> list[Table]:
    """Return how the contact goes with the impact speed; nothing without release angles."""
    columns = [
        make_text_column("Sample", [item.sample for item in found]),
        Column("Series", [str(item.series) for item in found]),
        read_column("p of τp, paper", found, "contact_time", 3),
        read_column("p of τ, law", found, "duration", 3),
        read_column("p of Fmax", found, "peak_force", 3),
        read_column("p of e", found, "restitution", 3),
    ]
    hertz, spring = HERTZ_SPEED_EXPONENTS, SPRING_SPEED_EXPONENTS
    note = (
        "Each goes as v^p over the series of a sample's release angles, v by the contact law."
        f" Without loss p is {hertz['duration']:g} of τ and {hertz['peak_force']:g} of Fmax for"
        f" Hertz, {spring['duration']:g} and {spring['peak_force']:g} for a linear spring; a loss"
        " that grows with the speed draws the contact out. ±: by the hits, or by what v^p leaves"
        f" if that is more. {ALL_SAMPLES}: with a constant for each sample."
    )
    return list_table(caption, columns, [note])


def tabulate_free_decays(samples: Sequence[SampleEstimate]) -> list[Table]:
    """Return damping by the free decay after the contact, beside the log decrement's."""
    known = [sample for sample in samples if math.isfinite(sample.free_decay.damping_ratio.value)]
    decays = [sample.free_decay for sample in known]
    columns = [
        make_text_column("Sample", [sample.name for sample in known]),
        read_optional("c2, paper [N s/m]", known, "paper.damping_coefficient", 1),
        read_column("c2, free decay [N s/m]", decays, "damping_coefficient", 1),
        read_optional("ζ, paper", known, "paper.damping_ratio", 3),
        read_column("ζ, free decay", decays, "damping_ratio", 3),
        read_optional("f [kHz]", decays, "frequency", 3),
        read_optional("Periods", decays, "periods", 1),
        read_optional("R²", decays, "r_squared", 4),
    ]
    note = (
        "Paper: from U1, inside the contact, and U2. Free decay: a damped sinusoid fitted to the"
        " sample's trace after the contact; f: its frequency. Periods: what of it stands out of"
        " the noise. R²: part of the tail that the fit explains."
    )
    return list_table("Damping by free decay", columns, [note])


def tabulate_methods(results: Results, sample: SampleEstimate) -> Table:
    """Return one sample's values by each method, with coverage and expected value.

    The control sample's table has the hammer, too.
    """
    reference, hammer = find_expected(results, sample.name), results.hammer
    law, decay = sample.contact_law, sample.free_decay
    others = [
        (CONTACT_TIME, "τ", "contact law", law.duration),
        (STIFFNESS, "k2", "free decay", decay.stiffness),
        # Between both bodies, not of the sample.
        (STIFFNESS, "k_eq", "law's linear spring", law.equivalent_stiffness),
        (DAMPING_COEFFICIENT, "c2", "free decay", decay.damping_coefficient),
    ]
    lines = []
    for item in SAMPLE_MEASURANDS:
        expected = format_number(item.read_reference(reference) * item.scale, item.digits)
        name = f"{item.sample_symbol} [{item.unit}]"
        lines.append((name, "the paper's", item.read(sample), item, expected))
        if item in HAMMER_MEASURANDS and hammer.control_sample == sample.name:
            others.append((item, f"{item.symbol}1", "of the hammer", item.read(hammer)))
        lines += [
            (f"{symbol} [{item.unit}]", method, found, item, "")
            for quantity, symbol, method, found in others
            if quantity is item and found.is_known
        ]
    plain = Measurand("", "", "", 3, "")
    lines += [
        (symbol, method, found, plain, "")
        for symbol, method, found in (
            ("ζ", "log decrement", sample.paper.damping_ratio),
            ("ζ", "free decay", decay.damping_ratio),
            ("e", "contact law", law.restitution),
            ("n", "contact law", law.exponent),
        )
        if found.is_known
    ]
    found = [quantity for _, _, quantity, _, _ in lines]
    columns = [
        make_text_column("", [name for name, *_ in lines]),
        make_text_column("Method", [method for _, method, *_ in lines]),
        Column("Value ± U", [item.format(quantity) for _, _, quantity, item, _ in lines]),
        Column("U [%]", [format_relative(quantity) for quantity in found]),
        Column("k", [format_coverage(quantity) for quantity in found]),
        Column("DoF", [format_freedom(quantity) for quantity in found]),
        Column("Expected", [expected for *_, expected in lines]),
    ]
    notes = _explain_few_hits([_make_row(results, sample.name, sample)], *SAMPLE_MEASURANDS)
    return make_table("By method", columns, notes)


def tabulate_budgets(name: str, body: SampleEstimate | HammerEstimate) -> Iterator[Table]:
    """Yield the uncertainty budgets of a sample or of the hammer, as far as there are any."""
    stated = body.paper if isinstance(body, SampleEstimate) else body
    for field in list_fields(type(stated)):
        quantity = getattr(stated, field.name)
        if not isinstance(quantity, Quantity) or not quantity.budget:
            continue
        unit = field.description.shown or field.description.unit
        scale = SCALES[unit]
        value = format_quantity(quantity, 3, scale)
        caption = f"{name}: {field.description.symbol} = {value} {unit}".rstrip()
        yield tabulate_budget(caption, quantity.budget, unit, scale)


def tabulate_shares(results: Results) -> list[Table]:
    """Return where each uncertainty comes from, in one line a body."""
    bodies = _make_rows(results, with_hammer=True)
    rows = [row for row in bodies if any(row.read(item).budget for item in SAMPLE_MEASURANDS)]
    columns = [make_text_column("Sample", [row.name for row in rows])]
    for item in SAMPLE_MEASURANDS:
        cells = [_describe_shares(row, item) for row in rows]
        columns.append(make_text_column(f"of {item.symbol}", cells))
    note = "Largest parts of the variance [%], down to a fifth of it."
    return list_table("Uncertainty budgets, in short", columns, [note])


def _describe_shares(row: _Row, quantity: Measurand) -> str:
    return ", ".join(
        f"{line.source.removesuffix(f' on {row.name}')} {100.0 * line.share:.0f}"
        for line in row.read(quantity).budget
        if line.share >= LARGE_SHARE
    )


def tabulate_budget(caption: str, budget: Sequence[BudgetLine], unit: str, scale: float) -> Table:
    """Return an uncertainty budget in a unit; what is small is named below it."""
    large = [line for line in budget if line.share >= SMALLEST_SHARE]
    small = [line.source for line in budget if line.share < SMALLEST_SHARE]
    columns = [
        make_text_column("Source", [line.source for line in large]),
        make_text_column("Type", [line.kind for line in large]),
        Column(
            f"u [{unit}]" if unit else "u", [f"{line.contribution * scale:.2g}" for line in large]
        ),
        Column("Share [%]", [f"{100.0 * line.share:.1f}" for line in large]),
    ]
    return make_table(caption, columns, [f"Below 0.05 %: {', '.join(small)}."] if small else [])
