"""A rig of real nodes, for tests of programs that talk to one."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Unpack

from impact_rig.analysis.sources import list_items
from impact_rig.api import VirtualRig
from impact_rig.cli.libraries import explain_missing
from impact_rig.configuration.processes import LOG_NAME, RECORDING_NAME, list_rig_processes
from impact_rig.configuration.rig_file import load_rig_file
from impact_rig.core.given.errors import ParameterError, RigError, check_count
from impact_rig.core.given.records import HitLabel, Truth
from impact_rig.devices.drivers import VIRTUAL, read_driver_name
from impact_rig.devices.source_table import read_source_keys
from impact_rig.devices.virtual.choices import SourceKeys
from impact_rig.nodes.discovery import use_own_domain
from impact_rig.present.printed_results import Results
from impact_rig.results.campaign import HitResults
from impact_rig.results.traces import TracedCampaign

START_TIMEOUT = 90.0
"""In which the nodes start [s]: two or three, more on a busy computer."""
END_TIMEOUT = 20.0
"""In which a campaign ends that a test before has left [s]."""
ATTEMPTS = 50
"""Rejected hits in a row that end a campaign, our choice: with faults half the hits are bad."""
QUICK = {"hammer": {"swing_time": 0.01}, "accelerometer": {"trigger_timeout": 0.1}}
"""Parameters of the nodes: a fast swing, a short wait for missed triggers."""


@dataclass(frozen=True)
class RunningRig:
    """Nodes of a rig that is up, each a process, and what may be asked of them.

    `domain` is a ROS domain of its own; ROS_DOMAIN_ID names it, so that nodes of yours join it.
    Hits are `campaign(...).record.hits`: of each `label`, `accepted`, `reasons`, `contact_time`.
    """

    domain: int  # ROS domain of its own
    folder: Path  # of the run
    simulation: VirtualRig | None  # strikes the same hits; None: it is no virtual rig
    check: Callable[[], None]  # raises `RigError`, with the end of the log, once the rig has ended

    @property
    def recording(self) -> Path:
        """The file that is being recorded."""
        return self.folder / RECORDING_NAME

    def campaign(self, samples: str | Sequence[str] = (), impacts: int = 2) -> Results:
        """Run a campaign to its end, and return what the rig found.

        One that a test before has left running or paused is ended first.

        Parameters
        ----------
        samples : str or sequence of str
            Names; empty: all.
        impacts : int
            Accepted hits of each.

        Raises
        ------
        RigError
            If it cannot be run, or does not succeed.
        """
        from impact_rig.nodes.campaign_client import CampaignClient, CampaignGoal

        check_count("impacts", impacts, 1)
        names = list_items(samples)
        goal = CampaignGoal(samples=names, impacts=impacts, attempts_per_impact=ATTEMPTS)
        with CampaignClient(check=self.check) as client:
            client.wait_for_rig(START_TIMEOUT)
            client.end_others(END_TIMEOUT)
            outcome = client.run(goal, _Nobody(), longest_pause=10.0)
        if not outcome.success:
            raise RigError(f"the campaign did not succeed: {outcome.message}")
        return Results(TracedCampaign(outcome.results), "campaign")

    def find_truth(self, hit: HitResults | HitLabel) -> Truth:
        """Return the truth of a hit of `Results.record.hits`, or of its label.

        Raises
        ------
        ParameterError
            If this is no virtual rig.
        """
        if self.simulation is None:
            raise ParameterError("the truth of a hit is known on the virtual rig alone")
        return self.simulation.find_truth(hit)


class _Nobody:
    """Do nothing: the virtual rig needs no person, its samples and hammer are numbers."""

    def follow(self, _rig: object) -> None:
        """See nothing."""

    def mount(self, *_: object) -> None:
        """Mount nothing."""

    put_back = let_go = hold_back = mount


@contextmanager
def run_rig(
    rig_file: str | Path | None = None,
    folder: Path | None = None,
    *,
    parameters: Mapping[str, Mapping[str, Any]] | None = None,
    only: Sequence[str] = (),
    **source: Unpack[SourceKeys],
) -> Iterator[RunningRig]:
    """Run the nodes of any rig during a block, in a ROS domain of its own.

    Its processes have ended when the block has, also if this process is killed. Nodes of yours
    that the rig needs, as by the driver `topic`, are started within the block: `campaign` waits.

    Parameters
    ----------
    rig_file : str or Path, optional
        Without it the paper's virtual rig.
    folder : Path, optional
        An empty one, for recording and log; without it one that is gone after the block.
    parameters : mapping, optional
        Of nodes: ``{"accelerometer": {"trigger_timeout": 5.0}}``. The virtual rig is quick where
        nothing else is said.
    only : sequence of str
        Nodes that are started; empty: all. A node of yours takes the place of another.
    **source
        As of `impact_rig.VirtualRig`, of a virtual rig: ``seed=7, plant="contact", faults=0.1``.

    Raises
    ------
    RigError
        If it cannot be started.
    """
    with explain_missing():
        from impact_rig.cli.demo import run_rig as run_processes
        from impact_rig.nodes.campaign_client import CampaignClient

    rig = load_rig_file(rig_file)
    is_virtual = read_driver_name(rig.source) == VIRTUAL
    simulation = VirtualRig(rig_file=rig_file, **source) if is_virtual else None
    with ExitStack() as stack:
        place = folder or Path(stack.enter_context(TemporaryDirectory()))
        processes = list_rig_processes(
            place.resolve(),
            rig=rig,
            source=read_source_keys(source),
            visualize=False,
            overrides=parameters or (QUICK if is_virtual else {}),
            only=only,
        )
        domain = stack.enter_context(use_own_domain())
        check = stack.enter_context(run_processes(processes, place / LOG_NAME))
        if is_virtual:
            with CampaignClient(check=check) as client:
                client.wait_for_rig(START_TIMEOUT)
        yield RunningRig(domain, place, simulation, check)


def run_virtual_rig(
    folder: Path, *, rig_file: str | Path | None = None, **source: Unpack[SourceKeys]
) -> AbstractContextManager[RunningRig]:
    """Run a virtual rig: `run_rig` with seed 1 where nothing else is said."""
    return run_rig(rig_file, folder, **source)
