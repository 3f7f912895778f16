"""``impact-rig campaign``: run a campaign on a rig that is up."""

import math
import shlex
import signal
import sys
from pathlib import Path
from typing import Self

import click
from rich.text import Text

from impact_rig.cli import options
from impact_rig.cli.output import make_progress, print_places, show_results
from impact_rig.configuration.processes import RESULTS_NAME, choose_run_folder
from impact_rig.core.given.errors import DeviceError, RigError
from impact_rig.core.given.findings import join_findings
from impact_rig.nodes.campaign_client import CampaignClient, CampaignGoal, CampaignOutcome
from impact_rig.nodes.campaign_plan import read_newest_campaign
from impact_rig.page.view import list_numbers
from impact_rig.present.console import ALARM
from impact_rig.recordings.source import list_parts
from impact_rig.results.campaign import HitResults
from impact_rig.results.results_file import write_results
from impact_rig.status.rig_status import RigStatus
from impact_rig.status.states import CampaignStatus


class CampaignView:
    """Follows a campaign on standard error; use it in a ``with`` statement.

    Each hit gets a line that stays, and so does a pause with its reason. A log, which has no bar,
    also gets a line for each sample.
    """

    def __init__(self) -> None:
        self._progress = make_progress()
        self._task = self._progress.add_task("looking for the rig", total=None)
        self._sample = ""
        self._record = 0
        self._pause = ""
        self._silent: tuple[str, ...] = ()

    def __enter__(self) -> Self:
        """Begin to draw."""
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Take the bar away."""
        self._progress.stop()

    def follow(self, rig: RigStatus) -> None:
        """Show what the campaign does now."""
        campaign, hit = rig.campaign, rig.last_hit
        names = [count.sample for count in campaign.counts]
        number = names.index(campaign.sample) if campaign.sample in names else 0
        place = f"sample {number + 1} of {len(names)}: {campaign.sample}"
        if campaign.sample != self._sample:
            self._sample = campaign.sample
            if self._progress.disable:
                self._print(place)
        if hit is not None and hit.record != self._record:
            self._record = hit.record
            self._print(_describe_hit(rig, hit))
        self._follow_pause(campaign)
        silent = rig.list_silent()[:1]
        if silent and silent != self._silent:
            self._print(Text(f"the {silent[0]} does not answer: keep away", ALARM))
        self._silent = silent
        # Accepted hits are counted: the next one is under way.
        total, accepted = len(names) * campaign.impacts, campaign.progress.accepted
        done = number * campaign.impacts + min(accepted, campaign.impacts)
        next_hit = min(accepted + 1, campaign.impacts)
        text = f"{place}, hit {next_hit} of {campaign.impacts}" if done < total else "estimating"
        if rejected := sum(count.rejected for count in campaign.counts):
            text += f", {rejected} rejected"
        self._progress.update(self._task, description=text, total=total, completed=done)

    def _follow_pause(self, campaign: CampaignStatus) -> None:
        """Say that the campaign pauses, or that it goes on."""
        if campaign.is_looking or not campaign.is_running:
            return
        pause = campaign.message if campaign.is_paused else ""
        if pause and pause != self._pause:
            self._print(Text.assemble(("paused", ALARM), f": {pause}"))
        elif self._pause and not pause:
            self._print("the campaign goes on")
        self._pause = pause

    def mount(self, sample: str, further: str) -> None:
        """Ask for a sample to be mounted, and wait for the answer."""
        self._ask(", ".join([f"Mount {sample}", *[further] * bool(further), "and press Enter"]))

    def put_back(self, refusal: str) -> None:
        """Ask for the hammer to be put back, and wait for the answer."""
        if refusal:
            self._print(Text(refusal, ALARM))
        self._ask("Put the hammer back into its holder and press Enter")

    def let_go(self, sample: str, patience: float) -> None:
        """Ask for the hammer to be released by hand."""
        self._print(f"Release the hammer on {sample}, within {patience:g} s")

    def hold_back(self, reason: str) -> None:
        """Withdraw the request to release the hammer by hand."""
        self._print(Text(f"STOP: do not release the hammer: {reason}", ALARM))

    def stay(self, text: str) -> None:
        """Show why the program goes on though the campaign is over."""
        self._progress.stop()
        self._print(text)

    def _print(self, text: str | Text) -> None:
        self._progress.console.print(text)

    def _ask(self, text: str) -> None:
        self._progress.stop()
        click.prompt(text, default="", show_default=False, err=True)
        self._progress.start()


def _describe_hit(rig: RigStatus, hit: HitResults) -> Text:
    """Return a hit as a line: a good one in numbers, another with its reasons."""
    place = f"{hit.sample}, hit {hit.impact}.{hit.attempt} "
    if not hit.accepted:
        return Text.assemble(place, ("rejected", ALARM), f": {join_findings(hit.reasons)}")
    numbers = ", ".join(f"{name} {text}" for name, text in list_numbers(rig, hit))
    return Text(f"{place}accepted: {numbers}")


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
    if outcome.results.samples or outcome.success:
        folder.mkdir(parents=True, exist_ok=True)
        write_results(path, outcome.results)
        show_results(path, [outcome.results], is_full=is_full, as_json=as_json)
        recording = Path(outcome.recording) if outcome.recording else None
        if recording is not None and len(list_parts(recording)) > 1:
            recording = recording.parent  # the run was resumed
        print_places(results=path, recording=recording)
    if not outcome.success:
        recorded = Path(outcome.recording).parent if outcome.recording else folder
        raise RigError(
            f"the campaign did not end as planned: {outcome.message}; {advise_resuming(recorded)}"
        )


def advise_resuming(folder: Path) -> str:
    """Return the commands that go on with a campaign; the demo's rig has ended with it."""
    run = shlex.quote(str(folder))
    return (
        f"to go on: impact-rig up --resume {run}, unless this rig is up, then"
        f" impact-rig campaign --resume {run}"
    )


UNATTENDED_PAUSE = 10.0  # [s] after which an unattended campaign ends


def run_campaign(
    client: CampaignClient, goal: CampaignGoal, view: CampaignView, *, is_attended: bool
) -> CampaignOutcome:
    """Run a campaign under a view.

    Ctrl-C, SIGTERM and a closed terminal cancel it on the rig, and so does a pause that only a
    person can end, if the campaign is unattended.
    """
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is signal.SIG_DFL:
            signal.signal(number, signal.default_int_handler)
    try:
        return client.run(goal, view, math.inf if is_attended else UNATTENDED_PAUSE)
    except (KeyboardInterrupt, click.Abort):
        client.cancel()
        if folder := client.run_folder:
            click.echo(f"stopped; {advise_resuming(folder)}", err=True)
        raise
    except DeviceError as error:
        if folder := client.run_folder:
            raise DeviceError(f"{error}; {advise_resuming(folder)}") from None
        raise


RIG_TIMEOUT = 7.0  # [s] to find a rig that is up


def run(
    samples: tuple[str, ...],
    impacts: int,
    angles: tuple[float, ...],
    ask: bool | None,
    check_mass: float,
    notes: str,
    resume: Path | None,
    wait: float | None,
    namespace: str,
    network: bool,
    output: Path | None,
    is_full: bool,
    as_json: bool,
) -> None:
    """Run the command; its options are declared in `commands.py`."""
    options.set_discovery(network=network)
    resumed = read_newest_campaign(resume) if resume else None
    with CampaignClient(namespace) as client, CampaignView() as view:
        client.wait_for_rig(RIG_TIMEOUT if wait is None else wait)
        if notes:
            client.publish_note(notes, RIG_TIMEOUT)
        confirm = not client.is_simulated if ask is None else ask
        goal = CampaignGoal(
            samples=samples, impacts=impacts, confirm_samples=confirm, release_angles=angles,
            check_mass=check_mass,
        )  # fmt: skip
        if resume and resumed is not None:
            client.check_run(resume)
            goal.resumed = resumed
        is_attended = sys.stdin.isatty() or sys.stderr.isatty()
        outcome = run_campaign(client, goal, view, is_attended=is_attended)
    recorded = Path(outcome.recording) if outcome.recording else None
    folder = output or resume
    if folder is None and recorded is not None and recorded.exists():
        folder = recorded.parent
    report_outcome(outcome, choose_run_folder(folder), is_full=is_full, as_json=as_json)
