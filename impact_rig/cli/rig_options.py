"""The options of a rig, each declared once, for the command line and for launch files."""

import json
from dataclasses import dataclass
from typing import Any

from impact_rig.configuration.parameters import PARAMETERS, Parameter
from impact_rig.devices.virtual.choices import Fault, Plant

TEXT, SWITCH = Parameter("", ""), Parameter(default=False, description="")


@dataclass(frozen=True)
class RigOption:
    """An option of a rig."""

    text: str
    default: str = ""  # what holds without it; empty: nothing to say
    value: Parameter = TEXT
    in_launch: str = ""  # further words, of a launch argument

    @property
    def help(self) -> str:
        """The help of the command line."""
        choices = f": {', '.join(self.value.choices)}" * bool(self.value.choices)
        return f"{self.text}{choices}." + f" [{self.default}]" * bool(self.default)

    @property
    def argument(self) -> dict[str, Any]:
        """The keywords of launch's DeclareLaunchArgument, whose values are texts."""
        choices, value = [*self.value.choices], ""
        if isinstance(self.value.default, bool):
            choices, value = ["true", "false"], "false"
        elif isinstance(self.value.default, str):
            value = self.value.default
        if choices and value not in choices:
            choices = [value, *choices]
        without = f"; empty: {self.default}" * (not value and bool(self.default))
        description = f"{self.text}{self.in_launch}{without}"
        return {"default_value": value, "choices": choices or None, "description": description}

    def read(self, name: str, text: str) -> Any:
        """Return what a launch argument says: a text as it is, a number None if it is empty.

        Raises
        ------
        ParameterError
            If it cannot be meant.
        """
        if isinstance(self.value.default, str):
            return text
        try:
            value = json.loads(text or "null")
        except json.JSONDecodeError:
            value = text
        return None if value is None else self.value.convert(name, value)


RIG_OPTIONS = {
    "rig_file": RigOption("Masses, samples and settings, in TOML", "the paper's rig"),
    "plant": RigOption(
        "Physics of the virtual rig",
        "as in the rig file, or published",
        Parameter("", "", choices=tuple(plant.value for plant in Plant)),
    ),
    "seed": RigOption(
        "Of the virtual rig: the same seed gives the same hits", "1", Parameter(1, "", low=0)
    ),
    "faults": RigOption(
        "Probability of each fault of the virtual rig, for each hit:"
        f" {', '.join(fault.value for fault in Fault)}",
        "0",
        Parameter(0.0, "", low=0.0, high=1.0),
    ),
    "continuous": RigOption(
        "Stream both channels all the time, and find the impacts in the stream",
        "each hit",
        SWITCH,
    ),
    "output": RigOption("Folder for recording, view and results", "runs/<time>"),
    "resume": RigOption(
        "Go on with this folder's run, with its rig", in_launch="; with impacts, with its campaign"
    ),
    "page": RigOption("Serve a page for the person at the rig", "", SWITCH),
    "viewer": RigOption(
        "Show it live, too: in a window, on a web page, in the Rerun viewer at"
        " rerun+http://HOST:9876/proxy",
        in_launch=": spawn, web or the address, several by commas",
    ),
    "only": RigOption(
        "Start only this node, the others elsewhere with the same options",
        in_launch="; several by commas; empty: all",
    ),
    "namespace": RigOption("ROS namespace of the rig", "none"),
    "network": RigOption(
        "Find nodes on other computers, too",
        "on this one",
        SWITCH,
        ", unless ROS_AUTOMATIC_DISCOVERY_RANGE is set",
    ),
    "rate": RigOption("Part of the original speed", "1", PARAMETERS["replayer"]["rate"]),
    "loop": RigOption("How often; 0: for ever", "1", PARAMETERS["replayer"]["loop"]),
    "impacts": RigOption(
        "Run a campaign at once, with so many accepted hits per sample, and end after it",
        "wait for `impact-rig campaign` or the action campaign/run",
        Parameter(10, "", low=1),
    ),
    "visualizer": RigOption(
        "Show model and measurement in Rerun; auto: if rerun-sdk is installed",
        value=Parameter("auto", "", choices=("auto", "true", "false")),
    ),
    "respawn": RigOption(
        "Start a node again that has ended; else the rig ends with it", value=SWITCH
    ),
    "params_file": RigOption(
        "YAML file with ROS parameters of the nodes; the other arguments go before it"
    ),
}
"""By name; the last four are of launch files alone."""
