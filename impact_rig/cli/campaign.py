"""``impact-rig campaign``: run a campaign on a rig that is up."""

import shlex
import signal
from datetime import datetime
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.progress import ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

from impact_rig.cli import options
from impact_rig.cli.progress_bar import ProgressBar
from impact_rig.configuration.processes import RESULTS_NAME, make_run_folder_name
from impact_rig.core.errors import DeviceError, RigError
from impact_rig.nodes.client import (
    CampaignClient,
    CampaignGoal,
    CampaignOutcome,
    read_newest_campaign,
)
from impact_rig.present.terminal.console import ALARM, GOOD, make_console
from impact_rig.present.terminal.results import print_full, print_screen
from impact_rig.results.numbers import MICRO, format_number
from impact_rig.results.results_file import format_json, results_to_json, write_results


class CampaignView(ProgressBar):
    """Follows a campaign on standard error; use it in a ``with`` statement.

    A rejected hit gets a line that stays, above the bar or in a log, and so does a pause with its
    reason. A log also has a line for each sample.

    Parameters
    ----------
    console : Console
        Where to draw.
    title : str
        What is done until the first sample's turn.
    """

    def __init__(self, console: Console, title: str = "starting the rig") -> None:
        super().__init__(
            console,
            title,
            TextColumn("{task.fields[done]}"),
            _Rejected(),
            TimeRemainingColumn(),
            done="",
            rejected=0,
        )
        self._sample = ""
        self._record = 0
        self._pause = ""

    def follow(self, feedback: Any) -> None:
        """Show one feedback of the campaign action."""
        if feedback.sample != self._sample:
            self._sample = feedback.sample
            if not self.is_drawn:
                self.console.print(
                    f"sample {feedback.sample_number} of {feedback.sample_count}:"
                    f" {feedback.sample}"
                )
        if feedback.last.record not in (0, self._record):
            self._record = feedback.last.record
            self._take_verdict(feedback.last)
        if feedback.message != self._pause:
            self._take_pause(feedback.message)
        total = feedback.sample_count * feedback.impacts
        done = (feedback.sample_number - 1) * feedback.impacts + feedback.impact
        self.update(
            description=_describe_place(feedback) if done < total else "estimating",
            total=total,
            completed=done,
            done=f"{done} of {total}",
            rejected=feedback.rejected,
        )

    def _take_verdict(self, hit: Any) -> None:
        if hit.accepted:
            contact_time = format_number(hit.contact_time * MICRO, 2)
            word, rest, style = "accepted", f"τp {contact_time} µs", GOOD
        else:
            word, rest, style = "rejected", "; ".join(hit.reasons), ALARM
            place = f"{hit.sample}, hit {hit.impact}.{hit.attempt} "
            self.console.print(Text.assemble(place, (word, style), f": {rest}"))
        codes = ", ".join(dict.fromkeys(reason.partition(":")[0] for reason in hit.reasons))
        self.update(
            status=Text.assemble(
                f"last hit, {hit.impact}.{hit.attempt}: ", (word, style), f", {codes or rest}"
            )
        )

    def _take_pause(self, reason: str) -> None:
        """Say why the campaign waits, or that it does not any more."""
        text = Text.assemble(("paused", ALARM), f": {reason}") if reason else Text("it goes on")
        self._pause = reason
        self.console.print(text)
        self.update(status=text)

    def mount(self, sample: str) -> None:
        """Ask for a sample to be mounted, and wait for the answer."""
        self._ask(f"Mount {sample} and press Enter")

    def put_back(self, refusal: str) -> None:
        """Ask for the hammer to be put back, and wait for the answer."""
        if refusal:
            self.console.print(refusal, style=ALARM)
        self._ask("Put the hammer back into its holder and press Enter")

    def let_go(self, sample: str, patience: float) -> None:
        """Say that the hammer may be let go by hand."""
        text = f"Let the hammer go on {sample}, within {patience:g} s"
        if not self.is_drawn:
            self.console.print(text)
        self.update(status=Text(text, GOOD))

    def _ask(self, text: str) -> None:
        self.hide()
        click.prompt(text, default="", show_default=False, err=True)
        self.show()


class _Rejected(ProgressColumn):
    """How many hits were rejected, if any."""

    def render(self, task: Task) -> Text:
        count = task.fields["rejected"]
        return Text(f"{count} rejected", ALARM) if count else Text()


def _describe_place(feedback: Any) -> str:
    # The hits that are counted are accepted ones: the next one is under way.
    return (
        f"{feedback.sample} ({feedback.sample_number} of {feedback.sample_count}),"
        f" hit {min(feedback.impact + 1, feedback.impacts)} of {feedback.impacts}"
    )


def report_outcome(
    outcome: CampaignOutcome, folder: Path, *, is_full: bool, as_json: bool
) -> None:
    """Write results.json into `folder`, print what was found and where the files are.

    Raises
    ------
    RigError
        If the campaign did not come to its end; what it found is written and printed first.
    """
    path = folder / RESULTS_NAME
    if outcome.results is not None and (outcome.results.samples or outcome.success):
        folder.mkdir(parents=True, exist_ok=True)
        write_results(path, outcome.results)
        if as_json:
            click.echo(format_json(results_to_json(outcome.results)), nl=False)
        elif is_full:
            print_full(make_console(), outcome.results)
        else:
            print_screen(make_console(), outcome.results)
        recording = Path(outcome.recording) if outcome.recording else None
        options.print_places(results=path, recording=recording)
    if not outcome.success:
        raise RigError(
            f"the campaign did not end as planned: {outcome.message}; {advise_resuming(folder)}"
        )


def advise_resuming(folder: Path) -> str:
    """Return the one command that goes on with a campaign."""
    return f"to go on: impact-rig campaign --resume {shlex.quote(str(folder))}"


def run_campaign(
    client: CampaignClient, goal: CampaignGoal, view: CampaignView
) -> CampaignOutcome:
    """Run a campaign under a view; Ctrl-C, or no more answers, cancels it on the rig first.

    So do SIGTERM and a terminal that is closed: nobody attends the hammer any more.
    """
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, signal.default_int_handler)
    try:
        return client.run(goal, view)
    except (KeyboardInterrupt, click.Abort):
        client.cancel()
        if folder := client.run_folder:
            click.echo(f"stopped; {advise_resuming(folder)}", err=True)
        raise
    except DeviceError as error:
        if folder := client.run_folder:
            raise DeviceError(f"{error}; {advise_resuming(folder)}") from None
        raise


LOOKING = "looking for the rig"
RIG_TIMEOUT = 30.0
"""How long the rig may take to be found [s], our choice: three times what a start takes on a busy
machine, most of which is six Python processes that load their libraries: 4 s of computing."""


@click.command(
    epilog="""
    \b
    Examples:
      impact-rig campaign                      the whole set, 10 hits each
      impact-rig campaign --samples "steel small" --impacts 5
      impact-rig campaign --angles 5,10,20     from each of these release angles
      impact-rig campaign --impacts 12 --keep 10    the ten most consistent of twelve
      impact-rig campaign --notes "new tip, 21 °C"
      impact-rig campaign --resume runs/2026-11-23T15-00-00    go on with a campaign
      impact-rig campaign --namespace rig1 --network    a rig on another host
    """
)
@options.samples_option
@options.impacts_option
@options.angles_option
@options.keep_option
@click.option(
    "--attempts",
    type=click.IntRange(1),
    help="Rejected hits in a row before giving up. [the rig's own limit]",
)
@click.option(
    "--ask/--no-ask",
    default=None,
    help="Wait until each sample is mounted. [yes, unless the hits are simulated]",
)
@click.option(
    "--notes", default="", metavar="TEXT", help="What the recording should say of this campaign."
)
@options.resume_option
@options.namespace_option
@options.network_option
@click.option(
    "--output",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for results.json. [that of the recording, if it is on this host]",
)
@options.full_option
@options.json_option
def command(
    samples: tuple[str, ...],
    impacts: int,
    angles: tuple[float, ...],
    keep: int,
    attempts: int | None,
    ask: bool | None,
    notes: str,
    resume: Path | None,
    namespace: str,
    network: bool,
    output: Path | None,
    is_full: bool,
    as_json: bool,
) -> None:
    """Run a campaign on a rig that is up, here or on another host.

    The rig's campaign node does the work; this command starts it, follows it, and asks for the
    next sample to be mounted, and for the hammer to be put back where nothing else does that.
    When a device is lost, the campaign pauses, says why, and goes on when it is back and a person
    has armed the hammer: see `impact-rig hammer`. What ended early goes on with --resume, on a
    rig that was started with the same.
    """
    from impact_rig.present.terminal.console import make_console

    options.check_keep(keep, impacts)
    options.set_discovery(network=network)
    resumed = read_newest_campaign(resume) if resume else None
    console = make_console(stderr=True)
    with CampaignClient(namespace) as client, CampaignView(console, LOOKING) as view:
        client.wait_for_rig(RIG_TIMEOUT)
        if notes:
            client.publish_note(notes, RIG_TIMEOUT)
        confirm = not client.is_hammerless if ask is None else ask
        goal = CampaignGoal(
            samples=samples, impacts=impacts, attempts_per_impact=attempts or 0,
            confirm_samples=confirm, keep_hits=keep, release_angles=angles,
        )  # fmt: skip
        if resume and resumed is not None:
            client.check_run(resume)
            goal.resumed = resumed
        outcome = run_campaign(client, goal, view)
    recorded = Path(outcome.recording) if outcome.recording else None
    output = output or resume
    if output is None:
        is_here = recorded is not None and recorded.exists()
        output = (
            recorded.parent
            if recorded is not None and is_here
            else Path(make_run_folder_name(datetime.now().astimezone()))
        )
    report_outcome(outcome, output, is_full=is_full, as_json=as_json)
