"""The log: a JSON object a line where nobody looks on, and no floods."""

import json
import logging
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta

import pytest

from common import log
from common.clock import ManualClock


@pytest.fixture
def root_logger() -> Iterator[logging.Logger]:
    """The root logger, given back as it was."""
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    yield root
    root.handlers[:] = handlers
    root.setLevel(level)


def test_each_line_is_json_and_names_service_and_vehicle(
    capsys: pytest.CaptureFixture[str], root_logger: logging.Logger
) -> None:
    log.configure("sim", "drone7")
    logging.getLogger("a").info("up with %d", 3)
    try:
        raise ValueError("two\nlines")
    except ValueError:
        logging.getLogger("b").exception("went wrong")
    logging.getLogger("c").debug("not shown")
    first, second = map(json.loads, capsys.readouterr().err.splitlines())
    assert datetime.now(UTC) - datetime.fromisoformat(first["time"]) < timedelta(seconds=5)
    assert first["message"] == "up with 3"
    assert (first["level"], first["logger"]) == ("info", "a")
    assert (first["service"], first["vehicle"]) == ("sim", "drone7")
    assert "ValueError: two\nlines" in second["exception"]


def test_the_same_warning_is_written_once_a_second_each_source(
    caplog: pytest.LogCaptureFixture,
) -> None:
    clock = ManualClock(10**12)
    warn = log.RateLimited(logging.getLogger("limited"), clock)
    for n in range(100):
        warn.warning(f"pose: bad {n}")
        warn.warning(f"imu: bad {n}")
        clock.advance(0.005)
    assert [record.getMessage() for record in caplog.records] == ["pose: bad 0", "imu: bad 0"]
    clock.advance(1.0)
    warn.warning("pose: bad again")
    assert caplog.records[-1].getMessage() == "pose: bad again (99 more like it)"
