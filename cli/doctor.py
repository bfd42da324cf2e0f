"""`autocomplete doctor`: what is installed, reachable and alive, and what to do about the rest."""

import argparse
import importlib.metadata
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from cli import launch
from cli import options as opts
from cli.link import linked
from common.clock import sleep
from common.network import ROUTER_PORT
from common.topics import SERVICES, alive_key_of
from services.overlay.config import Config as OverlayConfig

State = Literal["ok", "warn", "fail"]
OLDEST_PYTHON = (3, 11)
OLDEST_NODE = 20
COMMAND_TIMEOUT_S = 10.0
TOKENS_WAIT_S = 0.5
_COLOURS = {"ok": "green", "warn": "yellow", "fail": "red"}
_PROJECT = "autocomplete-teleoperation"
_EXTRAS = (*SERVICES, "training", "test", "check")


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
    for extra in _EXTRAS:
        missing = [name for name in _requirements_of(extra) if not _is_installed(name)]
        subject = f"packages of {extra}"
        if not missing:
            yield Finding(subject, "ok", ", ".join(_requirements_of(extra)) or "nothing of its own")
            continue
        # A machine may run a part of the chain, so a missing part is no failure.
        mend = f"to run it here: pip install -c constraints.txt -e '.[{extra}]'"
        yield Finding(subject, "warn", f"{', '.join(missing)} missing", mend)


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
    page = Path(__file__).parents[1] / "services/overlay/console/dist/index.html"
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
        "Chromium", "warn", "none; the tests of the page are skipped", "apt-get install chromium"
    )


def _docker() -> Finding:
    version = _output_of("docker", "info", "--format", "{{.ServerVersion}}")
    if version:
        return Finding("Docker", "ok", f"engine {version}")
    if shutil.which("docker") is None:
        return Finding("Docker", "warn", "none", "only docker compose needs it")
    return Finding("Docker", "warn", "the engine does not answer", "only docker compose needs it")


def _model() -> Finding:
    folder = Path(__file__).parents[1] / "models"
    found = sorted(path.name for path in folder.glob("*.onnx"))
    if found:
        return Finding("model", "ok", ", ".join(found))
    return Finding("model", "fail", f"no .onnx file in {folder}", "make train")


def _port(number: int, use: str, mend: str) -> Finding:
    if launch.is_free(number):
        return Finding(f"port {number}", "ok", f"free for {use}")
    return Finding(f"port {number}", "warn", f"taken; {use} cannot have it", mend)


def _ports() -> Iterator[Finding]:
    yield _port(ROUTER_PORT, "a router", "right if a router runs here already")
    yield _port(
        OverlayConfig.console_port,
        "the console",
        "right if the console runs here already; else demo --console-port 8090",
    )


def _network(options: argparse.Namespace) -> Iterator[Finding]:
    alive: set[str] = set()

    def note(key: str, there: bool) -> None:
        if there:
            alive.add(key.rsplit("/", 1)[1])

    try:
        with linked(options) as bus:
            bus.watch(alive_key_of(options.vehicle, "*"), note)
            sleep(TOKENS_WAIT_S)
    except OSError:
        mend = "right if nothing is to run yet; else 'autocomplete router', or name it: --connect"
        yield Finding("router", "warn", f"none at {options.connect}", mend)
        return
    yield Finding("router", "ok", options.connect)
    missing = [service for service in SERVICES if service not in alive]
    subject = f"services of {options.vehicle}"
    if not missing:
        yield Finding(subject, "ok", "all alive")
        return
    there = f"{', '.join(sorted(alive)) or 'none'} alive"
    mend = f"start {', '.join(missing)} with 'autocomplete run', or all with 'autocomplete up'"
    yield Finding(subject, "warn", there, mend)


def findings(options: argparse.Namespace) -> Iterator[Finding]:
    """Every finding, one after another as it is made."""
    for check in (_python, _renderer, _model, _node, _chromium, _docker):
        single: Callable[[], Finding] = check
        yield single()
    yield from _packages()
    yield from _ports()
    yield from _network(options)


def _run(options: argparse.Namespace) -> int:
    table = Table.grid(padding=(0, 2))
    failed = False
    for finding in findings(options):
        failed = failed or finding.state == "fail"
        colour = _COLOURS[finding.state]
        text = escape(finding.text) + (f"\n[dim]{escape(finding.mend)}[/]" if finding.mend else "")
        table.add_row(f"[{colour}]{finding.state}[/]", finding.subject, text)
    Console().print(table)
    return 1 if failed else 0
