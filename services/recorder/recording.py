"""One MCAP file: a channel a topic, JSON messages, chunks with an index."""

import contextlib
import json
import time
from pathlib import Path
from typing import IO

from mcap.writer import CompressionType, Writer

from common import CONTRACT_VERSION
from common import messages as m
from common.clock import NS_PER_S
from common.topics import TOPICS, Topic
from common.version import VERSION
from services.recorder.config import Config
from services.recorder.schema import schema_of, to_json

_COMPRESSION = {
    "zstd": CompressionType.ZSTD,
    "lz4": CompressionType.LZ4,
    "none": CompressionType.NONE,
}


class Recording:
    """Writes messages to a stream as MCAP; `close` makes the file whole.

    Args:
        stream: where the bytes go; closed with the recording.
        vehicle: whose messages they are.
        config: how they are packed.
    """

    def __init__(self, stream: IO[bytes], vehicle: str, config: Config) -> None:
        self.messages: dict[str, int] = {}
        self._stream = stream
        self._channels: dict[str, int] = {}
        self._schemas: dict[type[m.Message], int] = {}
        self._writer = Writer(
            stream, chunk_size=config.chunk_bytes, compression=_COMPRESSION[config.compression]
        )
        self._writer.start(profile="", library=f"autocomplete {VERSION}")
        self._writer.add_metadata(
            "autocomplete",
            {"vehicle": vehicle, "version": VERSION, "contract": str(CONTRACT_VERSION)},
        )

    def write(self, topic_name: str, message: m.Message, arrival_ns: int) -> None:
        """Add a message.

        Args:
            topic_name: a row of the table.
            message: what arrived on it.
            arrival_ns: when, in UTC; it becomes the log time, the stamp the publish time.

        Raises:
            OSError: if the stream takes no more, because the disk is full for instance.
        """
        channel = self._channels.get(topic_name)
        if channel is None:
            channel = self._add_channel(TOPICS[topic_name])
        self._writer.add_message(
            channel,
            log_time=arrival_ns,
            publish_time=max(message.stamp, 0),
            sequence=message.seq & 0xFFFFFFFF,
            data=to_json(topic_name, message),
        )
        self.messages[topic_name] = self.messages.get(topic_name, 0) + 1

    def size_bytes(self) -> int:
        """What has reached the stream by now."""
        return self._stream.tell()

    def close(self) -> None:
        """Write the last chunk and the index.

        Raises:
            OSError: if the stream does not take them.
        """
        try:
            self._writer.finish()
        finally:
            self._stream.close()

    def abandon(self) -> None:
        """Leave the file as it is, without an index: for a stream that takes no more."""
        # What is buffered cannot be written either; the file is closed all the same.
        with contextlib.suppress(OSError):
            self._stream.close()

    def _add_channel(self, topic: Topic) -> int:
        schema = self._schemas.get(topic.message)
        if schema is None:
            name, definition = schema_of(topic.message)
            schema = self._writer.register_schema(
                name, "jsonschema", json.dumps(definition).encode()
            )
            self._schemas[topic.message] = schema
        channel: int = self._writer.register_channel(topic.name, "json", schema)
        self._channels[topic.name] = channel
        return channel


def new_path(config: Config, vehicle: str, utc_ns: int) -> Path:
    """Where a recording that begins now goes."""
    began = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(utc_ns // NS_PER_S))
    return Path(config.folder) / f"{vehicle}-{began}.mcap"


def open_new(path: Path) -> IO[bytes]:
    """A new file for a recording; the folders to it are made.

    Raises:
        OSError: if it is there already or cannot be written; the text says what to do.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return path.open("xb")
    except FileExistsError:
        raise OSError(f"{path} is there already; choose another name") from None
    except OSError as error:
        reason = error.strerror or str(error)
        raise OSError(f"{path} cannot be written: {reason}; choose another folder") from None
