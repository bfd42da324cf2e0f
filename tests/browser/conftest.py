"""The console in a real browser: Debian's Chromium, driven by Playwright."""

import importlib.util
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

CONTRACT = Path(__file__).parents[1] / "contract"
sys.path.append(str(CONTRACT))

# The harness is that of the contract tests; both files are named conftest.
_spec = importlib.util.spec_from_file_location("contract_harness", CONTRACT / "conftest.py")
assert _spec is not None
assert _spec.loader is not None
harness = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(harness)

Client, Launch, Process, Streams = (
    harness.Client,
    harness.Launch,
    harness.Process,
    harness.Streams,
)
free_port, start_service = harness.free_port, harness.start_service
port, router, vehicle = harness.port, harness.router, harness.vehicle
client, streams, launch = harness.client, harness.streams, harness.launch

CHROMIUM = shutil.which("chromium")
FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    if CHROMIUM is None:
        pytest.skip("Chromium is not installed: apt-get install chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        yield browser
        browser.close()
