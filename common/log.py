"""Logging: one line an event, readable on a terminal, JSON elsewhere; repeats are limited."""

import json
import logging
import sys
import time
from typing import Any

from common.clock import NS_PER_S, Clock

REPEAT_PERIOD_S = 1.0
"""The same warning is written at most once in this time."""


class _JsonFormatter(logging.Formatter):
    # UTC, so that the logs of two machines can be laid side by side.
    converter = staticmethod(time.gmtime)
    default_time_format = "%Y-%m-%dT%H:%M:%S"
    default_msec_format = "%s.%03dZ"

    def __init__(self, bound: dict[str, str]) -> None:
        super().__init__()
        self._bound = bound

    def format(self, record: logging.LogRecord) -> str:
        line: dict[str, Any] = {
            "time": self.formatTime(record),
            "level": record.levelname.lower(),
            **self._bound,
            "logger": record.name,
            "message": record.getMessage(),
        }
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line)


def configure(service: str, vehicle: str, level: str = "INFO") -> None:
    """Send this process' log to stderr, each line bound to its service and vehicle."""
    handler = logging.StreamHandler(sys.stderr)
    if sys.stderr.isatty():
        handler.setFormatter(
            logging.Formatter(f"%(asctime)s %(levelname)-7s {service:<10} %(message)s", "%H:%M:%S")
        )
    else:
        handler.setFormatter(_JsonFormatter({"service": service, "vehicle": vehicle}))
    logging.basicConfig(level=level, handlers=[handler], force=True)


class RateLimited:
    """Writes a warning at most once a second for each source; says how many were left out.

    The source is the text up to its first colon.
    """

    def __init__(self, logger: logging.Logger, clock: Clock) -> None:
        self._logger = logger
        self._clock = clock
        self._last_ns: dict[str, int] = {}
        self._left_out: dict[str, int] = {}

    def warning(self, text: str) -> None:
        """Write `text`, unless its source was heard within the last second."""
        source = text.split(":", 1)[0]
        now_ns = self._clock.monotonic_ns()
        last_ns = self._last_ns.get(source)
        if last_ns is not None and now_ns - last_ns < REPEAT_PERIOD_S * NS_PER_S:
            self._left_out[source] = self._left_out.get(source, 0) + 1
            return
        self._last_ns[source] = now_ns
        left_out = self._left_out.pop(source, 0)
        self._logger.warning("%s%s", text, f" ({left_out} more like it)" if left_out else "")
