import time
from pathlib import Path

import pytest
from classifier_models import GOOD, write_model

from services.classifier.model import ModelError
from services.classifier.reload import ModelFile


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return write_model(tmp_path / "m.onnx")


def look_until_quiet(file: ModelFile) -> None:
    """See the change, see it settled, let the check end, take its outcome."""
    for _ in range(3):
        file.look()
        while file.is_checking:
            time.sleep(0.001)
    file.look()


def replace(path: Path, **changes: object) -> None:
    """As an operator should: beside it, then renamed."""
    write_model(path.with_suffix(".new"), **changes).replace(path)


def test_a_file_that_stays_is_not_read_again(path: Path) -> None:
    file = ModelFile(path)
    model = file.model
    look_until_quiet(file)
    assert file.model is model
    assert file.fault == ""


def test_a_new_file_is_taken(path: Path) -> None:
    file = ModelFile(path)
    old = file.model
    replace(path, logits=(2.0, 0.0, 0.0, 0.0))
    look_until_quiet(file)
    assert file.model is not old
    assert file.model.name != old.name
    assert file.fault == ""


def test_a_file_that_does_not_fit_keeps_the_old_model_until_a_good_one_comes(path: Path) -> None:
    file = ModelFile(path)
    old = file.model
    replace(path, metadata={**GOOD, "contract": "intent-sticks/9"})
    look_until_quiet(file)
    assert file.model is old
    assert "intent-sticks/9" in file.fault
    replace(path, logits=(2.0, 0.0, 0.0, 0.0))
    look_until_quiet(file)
    assert file.model is not old
    assert file.fault == ""


def test_a_file_that_is_gone_or_garbage_keeps_the_old_model(path: Path) -> None:
    file = ModelFile(path)
    old = file.model
    path.write_bytes(b"no model at all")
    look_until_quiet(file)
    assert file.model is old
    assert "no ONNX model" in file.fault
    path.unlink()
    look_until_quiet(file)
    assert file.model is old
    assert "cannot be read" in file.fault


def test_a_file_that_is_still_being_written_is_not_read(path: Path) -> None:
    file = ModelFile(path)
    old = file.model
    for size in range(1, 6):
        path.write_bytes(b"part" * size)
        file.look()
        assert not file.is_checking
    assert file.model is old
    assert file.fault == ""


def test_the_old_file_put_back_is_told_of_no_more(path: Path) -> None:
    file = ModelFile(path)
    aside = path.with_suffix(".old")
    aside.write_bytes(path.read_bytes())
    name = file.model.name
    path.write_bytes(b"no model at all")
    look_until_quiet(file)
    assert file.fault
    aside.replace(path)
    look_until_quiet(file)
    assert file.model.name == name
    assert file.fault == ""


def test_without_a_good_file_there_is_no_start(tmp_path: Path) -> None:
    with pytest.raises(ModelError):
        ModelFile(tmp_path / "nowhere.onnx")
