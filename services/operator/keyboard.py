"""A small window that takes keys; a terminal cannot, since it never tells of a key's release."""

import os

from common.config import ConfigError
from common.messages import DecideAction
from common.sticks import END_BUTTON
from services.operator.sources import Deflection, Reading

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
os.environ.setdefault("SDL_NO_SIGNAL_HANDLERS", "1")

import pygame

AXES: dict[str, tuple[int, int]] = {
    "w": (0, +1),
    "s": (0, -1),
    "a": (1, +1),
    "d": (1, -1),
    "up": (2, +1),
    "down": (2, -1),
    "left": (3, +1),
    "right": (3, -1),
}
"""Key -> which of vx vy vz wz, and its sign."""

DECISIONS: dict[str, DecideAction] = {
    "return": "accept",
    "escape": "cancel",
    "t": "takeoff",
    "l": "land",
    "delete": "emergency",
}

END = "e"
"""Ends a primitive while data is collected."""

FULL = 0.8
"""What a held key commands in the end."""
RISE_PER_S = 4.0
"""A key is pressed at once, a stick is not: the deflection grows at this rate."""

HELP = (
    "W S A D   forward back left right",
    "arrows   up down, turn left right",
    "Enter accept    Esc cancel    E end of primitive",
    "T take off   L land   Del emergency",
)
NO_SCREEN = {"dummy", "offscreen"}


class Keys:
    """Sticks from the keys that are held; released keys are neutral at once. Pure."""

    def __init__(self) -> None:
        self._axes = [0.0, 0.0, 0.0, 0.0]

    def step(self, held: set[str], elapsed_s: float) -> Reading:
        """The reading after `elapsed_s` with these keys held (names as pygame's)."""
        wanted = [0, 0, 0, 0]
        for key in held & AXES.keys():
            index, sign = AXES[key]
            wanted[index] += sign
        for index, sign in enumerate(wanted):
            so_far = self._axes[index] * sign
            grown = max(so_far, 0.0) + RISE_PER_S * elapsed_s
            self._axes[index] = sign * min(grown, FULL)
        return Reading(
            Deflection(*self._axes),
            buttons=(END_BUTTON,) if END in held else (),
            decisions=frozenset(DECISIONS[key] for key in held & DECISIONS.keys()),
        )


class Keyboard:
    """The window, polled.

    Raises:
        ConfigError: where there is no screen to open it on.
    """

    def __init__(self) -> None:
        try:
            pygame.display.init()
            driver = pygame.display.get_driver()
            if driver in NO_SCREEN:
                raise pygame.error(f"SDL offers only its {driver!r} driver")
            self._screen = pygame.display.set_mode((420, 140))
        except pygame.error as error:
            raise ConfigError(
                f"operator: source 'keyboard' needs a screen for its window ({error});"
                " use source 'console' and the browser's keyboard"
            ) from None
        pygame.display.set_caption("Autocomplete: keys")
        pygame.font.init()
        font = pygame.font.Font(None, 26)
        for row, line in enumerate(HELP):
            self._screen.blit(font.render(line, True, "white"), (14, 14 + 28 * row))
        pygame.display.flip()
        self._held: set[str] = set()
        self._keys = Keys()

    def poll(self, elapsed_s: float) -> Reading:
        """The hands now. Without the window's focus SDL reports every key as released."""
        for event in pygame.event.get():
            if event.type == pygame.KEYDOWN:
                self._held.add(pygame.key.name(event.key))
            elif event.type == pygame.KEYUP:
                self._held.discard(pygame.key.name(event.key))
            elif event.type in (pygame.WINDOWFOCUSLOST, pygame.QUIT):
                self._held.clear()
        return self._keys.step(self._held, elapsed_s)

    def close(self) -> None:
        """Close the window."""
        pygame.quit()
