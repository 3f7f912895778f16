"""The processes that make a rig: one list, for the command line and for ROS launch files."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

RECORDING_NAME = "session.mcap"
BAG_NAME = "session"
"""Of a recording that is a folder as rosbag2 writes it."""
VIEW_NAME = "session.rrd"
RESULTS_NAME = "results.json"
LOG_NAME = "nodes.log"


@dataclass(frozen=True)
class NodeProcess:
    """One node, to be started as a process of its own.

    Attributes
    ----------
    name : str
        Executable, and node name, of package impact_rig.
    parameters : mapping
        ROS parameters that differ from their defaults.
    """

    name: str
    parameters: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class RecordingPlan:
    """How a run is recorded.

    Attributes
    ----------
    bag : bool
        Into a folder as rosbag2 writes it; else into one file.
    compression : str
        Of chunks; empty: the recorder's default.
    notes : str
        In the operator's words.
    """

    bag: bool = False
    compression: str = ""
    notes: str = ""

    @property
    def name(self) -> str:
        """Of the recording, in the folder of the run."""
        return BAG_NAME if self.bag else RECORDING_NAME


def list_rig_processes(
    output: Path | str,
    *,
    rig_file: str = "",
    virtual: Mapping[str, Any] | None = None,
    record: bool = True,
    recording: RecordingPlan = RecordingPlan(),
    visualize: bool = True,
    viewer_url: str = "",
    overrides: Mapping[str, Mapping[str, Any]] | None = None,
) -> tuple[NodeProcess, ...]:
    """Return the nodes of a rig with their parameters.

    Parameters
    ----------
    output : Path or str
        Folder of the run; recording and view go there.
    rig_file : str
        Path of the rig file; empty: the paper's rig.
    virtual : mapping, optional
        Parameters of the virtual rig: plant, seed, fault_probability ...
    record : bool
        Whether everything is recorded; if not, the hammer is released all the same.
    recording : RecordingPlan
        How.
    visualize : bool
        Whether model and measurement are shown.
    viewer_url : str
        Show them in the viewer at this address; empty: write them into a file.
    overrides : mapping, optional
        Further parameters by node; they go before all others.

    Returns
    -------
    tuple of NodeProcess
        In no particular order: each node waits for the others.
    """
    folder = Path(output)
    hammer: dict[str, Any] = {} if record else {"require_recorder": False}
    accelerometer = dict(virtual or {})
    if not record:
        accelerometer["required_subscribers"] = "estimator"
    processes = [
        NodeProcess("hammer", hammer),
        NodeProcess("accelerometer", accelerometer),
        NodeProcess("estimator"),
        NodeProcess("campaign", {"rig_file": str(rig_file)} if rig_file else {}),
    ]
    if record:
        content = {
            "compression": recording.compression,
            "notes": recording.notes,
            "attachments": str(rig_file),
        }
        given = {name: value for name, value in content.items() if value}
        processes.append(
            NodeProcess("recorder", {"output": str(folder / recording.name), **given})
        )
    if visualize:
        view = {"connect": viewer_url} if viewer_url else {"output": str(folder / VIEW_NAME)}
        processes.append(NodeProcess("visualizer", view))
    further = overrides or {}
    return tuple(
        NodeProcess(process.name, {**process.parameters, **further.get(process.name, {})})
        for process in processes
    )


def make_run_folder_name(now: datetime) -> str:
    """Return ``runs/<time>`` for a run that starts `now`."""
    return str(Path("runs") / now.strftime("%Y-%m-%dT%H-%M-%S"))
