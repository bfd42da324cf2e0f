"""A vehicle's file that cannot be used is refused in one line that names it and what is missing."""

from pathlib import Path

import pytest

from cli.main import main
from common.messages import ResetRequest
from services.sim import plants
from services.sim.config import Config
from services.sim.core import ResetError, Simulation

PAGE = Path(__file__).parents[3] / "docs" / "simulator.md"


def heavy() -> str:
    """The file of the docs."""
    _, _, page = PAGE.read_text().partition("## A vehicle of your own")
    return page.partition("```python\n")[2].partition("```\n")[0]


def without(method: str) -> str:
    before, _, rest = heavy().partition(f"    def {method}(")
    return before + rest.partition("\n\n")[2]


WRONG = {
    "no_plant": (heavy().replace("PLANT = HeavyPlant", ""), "it has no PLANT"),
    "no_class": (heavy().replace("= HeavyPlant", "= HeavyPlant(0.005)"), "must be a class"),
    "other_class": (heavy().replace("PLANT = HeavyPlant", "PLANT = Build"), "derived from"),
    "syntax": ("def f(:\n", "syntax.py: SyntaxError"),
    "absent": ("import nothing_like_that\n", "absent.py:1: ModuleNotFoundError"),
    "no_look": (heavy().replace("look=(RING,)", "look=()"), "build.look is empty"),
    "no_hull": (heavy().replace("hull=(RING,)", "hull=()"), "build.hull is empty"),
    "look_of_numbers": (heavy().replace("look=(RING,)", "look=(1,)"), "`build.look[0]`"),
    "texture": (heavy().replace('"metal"', '"velvet"'), "`build.hull[0].texture`"),
    "flat": (heavy().replace("(0.9, 0.9, 0.3)", "(0.9, 0.9, 0.0)"), "above 0"),
    "weightless": (heavy().replace("MASS_KG = 4.0", "MASS_KG = 0.0"), "mass_kg"),
    "heavy_text": (heavy().replace("MASS_KG = 4.0", 'MASS_KG = "4"'), "`build.mass_kg`"),
    "no_build": (heavy().replace("    build = Build", "    build = 3  #"), "build is 3"),
    "nose": (
        heavy().replace("look=(RING,)", "look=(RING,), sensors=frozenset({'nose'})"),
        "'nose'; there are altimeter, camera/down, camera/front, imu",
    ),
    "three_speeds": (heavy().replace("(3.0, 3.0, 1.0, 1.2, 1.0)", "(3.0,)"), "full_stick"),
    "no_life": (heavy().replace("25 * 60.0", "0.0"), "life_s"),
    "no_fly": (without("fly"), "lacks fly"),
    "no_landing": (without("land"), "lacks land"),
    "no_loads": (heavy().replace("return NO_LOADS", "return None"), "fall returned None"),
    "nan": (heavy().replace("thrust_n=MASS_KG", "thrust_n=float('nan')"), "finite"),
    "raises": (heavy().replace("return NO_LOADS", "return 1 / 0"), "ZeroDivisionError"),
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(plants, "__path__", [*plants.__path__, str(tmp_path)])
    return tmp_path


@pytest.mark.parametrize("name", WRONG)
def test_a_file_that_is_no_vehicle_is_refused_by_name(name: str, folder: Path) -> None:
    code, said = WRONG[name]
    (folder / f"{name}.py").write_text(code)
    for settings in ({"plant": name}, {"vehicles": f"tum,{name}"}):
        with pytest.raises(ValueError, match=next(iter(settings))) as caught:
            Config(**settings)
        assert f"{folder / name}.py" in str(caught.value)
        assert said in str(caught.value)
        assert len(str(caught.value).splitlines()) == 1


def test_on_the_command_line_it_is_wrong_usage(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "cart.py").write_text("")
    assert main(["run", "sim", "--plant", "cart"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "sets 'plant': " in line
    assert "cart.py: it has no PLANT; end it with PLANT = " in line


def test_a_reset_into_it_is_refused_and_changes_nothing(folder: Path) -> None:
    (folder / "ghost.py").write_text(heavy().replace("look=(RING,)", "look=()"))
    simulation = Simulation(Config(world="empty", renderer="none"))
    with pytest.raises(ResetError, match="look is empty") as caught:
        simulation.reset(ResetRequest(plant="ghost"))
    assert caught.value.field == "plant"
    assert simulation.status().plant == "tum"
    with pytest.raises(ResetError, match="no plant 'zeppelin'; there are ardrone, ghost"):
        simulation.reset(ResetRequest(plant="zeppelin"))
    simulation.close()


def test_numbers_of_numpy_are_as_good(folder: Path) -> None:
    code = heavy().replace("MASS_KG = 4.0", "import numpy as np\nMASS_KG = np.float64(4.0)")
    (folder / "scientific.py").write_text(code.replace("(0.1, 0.1, 0.18)", "(np.ones(3) * 0.1)"))
    simulation = Simulation(Config(world="empty", plant="scientific"))
    simulation.step()
    simulation.close()
