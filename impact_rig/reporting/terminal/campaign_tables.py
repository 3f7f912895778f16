"""Everything that a campaign found, in a terminal."""

from rich.console import Console
from rich.text import Text

from impact_rig.reporting.terminal.console import ALARM, GOOD, TITLE, print_text
from impact_rig.reporting.terminal.model_tables import (
    print_comparison,
    print_free_decays,
    print_identifications,
    print_pulse_shapes,
)
from impact_rig.reporting.terminal.paper_tables import (
    find_largest_differences,
    print_contact_times,
    print_damping,
    print_stiffness,
)
from impact_rig.reporting.terminal.remarks import print_notes, print_rejections, print_warnings
from impact_rig.results.campaign import Results


def print_results(console: Console, results: Results) -> None:
    """Print everything that a campaign found.

    The list of rejected hits, which may be long, comes first: the results stay in sight.

    Parameters
    ----------
    console : Console
        See `make_console`.
    results : Results
        What was found, and the set-up that the expected values come from.

    Raises
    ------
    ParameterError
        If the results name a sample that is not in their set-up.
    """
    print_rejections(console, results)
    print_contact_times(console, results)
    print_stiffness(console, results)
    print_damping(console, results)
    print_comparison(console, results.samples)
    print_pulse_shapes(console, results.samples)
    print_free_decays(console, results.samples)
    print_identifications(console, results.samples)
    print_warnings(console, results.samples)
    print_notes(console, results.samples)
    _print_summary(console, results)


def _print_summary(console: Console, results: Results) -> None:
    count, rejected = len(results.samples), len(results.rejections)
    accepted = sum(sample.impacts_accepted for sample in results.samples)
    print_text(
        console,
        Text.assemble(
            (f"{count} sample{'s' * (count != 1)}, ", TITLE),
            (f"{accepted} hit{'s' * (accepted != 1)} accepted", GOOD if accepted else ALARM),
            (", ", TITLE),
            (f"{rejected} rejected", ALARM if rejected else TITLE),
            (".", TITLE),
        ),
    )
    largest = find_largest_differences(results)
    if largest:
        parts = (f"{symbol} {percent:.2f} %" for symbol, percent in largest.items())
        print_text(console, f"Largest differences: {', '.join(parts)}.")
