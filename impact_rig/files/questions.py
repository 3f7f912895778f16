"""What neither a measured file nor the user states is asked in one question."""

from dataclasses import dataclass, field

from impact_rig.core.given.errors import SignalError
from impact_rig.files.measurement import MeasuredChannel, Measurement
from impact_rig.files.names import find_unit

BODIES = {"hammer": "hammer", "specimen": "sample"}
"""Name of a role's body for people."""
CHOICE = 'channel = "?"'
"""The line that chooses a channel."""
SHOWN_CHANNELS = 6  # of a file whose channels are listed in a message


@dataclass(frozen=True)
class Missing:
    """Something that neither file nor user say."""

    what: str  # for people
    line: str  # of a file of channels
    table: str = ""  # where the line stands; empty: above all tables
    option: str = ""  # of the command line that says the same


@dataclass
class Questions:
    """The missing statements of a file, and the remarks on it."""

    measurement: Measurement
    needs_scale: bool  # ask for all that makes accelerations; False: contact times are enough
    missing: list[Missing] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)  # what was taken for granted

    def ask(self) -> None:
        """Raise `SignalError` with one question for all that is missing, if something is."""
        if not self.missing:
            return
        path = self.measurement.path
        whats = "; ".join(dict.fromkeys(item.what for item in self.missing))
        options = [item.option for item in self.missing if item.option]
        lines = [f"{item.line}{item.table and f' under [{item.table}]'}" for item in self.missing]
        ways = [f"give {' '.join(options)}"] if len(options) == len(lines) else []
        ways.append(f"write {' and '.join(dict.fromkeys(lines))} into a file for --channels")
        raise SignalError(
            f"{path}: {whats}: {', or '.join(ways)} (`impact-rig import --template FILE` begins"
            " one)"
        )


def list_channels(measurement: Measurement) -> str:
    """Return numbers, names, units and sizes of the first channels."""
    lines = describe_channels(measurement)
    if left := lines[SHOWN_CHANNELS:]:
        lines[SHOWN_CHANNELS:] = [
            f"{len(left)} more (`impact-rig import --template FILE` lists all)"
        ]
    return ", ".join(lines)


def describe_channels(measurement: Measurement) -> list[str]:
    """Return number, name, unit and size of each channel."""
    return [
        f"{number} {describe_channel(channel)}"
        for number, channel in enumerate(measurement.channels, start=1)
    ]


def describe_channel(channel: MeasuredChannel) -> str:
    """Return name, size and unit of a channel."""
    unit = channel.unit or find_unit(channel.name)
    return f"{channel.name!r} ({channel.values.size} points{unit and ' in '}{unit})"
