"""Reads `rostopic echo` of sensor_msgs/Joy: YAML documents divided by `---`.

Of ROS 1 (`secs`, `nsecs`) and ROS 2 (`sec`, `nanosec`).
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from common.clock import NS_PER_S
from training.dataset.axes import Axes
from training.dataset.track import Problem, Track, TrackBuilder

Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""libyaml where PyYAML has it: 8 times faster."""

FACES = {0: "cross", 1: "circle", 2: "triangle", 3: "square"}
"""Joy's buttons of a PS3 pad, as the original set's parser reads them."""


def read_joy(path: Path, axes: Axes) -> tuple[list[Track], list[Problem]]:
    """The sticks of a file, and its documents that cannot be used.

    Raises:
        OSError: if it cannot be read.
    """
    builder = TrackBuilder(str(path))
    for number, (line, text) in enumerate(_documents(path), start=1):
        where = f"document {number} (line {line})"
        try:
            time_s, values, buttons = _parse(yaml.load(text, Loader))
            sticks = axes.sticks(values)
        except yaml.YAMLError as error:
            reason = " ".join(str(error).split())
            builder.reject(where, f"no YAML, cut off perhaps: {reason[:100]}; it is left out")
        # A whole number of 400 digits is none that a float holds.
        except (ValueError, TypeError, OverflowError) as error:
            builder.reject(where, f"{error}; it is left out")
        else:
            held = tuple(
                name for index, name in FACES.items() if index < len(buttons) and buttons[index]
            )
            builder.add(where, time_s, sticks, held)
    return builder.tracks(), builder.problems


def _documents(path: Path) -> Iterator[tuple[int, str]]:
    """The file's documents with the number of their first line."""
    begin = 1
    lines: list[str] = []
    with path.open(encoding="utf-8", errors="replace") as stream:
        for number, line in enumerate(stream, start=1):
            if line.rstrip() == "---":
                if any(each.strip() for each in lines):
                    yield begin, "".join(lines)
                begin, lines = number + 1, []
            else:
                lines.append(line)
    if any(each.strip() for each in lines):
        yield begin, "".join(lines)


def _parse(message: Any) -> tuple[float, list[float], list[Any]]:
    """Time in s, axes and buttons of one message.

    Raises:
        ValueError: if it is no Joy; the text says what it lacks.
    """
    if not isinstance(message, dict):
        raise ValueError("no sensor_msgs/Joy")
    header = message.get("header")
    stamp = header.get("stamp") if isinstance(header, dict) else None
    if not isinstance(stamp, dict):
        raise ValueError("header.stamp is missing")
    seconds = stamp.get("secs", stamp.get("sec"))
    rest_ns = stamp.get("nsecs", stamp.get("nanosec"))
    if not isinstance(seconds, int) or not isinstance(rest_ns, int):
        raise ValueError("header.stamp lacks its secs or nsecs")
    axes, buttons = message.get("axes"), message.get("buttons", [])
    if not isinstance(axes, list) or not all(isinstance(a, int | float) for a in axes):
        raise ValueError("axes is no list of numbers")
    if not isinstance(buttons, list):
        raise ValueError("buttons is no list")
    return seconds + rest_ns / NS_PER_S, [float(a) for a in axes], buttons
