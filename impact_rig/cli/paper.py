"""`impact-rig paper`: the arithmetic of the paper, printed beside computed."""

import click
from rich.console import Console

from impact_rig.cli import options
from impact_rig.core.estimation.size_exponent import HERTZ_EXPONENT, SPRING_EXPONENT
from impact_rig.core.setup.paper import ACCELEROMETER_MASS
from impact_rig.present.terminal.console import ALARM, make_console, print_table, print_text
from impact_rig.results.numbers import format_number
from impact_rig.results.paper_arithmetic import (
    CellArithmetic,
    HammerArithmetic,
    PaperArithmetic,
    SizeArithmetic,
    compute_paper,
)
from impact_rig.results.results_file import format_json
from impact_rig.results.tables import Column
from impact_rig.results.wire import to_json

MISPRINT_MARK = "*"


@click.command(
    "paper",
    epilog="""
    \b
    Examples:
      impact-rig paper
      impact-rig paper --json | python3 -m json.tool
    """,
)
@options.json_option
def command(as_json: bool) -> None:
    """Check the arithmetic of the paper.

    Computes the stiffness of all twelve samples (Table 3) from their masses (Table 1) and
    contact times (Table 2) by equations (5) and (6), and what the damping coefficients of Table 4
    mean. Printed value, computed value, difference; the misprint is marked. And how the contact
    times go with the mass, which tells a Hertz contact from a linear spring.
    """
    paper = compute_paper()
    if as_json:
        click.echo(format_json(to_json(paper)), nl=False)
        return
    console = make_console()
    _print_stiffness(console, paper)
    _print_damping(console, paper)
    _print_sizes(console, paper)
    _print_facts(console, paper)
    _print_agreement(console, paper)


def _print_stiffness(console: Console, paper: PaperArithmetic) -> None:
    rows, notes = [], []
    for sample in paper.samples:
        printed = format_number(sample.printed_stiffness_n_per_m / 1e6, 2)
        rows.append(
            (
                f"{sample.name} {MISPRINT_MARK}" if sample.is_misprinted else sample.name,
                format_number(sample.moving_mass_kg * 1e3, 2),
                format_number(sample.printed_contact_time_s * 1e6, 2),
                printed,
                format_number(sample.computed_stiffness_n_per_m / 1e6, 2),
                f"{sample.difference_percent:+z.2f}",
            )
        )
        if sample.is_misprinted:
            rows.append(
                (
                    "  corrected",
                    "",
                    format_number(sample.corrected_contact_time_s * 1e6, 2),
                    printed,
                    format_number(sample.corrected_stiffness_n_per_m / 1e6, 2),
                    f"{sample.corrected_difference_percent:+z.2f}",
                )
            )
            notes.append(
                f"{MISPRINT_MARK} misprint in Table 2:"
                f" {sample.printed_contact_time_s * 1e6:.2f} µs would give"
                f" {sample.computed_stiffness_n_per_m / 1e6:.1f} MN/m;"
                f" {sample.corrected_contact_time_s * 1e6:.1f} µs agrees with Table 3."
            )
    hammer = paper.hammer
    rows.append(
        (
            "hammer k1",
            "",
            "",
            format_number(hammer.printed_stiffness_n_per_m / 1e6, 2),
            format_number(hammer.computed_stiffness_n_per_m / 1e6, 2),
            f"{hammer.difference_percent:+z.2f}",
        )
    )
    notes.append(f"k1 = 2 k_eq of {hammer.control_sample}; k2 uses the printed k1.")
    headers = ("Sample", "m2 [g]", "τp [µs]", "printed", "computed", "Diff. %")
    # The misprint is marked by its star, and by the size of its difference.
    styles = [ALARM if row[0].endswith(MISPRINT_MARK) else "" for row in rows]
    columns = [
        Column(header, cells, is_text=index == 0, styles=styles)
        for index, (header, cells) in enumerate(zip(headers, zip(*rows, strict=True), strict=True))
    ]
    print_table(console, "Table 3 from Tables 1 and 2. Stiffness k2 [MN/m]", columns, notes)


def _print_damping(console: Console, paper: PaperArithmetic) -> None:
    bodies: list[CellArithmetic | HammerArithmetic] = [*paper.samples, paper.hammer]
    columns = [
        Column("Sample", [*(sample.name for sample in paper.samples), "hammer"], is_text=True),
        Column("c [N s/m]", [f"{body.damping_coefficient_n_s_per_m:.0f}" for body in bodies]),
        Column("k [MN/m]", [f"{body.printed_stiffness_n_per_m / 1e6:.2f}" for body in bodies]),
        Column("ζ", [format_number(body.damping.damping_ratio, 3) for body in bodies]),
        Column("Δ", [format_number(body.damping.log_decrement, 3) for body in bodies]),
        Column("U1/U2", [format_number(body.damping.peak_ratio, 1) for body in bodies]),
    ]
    note = (
        "ζ = c / (2 √(k m)); Δ = ln(U1/U2) = 2π ζ / √(1 - ζ²). Equation (7b) prints a minus under"
        " the root where this needs a plus."
    )
    print_table(console, "What Table 4 means", columns, (note,))


def _print_sizes(console: Console, paper: PaperArithmetic) -> None:
    sizes, every = paper.sizes, paper.sizes[-1]
    columns = [
        Column("Material", [size.material or "all" for size in sizes], is_text=True),
        Column("p", [format_number(size.exponent.value, 3) for size in sizes]),
        Column("u(p)", [format_number(size.exponent.standard, 3) for size in sizes]),
        Column("leaves\n[%]", [format_number(size.residual_percent, 1) for size in sizes]),
        Column(
            "p = 2/5\nleaves [%]",
            [format_number(size.hertz_residual_percent, 1) for size in sizes],
        ),
        Column(
            "p = 1/2\nleaves [%]",
            [format_number(size.spring_residual_percent, 1) for size in sizes],
        ),
    ]
    how = (
        "Misprint corrected; one constant C for each material; u(p): standard uncertainty; leaves:"
        " RMS of the contact times' deviations."
    )
    meaning = (
        "p = 2/5 is a Hertz contact, p = 1/2 a linear spring whose stiffness does not depend on"
        f" the size. All: {_count_away(every, HERTZ_EXPONENT)} standard uncertainties from 2/5,"
        f" {_count_away(every, SPRING_EXPONENT)} from 1/2."
    )
    print_table(console, "Table 2 over the masses: τp = C m_eq^p", columns, (how, meaning))


def _count_away(size: SizeArithmetic, exponent: float) -> str:
    return format_number(abs(size.exponent.value - exponent) / size.exponent.standard, 1)


def _print_facts(console: Console, paper: PaperArithmetic) -> None:
    worst = max(
        (sample for sample in paper.samples if not sample.is_misprinted),
        key=lambda sample: abs(sample.without_accelerometer_percent),
    )
    speed = paper.speed
    print_text(
        console,
        f"m2 includes the accelerometer of {ACCELEROMETER_MASS * 1e3:g} g: without it"
        f" {worst.name} would be off by {worst.without_accelerometer_percent:+.1f} %.",
    )
    print_text(
        console,
        "Impact speed: 3.7° in 207 ms is"
        f" {speed.computed_angular_speed_rad_per_s:.3f} rad/s, so"
        f" {speed.computed_speed_m_per_s * 100:.2f} cm/s; the paper prints"
        f" {speed.printed_angular_speed_rad_per_s:g} rad/s and"
        f" {speed.printed_speed_m_per_s * 100:.2f} cm/s, which is the default here.",
    )
    console.print()


def _print_agreement(console: Console, paper: PaperArithmetic) -> None:
    print_text(
        console,
        f"Table 3 agrees within 0.1 % in {paper.cells_within_0_1_percent} of"
        f" {len(paper.samples)} cells, within 0.5 % in {paper.cells_within_0_5_percent};"
        f" misprinted: {', '.join(paper.misprinted)}.",
    )
