"""`autocomplete doctor`: what is installed, reachable and alive, and what to do about the rest."""

import argparse
import importlib.metadata
import platform
import re
import shutil
import subprocess
import sys
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Literal

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from cli import launch
from cli import options as opts
from cli.extras import FOLDER, installs
from cli.link import alive_services, linked
from common.clock import sleep
from common.network import DEFAULT_ENDPOINT, ROUTER_PORT
from common.topics import SERVICES
from services.overlay.config import Config as OverlayConfig

State = Literal["ok", "note", "warn", "fail"]
"""`note`: not here, and nothing that flies needs it."""
OLDEST_PYTHON = (3, 11)
OLDEST_NODE = 20
COMMAND_TIMEOUT_S = 10.0
TOKENS_WAIT_S = 0.5
PAGE_TIMEOUT_S = 1.0
_COLOURS = {"ok": "green", "note": "dim", "warn": "yellow", "fail": "red"}
_PROJECT = "autocomplete-teleoperation"
_USES = {"training": "to train", "test": "to run the tests", "check": "to run make check"}
"""What the extras are for that no flight needs."""


@dataclass(frozen=True)
class Finding:
    """One line: what was looked at, what was found, and what to do about it."""

    subject: str
    state: State
    text: str
    mend: str = ""


def declare(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    opts.add_network(parser)
    opts.add_examples(
        parser,
        "autocomplete doctor",
        "autocomplete doctor --connect tcp/192.168.1.20:7447     # before a flight on two machines",
    )
    parser.set_defaults(action=_run)


def _python() -> Finding:
    version = platform.python_version()
    if sys.version_info[:2] >= OLDEST_PYTHON:
        return Finding("Python", "ok", version)
    return Finding("Python", "fail", version, "use 3.11 or newer: make PYTHON=/path/to/python3.11")


def _requirements_of(extra: str) -> list[str]:
    """The names of what an extra installs, as the installed project states it."""
    names = []
    for line in importlib.metadata.requires(_PROJECT) or []:
        requirement, _, marker = line.partition(";")
        if re.search(rf"extra == ['\"]{extra}['\"]", marker):
            name = re.match(r"[A-Za-z0-9._-]+", requirement)
            assert name is not None
            names.append(name.group())
    return names


def _is_installed(package: str) -> bool:
    try:
        importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


def _packages() -> Iterator[Finding]:
    for extra in (*SERVICES, *_USES):
        missing = [name for name in _requirements_of(extra) if not _is_installed(name)]
        subject = f"packages of {extra}"
        if not missing:
            yield Finding(subject, "ok", ", ".join(_requirements_of(extra)) or "nothing of its own")
            continue
        # A machine may run a part of the chain, so a missing part is no failure.
        use = _USES.get(extra, "to run it here")
        mend = f"{use}: {installs(extra)}"
        state: State = "note" if extra in _USES else "warn"
        yield Finding(subject, state, f"{', '.join(missing)} missing", mend)


def _renderer() -> Finding:
    try:
        import moderngl

        # The names of the runtime packages; moderngl's defaults are those of the -dev packages.
        names: dict[str, Any] = {"libgl": "libGL.so.1", "libegl": "libEGL.so.1"}
        context = moderngl.create_context(standalone=True, **names | {"backend": "egl"})
        name = context.info["GL_RENDERER"]
        context.release()
    except ModuleNotFoundError:
        return Finding("OpenGL over EGL", "warn", "moderngl is missing", "see packages of sim")
    except Exception as error:  # moderngl raises plain Exception where there is no driver.
        return Finding(
            "OpenGL over EGL",
            "warn",
            f"{error}; pybullet's TinyRenderer draws, slowly",
            "apt-get install libegl1 libgl1 libgl1-mesa-dri",
        )
    return Finding("OpenGL over EGL", "ok", str(name))


def _output_of(*command: str) -> str | None:
    """The first line that a program prints; None if it is not there or fails."""
    if shutil.which(command[0]) is None:
        return None
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=COMMAND_TIMEOUT_S, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return (done.stdout.strip().splitlines() or [""])[0]


def _node() -> Finding:
    page = FOLDER / "services/overlay/console/dist/index.html"
    built = "the console is built" if page.is_file() else "the console is its plain page"
    version = _output_of("node", "--version")
    npm = _output_of("npm", "--version")
    if version is None or npm is None:
        mend = "" if page.is_file() else f"install Node.js {OLDEST_NODE} or newer, then make setup"
        return Finding("Node.js", "ok" if page.is_file() else "warn", f"none; {built}", mend)
    major = int(re.sub(r"\D.*", "", version.lstrip("v")) or 0)
    text = f"{version}, npm {npm}; {built}"
    if major < OLDEST_NODE:
        mend = f"install Node.js {OLDEST_NODE} or newer to build the console"
        return Finding("Node.js", "warn", text, mend)
    mend = "" if page.is_file() else "make setup"
    return Finding("Node.js", "ok" if page.is_file() else "warn", text, mend)


def _chromium() -> Finding:
    for name in ("chromium", "chromium-browser", "google-chrome"):
        version = _output_of(name, "--version")
        if version is not None:
            return Finding("Chromium", "ok", version)
    return Finding(
        "Chromium", "note", "none; the tests of the page are skipped", "apt-get install chromium"
    )


def _docker() -> Finding:
    version = _output_of("docker", "info", "--format", "{{.ServerVersion}}")
    if version:
        return Finding("Docker", "ok", f"engine {version}")
    if shutil.which("docker") is None:
        return Finding("Docker", "note", "none", "only docker compose needs it")
    return Finding("Docker", "note", "the engine does not answer", "only docker compose needs it")


def _model() -> Finding:
    folder = FOLDER / "models"
    found = sorted(path.name for path in folder.glob("*.onnx"))
    if found:
        return Finding("model", "ok", ", ".join(found))
    return Finding("model", "fail", f"no .onnx file in {folder}", "make train")


def _console_port() -> Finding:
    port = OverlayConfig.console_port
    subject = f"port {port}"
    if launch.is_free(port):
        return Finding(subject, "ok", "free for the console")
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=PAGE_TIMEOUT_S) as page:
            is_ours = b"Autocomplete" in page.read()
    except (OSError, ValueError):
        is_ours = False
    if is_ours:
        return Finding(subject, "ok", f"the console is at http://localhost:{port}")
    return Finding(
        subject,
        "warn",
        "taken by another program",
        "put the console elsewhere: --console-port 8090",
    )


def _router_port(is_ours: bool) -> Finding:
    subject = f"port {ROUTER_PORT}"
    if launch.is_free(ROUTER_PORT):
        return Finding(subject, "ok", "free for a router")
    if is_ours:
        return Finding(subject, "ok", "the router's")
    mend = "right if a router runs here already; else 'autocomplete router --listen' another one"
    return Finding(subject, "warn", "taken", mend)


def _network(options: argparse.Namespace) -> Iterator[Finding]:
    try:
        with linked(options) as bus:
            alive = alive_services(bus, options.vehicle)
            sleep(TOKENS_WAIT_S)
            there = sorted(alive)
    except OSError:
        # On this machine it is started with the first flight; elsewhere somebody expects it.
        state: State = "note" if options.connect == DEFAULT_ENDPOINT else "warn"
        mend = "right if nothing is to run yet; else 'autocomplete router', or name it: --connect"
        yield Finding("router", state, f"none at {options.connect}", mend)
        return
    yield Finding("router", "ok", options.connect)
    # Nobody needs a recorder to fly.
    missing = [service for service in SERVICES if service not in (*there, "recorder")]
    subject = f"services of {options.vehicle}"
    if not missing:
        without = "" if "recorder" in there else "; none records"
        yield Finding(subject, "ok", f"all alive{without}")
        return
    mend = f"start {', '.join(missing)} with 'autocomplete run', or all with 'autocomplete up'"
    yield Finding(subject, "warn", f"{', '.join(there) or 'none'} alive", mend)


def findings(options: argparse.Namespace) -> Iterator[Finding]:
    """Every finding, one after another as it is made."""
    for check in (_python, _renderer, _model, _node, _chromium, _docker):
        single: Callable[[], Finding] = check
        yield single()
    yield from _packages()
    router, *services = _network(options)
    yield _router_port(router.state == "ok" and options.connect == DEFAULT_ENDPOINT)
    yield _console_port()
    yield router
    yield from services


def _run(options: argparse.Namespace) -> int:
    table = Table.grid(padding=(0, 2))
    states: set[State] = set()
    has_router = False
    for finding in findings(options):
        states.add(finding.state)
        has_router = has_router or (finding.subject, finding.state) == ("router", "ok")
        colour = _COLOURS[finding.state]
        text = escape(finding.text) + (f"\n[dim]{escape(finding.mend)}[/]" if finding.mend else "")
        table.add_row(f"[{colour}]{finding.state}[/]", finding.subject, text)
    console = Console()
    console.print(table)
    if states <= {"ok", "note"} and not has_router:
        console.print("Ready: 'autocomplete demo' flies by itself, 'autocomplete up' is for you.")
    return 1 if "fail" in states else 0
