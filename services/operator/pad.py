"""The pad in the operator's hands, through SDL. No thread: it is polled."""

import logging
import os

from services.operator.profiles import PROFILES, Profile, profile_of, read
from services.operator.sources import Reading

# SDL reads these when it starts: no window, no handlers of signals, pads without a focused window.
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
os.environ.setdefault("SDL_NO_SIGNAL_HANDLERS", "1")
os.environ.setdefault("SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS", "1")

import pygame

log = logging.getLogger(__name__)


class Pad:
    """The first pad that is plugged in, whenever that is.

    Args:
        profile: a name of `PROFILES`, or empty to choose by the pad's name.
        dead_band: deflections of an axis up to this count as none.
    """

    def __init__(self, profile: str, dead_band: float) -> None:
        self._forced = PROFILES[profile] if profile else None
        self._dead_band = dead_band
        self._device: pygame.joystick.JoystickType | None = None
        self._profile: Profile = PROFILES["generic"]
        os.environ["SDL_VIDEODRIVER"] = "dummy"
        pygame.display.init()
        pygame.joystick.init()

    @property
    def name(self) -> str | None:
        """What the pad calls itself; None while there is none."""
        return self._device.get_name() if self._device is not None else None

    def poll(self) -> Reading | None:
        """The hands now; None while there is no pad."""
        for event in pygame.event.get((pygame.JOYDEVICEADDED, pygame.JOYDEVICEREMOVED)):
            self._plugged(event)
        # Axes and buttons are read as states: their events only have to be thrown away.
        pygame.event.clear()
        device = self._device
        if device is None:
            return None

        def axis(index: int) -> float:
            return device.get_axis(index) if index < device.get_numaxes() else 0.0

        def button(index: int) -> bool:
            return index < device.get_numbuttons() and bool(device.get_button(index))

        return read(self._profile, axis, button, self._dead_band)

    def close(self) -> None:
        """Let go of the pad and of SDL."""
        self._device = None
        pygame.joystick.quit()
        pygame.display.quit()

    def _plugged(self, event: pygame.event.Event) -> None:
        if event.type == pygame.JOYDEVICEREMOVED:
            device = self._device
            if device is not None and device.get_instance_id() == event.instance_id:
                log.warning("the pad %s is gone", device.get_name())
                self._device = None
        if self._device is None and pygame.joystick.get_count() > 0:
            self._device = device = pygame.joystick.Joystick(0)
            self._profile = self._forced or profile_of(device.get_name())
            names = [name for name, profile in PROFILES.items() if profile is self._profile]
            log.info("using the pad %s as %s", device.get_name(), names[0])
            # SDL knows a pad's axes only after it has looked once since opening it.
            pygame.event.pump()
