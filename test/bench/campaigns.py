"""Recordings to measure with: campaigns that are run once, and what is made of them."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from impact_rig.core.errors import RigError
from impact_rig.recordings.source import RUN_NAME, SUFFIX


@dataclass(frozen=True)
class Campaign:
    """A campaign of the virtual rig, run as a user runs it."""

    recording: Path
    seconds: float  # from the command to its end, the printed tables


class Campaigns:
    """Campaigns that are run when a part needs them, and kept for all parts.

    Parameters
    ----------
    folder : Path
        Where to; it need not exist.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._campaigns: list[Campaign] = []

    def take(self, count: int) -> tuple[Campaign, ...]:
        """Return the first `count` campaigns; run those that there are not yet.

        Raises
        ------
        RigError
            If a campaign fails, for example for want of ROS 2.
        """
        while len(self._campaigns) < count:
            self._campaigns.append(run_campaign(self._folder / str(len(self._campaigns))))
        return tuple(self._campaigns[:count])


def run_campaign(folder: Path) -> Campaign:
    """Run `impact-rig demo`, the paper's whole campaign, into a folder that does not exist.

    Raises
    ------
    RigError
        If the campaign fails, for example for want of ROS 2.
    """
    # In a separate ROS domain, never that of a real rig.
    environment = {key: value for key, value in os.environ.items() if key != "ROS_DOMAIN_ID"}
    started = time.perf_counter()
    with subprocess.Popen(
        [sys.executable, "-m", "impact_rig.cli.main", "demo", "--output", str(folder)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        start_new_session=True,
    ) as process:
        try:
            _, errors = process.communicate()
        except (KeyboardInterrupt, SystemExit):
            # It ends its nodes first, which still write into the folder.
            process.send_signal(signal.SIGINT)
            process.communicate()
            raise
    seconds = time.perf_counter() - started
    if process.returncode:
        reason = errors.strip().splitlines()[-1:] or [f"exit code {process.returncode}"]
        raise RigError(f"no campaign to measure with could be run: {reason[0]}")
    return Campaign(folder / f"{RUN_NAME}{SUFFIX}", seconds)
