"""What the README says to type exists, and what it points to is there."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "models" / "README.md",
    *sorted((ROOT / "docs").glob("*.md")),
]
TEXT = "\n".join(page.read_text() for page in PAGES)
BLOCKS = [block for page in PAGES for block in page.read_text().split("```")[1::2]]
SHELL = "\n".join(block for block in BLOCKS if block.startswith(("sh\n", "\n")))


def flags_by_command() -> dict[str, set[str]]:
    """The flags that the docs print, by the command they belong to."""
    flags: dict[str, set[str]] = {}
    inline = "\n".join(re.findall(r"`(autocomplete [^`\n]*)`", TEXT))
    for words in re.findall(r"\bautocomplete ([a-z][^#&;|`\n]*)", f"{SHELL}\n{inline}"):
        command, _, rest = words.partition(" ")
        second = re.match(r"[a-z]+", rest)
        if command in ("run", "dataset") and second is not None:
            command = f"{command} {second.group()}"
        flags.setdefault(command, set()).update(re.findall(r"--[a-z][a-z-]*", rest))
    return flags


@pytest.mark.parametrize("target", sorted(set(re.findall(r"^make ([a-z-]+)", SHELL, flags=re.M))))
def test_each_make_target_named_in_the_docs_exists(target: str) -> None:
    assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(), flags=re.M)


def test_scripts_of_the_docs_are_run_without_their_folder_on_the_path() -> None:
    # docs/worlds would hide the package `worlds`.
    runs = re.findall(r"python (.*)docs/\w+\.py", (ROOT / "Makefile").read_text())
    assert runs == ["-P "] * 3


@pytest.mark.parametrize(("command", "flags"), sorted(flags_by_command().items()))
def test_each_command_printed_in_the_docs_takes_its_flags(command: str, flags: set[str]) -> None:
    entry_point = Path(sys.executable).with_name("autocomplete")
    words = [str(entry_point), *command.split(), "--help"]
    run = subprocess.run(words, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert flags <= set(re.findall(r"--[a-z][a-z-]*", run.stdout))


def slug(heading: str) -> str:
    """What a link to a heading says after the #, on GitHub."""
    return re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_each_link_to_a_heading_finds_it(page: Path) -> None:
    for link, heading in re.findall(r"\]\(([^)#]*)#([^)]+)\)", page.read_text()):
        if not link.startswith("http"):
            there = (page.parent / link) if link else page
            headings = re.findall(r"^#+ (.*)$", there.read_text(), flags=re.M)
            assert heading in map(slug, headings), f"{page.name}: {link}#{heading}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_each_link_to_a_file_leads_somewhere(page: Path) -> None:
    for link in re.findall(r"\]\(([^)#]+)", page.read_text()):
        if not link.startswith("http"):
            assert (page.parent / link).exists(), f"{page.name}: {link}"


@pytest.mark.parametrize(
    "path",
    sorted(
        set(
            re.findall(
                r"`((?:services|common|studies|worlds|tests|training|cli|deploy|docs|models)/[\w/.]+)`",
                TEXT,
            )
        )
    ),
)
def test_each_path_named_in_the_docs_is_there(path: str) -> None:
    assert (ROOT / path).exists()
