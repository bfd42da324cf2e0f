"""The console's page, built and plain: it shows, decides and flies."""

import time
from collections.abc import Iterator
from typing import Any

import msgpack
import pytest
from conftest import Client, Launch, Process, Streams, free_port, start_service
from overlay_world import World

PAGES = ["/", "/plain"]


@pytest.fixture(scope="module")
def console_port() -> int:
    return free_port()


@pytest.fixture(scope="module")
def overlay(launch: Launch, client: Client, console_port: int) -> Process:
    client.collect("console/stick")
    return start_service(launch, client, "overlay", "--console-port", str(console_port))


@pytest.fixture
def world(client: Client, streams: Streams, overlay: Process) -> World:
    world = World(client, streams)
    world.number = 41
    return world


@pytest.fixture
def requests(client: Client) -> Iterator[list[dict[str, Any]]]:
    """What reaches `autopilot/decide`, which grants everything."""
    heard: list[dict[str, Any]] = []

    def decide(query: Any) -> None:
        heard.append(msgpack.unpackb(query.payload.to_bytes()))
        with query:
            reply = {"ok": True, "reason": "accepted", "mode": "engaged"}
            query.reply(query.key_expr, msgpack.packb(reply))

    queryable = client.session.declare_queryable(client.key("autopilot/decide"), decide)
    yield heard
    queryable.undeclare()


@pytest.fixture
def open_page(browser: Any, console_port: int) -> Iterator[Any]:
    """Opens pages; whatever one complains of in its console is an error."""
    complaints: list[str] = []
    contexts = []

    def start(path: str, **options: Any) -> Any:
        context = browser.new_context(**{"viewport": {"width": 1280, "height": 800}} | options)
        contexts.append(context)
        page = context.new_page()
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(f"http://127.0.0.1:{console_port}{path}")
        return page

    yield start
    for context in contexts:
        context.close()
    assert not complaints


def pixels(page: Any) -> list[int]:
    """The canvas, coarsely."""
    return page.evaluate(
        """() => {
            const canvas = document.getElementById("picture");
            const { data } = canvas.getContext("2d")
                .getImageData(0, 0, canvas.width, canvas.height);
            return Array.from(data.filter((_, i) => i % 404 === 0));
        }"""
    )


def wait_until(page: Any, condition: Any, timeout_s: float = 10.0) -> None:
    deadline = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline, f"not within {timeout_s} s"
        page.wait_for_timeout(20)


def is_offered(page: Any) -> bool:
    return "line" in page.inner_text("body") and any(pixels(page))


@pytest.mark.parametrize("path", PAGES)
def test_it_shows_pictures_as_they_come(world, open_page, path):
    page = open_page(path)
    wait_until(page, lambda: is_offered(page))
    with_path = pixels(page)
    world.pose["status"] = "lost"
    wait_until(page, lambda: pixels(page) != with_path)
    assert page.inner_text("#mode") == "manual"


@pytest.mark.parametrize("path", PAGES)
def test_pressing_accept_reaches_the_autopilot_with_what_is_on_the_screen(
    world, open_page, requests, path
):
    page = open_page(path)
    wait_until(page, lambda: is_offered(page))
    page.wait_for_timeout(300)
    page.click("#accept")
    wait_until(page, lambda: len(requests) == 1)
    assert (requests[0]["action"], requests[0]["suggestion"]) == ("accept", 41)
    wait_until(page, lambda: "accepted" in page.inner_text("#answer"))
    page.keyboard.press("Escape")
    wait_until(page, lambda: len(requests) == 2)
    assert requests[1]["action"] == "cancel"
    assert requests[1]["nonce"] != requests[0]["nonce"]


def test_a_refusal_says_what_to_do(client, world, open_page):
    def refuse(query: Any) -> None:
        with query:
            reply = {"ok": False, "reason": "stick", "mode": "manual"}
            query.reply(query.key_expr, msgpack.packb(reply))

    queryable = client.session.declare_queryable(client.key("autopilot/decide"), refuse)
    page = open_page("/")
    wait_until(page, lambda: is_offered(page))
    page.keyboard.press("Enter")
    wait_until(page, lambda: page.inner_text("#answer") == "Refused: let go of the sticks first")
    queryable.undeclare()


@pytest.mark.parametrize("path", PAGES)
def test_a_key_moves_the_stick_and_letting_go_is_neutral(client, world, open_page, path):
    page = open_page(path)
    wait_until(page, lambda: is_offered(page))
    sent = client.collect("console/stick")
    begin = len(sent)
    page.keyboard.down("w")
    wait_until(page, lambda: any(m["vx"] >= 0.75 for m in sent[begin:]))
    page.keyboard.up("w")
    wait_until(page, lambda: sent[-1]["vx"] == 0.0)
    assert all(m["vy"] == m["vz"] == m["wz"] == 0.0 for m in sent[begin:])
    count = len(sent)
    page.wait_for_timeout(300)
    assert len(sent) == count


@pytest.mark.parametrize("path", PAGES)
def test_the_end_of_a_primitive_is_a_key_or_a_press(client, world, open_page, path):
    page = open_page(path)
    wait_until(page, lambda: is_offered(page))
    # Whoever flew in the test before has the pad for a second more.
    page.wait_for_timeout(1100)
    sent = client.collect("console/stick")
    for end in (lambda: page.keyboard.press("e"), lambda: page.click("#mark")):
        begin = len(sent)
        end()
        wait_until(page, lambda b=begin: any(m.get("buttons") == ["end"] for m in sent[b:]))
        wait_until(page, lambda: not sent[-1].get("buttons"))


def test_shortcuts_of_the_browser_do_not_land_the_drone(world, open_page, requests):
    page = open_page("/")
    wait_until(page, lambda: is_offered(page))
    page.keyboard.press("Control+l")
    page.keyboard.press("l")
    wait_until(page, lambda: bool(requests))
    page.wait_for_timeout(200)
    assert [each["action"] for each in requests] == ["land"]


def is_built(page: Any) -> bool:
    return page.locator("#stage").count() > 0


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (1920, 1080)])
def test_everything_is_on_the_screen_at_once(world, open_page, width, height):
    page = open_page("/", viewport={"width": width, "height": height})
    wait_until(page, lambda: is_offered(page))
    if not is_built(page):
        pytest.skip("the page was not built here: no Node")
    page.wait_for_timeout(300)
    assert page.evaluate("document.documentElement.scrollHeight") <= height
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert not page.locator(".thumbs").is_visible()


def test_thumbs_on_a_phone_fly(client, world, open_page):
    page = open_page("/", viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    wait_until(page, lambda: is_offered(page))
    if not is_built(page):
        pytest.skip("the page was not built here: no Node")
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    sent = client.collect("console/stick")
    box = page.locator("#left-thumb").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x, y - box["height"] / 2)
    wait_until(page, lambda: bool(sent) and sent[-1]["vx"] > 0.8)
    assert abs(sent[-1]["vy"]) < 0.1
    page.mouse.up()
    wait_until(page, lambda: sent[-1]["vx"] == 0.0)


@pytest.mark.parametrize("path", PAGES)
def test_a_server_that_stops_is_shown(client, launch, browser, path):
    port = free_port()
    process = launch("overlay", "--console-port", str(port))
    client.wait_alive("overlay")
    page = browser.new_page()
    deadline = time.monotonic() + 20.0
    while time.monotonic() < deadline:
        try:
            page.goto(f"http://127.0.0.1:{port}{path}")
            break
        except Exception:
            page.wait_for_timeout(200)
    wait_until(page, lambda: "no console server" not in page.inner_text("body"))
    page.wait_for_timeout(500)
    assert process.stop() == 0
    wait_until(page, lambda: "no console server" in page.inner_text("body"))
    if is_built(page):
        assert page.evaluate("document.body.dataset.link") == "down"
        assert page.locator("#veil").is_visible()
    page.close()
