"""Messages as JSON with the schemas that Foxglove and other MCAP readers know.

Pictures become foxglove.CompressedImage with this project's other fields beside its own, so that
nothing is lost; everything else keeps the shape it has on the wire.
"""

from typing import Any

import msgspec

from common import messages as m
from common.clock import NS_PER_S

IMAGE_SCHEMA_NAME = "foxglove.CompressedImage"
"""https://docs.foxglove.dev/docs/visualization/message-schemas/compressed-image"""

_TIME = {
    "type": "object",
    "title": "time",
    "properties": {
        "sec": {"type": "integer", "minimum": 0},
        "nsec": {"type": "integer", "minimum": 0, "maximum": 999_999_999},
    },
}

_encoder = msgspec.json.Encoder()


def schema_of(message: type[m.Message]) -> tuple[str, dict[str, Any]]:
    """The name and JSON Schema under which a message type is recorded."""
    schema = _plain(m.json_schema_of(message)["$defs"][message.__name__])
    if message is not m.Image:
        return message.__name__, schema
    properties = {
        "timestamp": _TIME | {"description": "when the picture was taken"},
        "frame_id": {"type": "string"},
        **schema["properties"],
    }
    return IMAGE_SCHEMA_NAME, schema | {"title": IMAGE_SCHEMA_NAME, "properties": properties}


def to_json(topic_name: str, message: m.Message) -> bytes:
    """A message as its schema describes it; bytes are base64."""
    if not isinstance(message, m.Image):
        return _encoder.encode(message)
    seconds, nanoseconds = divmod(max(message.capture, 0), NS_PER_S)
    return _encoder.encode(
        {
            "timestamp": {"sec": seconds, "nsec": nanoseconds},
            "frame_id": topic_name,
            **msgspec.structs.asdict(message),
        }
    )


def _plain(schema: Any) -> Any:
    """The same schema with fixed lists as `items`, which is all that Foxglove's reader knows."""
    if isinstance(schema, list):
        return [_plain(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    plain = {key: _plain(value) for key, value in schema.items() if key != "prefixItems"}
    if "prefixItems" in schema:
        plain["items"] = _plain(schema["prefixItems"][0])
    return plain
