"""What is drawn: the newest suggestion's path on the newest picture, and who flies. Pure."""

from collections import deque

import msgspec

from common import messages as m
from common.camera import Lens
from common.clock import seconds
from common.topics import TOPICS
from services.overlay import picture as pic
from services.overlay.arrows import arrows_of
from services.overlay.config import Config

POSES = 100
"""A second of poses: a picture arrives later than the pose of its moment."""
MATCH_S = 0.1
"""A pose whose stamp is this far from the picture's moment does not belong to it."""

OFFERS = 16
"""Suggestions kept: an accepted one may be seconds older than the newest."""

BATTERY_LOW = 0.2
"""A charge below this is written as a warning; the autopilot begins no path with it."""

SECTORS = ("ahead", "ahead left", "left", "back left", "back", "back right", "right", "ahead right")


class Overlay:
    """Keeps the newest of each topic and draws pictures."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._poses: deque[m.Pose] = deque(maxlen=POSES)
        self._arrival_ns: dict[str, int] = {}
        self.status: m.AutopilotStatus | None = None
        self.vehicle: m.VehicleStatus | None = None
        self.intent: m.Intent | None = None
        self._offers: deque[m.Suggestion] = deque(maxlen=OFFERS)
        self._engaged: m.Suggestion | None = None
        self._refusal: m.Refusal | None = None
        self.undecodable = 0

    def on_pose(self, pose: m.Pose, now_ns: int) -> None:
        """Remember a pose; one that goes back in time begins anew."""
        if self._poses and pose.stamp < self._poses[-1].stamp:
            # The console's thread may be looking at the old ones.
            self._poses = deque(maxlen=POSES)
        self._poses.append(pose)
        self._arrival_ns["pose"] = now_ns

    def on_stick(self, stick: m.Stick, now_ns: int) -> None:
        """Note that the operator's link lives."""
        self._arrival_ns["stick"] = now_ns

    def on_intent(self, intent: m.Intent, now_ns: int) -> None:
        """Remember what the operator seems to mean."""
        self.intent = intent
        self._arrival_ns["intent"] = now_ns

    def on_suggestion(self, suggestion: m.Suggestion, now_ns: int) -> None:
        """Remember what can be accepted."""
        self._offers.append(suggestion)
        self._refusal = None
        self._arrival_ns["suggestion"] = now_ns

    def on_refusal(self, refusal: m.Refusal, now_ns: int) -> None:
        """Remember why what the operator means is not suggested."""
        self._refusal = refusal
        self._arrival_ns["refusal"] = now_ns

    def on_autopilot(self, status: m.AutopilotStatus, now_ns: int) -> None:
        """Remember who flies, and the suggestion that is being flown."""
        self.status = status
        self._arrival_ns["autopilot"] = now_ns
        flown = status.suggestion if status.mode == "engaged" else 0
        if self._engaged is None or self._engaged.id != flown:
            # The newest of an id: a synthesis that was restarted counts from 1 again.
            same = (each for each in reversed(self._offers) if each.id == flown)
            self._engaged = next(same, None)

    def on_vehicle(self, vehicle: m.VehicleStatus, now_ns: int) -> None:
        """Remember the vehicle's state."""
        self.vehicle = vehicle
        self._arrival_ns["vehicle"] = now_ns

    def age_s(self, topic: str, now_ns: int) -> float | None:
        """How long ago the newest message of a topic came; None if none did."""
        arrival_ns = self._arrival_ns.get(topic)
        return None if arrival_ns is None else seconds(now_ns - arrival_ns)

    def is_fresh(self, topic: str, now_ns: int) -> bool:
        """Whether the newest message of a topic is young enough to count."""
        age_s = self.age_s(topic, now_ns)
        return age_s is not None and age_s <= TOPICS[topic].max_age_s

    def is_engaged(self, now_ns: int) -> bool:
        """Whether the autopilot flies a path."""
        if self.status is None or not self.is_fresh("autopilot", now_ns):
            return False
        return self.status.mode == "engaged"

    def shown(self, now_ns: int) -> m.Suggestion | None:
        """The suggestion to draw: the one being flown, else one that can still be accepted."""
        if self.is_engaged(now_ns):
            return self._engaged
        return self._offers[-1] if self.is_fresh("suggestion", now_ns) else None

    def advice(self, now_ns: int) -> str:
        """Why there is no suggestion, or not quite the one that was meant; empty if all is well."""
        refusal = self._refusal
        if refusal is not None and self.is_fresh("refusal", now_ns):
            return "" if self.is_engaged(now_ns) else f"no {refusal.label}: {refusal.reason}"
        shown = self.shown(now_ns)
        return (shown.note or "") if shown is not None else ""

    def pose_status(self, now_ns: int) -> str:
        """`ok`, `degraded` or `lost`."""
        poses = self._poses
        if not poses or not self.is_fresh("pose", now_ns):
            return "lost"
        return poses[-1].status

    def draw(self, image: m.Image, now_ns: int) -> m.Image | None:
        """The picture with arrows and a strip of text; None if it is no picture."""
        self._arrival_ns["camera/front"] = now_ns
        picture = pic.decode(image.data)
        if picture is None or picture.shape[:2] != (image.height, image.width):
            self.undecodable += 1
            return None
        suggestion = self.shown(now_ns)
        pose = self._pose_at(image.capture, now_ns)
        if suggestion is not None and pose is not None:
            lens = Lens(image.width, image.height, image.intrinsics, image.distortion)
            colour = pic.ENGAGED if self.is_engaged(now_ns) else pic.SUGGESTED
            config = self._config
            for arrow in arrows_of(suggestion, pose, lens, config.drawn_m, config.below_m):
                pic.draw_arrow(picture, arrow, colour)
        pic.draw_strip(picture, self._texts(suggestion, pose, now_ns))
        if advice := self.advice(now_ns):
            pic.draw_foot(picture, advice, pic.TEXT)
        data = pic.encode(picture, self._config.jpeg_quality)
        return msgspec.structs.replace(image, data=data)

    def health(self, now_ns: int) -> tuple[m.HealthState, str]:
        """What is missing for a picture with a path in it."""
        missing = [
            topic
            for topic in ("camera/front", "pose", "autopilot")
            if not self.is_fresh(topic, now_ns)
        ]
        parts = [f"no {topic}" for topic in missing]
        if self.undecodable:
            parts.append(f"{self.undecodable} pictures that are no JPEG of their size")
        return ("degraded" if missing else "ok"), ", ".join(parts)

    def _pose_at(self, capture_ns: int, now_ns: int) -> m.Pose | None:
        """The pose of the picture's moment: both stamps are of the vehicle's own clock."""
        if not self._poses or not self.is_fresh("pose", now_ns):
            return None
        pose = min(self._poses, key=lambda each: abs(each.stamp - capture_ns))
        if seconds(abs(pose.stamp - capture_ns)) > MATCH_S:
            # Another clock stamped them; the newest is the best guess then.
            pose = self._poses[-1]
        return None if pose.status == "lost" else pose

    def _texts(
        self, suggestion: m.Suggestion | None, pose: m.Pose | None, now_ns: int
    ) -> list[tuple[str, pic.Colour]]:
        texts: list[tuple[str, pic.Colour]] = []
        engaged = self.is_engaged(now_ns)
        if self.status is None or not self.is_fresh("autopilot", now_ns):
            texts.append(("NO AUTOPILOT", pic.WARNING))
        else:
            colour = pic.ENGAGED if engaged else pic.TEXT
            texts.append((self.status.mode.upper(), colour))
        if suggestion is not None:
            text = f"{suggestion.primitive} {suggestion.confidence:.0%}"
            if suggestion.primitive == "line":
                text += f" {SECTORS[suggestion.heading_sector]}"
            texts.append((text, pic.ENGAGED if engaged else pic.SUGGESTED))
        if pose is None:
            texts.append(("POSE LOST", pic.WARNING))
        elif pose.status == "degraded":
            texts.append(("pose degraded", pic.WARNING))
        if self.vehicle is not None:
            low = self.vehicle.battery < BATTERY_LOW
            battery = f"battery {self.vehicle.battery:.0%}"
            texts.append((battery, pic.WARNING if low else pic.TEXT))
        stick_age_s = self.age_s("stick", now_ns)
        if stick_age_s is None or not self.is_fresh("stick", now_ns):
            texts.append(("NO STICKS", pic.WARNING))
        else:
            texts.append((f"sticks {1000 * stick_age_s:.0f} ms", pic.TEXT))
        return texts
