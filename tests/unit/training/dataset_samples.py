"""Sticks and files of sticks to read, small and made here."""

import io
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from common import messages as m
from services.recorder.config import Config
from services.recorder.recording import Recording
from training.dataset.primitive import Primitive

UTC_S = 1_700_000_000
UTC_NS = UTC_S * 1_000_000_000
STEP_NS = 20_000_000
REST = (0.0, 0.0, 0.0, 0.0)
FORWARD = (0.7, 0.0, 0.0, 0.0)


def circle(samples: int = 150, rate_hz: float = 50.0) -> np.ndarray:
    """Sticks that turn once, never beyond full."""
    angle = 2.0 * np.pi * np.arange(samples) / samples
    sticks = np.zeros((samples, 4))
    sticks[:, 0], sticks[:, 1] = 0.7 * np.cos(angle), 0.7 * np.sin(angle)
    return sticks


def primitive(**changes: Any) -> Primitive:
    """An arc of 3 s at 50 Hz, or what the changes make of it."""
    sticks = np.asarray(changes.pop("sticks", circle()), dtype=np.float64)
    fields = {
        "times_s": np.arange(len(sticks)) / 50.0,
        "sticks": sticks,
        "label": "arc",
        "operator": "ana",
        "family": "",
        "source": "test",
        "utc_ns": UTC_NS,
    }
    return Primitive(**(fields | changes))


Row = tuple[Sequence[float], str]
"""vx vy vz wz and the button that is held, or ""."""


def performed(*parts: tuple[Iterable[Sequence[float]], str]) -> list[Row]:
    """Rest, then each part's sticks, half a second of rest, and its button held for 0.1 s."""
    rows: list[Row] = [(REST, "")] * 10
    for sticks, button in parts:
        rows += [(tuple(row), "") for row in sticks]
        rows += [(REST, "")] * 25 + [(REST, button)] * 5 + [(REST, "")] * 10
    return rows


CSV_BUTTONS = ("triangle", "circle", "cross", "square")


def write_csv(path: Path, rows: Sequence[Row]) -> Path:
    lines = ["secs,a,b,c,tri,cir,X,squ"]
    for number, (sticks, button) in enumerate(rows):
        vx, vy, vz, _ = sticks
        pressed = ",".join(str(int(button == name)) for name in CSV_BUTTONS)
        lines.append(f"{UTC_S + 0.02 * number:.6f},{vy:.6f},{vx:.6f},{vz:.6f},{pressed}")
    path.write_text("\n".join(lines) + "\n")
    return path


JOY_BUTTONS = ("cross", "circle", "triangle", "square")


def joy_document(number: int, sticks: Sequence[float], button: str) -> str:
    vx, vy, vz, wz = (float(axis) for axis in sticks)
    stamp_ns = number * STEP_NS
    buttons = [int(button == name) for name in JOY_BUTTONS]
    return (
        f"header: \n  seq: {number}\n  stamp: \n    secs: {UTC_S + stamp_ns // 10**9}\n"
        f"    nsecs: {stamp_ns % 10**9}\n  frame_id: ''\n"
        f"axes: {[vy, vx, wz, vz, 0.0]}\nbuttons: {[*buttons, 0, 0]}\n"
    )


def write_joy(path: Path, rows: Sequence[Row]) -> Path:
    documents = [joy_document(number, *row) for number, row in enumerate(rows)]
    path.write_text("---\n".join(documents) + "---\n")
    return path


def write_vectors(path: Path, rows: Sequence[tuple[np.ndarray, object]]) -> Path:
    lines = []
    for sticks, label in rows:
        cells = [json.dumps([row[1], row[0], row[2]]) for row in sticks.tolist()]
        lines.append(",".join([*(f'"{cell}"' for cell in cells), str(label)]))
    path.write_text("\n".join(lines) + "\n")
    return path


def stick(number: int, sticks: Sequence[float], button: str = "") -> m.Stick:
    vx, vy, vz, wz = (float(axis) for axis in sticks)
    return m.Stick(
        stamp=UTC_NS + number * STEP_NS,
        seq=number,
        vx=vx,
        vy=vy,
        vz=vz,
        wz=wz,
        buttons=[button] if button else None,
    )


def sticks_of(rows: Sequence[Row]) -> list[m.Stick]:
    return [stick(number, *row) for number, row in enumerate(rows)]


def write_recording(path: Path, messages: Sequence[tuple[str, m.Message, int]]) -> Path:
    """(topic, message, arrival in ns) into a file of the recorder's own."""
    stream = io.BytesIO()
    stream.close = lambda: None  # type: ignore[method-assign]
    recording = Recording(stream, "drone0", Config())
    for topic, message, arrival_ns in messages:
        recording.write(topic, message, arrival_ns)
    recording.close()
    path.write_bytes(stream.getvalue())
    return path


def write_sticks(path: Path, rows: Sequence[Row]) -> Path:
    sticks = sticks_of(rows)
    return write_recording(path, [("stick", each, each.stamp + 500_000) for each in sticks])
