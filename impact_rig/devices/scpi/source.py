"""An instrument that speaks SCPI as a source of accelerations: triggered records, one by one."""

import time
from collections import deque
from contextlib import suppress
from textwrap import indent
from typing import ClassVar

import numpy as np

from impact_rig.configuration.toml_table import REQUIRED, TomlTable
from impact_rig.core.errors import DeviceError, ParameterError
from impact_rig.core.signals.record import ChannelBlock, RawArray
from impact_rig.devices.acceleration_source import (
    AcquiredBlock,
    Acquisition,
    AcquisitionPlan,
    SourceChannel,
)
from impact_rig.devices.found_device import FoundDevice
from impact_rig.devices.scpi.connection import ScpiConnection, parse_address
from impact_rig.devices.scpi.generic import EXAMPLE as GENERIC_EXAMPLE
from impact_rig.devices.scpi.generic import Generic
from impact_rig.devices.scpi.points import fetch_points, make_channel_block
from impact_rig.devices.scpi.program import ChannelProgram, Profile, Program
from impact_rig.devices.scpi.red_pitaya import EXAMPLE as RED_PITAYA_EXAMPLE
from impact_rig.devices.scpi.red_pitaya import RedPitaya

PORT = 5000
"""Where Red Pitaya's server listens."""
TIMEOUT = 2.0
"""How long a connection or an answer may take [s], our choice."""
LONGEST_TIMEOUT = 5.0
"""[s], our choice: well below what the accelerometers wait for a driver."""
POLL_PERIOD = 1e-3
"""How often an armed instrument is asked whether it has triggered [s], our choice: it costs a
twentieth of a core, and the record comes half of this later."""
NANO = 1e9

PROFILES: dict[str, type[Profile]] = {"red_pitaya": RedPitaya, "generic": Generic}
"""Kinds of instruments."""
EXAMPLE = f"""\
{RED_PITAYA_EXAMPLE}
# Any other instrument, by its commands:
{indent(GENERIC_EXAMPLE, "# ")}"""


class ScpiSource:
    """Arms an instrument, asks until it has triggered, and fetches the record of its channels.

    Parameters
    ----------
    options : TomlTable
        Table [source] of the rig file without what all sources share.

    Raises
    ------
    ParameterError
        If a key or a value is none that the profile knows.
    """

    description: ClassVar[str] = (
        "a digitizer that speaks SCPI over TCP: Red Pitaya, or any other by its commands"
    )
    example: ClassVar[str] = EXAMPLE

    def __init__(self, options: TomlTable) -> None:
        profile = PROFILES[options.take_choice("profile", tuple(PROFILES), "red_pitaya")]
        options.check_keys("address", "profile", "identity", "timeout", *profile.KEYS)
        address = options.take_text("address", REQUIRED, f"192.168.1.20:{PORT}")
        try:
            self._host, self._port = parse_address(address, PORT)
        except ParameterError as error:
            raise options.make_error("address", str(error)) from None
        self._identity = options.take_text("identity", profile.IDENTITY)
        self._timeout = options.take_quantity(
            "timeout", "s", f"{TIMEOUT:g} s", TIMEOUT, low=1e-3, high=LONGEST_TIMEOUT
        )
        self._profile = profile(options)
        self._connection: ScpiConnection | None = None
        self._plan: AcquisitionPlan | None = None
        self._program: Program | None = None
        self._is_armed = False
        self._passed = 0
        self._asked = self._triggered = 0
        self._blocks: deque[AcquiredBlock] = deque()

    @classmethod
    def find_devices(cls) -> tuple[FoundDevice, ...]:
        """Return nothing: nobody on a network is asked who did not ask for it."""
        return ()

    def configure(self, plan: AcquisitionPlan) -> Acquisition:
        """Connect, see that it is the right instrument, and set it up.

        Raises
        ------
        DeviceError
            If it is not there, another one, or does not obey.
        ParameterError
            If it cannot do what the plan says.
        """
        if plan.continuous:
            raise ParameterError(
                "a source that speaks SCPI gives records of single hits: set mode to triggered"
            )
        self.close()
        program = self._profile.make_program(plan)
        self._connection = ScpiConnection(self._host, self._port, self._timeout)
        try:
            identity = self._check_identity(self._connection)
            _set_up(self._connection, program)
        except DeviceError:
            self.close()
            raise
        self._plan, self._program = plan, program
        return Acquisition(f"{identity} at {self._host}:{self._port}", program.sampling_rate)

    def arm(self) -> None:
        """Let the instrument wait for a trigger.

        Raises
        ------
        DeviceError
            If it is gone, or somebody else has changed its settings.
        """
        connection, _, program = self._require()
        self.disarm()
        for setting in program.settings:
            if setting.query and not setting.is_obeyed(answer := connection.ask(setting.query)):
                raise connection.make_error(
                    f"answers {answer!r} to {setting.query}, where {setting.answer} was set:"
                    " another program talks to it, too"
                )
        query = program.milestones[0].query
        # An answer says that what was said before has been done.
        for commands, pause in ((program.start, program.fill_time), (program.arm, 0.0)):
            if commands:
                for command in commands:
                    connection.send(command)
                connection.ask(query)
                time.sleep(pause)
        self._is_armed, self._passed = True, 0
        self._asked = time.time_ns()

    def read(self, timeout: float) -> AcquiredBlock | None:
        """Return the next block of a record; None if there is none within `timeout` seconds.

        Raises
        ------
        DeviceError
            If the instrument is gone, or does not answer as it should.
        """
        if self._blocks:
            return self._blocks.popleft()
        connection, plan, program = self._require()
        if not self._is_armed:
            connection.wait(timeout)
            return None
        deadline = time.monotonic() + timeout
        while not self._is_complete(connection, program):
            left = deadline - time.monotonic()
            if left <= 0.0:
                return None
            time.sleep(min(POLL_PERIOD, left))
        self._is_armed = False
        self._blocks.extend(self._fetch(connection, plan, program))
        return self._blocks.popleft()

    def disarm(self) -> None:
        """Stop the instrument, and forget what has not been read; raises `DeviceError`."""
        self._blocks.clear()
        if self._is_armed and self._connection is not None and self._program is not None:
            self._is_armed = False
            for command in self._program.stop:
                self._connection.send(command)

    def check(self) -> None:
        """Ask the instrument who it is; raises `DeviceError`."""
        self._check_identity(self._require()[0])

    def close(self) -> None:
        """Stop the instrument as far as it listens, and hang up."""
        with suppress(DeviceError):
            self.disarm()
        self._is_armed = False
        if self._connection is not None:
            self._connection.close()
        self._connection = self._plan = self._program = None

    def _require(self) -> tuple[ScpiConnection, AcquisitionPlan, Program]:
        if self._connection is None or self._plan is None or self._program is None:
            raise DeviceError("the SCPI instrument is not configured: configure it first")
        return self._connection, self._plan, self._program

    def _check_identity(self, connection: ScpiConnection) -> str:
        identity = connection.ask("*IDN?")
        if self._identity.upper() not in identity.upper():
            raise connection.make_error(
                f"is {identity!r}: its answer to *IDN? must contain {self._identity!r}; check"
                " address and identity of [source]"
            )
        return identity

    def _is_complete(self, connection: ScpiConnection, program: Program) -> bool:
        """Ask for the milestone that comes next, and return whether there is none any more."""
        while self._passed < len(program.milestones):
            milestone = program.milestones[self._passed]
            answer = connection.ask(milestone.query)
            now = time.time_ns()
            if answer != milestone.answer:
                if milestone.waiting and answer != milestone.waiting:
                    wanted = f"{milestone.waiting} or {milestone.answer}"
                    raise connection.make_nonsense_error(milestone.query, answer, wanted)
                self._asked = now
                return False
            if not self._passed:
                # It came between this answer and the one before.
                self._triggered = (self._asked + now) // 2
            self._passed += 1
        return True

    def _fetch(
        self, connection: ScpiConnection, plan: AcquisitionPlan, program: Program
    ) -> list[AcquiredBlock]:
        """Return the blocks of the record that is complete."""
        start = self._find_start(connection, plan, program)
        hammer = fetch_points(connection, program.hammer, start, plan.points)
        specimen: RawArray = np.empty(0, np.int32)
        if program.specimen is not None:
            specimen = fetch_points(connection, program.specimen, start, plan.points)
        period = NANO / program.sampling_rate
        stamp = self._triggered - round(plan.pre_trigger_points * period)
        return [
            AcquiredBlock(
                first_sample=first,
                hammer=make_channel_block(
                    hammer[first : first + plan.block_size], program.hammer, plan.hammer
                ),
                specimen=_make_specimen(
                    specimen[first : first + plan.block_size], program.specimen, plan.specimen
                ),
                last=first + plan.block_size >= plan.points,
                stamp=stamp + round(first * period),
            )
            for first in range(0, plan.points, plan.block_size)
        ]

    @staticmethod
    def _find_start(connection: ScpiConnection, plan: AcquisitionPlan, program: Program) -> int:
        """Return where the record begins in the instrument's memory."""
        if not program.position:
            return 0
        answer = connection.ask(program.position)
        if not answer.isascii() or not answer.isdigit() or int(answer) >= program.memory:
            wanted = f"a whole number below {program.memory}"
            raise connection.make_nonsense_error(program.position, answer, wanted)
        return (int(answer) - plan.pre_trigger_points) % program.memory


def _set_up(connection: ScpiConnection, program: Program) -> None:
    """Say all settings, and see that they are obeyed."""
    for setting in program.settings:
        connection.send(setting.command)
        if setting.query and not setting.is_obeyed(answer := connection.ask(setting.query)):
            raise connection.make_error(
                f"does not obey {setting.command}: it answers {answer!r} to {setting.query}; is"
                " it the right profile and board?"
            )


def _make_specimen(
    output: RawArray, program: ChannelProgram | None, channel: SourceChannel | None
) -> ChannelBlock:
    """Return the sample's channel, without points where it is not measured."""
    if program is None or channel is None:
        return ChannelBlock(np.empty(0, np.int32), 1.0, 0.0, 0.0)
    return make_channel_block(output, program, channel)
