"""The pad adapter on SDL's own virtual joysticks."""

from collections.abc import Iterator

import pytest
from operator_pads import VirtualPads

from services.operator.pad import Pad
from services.operator.sources import NEUTRAL


@pytest.fixture
def pads() -> VirtualPads:
    return VirtualPads()


@pytest.fixture
def pad() -> Iterator[Pad]:
    pad = Pad("", 0.1)
    yield pad
    pad.close()


PS3 = "Sony PLAYSTATION(R)3 Controller"


def test_without_a_pad_there_is_no_reading(pad: Pad) -> None:
    assert pad.poll() is None
    assert pad.name is None


def test_sticks_and_buttons_of_a_plugged_pad_are_read(pad: Pad, pads: VirtualPads) -> None:
    instance = pads.plug(PS3)
    reading = pad.poll()
    assert pad.name == PS3
    assert reading is not None
    assert reading.sticks == NEUTRAL
    pads.move(instance, 1, -1.0)
    pads.move(instance, 3, 0.55)
    pads.press(instance, 5)
    pads.press(instance, 0)
    reading = pad.poll()
    assert reading is not None
    assert reading.sticks.vx == 1.0
    assert reading.sticks.wz == pytest.approx(-0.5, abs=1e-3)
    assert reading.decisions == {"accept"}
    assert reading.buttons == ("cross",)
    pads.move(instance, 1, 0.0)
    reading = pad.poll()
    assert reading is not None
    assert reading.sticks.vx == 0.0
    pads.unplug()


def test_an_unplugged_pad_gives_no_old_value_and_may_come_back(pad: Pad, pads: VirtualPads) -> None:
    first = pads.plug(PS3)
    pad.poll()
    pads.move(first, 1, -1.0)
    reading = pad.poll()
    assert reading is not None
    assert reading.sticks.vx == 1.0
    pads.unplug()
    assert pad.poll() is None
    second = pads.plug("Microsoft X-Box 360 pad", buttons=11)
    reading = pad.poll()
    assert reading is not None
    assert reading.sticks == NEUTRAL
    pads.press(second, 7)
    reading = pad.poll()
    assert reading is not None
    assert reading.decisions == {"takeoff"}
    pads.unplug()


def test_a_pad_with_few_axes_and_buttons_is_no_error(pad: Pad, pads: VirtualPads) -> None:
    instance = pads.plug("Two axes", axes=2, buttons=2)
    pads_reading = pad.poll()
    assert pads_reading is not None
    pads.move(instance, 1, -1.0)
    reading = pad.poll()
    assert reading is not None
    assert reading.sticks.vx == 1.0
    assert reading.sticks.wz == 0.0
    pads.unplug()


def test_a_profile_can_be_forced(pads: VirtualPads) -> None:
    pad = Pad("generic", 0.1)
    instance = pads.plug(PS3)
    pad.poll()
    pads.move(instance, 2, -1.0)
    reading = pad.poll()
    assert reading is not None
    assert reading.sticks.wz == 1.0
    pads.unplug()
    pad.close()
