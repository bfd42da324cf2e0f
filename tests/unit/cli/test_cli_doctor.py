"""The doctor says what will draw the pictures."""

import moderngl
import pytest

from cli.doctor import _renderer


def test_it_names_what_opengl_draws_with() -> None:
    found = _renderer()
    if found.state != "ok":
        pytest.skip(f"no OpenGL here: {found.text}")
    assert found.text


def test_without_opengl_it_names_what_draws_instead_and_the_mend(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(**_: object) -> None:
        raise RuntimeError("cannot load libEGL.so.1")

    monkeypatch.setattr(moderngl, "create_context", fail)
    found = _renderer()
    assert found.state == "warn"
    assert "libEGL" in found.text
    assert "TinyRenderer" in found.text
    assert "apt-get install" in found.mend
