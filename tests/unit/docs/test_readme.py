"""What the README says to type exists, and what it points to is there."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
TEXT = "\n".join(page.read_text() for page in PAGES)
SHELL = "\n".join(re.findall(r"```sh\n(.*?)```", TEXT, flags=re.DOTALL))


@pytest.mark.parametrize("target", sorted(set(re.findall(r"^make ([a-z-]+)", SHELL, flags=re.M))))
def test_each_make_target_named_in_the_docs_exists(target: str) -> None:
    assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(), flags=re.M)


@pytest.mark.parametrize("command", sorted(set(re.findall(r"autocomplete ([a-z]+)", SHELL))))
def test_each_command_named_in_the_docs_explains_itself(command: str) -> None:
    entry_point = Path(sys.executable).with_name("autocomplete")
    run = subprocess.run([entry_point, command, "--help"], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert "usage:" in run.stdout


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_each_link_to_a_file_leads_somewhere(page: Path) -> None:
    for link in re.findall(r"\]\(([^)#]+)", page.read_text()):
        if not link.startswith("http"):
            assert (page.parent / link).exists(), f"{page.name}: {link}"


@pytest.mark.parametrize(
    "path", sorted(set(re.findall(r"`((?:services|common|studies|worlds|tests)/[\w/.]+)`", TEXT)))
)
def test_each_path_named_in_the_docs_is_there(path: str) -> None:
    assert (ROOT / path).exists()
