"""Messages in the encodings of other programs, decoded by the schemas in their files."""

import json
from collections.abc import Callable
from typing import Any

from mcap.records import Schema

from impact_rig.core.given.errors import FileError
from impact_rig.recordings.records import ROS, Channel, Encoding, RawMessage
from impact_rig.recordings.schemas import decode_message

Decode = Callable[[RawMessage], Any]
"""Returns a message with its fields as attributes, or as a dict."""
PROTOBUF = "protobuf"


def _make_json_decoder(channel: Channel) -> Decode:
    def decode(message: RawMessage) -> Any:
        try:
            return json.loads(message.data)
        except (ValueError, RecursionError) as error:
            raise FileError(f"a message on {channel.topic} is no JSON: {error}") from None

    return decode


def _make_protobuf_decoder(channel: Channel) -> Decode:
    from mcap_protobuf.decoder import DecoderFactory

    content = channel.schema.encode(errors="surrogateescape")
    schema = Schema(id=1, data=content, encoding=PROTOBUF, name=channel.type_name)
    decode: Any = DecoderFactory().decoder_for(PROTOBUF, schema)
    return lambda message: decode(message.data)


DECODERS: dict[Encoding, Callable[[Channel], Decode]] = {
    ROS: lambda _: decode_message,
    ("json", "jsonschema"): _make_json_decoder,
    ("json", ""): _make_json_decoder,
    (PROTOBUF, PROTOBUF): _make_protobuf_decoder,
}
"""Makers of decoders by encoding."""
