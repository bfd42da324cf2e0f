"""Reads what `autocomplete record` wrote: MCAP files with a JSON message of the contract each."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
from mcap.reader import NonSeekingReader

from common import messages as m
from common.clock import NS_PER_S
from common.topics import TOPICS
from training.dataset.track import Problem, Track, TrackBuilder


@dataclass(frozen=True)
class Logged:
    """A message of a recording, and when it reached the recorder in UTC."""

    topic: str
    log_ns: int
    message: m.Message


def read_messages(path: Path, topics: Sequence[str]) -> tuple[list[Logged], list[Problem]]:
    """The messages of some topics in the order of their arrival, and what cannot be read.

    A file that is cut off gives what was written before.

    Raises:
        OSError: if it cannot be opened.
    """
    logged: list[Logged] = []
    problems: list[Problem] = []
    with path.open("rb") as stream:
        # Not through the index: it is the end of the file, which a crash does not leave behind.
        messages = NonSeekingReader(stream).iter_messages(topics, log_time_order=False)
        try:
            for _, channel, raw in messages:
                try:
                    message = msgspec.json.decode(raw.data, type=TOPICS[channel.topic].message)
                except (msgspec.DecodeError, UnicodeDecodeError) as error:
                    where = f"{channel.topic} {raw.sequence}"
                    problems.append(Problem(str(path), where, f"{error}; it is left out"))
                else:
                    logged.append(Logged(channel.topic, raw.log_time, message))
        # The reader and each decompressor have errors of their own for bytes that are broken.
        except Exception as error:
            reason = f"{type(error).__name__}: {error}".rstrip(": ")
            done = f"what comes before, {len(logged)} messages, is used" if logged else "no MCAP?"
            problems.append(Problem(str(path), "", f"cannot be read to its end ({reason}); {done}"))
    logged.sort(key=lambda each: each.log_ns)
    return logged, problems


def tracks_of(
    path: Path, sticks: Sequence[m.Stick], problems: list[Problem]
) -> tuple[list[Track], list[Problem]]:
    """Sticks as tracks, with the problems so far and their own."""
    builder = TrackBuilder(str(path))
    for stick in sticks:
        values = (stick.vx, stick.vy, stick.vz, stick.wz)
        where = f"stick {stick.seq}"
        builder.add(where, stick.stamp / NS_PER_S, values, tuple(stick.buttons or ()))
    return builder.tracks(), problems + builder.problems


def read_recording(path: Path) -> tuple[list[Track], list[Problem]]:
    """The sticks of a recording, and its messages that cannot be used.

    Raises:
        OSError: if it cannot be opened.
    """
    logged, problems = read_messages(path, ["stick"])
    sticks = [each.message for each in logged if isinstance(each.message, m.Stick)]
    if not sticks and not problems:
        problems.append(Problem(str(path), "", "holds no sticks; record while somebody flies"))
    return tracks_of(path, sticks, problems)
