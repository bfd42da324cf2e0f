import numpy as np
import pytest

from training import ablation
from training.ablation import LEFT_OUT, VARIANTS, ablate, page_of, sets_of
from training.fit import Budget
from training.people import Share

FEW = Share(wide_people=10, wide=0.02, thesis_people=4, thesis=0.01)


def test_a_variant_a_row_judged_on_people_nobody_has_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("TRAINING", "VALIDATION", "TEST"):
        monkeypatch.setattr(ablation, name, FEW)
    monkeypatch.setattr(ablation, "STRANGERS", Share(4, 0.02, 0, 0.0, none=0.0))
    sets = sets_of(lambda *_: None)
    people = [set(examples.operators.tolist()) for examples in sets.values()]
    assert len(set.union(*people)) == sum(map(len, people))
    assert set(sets["left out"].families.tolist()) == set(LEFT_OUT)
    for name in ("training", "validation", "wide"):
        wide = np.char.find(sets[name].operators, "-wide") > 0
        assert wide.any()
        assert not set(sets[name].families[wide].tolist()) & set(LEFT_OUT)
    told = []
    rows = list(
        ablate(sets, lambda *at: told.append(at), VARIANTS[:2], seeds=(3,), budget=Budget(100))
    )
    assert told[-1] == ("variants", 2, 2)
    assert [row.name for row in rows] == [variant.name for variant in VARIANTS[:2]]
    assert rows[1].parameters < rows[0].parameters
    page = page_of(rows, {name: len(examples) for name, examples in sets.items()})
    assert f"| {rows[1].name} |" in page
    assert f"{rows[0].f1['left out', None][0]:.3f}" in page


def test_every_variant_changes_something() -> None:
    shipped, *others = VARIANTS
    settings = [(v.architecture, v.cuts, v.augment) for v in VARIANTS]
    assert settings[0] == (type(shipped.architecture)(), True, True)
    assert len(set(settings)) == len(others) + 1
