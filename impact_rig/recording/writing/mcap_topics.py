"""The topics of an MCAP file in the making: their numbers, and the records that announce them."""

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from impact_rig.recording.interfaces.message_definitions import MessageDefinition
from impact_rig.recording.interfaces.qos_profiles import OfferedQos, format_offered_qos
from impact_rig.recording.writing.mcap_summary import format_record


class McapTopics:
    """Numbers types and topics, each from 1."""

    def __init__(self) -> None:
        self._schemas: dict[tuple[str, str], int] = {}
        self._channels: dict[str, int] = {}

    def find(self, topic: str) -> int:
        """Return the number of a topic's channel; 0: it was never announced."""
        return self._channels.get(topic, 0)

    def announce(
        self, topic: str, definition: MessageDefinition, qos: tuple[OfferedQos, ...]
    ) -> tuple[int, list[tuple[Opcode, bytes]]]:
        """Return the number of a new topic's channel, and what announces it.

        Parameters
        ----------
        topic : str
            Full name.
        definition : MessageDefinition
            Of its type.
        qos : tuple of OfferedQos
            What its publishers offer.

        Returns
        -------
        int
            The number.
        list of tuple of Opcode and bytes
            Its record, and before it that of its type, unless another topic has it already.
        """
        records = []
        key = (definition.type_name, definition.text)
        if key not in self._schemas:
            number = self._schemas[key] = len(self._schemas) + 1
            schema = Schema(number, definition.text.encode(), "ros2msg", definition.type_name)
            records.append((Opcode.SCHEMA, format_record(schema)))
        metadata = {
            "offered_qos_profiles": format_offered_qos(qos),
            "topic_type_hash": definition.type_hash,
        }
        self._channels[topic] = channel = len(self._channels) + 1
        announced = Channel(channel, topic, "cdr", metadata, self._schemas[key])
        records.append((Opcode.CHANNEL, format_record(announced)))
        return channel, records
