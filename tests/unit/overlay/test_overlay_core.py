"""What is drawn, when, and what is carried through."""

import cv2
import numpy as np
import overlay_scenes as scenes
import pytest
from overlay_scenes import NOW_NS

from common.clock import nanoseconds
from common.topics import TOPICS
from services.overlay.config import Config
from services.overlay.core import Overlay

PATH = scenes.suggestion(scenes.line())


@pytest.fixture
def core() -> Overlay:
    """Everything is there and fresh, but no suggestion."""
    core = Overlay(Config())
    core.on_pose(scenes.pose(), NOW_NS)
    core.on_autopilot(scenes.status(), NOW_NS)
    return core


def later(topic: str) -> int:
    """Just after what came on the topic at NOW_NS is too old."""
    return NOW_NS + nanoseconds(TOPICS[topic].max_age_s) + 1


def is_path_drawn(core: Overlay, now_ns: int = NOW_NS) -> bool:
    drawn = core.draw(scenes.image(), now_ns)
    assert drawn is not None
    changed = np.abs(scenes.pixels(drawn).astype(int) - scenes.background()).max(axis=2) > 60
    return bool(changed[30:].any())


def test_a_fresh_suggestion_is_drawn_and_without_one_the_picture_is_left_alone(core):
    assert not is_path_drawn(core)
    core.on_suggestion(PATH, NOW_NS)
    assert is_path_drawn(core)


def test_a_suggestion_that_can_no_longer_be_accepted_is_not_drawn(core):
    core.on_suggestion(PATH, NOW_NS)
    now_ns = later("suggestion")
    core.on_pose(scenes.pose(), now_ns)
    core.on_autopilot(scenes.status(), now_ns)
    assert not is_path_drawn(core, now_ns)


def test_nothing_is_drawn_while_the_pose_is_lost(core):
    core.on_suggestion(PATH, NOW_NS)
    core.on_pose(scenes.pose(status="lost"), NOW_NS)
    assert core.pose_status(NOW_NS) == "lost"
    core = Overlay(Config())
    core.on_suggestion(PATH, NOW_NS)
    core.on_pose(scenes.pose(status="lost"), NOW_NS)
    assert not is_path_drawn(core)


def test_nothing_is_drawn_from_an_old_pose(core):
    core.on_suggestion(PATH, NOW_NS)
    assert not is_path_drawn(core, later("pose"))
    assert core.pose_status(later("pose")) == "lost"


def test_a_degraded_pose_is_still_drawn_from(core):
    core.on_suggestion(PATH, NOW_NS)
    core.on_pose(scenes.pose(status="degraded"), NOW_NS)
    assert is_path_drawn(core)
    assert core.pose_status(NOW_NS) == "degraded"


def test_what_is_being_flown_is_drawn_however_old_it_is_and_whatever_came_after_it(core):
    core.on_suggestion(PATH, NOW_NS)
    newer = scenes.suggestion(scenes.line(), id=2, primitive="line")
    core.on_suggestion(newer, NOW_NS)
    now_ns = NOW_NS
    for _ in range(60):
        now_ns += nanoseconds(0.2)
        core.on_autopilot(scenes.status("engaged", flown=1), now_ns)
        core.on_pose(scenes.pose(), now_ns)
        core.on_suggestion(newer, now_ns)
        assert core.shown(now_ns) is PATH
    assert is_path_drawn(core, now_ns)


def test_after_the_autopilot_let_go_the_newest_suggestion_is_shown_again(core):
    newer = scenes.suggestion(scenes.line(), id=2)
    core.on_suggestion(PATH, NOW_NS)
    core.on_autopilot(scenes.status("engaged", flown=1), NOW_NS)
    core.on_suggestion(newer, NOW_NS)
    assert core.shown(NOW_NS) is PATH
    core.on_autopilot(scenes.status("manual"), NOW_NS)
    assert core.shown(NOW_NS) is newer


def test_an_autopilot_that_went_silent_is_not_said_to_fly(core):
    core.on_suggestion(PATH, NOW_NS)
    core.on_autopilot(scenes.status("engaged", flown=1), NOW_NS)
    assert core.is_engaged(NOW_NS)
    assert not core.is_engaged(later("autopilot"))


def test_a_path_that_the_overlay_never_heard_of_is_not_drawn(core):
    core.on_suggestion(PATH, NOW_NS)
    core.on_autopilot(scenes.status("engaged", flown=77), NOW_NS)
    assert core.shown(NOW_NS) is None


def test_a_synthesis_that_counts_from_one_again_is_believed(core):
    core.on_suggestion(PATH, NOW_NS)
    again = scenes.suggestion(scenes.circle(3.0, left=True))
    core.on_suggestion(again, NOW_NS)
    core.on_autopilot(scenes.status("engaged", flown=again.id), NOW_NS)
    assert core.shown(NOW_NS) is again


def is_foot_written(core: Overlay, now_ns: int = NOW_NS) -> bool:
    drawn = core.draw(scenes.image(), now_ns)
    changed = np.abs(scenes.pixels(drawn).astype(int) - scenes.background()).max(axis=2) > 30
    return bool(changed[-20:].mean() > 0.5)


def test_the_reason_for_no_suggestion_is_written_until_it_is_old(core):
    assert core.advice(NOW_NS) == ""
    assert not is_foot_written(core)
    core.on_refusal(scenes.refusal("it bends"), NOW_NS)
    assert core.advice(NOW_NS) == "no arc: it bends"
    assert is_foot_written(core)
    assert core.advice(later("refusal")) == ""


def test_a_suggestion_takes_the_place_of_a_refusal_and_tells_its_own_note(core):
    core.on_refusal(scenes.refusal("it bends"), NOW_NS)
    core.on_suggestion(PATH, NOW_NS)
    assert core.advice(NOW_NS) == ""
    core.on_suggestion(scenes.suggestion(scenes.line(), note="ends after 5.0 m"), NOW_NS)
    assert core.advice(NOW_NS) == "ends after 5.0 m"
    # What is said of the next one is no news for who flies along this one.
    core.on_refusal(scenes.refusal("it bends"), NOW_NS)
    core.on_autopilot(scenes.status("engaged", flown=1), NOW_NS)
    assert core.advice(NOW_NS) == ""


def test_a_long_reason_is_cut_to_the_pictures_width(core):
    core.on_refusal(scenes.refusal("x" * 200), NOW_NS)
    assert is_foot_written(core)
    tiny = scenes.image(picture=np.zeros((10, 16, 3), np.uint8), width=16, height=10)
    assert core.draw(tiny, NOW_NS) is not None


def test_the_pose_of_the_pictures_moment_is_used(core):
    core.on_suggestion(PATH, NOW_NS)
    # It looked ahead when the picture was taken, and has turned round since.
    turned = scenes.pose(stamp=scenes.STAMP_NS + 50_000_000, angles=(0.0, 0.0, 3.1))
    core.on_pose(turned, NOW_NS)
    assert is_path_drawn(core)


def test_the_newest_pose_is_used_when_another_clock_stamped_the_pictures(core):
    core.on_suggestion(PATH, NOW_NS)
    drawn = core.draw(scenes.image(capture=12345), NOW_NS)
    assert drawn is not None
    assert core.shown(NOW_NS) is PATH
    changed = np.abs(scenes.pixels(drawn).astype(int) - scenes.background()).max(axis=2) > 60
    assert changed[30:].any()


def test_moment_lens_and_size_are_carried_through(core):
    core.on_suggestion(PATH, NOW_NS)
    image = scenes.image(distortion=(0.01, 0.0, 0.0, 0.0))
    drawn = core.draw(image, NOW_NS)
    for field in ("width", "height", "format", "intrinsics", "distortion", "capture"):
        assert getattr(drawn, field) == getattr(image, field)
    assert drawn.data != image.data


def claiming(side_px: int) -> bytes:
    """A JPEG whose header says that it is a square of so many pixels a side."""
    data = bytearray(scenes.image().data)
    sides = data.index(b"\xff\xc0") + 5
    data[sides : sides + 4] = 2 * side_px.to_bytes(2, "big")
    return bytes(data)


@pytest.mark.parametrize(
    "bad",
    [
        scenes.image(data=b""),
        scenes.image(data=b"\xff\xd8 no picture \xff\xd9"),
        scenes.image(data=scenes.image().data[:200]),
        scenes.image(data=claiming(65500)),
        scenes.image(width=320),
        scenes.image(picture=np.zeros((48, 64, 3), np.uint8)),
    ],
    ids=[
        "empty",
        "no JPEG",
        "cut off",
        "too large",
        "another size",
        "smaller than it says",
    ],
)
def test_a_picture_that_is_none_is_counted_and_dropped(core, bad):
    assert core.draw(bad, NOW_NS) is None
    assert core.undecodable == 1
    assert "1 pictures" in core.health(NOW_NS)[1]
    assert core.draw(scenes.image(), NOW_NS) is not None


def test_a_picture_smaller_than_the_strip_is_drawn_too(core):
    core.on_suggestion(PATH, NOW_NS)
    tiny = scenes.image(picture=np.zeros((10, 16, 3), np.uint8), width=16, height=10)
    assert scenes.pixels(core.draw(tiny, NOW_NS)).shape == (10, 16, 3)


def test_health_names_what_is_missing():
    core = Overlay(Config())
    state, detail = core.health(NOW_NS)
    assert state == "degraded"
    assert detail == "no camera/front, no pose, no autopilot"
    core.on_pose(scenes.pose(), NOW_NS)
    core.on_autopilot(scenes.status(), NOW_NS)
    core.draw(scenes.image(), NOW_NS)
    assert core.health(NOW_NS) == ("ok", "")


def test_the_same_inputs_draw_the_same_picture(core):
    core.on_suggestion(PATH, NOW_NS)
    first = core.draw(scenes.image(), NOW_NS)
    assert core.draw(scenes.image(), NOW_NS).data == first.data


def test_the_config_names_the_field_that_is_wrong():
    for field, value in (
        ("console_port", 70000),
        ("jpeg_quality", 0),
        ("drawn_m", 0.5),
        ("below_m", -1.0),
    ):
        with pytest.raises(ValueError, match=field):
            Config(**{field: value})


def test_decoding_never_raises():
    rng = np.random.default_rng(4)
    good = bytearray(scenes.image().data)
    core = Overlay(Config())
    for _ in range(30):
        spoilt = bytearray(good)
        for place in rng.integers(2, len(good), size=20):
            spoilt[place] = rng.integers(0, 256)
        core.draw(scenes.image(data=bytes(spoilt)), NOW_NS)
    assert cv2.imdecode(np.frombuffer(bytes(good), np.uint8), cv2.IMREAD_COLOR) is not None
