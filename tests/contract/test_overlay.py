"""The overlay as the contract has it: the path in the picture, and the console beside it."""

import itertools
import signal
import threading
import time
import urllib.request
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import pytest
from conftest import (
    Client,
    Launch,
    Process,
    Streams,
    assert_starts_before_its_router,
    assert_stops_without_a_router,
    free_port,
    start_service,
)
from overlay_world import Page, World, arrow_pixels, grey_picture, on_path_px, picture_of
from payloads import GOOD, assert_bad_input_is_dropped_and_counted

LISTENS_TO = {
    "pose": "Pose",
    "stick": "Stick",
    "intent": "Intent",
    "suggestion": "Suggestion",
    "refusal": "Refusal",
    "autopilot": "AutopilotStatus",
    "vehicle": "VehicleStatus",
    "camera/front": "Image",
}
nonces = itertools.count(1)


@pytest.fixture(scope="module")
def console_port() -> int:
    return free_port()


@pytest.fixture(scope="module")
def overlay(launch: Launch, client: Client, console_port: int) -> Process:
    for topic in ("overlay/front", "console/stick", "health/overlay"):
        client.collect(topic)
    return start_service(launch, client, "overlay", "--console-port", str(console_port))


@pytest.fixture
def world(client: Client, streams: Streams, overlay: Process) -> World:
    return World(client, streams)


@pytest.fixture
def page(overlay: Process, console_port: int) -> Iterator[Page]:
    page = Page(console_port)
    yield page
    page.leave()


class Decider:
    """Answers `autopilot/decide` as it is told to, or lets the askers wait."""

    def __init__(self, client: Client) -> None:
        self.requests: list[dict[str, Any]] = []
        self.reply: dict[str, Any] = {"ok": True, "reason": "accepted", "mode": "engaged"}
        self.answers = True
        self._kept: list[Any] = []
        self._queryable = client.session.declare_queryable(
            client.key("autopilot/decide"), self._decide
        )

    def _decide(self, query: Any) -> None:
        self.requests.append(msgpack.unpackb(query.payload.to_bytes()))
        if not self.answers:
            self._kept.append(query)
            return
        with query:
            query.reply(query.key_expr, msgpack.packb(self.reply))

    def close(self) -> None:
        self._kept.clear()
        self._queryable.undeclare()


@pytest.fixture
def decider(client: Client) -> Iterator[Decider]:
    decider = Decider(client)
    yield decider
    decider.close()


class TestPictures:
    def test_the_path_is_drawn_where_a_camera_would_see_it(self, client, world):
        shown = client.next("overlay/front", lambda i: arrow_pixels(picture_of(i["data"])) > 500)
        picture = picture_of(shown["data"])
        # The first arrow stands at 1.4 m: its solid part begins 1.63 m ahead and ends at 1.9 m.
        row, column = on_path_px(1.75)
        assert np.ptp(picture[row, column].astype(int)) > 60
        above = picture[30:175].astype(int) - grey_picture()[30:175]
        assert np.abs(above).max() < 12

    def test_moment_lens_and_size_are_those_of_the_camera(self, client, world):
        # A picture of the world before this one may still be on its way.
        shown = client.next("overlay/front", lambda image: image["capture"] in world.captures)
        assert (shown["width"], shown["height"], shown["format"]) == (640, 360, "jpeg")
        assert shown["intrinsics"] == [430.0, 430.0, 320.0, 180.0]
        assert shown["distortion"] == [0.0, 0.0, 0.0, 0.0]
        assert picture_of(shown["data"]).shape == (360, 640, 3)

    def test_every_picture_comes_through_once_in_order_and_at_once(self, client, world):
        shown = client.collect("overlay/front")
        client.next("overlay/front")
        begin, sent = len(shown), len(world.captures)
        time.sleep(2.0)
        batch = list(shown)[begin:]
        assert len(batch) >= 0.9 * (len(world.captures) - sent)
        assert len(batch) >= 45
        assert [m["seq"] for m in batch] == list(
            range(batch[0]["seq"], batch[0]["seq"] + len(batch))
        )
        captures = [m["capture"] for m in batch]
        assert captures == sorted(set(captures))
        assert set(shown.encodings) == {"application/msgpack;Image/1"}
        utc_of_monotonic_s = time.time() - time.monotonic()
        ages_s = [
            arrived + utc_of_monotonic_s - capture / 1e9
            for arrived, capture in zip(shown.arrival_s[begin:], captures, strict=False)
        ]
        assert np.median(ages_s) < 0.1

    def test_no_path_without_a_pose_and_without_a_suggestion(self, client, world):
        def bare(image: dict[str, Any]) -> bool:
            return arrow_pixels(picture_of(image["data"])) == 0

        def drawn(image: dict[str, Any]) -> bool:
            return arrow_pixels(picture_of(image["data"])) > 500

        client.next("overlay/front", drawn)
        world.pose["status"] = "lost"
        client.next("overlay/front", bare)
        world.pose["status"] = "ok"
        client.next("overlay/front", drawn)
        world.suggests = False
        begin = time.monotonic()
        client.next("overlay/front", bare)
        assert 2.0 < time.monotonic() - begin < 4.5

    def test_the_path_being_flown_stays_whatever_is_suggested_meanwhile(self, client, world, page):
        client.next("overlay/front")
        world.number = 11
        page.next_state(lambda s: s["offer"] is not None and s["offer"]["id"] == 11)
        world.status.update(mode="engaged", suggestion=11)
        page.next_state(lambda s: s["mode"] == "engaged")
        world.number = 12
        time.sleep(0.6)
        assert page.next_state(lambda s: True)["offer"]["id"] == 11

    def test_pictures_that_are_none_are_passed_over_and_told(self, client, overlay):
        before = client.next("health/overlay")["rejected"]
        for more in ({"data": b"no picture"}, {"width": 65}):
            client.publish("camera/front", {**GOOD["Image"], **more})
            time.sleep(0.05)
        health = client.next("health/overlay", lambda h: "no JPEG" in h["detail"])
        assert health["rejected"] == before
        assert overlay.popen.poll() is None


def test_bad_input_is_dropped_and_counted(client, overlay):
    with ThreadPoolExecutor(4) as pool:
        checks = [
            pool.submit(assert_bad_input_is_dropped_and_counted, client, "overlay", topic, message)
            for topic, message in LISTENS_TO.items()
        ]
        for check in checks:
            check.result()


class TestHealth:
    def test_it_tells_what_comes_and_what_is_missing(self, client, world):
        health = client.next("health/overlay", lambda h: h["state"] == "ok")
        assert health["service"] == "overlay"
        assert health["rates"].keys() == LISTENS_TO.keys()
        assert 0.0 < health["latency_p50"] <= health["latency_p99"] < 0.5
        assert "application/msgpack;Health/1" in client.collect("health/overlay").encodings

    def test_without_pictures_it_is_degraded(self, client, overlay):
        health = client.next("health/overlay", lambda h: "no camera/front" in h["detail"])
        assert health["state"] == "degraded"

    def test_it_is_alive(self, client, overlay):
        assert "overlay" in client.alive()


class TestConsole:
    @pytest.mark.parametrize("path", ["/", "/plain"])
    def test_it_serves_a_page(self, overlay, console_port, path):
        with urllib.request.urlopen(f"http://127.0.0.1:{console_port}{path}", timeout=5) as reply:
            assert reply.status == 200
            assert reply.headers["Content-Type"].startswith("text/html")
            text = reply.read().decode()
        assert 'id="picture"' in text
        assert 'id="accept"' in text

    def test_pictures_and_state_are_streamed(self, world, page):
        page.wait(lambda: len(page.pictures) > 10)
        assert picture_of(page.pictures[-1]).shape == (360, 640, 3)
        state = page.next_state(lambda s: s["offer"] is not None and s["mode"] == "manual")
        assert state["offer"] == {
            "id": 1,
            "primitive": "line",
            "confidence": 0.9,
            "speed_mps": 0.8,
            "fit_rms_m": 0.02,
        }
        assert state["label"] == "line"
        assert state["probabilities"]["line"] == 0.91
        assert (state["vehicle_state"], state["world"]) == ("flying", "track")
        assert state["battery"] == 0.9
        assert (state["pose_status"], state["linked"], state["pad"]) == ("ok", True, "free")
        assert "overlay" in state["alive"]
        assert all(age_s < 2.0 for age_s in state["ages_s"].values())

    def test_what_is_too_old_to_count_is_named(self, world, streams, page):
        page.next_state(lambda s: not s["stale"])
        streams.close()
        state = page.next_state(lambda s: "vehicle" in s["stale"])
        assert state["stale"] == ["camera/front", "pose", "stick", "autopilot", "vehicle"]

    def test_a_page_that_shows_nothing_gets_few_pictures_and_slows_nobody(
        self, world, page, console_port
    ):
        frozen = Page(console_port, shows=False)
        try:
            before = len(page.pictures)
            time.sleep(1.0)
            assert len(page.pictures) - before >= 20
            assert 1 <= len(frozen.pictures) <= 6
        finally:
            frozen.leave()

    @pytest.mark.parametrize(
        "text",
        [
            "hello",
            "{}",
            '{"type":"fly"}',
            '{"type":"stick","vx":2,"vy":0,"vz":0,"wz":0}',
            '{"type":"decide","action":"dance","nonce":1}',
            "[" * 2000,
        ],
    )
    def test_nonsense_gets_an_error_and_it_goes_on(self, page, text):
        page.say(text)
        page.wait(lambda: bool(page.answers))
        assert page.answers[0]["type"] == "error"
        assert page.answers[0]["error"]
        page.next_state(lambda s: True)

    def test_a_decision_reaches_the_autopilot_and_its_answer_the_page(self, page, decider):
        nonce = next(nonces)
        page.say({"type": "decide", "action": "accept", "nonce": nonce, "suggestion": 5})
        page.wait(lambda: bool(page.answers))
        assert decider.requests == [{"action": "accept", "nonce": nonce, "suggestion": 5}]
        assert page.answers == [
            {"type": "decision", "nonce": nonce, "ok": True, "reason": "accepted"}
        ]
        decider.reply = {"ok": False, "reason": "stick", "mode": "manual"}
        page.say({"type": "decide", "action": "takeoff", "nonce": next(nonces)})
        page.wait(lambda: len(page.answers) == 2)
        assert (page.answers[1]["ok"], page.answers[1]["reason"]) == (False, "stick")

    def test_without_an_autopilot_a_decision_is_refused(self, page):
        page.say({"type": "decide", "action": "accept", "nonce": next(nonces)})
        page.wait(lambda: bool(page.answers))
        assert page.answers[0]["ok"] is False
        assert page.answers[0]["reason"]

    def test_an_autopilot_that_does_not_answer_freezes_nothing(self, world, page, decider):
        decider.answers = False
        page.wait(lambda: len(page.pictures) > 5)
        page.say({"type": "decide", "action": "accept", "nonce": next(nonces)})
        page.wait(lambda: bool(decider.requests))
        before = len(page.pictures)
        time.sleep(1.0)
        assert len(page.pictures) - before >= 20
        page.wait(lambda: bool(page.answers))
        assert page.answers[0]["ok"] is False

    def test_emergency_never_waits_and_old_decisions_are_never_asked(self, page, decider):
        decider.answers = False
        for _ in range(6):
            page.say({"type": "decide", "action": "accept", "nonce": next(nonces)})
        page.say({"type": "decide", "action": "emergency", "nonce": next(nonces)})
        page.wait(lambda: any(r["action"] == "emergency" for r in decider.requests), 1.0)
        assert len([answer for answer in page.answers if not answer["ok"]]) >= 4
        decider.answers = True
        time.sleep(3.0)
        assert len([r for r in decider.requests if r["action"] == "accept"]) <= 2

    @pytest.mark.parametrize("origin", ["http://elsewhere.example", "null", "http://[::1"])
    def test_another_sites_page_is_not_let_in(self, overlay, console_port, origin):
        assert Page(console_port, origin=origin).refused
        assert "Traceback" not in overlay.log.read_text()
        ours = Page(console_port, origin=f"http://127.0.0.1:{console_port}")
        assert not ours.refused
        ours.leave()


class TestPad:
    def test_sticks_are_sent_while_they_are_held_and_neutral_once_after(self, client, page):
        sent = client.collect("console/stick")
        page.next_state(lambda s: s["pad"] == "free")
        begin = len(sent)
        page.release()
        page.push(0.6, vx=0.5, wz=-0.25)
        page.release()
        time.sleep(0.4)
        batch = list(sent)[begin:]
        held, last = batch[:-1], batch[-1]
        assert len(held) >= 20
        assert {(m["vx"], m["vy"], m["vz"], m["wz"]) for m in held} == {(0.5, 0.0, 0.0, -0.25)}
        assert (last["vx"], last["vy"], last["vz"], last["wz"]) == (0.0, 0.0, 0.0, 0.0)
        assert "application/msgpack;Stick/1" in sent.encodings

    def test_the_end_of_a_primitive_is_a_button_held_for_a_moment(self, client, page):
        sent = client.collect("console/stick")
        page.next_state(lambda s: s["pad"] == "free")
        begin = len(sent)
        page.say({"type": "mark"})
        page.wait(lambda: len(sent) > begin and not sent[-1].get("buttons"))
        batch = list(sent)[begin:]
        assert len(batch) >= 3
        assert {tuple(m.get("buttons", ())) for m in batch[:-1]} == {("end",)}
        assert all(m["vx"] == m["vy"] == m["vz"] == m["wz"] == 0.0 for m in batch)

    @pytest.mark.parametrize("how", ["silent", "gone"])
    def test_a_page_that_stops_or_goes_is_neutral_once(self, client, overlay, console_port, how):
        sent = client.collect("console/stick")
        page = Page(console_port)
        page.next_state(lambda s: s["pad"] == "free")
        page.release()
        page.push(0.2, vy=0.7)
        if how == "gone":
            page.leave()
        begin = time.monotonic()
        time.sleep(0.5)
        assert sent[-1]["vy"] == 0.0
        assert sent[-2]["vy"] == 0.7
        assert sent.arrival_s[-1] - begin < 0.35
        if how == "silent":
            # Sticks that are still held when they come again do nothing.
            count = len(sent)
            page.push(0.2, vy=0.7)
            assert page.next_state(lambda s: s["pad"] == "stale")
            assert len(sent) == count
            page.release()
            page.push(0.1, vy=0.6)
            assert any(m["vy"] == 0.6 for m in sent[count:])
            page.leave()

    def test_only_one_page_flies(self, client, page, console_port):
        sent = client.collect("console/stick")
        second = Page(console_port)
        try:
            page.next_state(lambda s: s["pad"] == "free")
            for each in (page, second):
                each.release()
            begin = len(sent)
            held = threading.Thread(target=page.push, args=(0.8,), kwargs={"vx": 0.5})
            held.start()
            page.next_state(lambda s: s["pad"] == "yours")
            second.push(0.2, vx=-0.9)
            second.next_state(lambda s: s["pad"] == "busy")
            held.join()
            page.release()
            assert {m["vx"] for m in sent[begin:]} <= {0.5, 0.0}
        finally:
            second.leave()


class TestLifecycle:
    def test_sigterm_ends_it_cleanly_with_pages_open_and_a_decision_pending(
        self, client, launch, decider
    ):
        port = free_port()
        process = launch("overlay", "--console-port", str(port))
        client.wait_alive("overlay")
        deadline = time.monotonic() + 10.0
        while "console" not in process.log.read_text() and time.monotonic() < deadline:
            try:
                urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=1).close()
                break
            except OSError:
                time.sleep(0.1)
        page = Page(port)
        decider.answers = False
        page.say({"type": "decide", "action": "land", "nonce": next(nonces)})
        page.wait(lambda: bool(decider.requests))
        process.popen.send_signal(signal.SIGTERM)
        assert process.popen.wait(8.0) == 0, process.log.read_text()
        log = process.log.read_text()
        assert "Traceback" not in log
        assert "pending" not in log
        page.leave()

    def test_a_port_in_use_is_one_line_that_names_the_field(self, overlay, launch, console_port):
        process = launch("overlay", "--console-port", str(console_port))
        assert process.popen.wait(15.0) == 1
        log = process.log.read_text()
        assert "console_port" in log
        assert "Traceback" not in log

    def test_it_starts_before_its_router(self, tmp_path: Path):
        assert_starts_before_its_router(
            "overlay", "--console-port", str(free_port()), tmp_path=tmp_path
        )

    def test_it_stops_without_a_router(self, tmp_path: Path):
        assert_stops_without_a_router("overlay", "--console-port", "0", tmp_path=tmp_path)
