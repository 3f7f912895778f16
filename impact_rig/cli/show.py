"""Results as commands print them."""

from collections.abc import Sequence
from pathlib import Path

from impact_rig.cli.output import print_json
from impact_rig.present.console import make_console, print_warning
from impact_rig.present.screen import print_full, print_screen
from impact_rig.results.campaign import Results
from impact_rig.results.results_file import results_to_json


def show_results(
    path: Path,
    found: Sequence[Results],
    warnings: Sequence[str] = (),
    *,
    is_full: bool,
    as_json: bool,
) -> None:
    """Print the results of each campaign of a file, as tables or as JSON."""
    if as_json:
        for warning in warnings:
            print_warning(warning)
        contents = [results_to_json(results) for results in found]
        if contents:
            print_json(contents if len(found) > 1 else contents[0])
        return
    console = make_console()
    show = print_full if is_full else print_screen
    for number, results in enumerate(found, start=1):
        if len(found) > 1:
            console.print(f"{path}, campaign {number}\n", style="bold underline")
        show(console, results, warnings)
