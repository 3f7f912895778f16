"""Everything that a campaign found, in a terminal."""

from rich.console import Console

from impact_rig.core.setup.samples import SampleSet
from impact_rig.reporting.model_tables import (
    print_comparison,
    print_free_decays,
    print_identifications,
    print_pulse_shapes,
)
from impact_rig.reporting.paper_tables import (
    find_largest_differences,
    print_contact_times,
    print_damping,
    print_stiffness,
)
from impact_rig.reporting.remarks import print_notes, print_rejections, print_warnings
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
    samples = results.setup.to_samples()
    print_rejections(console, results)
    print_contact_times(console, results.samples, samples)
    print_stiffness(console, results, samples)
    print_damping(console, results, samples)
    print_comparison(console, results.samples)
    print_pulse_shapes(console, results.samples)
    print_free_decays(console, results.samples)
    print_identifications(console, results.samples)
    print_warnings(console, results.samples)
    print_notes(console, results.samples)
    _print_summary(console, results, samples)


def _print_summary(console: Console, results: Results, samples: SampleSet) -> None:
    count = len(results.samples)
    accepted = sum(sample.impacts_accepted for sample in results.samples)
    console.print(
        f"{count} sample{'s' * (count != 1)}, {accepted} hit{'s' * (accepted != 1)} accepted,"
        f" {len(results.rejections)} rejected."
    )
    largest = find_largest_differences(results.samples, samples)
    if largest:
        parts = (f"{symbol} {percent:.2f} %" for symbol, percent in largest.items())
        console.print(f"Largest differences: {', '.join(parts)}.")
