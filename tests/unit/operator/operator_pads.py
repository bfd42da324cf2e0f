"""SDL's own virtual joysticks: nothing of a pad is faked but the hardware."""

import ctypes
from pathlib import Path

import pygame
import pytest


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
