import pytest

from cli.extras import needing
from cli.main import main


def test_a_missing_package_is_told_with_what_installs_it() -> None:
    with (
        pytest.raises(OSError, match=r"^nowhere is missing: .*pip install .*'\.\[training\]'$"),
        needing("training"),
    ):
        raise ModuleNotFoundError("No module named 'nowhere'", name="nowhere")


def test_a_job_that_is_stopped_has_failed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("cli.worlds.worlds.names", interrupted)
    assert main(["worlds"]) == 1
    assert capsys.readouterr().err == "autocomplete worlds: stopped\n"
