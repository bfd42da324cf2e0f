"""What the console's page and its server say to one another, over one WebSocket.

From the server: binary messages are JPEG pictures; text messages are JSON maps with a `type`. The
page answers each picture with `shown`; few are on their way to a page that does not, and the next
is always the newest: a slow page sees fewer pictures and never old ones.
"""

import math
from typing import Annotated

import msgspec
from msgspec import Meta

from common.messages import Confidence, Count, DecideAction, Fraction
from services.overlay.lease import Standing


class ClientMessage(msgspec.Struct, frozen=True, tag_field="type", forbid_unknown_fields=True):
    """What a page sends."""

    def __post_init__(self) -> None:
        for field in self.__struct_fields__:
            value = getattr(self, field)
            if isinstance(value, float) and not math.isfinite(value):
                raise ValueError(f"{field} is not finite")


class StickMoved(ClientMessage, frozen=True, tag="stick"):
    """The page's sticks; sent at about 50 Hz while they are held."""

    vx: Fraction
    vy: Fraction
    vz: Fraction
    wz: Fraction


class Released(ClientMessage, frozen=True, tag="release"):
    """The page's sticks are let go: said once when it connects, and after they were held."""


class Marked(ClientMessage, frozen=True, tag="mark"):
    """A primitive ends here: said while data is collected."""


class Decided(ClientMessage, frozen=True, tag="decide"):
    """A button was pressed."""

    action: DecideAction
    nonce: Annotated[int, Meta(ge=-(2**63), le=2**63 - 1)]
    suggestion: Count | None = None


class Shown(ClientMessage, frozen=True, tag="shown"):
    """The last picture is on the screen."""


FromPage = StickMoved | Released | Marked | Decided | Shown


class Answer(msgspec.Struct, frozen=True, tag_field="type", tag="decision"):
    """What became of a decision."""

    nonce: int
    ok: bool
    reason: str


class Problem(msgspec.Struct, frozen=True, tag_field="type", tag="error"):
    """What the page sent cannot be used."""

    error: str


class Offer(msgspec.Struct, frozen=True):
    """The suggestion on the screen."""

    id: Count
    primitive: str
    confidence: Confidence
    speed_mps: float
    fit_rms_m: float


class State(msgspec.Struct, frozen=True, tag_field="type", tag="state"):
    """What the page shows around the picture; ages in s, None for what never came."""

    vehicle_name: str
    mode: str
    reason: str
    progress_m: float
    cross_track_m: float
    offer: Offer | None
    advice: str
    """Why there is no suggestion, or not quite the one that was meant."""
    label: str
    probabilities: dict[str, float]
    vehicle_state: str
    battery: float | None
    collisions: int
    world: str
    pose_status: str
    ages_s: dict[str, float | None]
    stale: list[str]
    """Those of `ages_s` whose newest message is too old to count."""
    alive: list[str]
    linked: bool
    pad: Standing
    """What the pad is to this page."""


_decoder: msgspec.json.Decoder[FromPage] = msgspec.json.Decoder(FromPage)
_encoder = msgspec.json.Encoder()


def decode(text: str) -> FromPage:
    """What a page said.

    Raises:
        msgspec.MsgspecError: if it is nothing that a page may say.
    """
    return _decoder.decode(text)


def encode(message: Answer | Problem | State) -> str:
    """A message to a page, as JSON."""
    return _encoder.encode(message).decode()
