"""The recorder's wiring: every recorded topic into one file, from start to end of the process."""

import logging

from common import messages as m
from common.config import ConfigError
from common.node import Node
from common.topics import TOPICS
from services.recorder.config import Config
from services.recorder.recording import Recording, new_path, open_new

DEPTH = 256
"""Payloads of one topic that wait at most while the disk is busy: 1.3 s of the fastest."""

log = logging.getLogger(__name__)


class Recorder:
    """Writes until the disk takes no more; then says so in its health and stays."""

    def __init__(self, node: Node, config: Config) -> None:
        self._node = node
        self._path = new_path(config, node.vehicle, node.clock.utc_ns())
        try:
            self._recording = Recording(open_new(self._path), node.vehicle, config)
        except OSError as error:
            raise ConfigError(f"recorder: {error}") from None
        self._failure = ""
        log.info("recording to %s", self._path)

    def write(self, topic_name: str, message: m.Message, arrival_ns: int) -> None:
        """Record a message that arrived at `arrival_ns` on the monotonic clock."""
        if self._failure:
            return
        clock = self._node.clock
        arrival_utc_ns = clock.utc_ns() - (clock.monotonic_ns() - arrival_ns)
        try:
            self._recording.write(topic_name, message, arrival_utc_ns)
        except OSError as error:
            self._give_up(error)

    def health(self) -> tuple[m.HealthState, str]:
        """Where it records and how much there is, or why it does not."""
        if self._failure:
            return "failed", self._failure
        megabytes = self._recording.size_bytes() / 1e6
        count = sum(self._recording.messages.values())
        return "ok", f"{self._path}: {count} messages, {megabytes:.1f} MB"

    def close(self) -> None:
        """Finish the file."""
        if self._failure:
            return
        try:
            self._recording.close()
        except OSError as error:
            self._give_up(error)
        else:
            log.info("wrote %s", self._path)

    def _give_up(self, error: OSError) -> None:
        reason = error.strerror or str(error)
        self._failure = f"{self._path} takes no more: {reason}; make room and start again"
        log.error(self._failure)
        self._recording.abandon()


def wire(node: Node, config: Config) -> None:
    """Connect the recorder to every topic that the table records."""
    recorder = Recorder(node, config)

    def record(topic_name: str) -> None:
        node.on(
            topic_name,
            lambda message, arrival_ns: recorder.write(topic_name, message, arrival_ns),
            depth=DEPTH,
            timed=topic_name == "pose",
        )

    for topic in TOPICS.values():
        if topic.recorded:
            record(topic.name)
    node.reports(recorder.health)
    node.on_close(recorder.close)
