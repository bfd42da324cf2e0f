"""The pad adapter on SDL's own virtual joystick: nothing of it is faked but the hardware."""

import ctypes
from collections.abc import Iterator
from pathlib import Path

import pytest

from services.operator.pad import Pad
from services.operator.sources import NEUTRAL

pygame = pytest.importorskip("pygame")


class _Description(ctypes.Structure):
    """SDL_VirtualJoystickDesc, version 1 (SDL 2.24 and later)."""

    _fields_ = (
        *((name, ctypes.c_uint16) for name in ("version", "type", "axes", "buttons", "hats")),
        *((name, ctypes.c_uint16) for name in ("vendor", "product", "padding")),
        ("button_mask", ctypes.c_uint32),
        ("axis_mask", ctypes.c_uint32),
        ("name", ctypes.c_char_p),
        ("user", ctypes.c_void_p),
        ("callbacks", ctypes.c_void_p * 6),
    )


class VirtualPads:
    """Plugs pads into the SDL that pygame has loaded."""

    def __init__(self) -> None:
        folder = Path(pygame.__file__).parent.parent / "pygame.libs"
        libraries = sorted(folder.glob("libSDL2-2*"))
        if not libraries:
            pytest.skip("pygame does not bring its own SDL here")
        self._sdl = ctypes.CDLL(str(libraries[0]))
        self._sdl.SDL_JoystickFromInstanceID.restype = ctypes.c_void_p
        self._kept: list[_Description] = []

    def plug(self, name: str, axes: int = 6, buttons: int = 17) -> int:
        description = _Description(
            version=1, type=0, axes=axes, buttons=buttons, name=name.encode()
        )
        self._kept.append(description)
        index = self._sdl.SDL_JoystickAttachVirtualEx(ctypes.byref(description))
        assert index >= 0
        return int(self._sdl.SDL_JoystickGetDeviceInstanceID(index))

    def unplug(self, index: int = 0) -> None:
        assert self._sdl.SDL_JoystickDetachVirtual(index) == 0

    def move(self, instance: int, axis: int, value: float) -> None:
        pad = ctypes.c_void_p(self._sdl.SDL_JoystickFromInstanceID(instance))
        raw = ctypes.c_int16(max(-32768, min(32767, round(value * 32768))))
        assert self._sdl.SDL_JoystickSetVirtualAxis(pad, axis, raw) == 0

    def press(self, instance: int, button: int, down: bool = True) -> None:
        pad = ctypes.c_void_p(self._sdl.SDL_JoystickFromInstanceID(instance))
        assert self._sdl.SDL_JoystickSetVirtualButton(pad, button, int(down)) == 0


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
