"""A rig of real nodes, for tests of programs that talk to one."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from impact_rig.analysis.sources import list_items
from impact_rig.api import VirtualRig
from impact_rig.cli.libraries import explain_missing
from impact_rig.configuration.processes import (
    DISCOVERY,
    LOG_NAME,
    RECORDING_NAME,
    list_rig_processes,
)
from impact_rig.configuration.rig_file import load_rig_file
from impact_rig.core.given.errors import RigError, check_count
from impact_rig.core.given.records import Truth
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
    simulation: VirtualRig  # strikes the same hits
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

    def find_truth(self, hit: HitResults) -> Truth:
        """Return the truth of a hit of `Results.record.hits`."""
        return self.simulation.find_truth(hit)


class _Nobody:
    """Do nothing: the virtual rig needs no person, its samples and hammer are numbers."""

    def follow(self, _rig: object) -> None:
        """See nothing."""

    def mount(self, *_: object) -> None:
        """Mount nothing."""

    put_back = let_go = hold_back = mount


@contextmanager
def run_virtual_rig(
    folder: Path,
    *,
    seed: int = 1,
    plant: str = "published",
    faults: float = 0.0,
    rig_file: Path | None = None,
) -> Iterator[RunningRig]:
    """Run a virtual rig of real nodes during a block, in a ROS domain of its own.

    Its processes have ended when the block has, also if this process is killed.

    Parameters
    ----------
    folder : Path
        An empty one, for recording and log.
    seed, plant, faults, rig_file
        As of `impact_rig.VirtualRig`.

    Raises
    ------
    RigError
        If it does not start.
    """
    with explain_missing():
        from impact_rig.cli.demo import run_rig
        from impact_rig.nodes.campaign_client import CampaignClient

    simulation = VirtualRig(seed=seed, plant=plant, faults=faults, rig_file=rig_file)
    processes = list_rig_processes(
        folder.resolve(),
        rig=load_rig_file(rig_file),
        source={"seed": seed, "plant": plant, "fault_probability": faults},
        visualize=False,
        overrides=QUICK,
    )
    with use_own_domain() as domain, run_rig(processes, folder / LOG_NAME) as check:
        with CampaignClient(check=check) as client:
            client.wait_for_rig(START_TIMEOUT)
        yield RunningRig(domain, folder, simulation, check)


@contextmanager
def use_own_domain() -> Iterator[int]:
    """Let all nodes that start in the block, in any process, be in a ROS domain of their own."""
    from impact_rig.nodes.discovery import reserve_domain

    with reserve_domain() as domain, pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(domain))
        patch.setenv(DISCOVERY, "LOCALHOST")
        yield domain
