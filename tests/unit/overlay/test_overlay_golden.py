"""The drawing as a whole, against pictures that were looked at.

After a wanted change: `RENEW_GOLDEN=1 pytest tests/unit/overlay/test_overlay_golden.py`, then look.
"""

import os
from pathlib import Path

import cv2
import numpy as np
import overlay_scenes as scenes
import pytest
from overlay_scenes import NOW_NS

from common import messages as m
from services.overlay.config import Config
from services.overlay.core import Overlay

GOLDEN = Path(__file__).parent / "golden"
DIFFERENCE = 40
"""Levels by which a pixel may differ: another JPEG or text library rounds another way."""
DIFFERING = 0.002
"""Part of the pixels that may differ by more."""


def core_with(suggestion: m.Suggestion, mode: m.FlightMode) -> Overlay:
    core = Overlay(Config(jpeg_quality=95))
    core.on_pose(scenes.pose(), NOW_NS)
    core.on_suggestion(suggestion, NOW_NS)
    core.on_autopilot(scenes.status(mode, suggestion.id), NOW_NS)
    core.on_stick(m.Stick(stamp=0, seq=0, vx=0.0, vy=0.0, vz=0.0, wz=0.0), NOW_NS - 12 * 1_000_000)
    core.on_vehicle(
        m.VehicleStatus(
            stamp=0, seq=0, state="flying", battery=0.87, world="x", plant="tum", collisions=0
        ),
        NOW_NS,
    )
    return core


SCENES = {
    "offered_line": (
        scenes.suggestion(scenes.line(), primitive="line", heading_sector=0),
        "manual",
    ),
    "engaged_circle": (
        scenes.suggestion(scenes.circle(4.0, left=True), closed=True),
        "engaged",
    ),
    "offered_helix": (
        scenes.suggestion(scenes.circle(4.0, left=False, turns=3, pitch_m=4.0), primitive="helix"),
        "manual",
    ),
}


@pytest.mark.parametrize("name", SCENES)
def test_the_picture_looks_as_it_did(name):
    suggestion, mode = SCENES[name]
    drawn = core_with(suggestion, mode).draw(scenes.image(), NOW_NS)
    picture = scenes.pixels(drawn)
    path = GOLDEN / f"{name}.png"
    if os.environ.get("RENEW_GOLDEN"):
        cv2.imwrite(str(path), picture, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    golden = cv2.imread(str(path))
    assert golden is not None, f"{path} is missing"
    difference = np.abs(picture.astype(int) - golden.astype(int)).max(axis=2)
    assert (difference > DIFFERENCE).mean() <= DIFFERING
