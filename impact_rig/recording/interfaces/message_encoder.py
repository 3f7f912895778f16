"""Core types to CDR by the installed definitions, for recordings that are made without ROS."""

from dataclasses import asdict, fields
from typing import Any

import numpy as np
from rosbags.typesys import TypesysError, get_types_from_msg
from rosbags.typesys.store import Typestore

from impact_rig import __version__
from impact_rig.core.errors import FileError
from impact_rig.core.setup.samples import RigSetup, Sample
from impact_rig.core.signals.record import Block, ChannelBlock
from impact_rig.recording.interfaces.message_definitions import (
    MessageDefinition,
    find_message_definition,
)
from impact_rig.recording.reading.mcap_reader import BLOCK_TYPE, SETUP_TYPE

NANOSECONDS = 1_000_000_000
PACKAGE = "impact_rig_msgs/msg/"


class MessageEncoder:
    """Serialises set-ups and blocks as the rig's nodes publish them.

    Attributes
    ----------
    setup_definition, block_definition : MessageDefinition
        What the recording must say of their types.

    Raises
    ------
    FileError
        If the rig's interfaces are not installed, or cannot be understood.
    """

    def __init__(self) -> None:
        self._store = Typestore()
        self.setup_definition = self._register(SETUP_TYPE)
        self.block_definition = self._register(BLOCK_TYPE)

    def _register(self, type_name: str) -> MessageDefinition:
        definition = find_message_definition(type_name)
        try:
            self._store.register(get_types_from_msg(definition.text, type_name))
        except TypesysError as error:
            raise FileError(f"the installed {type_name} cannot be understood: {error}") from None
        return definition

    def encode_setup(self, setup: RigSetup, stamp: int) -> bytes:
        """Return a set-up as a message.

        Parameters
        ----------
        setup : RigSetup
            Masses, samples, settings.
        stamp : int
            Nanoseconds since the epoch.
        """
        samples = setup.samples
        message = self._make(
            SETUP_TYPE,
            header=self._make_header(stamp),
            name=setup.name,
            description=setup.description,
            software_version=__version__,
            hammer_mass=setup.hammer_mass,
            hammer_mass_uncertainty=setup.hammer_mass_uncertainty,
            hammer_stiffness=setup.hammer_stiffness,
            accelerometer_mass=samples.accelerometer_mass,
            accelerometer_mass_uncertainty=samples.accelerometer_mass_uncertainty,
            clock_uncertainty=setup.clock_uncertainty,
            impact_speed=setup.impact_speed,
            control_sample=samples.control_sample,
            samples=[self._make_sample(sample) for sample in samples.samples],
            analysis=self._make(PACKAGE + "AnalysisSettings", **asdict(setup.analysis)),
            sensors=[self._make(PACKAGE + "Sensor", **asdict(item)) for item in setup.sensors],
        )
        return bytes(self._store.serialize_cdr(message, SETUP_TYPE))

    def encode_block(self, block: Block) -> bytes:
        """Return a block as a message, stamped with its first point's time."""
        message = self._make(
            BLOCK_TYPE,
            header=self._make_header(block.stamp),
            record=block.label.record,
            sample=block.label.sample,
            impact=block.label.impact,
            attempt=block.label.attempt,
            first_sample=block.first_sample,
            sampling_rate=block.sampling_rate,
            triggered=block.triggered,
            last=block.last,
            hammer=self._make_channel(block.hammer),
            specimen=self._make_channel(block.specimen),
        )
        return bytes(self._store.serialize_cdr(message, BLOCK_TYPE))

    def _make_sample(self, sample: Sample) -> Any:
        names = [field.name for field in fields(sample)]
        return self._make(PACKAGE + "Sample", **{name: getattr(sample, name) for name in names})

    def _make_channel(self, channel: ChannelBlock) -> Any:
        is_counted = channel.output.dtype == np.int32
        return self._make(
            PACKAGE + "Channel",
            counts=channel.output if is_counted else np.empty(0, np.int32),
            values=np.empty(0) if is_counted else channel.output,
            scale=channel.scale,
            offset=channel.offset,
            full_scale=channel.full_scale,
            overload=channel.overloaded,
        )

    def _make_header(self, stamp: int) -> Any:
        seconds, rest = divmod(stamp, NANOSECONDS)
        time = self._make("builtin_interfaces/msg/Time", sec=seconds, nanosec=rest)
        return self._make("std_msgs/msg/Header", stamp=time, frame_id="")

    def _make(self, type_name: str, **values: Any) -> Any:
        return self._store.types[type_name](**values)
