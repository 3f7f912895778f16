"""Descriptions of a rig's options, for the command line and for launch files."""

from dataclasses import dataclass


@dataclass(frozen=True)
class OptionText:
    """Description of an option."""

    text: str
    default: str = ""  # what holds without it; empty: nothing to say

    @property
    def help(self) -> str:
        """The help of the command line."""
        return f"{self.text}." + (f" [{self.default}]" if self.default else "")

    @property
    def description(self) -> str:
        """The description of a launch argument, whose value may be empty."""
        return self.text + (f"; empty: {self.default}" if self.default else "")


RIG_FILE = OptionText("Masses, samples and settings, in TOML", "the paper's rig")
PLANT = OptionText("Physics of the virtual rig", "as in the rig file, or published")
SEED = OptionText("Of the virtual rig: the same seed gives the same hits", "1")
FAULTS = OptionText("Probability of each fault of the virtual rig, for each hit", "0")
CONTINUOUS = OptionText(
    "Stream both channels all the time, and find the impacts in the stream", "each hit"
)
OUTPUT = OptionText("Folder for recording, view and results", "runs/<time>")
RESUME = OptionText("Go on with this folder's run, with its rig")
PAGE = OptionText("Serve a page for the person at the rig")
VIEWER = OptionText(
    "Show it live, too: in a window, on a web page, in the Rerun viewer at"
    " rerun+http://HOST:9876/proxy"
)
ONLY = OptionText("Start only this node, the others elsewhere with the same options")
NAMESPACE = OptionText("ROS namespace of the rig", "none")
NETWORK = OptionText("Find nodes on other computers, too", "on this one")
RATE = OptionText("Part of the original speed", "1")
LOOP = OptionText("How often; 0: for ever", "1")
