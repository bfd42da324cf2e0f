"""Makes docs/console.png: the demo flies, and the page is caught while an arc is flown."""

import shutil
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

from cli import launch
from common.topics import SERVICES

PICTURE = Path(__file__).with_name("console.png")
FLIGHT_TIMEOUT_MS = 120_000


def main() -> int:
    """Fly, wait for the offer, take the picture; returns the exit code."""
    chromium = shutil.which("chromium")
    if chromium is None:
        sys.stderr.write("chromium is not installed; on Debian: apt install chromium\n")
        return 1
    port = launch.free_port()
    settings = {
        "overlay": {"console_port": str(port)},
        "operator": {"source": "scripted", "laps": "1"},
    }
    services = [service for service in SERVICES if service != "recorder"]
    with launch.running(services, settings), sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=chromium, args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        for _ in range(100):
            page.wait_for_timeout(200)
            if not launch.is_free(port):
                break
        page.goto(f"http://localhost:{port}/")
        page.wait_for_function(
            "document.querySelector('#offer-shape').textContent.startsWith('arc')"
            " && document.body.dataset.mode === 'engaged'",
            timeout=FLIGHT_TIMEOUT_MS,
        )
        page.wait_for_timeout(1500)
        page.screenshot(path=PICTURE)
        browser.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
