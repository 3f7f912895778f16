"""What a person sees of a running campaign: a progress bar, rejections, questions."""

import math
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import MofNCompleteColumn, TextColumn

from impact_rig.cli.progress_bar import ProgressBar
from impact_rig.configuration.processes import RESULTS_NAME
from impact_rig.core.errors import RigError
from impact_rig.nodes.campaign_client import CampaignClient, CampaignOutcome, CampaignRequest
from impact_rig.reporting.tables import print_results
from impact_rig.reporting.terminal import make_console
from impact_rig.results.results_file import format_json, results_to_json, write_results


class CampaignView(ProgressBar):
    """Follows a campaign on standard error; use it in a ``with`` statement.

    Parameters
    ----------
    console : Console
        Where to draw; without a terminal, one line per sample instead of a bar.
    """

    def __init__(self, console: Console) -> None:
        super().__init__(
            console,
            "starting the rig",
            MofNCompleteColumn(),
            TextColumn("{task.fields[left]}"),
            is_wide=True,
            left="",
        )
        self._sample = ""

    def follow(self, feedback: Any) -> None:
        """Show one feedback of the campaign action."""
        total = feedback.sample_count * feedback.impacts
        done = (feedback.sample_number - 1) * feedback.impacts + feedback.impact
        left = feedback.time_left
        self.update(
            description=f"{feedback.sample}, hit {feedback.impact}/{feedback.impacts}"
            + (f", {feedback.rejected} rejected" if feedback.rejected else ""),
            total=total,
            completed=done,
            left="" if math.isnan(left) else f"{left:.0f} s left",
        )
        if feedback.sample != self._sample:
            self._sample = feedback.sample
            if not self.console.is_terminal:
                self.console.print(
                    f"sample {feedback.sample_number} of {feedback.sample_count}:"
                    f" {feedback.sample}"
                )

    def ask(self, sample: str) -> None:
        """Ask for a sample to be mounted, and wait for the answer."""
        self.hide()
        click.prompt(f"Mount {sample} and press Enter", default="", show_default=False, err=True)
        self.show()


def report_outcome(outcome: CampaignOutcome, folder: Path, *, as_json: bool) -> None:
    """Write results.json into `folder` and print the tables, or the JSON.

    Raises
    ------
    RigError
        If the campaign did not come to its end; what it found is written and printed all the
        same.
    """
    path = folder / RESULTS_NAME
    if outcome.results.samples or outcome.success:
        folder.mkdir(parents=True, exist_ok=True)
        write_results(path, outcome.results)
        if as_json:
            click.echo(format_json(results_to_json(outcome.results)), nl=False)
        elif outcome.setup is not None:
            print_results(make_console(), outcome.results)
        for what, where in (("results", path), ("recording", outcome.recording)):
            if where:
                click.echo(f"{what + ':':10} {where}", err=True)
    if not outcome.success:
        raise RigError(f"the campaign did not end as planned: {outcome.message}")


def run_campaign(
    client: CampaignClient, request: CampaignRequest, view: CampaignView
) -> CampaignOutcome:
    """Run a campaign under a view; Ctrl-C cancels it on the rig before it is passed on."""
    try:
        return client.run(request, follow=view.follow, confirm=view.ask)
    except KeyboardInterrupt:
        client.cancel()
        raise
