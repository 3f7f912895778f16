"""What is said to an instrument for one plan: what a profile makes, and a source says."""

from dataclasses import dataclass
from typing import ClassVar, Protocol

from impact_rig.configuration.toml_table import TomlTable
from impact_rig.devices.acceleration_source import AcquisitionPlan

SAME = 1e-3
"""How far a number that an instrument tells may be from what it was told, relative [-], our
choice: they round."""
FILL_MARGIN = 1e-3
"""How much longer than the pre-trigger an instrument samples before it may trigger [s], our
choice."""
ASCII = "ascii"
"""Format of points as text: numbers with commas, in braces or not."""


@dataclass(frozen=True)
class Setting:
    """A command, and how to see that it was obeyed.

    Attributes
    ----------
    command : str
        It has no answer.
    query, answer : str
        What is asked afterwards, and what must come; empty: nothing is asked.
    """

    command: str
    query: str = ""
    answer: str = ""

    def is_obeyed(self, answer: str) -> bool:
        """Return whether an answer is the wanted one, as a number or as a text."""
        try:
            number, wanted = float(answer), float(self.answer)
        except ValueError:
            return answer.upper() == self.answer.upper()
        return abs(number - wanted) <= SAME * abs(wanted)


@dataclass(frozen=True)
class Milestone:
    """Something that an armed instrument comes to, and that must be asked for.

    Attributes
    ----------
    query : str
        Asked until the answer comes.
    answer : str
        That it has come.
    waiting : str
        The answer before; empty: any other.
    """

    query: str
    answer: str
    waiting: str = ""


@dataclass(frozen=True)
class ChannelProgram:
    """How the points of one channel are fetched, and what they mean.

    Attributes
    ----------
    commands : tuple of str
        Said before.
    query : str
        Its answer is the points; ``{start}`` in it: where the record begins in the memory.
    points_format : str
        `ASCII`, or numpy's name of the type of a number in a block of bytes.
    step : float
        Voltage of one count [V].
    zero : float
        Count at no voltage.
    input_range : float
        Largest voltage of the input, either sign [V].
    rails : tuple of float
        Counts at which the input is overloaded, these and all beyond.
    """

    commands: tuple[str, ...]
    query: str
    points_format: str
    step: float
    zero: float
    input_range: float
    rails: tuple[float, float]


@dataclass(frozen=True)
class Program:
    """All that is said to an instrument.

    Attributes
    ----------
    sampling_rate : float
        That it really does [Hz].
    settings : tuple of Setting
        When it is configured.
    start : tuple of str
        Said at each arming, before what stands before the trigger can be sampled.
    fill_time : float
        That this takes [s].
    arm : tuple of str
        Said then: from here on a trigger counts.
    milestones : tuple of Milestone
        In their order: the first is the trigger, after the last the record is complete.
    position : str
        Query for the place of the trigger in the memory; empty: its points begin with the record.
    memory : int
        Points of each channel.
    stop : tuple of str
        Said to disarm it.
    hammer : ChannelProgram
        Inside the hammer.
    specimen : ChannelProgram or None
        On the sample; None: not measured.
    """

    sampling_rate: float
    settings: tuple[Setting, ...]
    start: tuple[str, ...]
    fill_time: float
    arm: tuple[str, ...]
    milestones: tuple[Milestone, ...]
    position: str
    memory: int
    stop: tuple[str, ...]
    hammer: ChannelProgram
    specimen: ChannelProgram | None


class Profile(Protocol):
    """A kind of instrument: called with the options of the rig file.

    Attributes
    ----------
    KEYS : tuple of str
        Its own keys of the table [source].
    IDENTITY : str
        What its answer to ``*IDN?`` contains; empty: anything.
    """

    KEYS: ClassVar[tuple[str, ...]]
    IDENTITY: ClassVar[str]

    def __init__(self, options: TomlTable) -> None: ...

    def make_program(self, plan: AcquisitionPlan) -> Program:
        """Return what to say; raises `ParameterError` if it cannot do the plan."""
        ...
