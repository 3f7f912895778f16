"""Decodes CDR messages by the schemas that stand beside them in a recording."""

from collections.abc import Callable
from typing import Any

from rosbags.serde import SerdeError
from rosbags.typesys import TypesysError, get_types_from_msg
from rosbags.typesys.store import Typestore

from impact_rig.core.errors import FileError
from impact_rig.recording.mcap_file import Channel


class SchemaDecoder:
    """Keeps one decoder for each channel it has met.

    Every channel has a store of types of its own, so that a file whose topics were recorded with
    different versions of a type is decoded right.
    """

    def __init__(self) -> None:
        self._decoders: dict[tuple[str, str], Callable[[bytes], Any]] = {}

    def decode(self, channel: Channel, data: bytes) -> Any:
        """Return a message as an object with its fields as attributes.

        Parameters
        ----------
        channel : Channel
            Whose schema describes the message.
        data : bytes
            The serialised message.

        Raises
        ------
        FileError
            If the schema cannot be understood or the message does not fit it.
        """
        key = (channel.type_name, channel.schema)
        decoder = self._decoders.get(key)
        if decoder is None:
            decoder = self._decoders[key] = _make_decoder(channel)
        try:
            return decoder(data)
        except (SerdeError, IndexError, AssertionError) as error:
            raise FileError(
                f"a message on {channel.topic} does not fit its schema: {error}"
            ) from None


def _make_decoder(channel: Channel) -> Callable[[bytes], Any]:
    store = Typestore()
    try:
        store.register(get_types_from_msg(channel.schema, channel.type_name))
        store.get_msgdef(channel.type_name)
    except (TypesysError, KeyError, SyntaxError, RecursionError) as error:
        raise FileError(
            f"the schema of {channel.type_name} on {channel.topic} cannot be understood:"
            f" {str(error).splitlines()[0] if str(error) else type(error).__name__}"
        ) from None

    def decode(data: bytes) -> Any:
        return store.deserialize_cdr(data, channel.type_name)

    return decode
