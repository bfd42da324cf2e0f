"""Every classifier by its name; what it needs is imported when it is asked for."""

from training.evaluation.contender import Contender
from training.evaluation.names import LITE, OURS

_VIEWS = "training/evaluation/views.py"
_THESIS = ("training/evaluation/thesis.py", "training/svm.py", _VIEWS)
_ROCKETS = ("training/evaluation/kernels.py", "training/evaluation/ridge.py", _VIEWS)
_TREES = ("training/evaluation/trees.py", "training/evaluation/geometry.py", _VIEWS)

CODE: dict[str, tuple[str, ...]] = {
    OURS: (
        "training/windows.py",
        "training/geometry.py",
        "training/network.py",
        "training/fit.py",
        "training/calibration.py",
        "training/export.py",
        "training/evaluation/ours.py",
        "training/evaluation/rejection.py",
        "services/classifier/window.py",
    ),
    "cnn-gru-thesis": _THESIS,
    "svm": _THESIS,
    "MiniRocket": _ROCKETS,
    "MultiRocketHydra": _ROCKETS,
    "QUANT": _ROCKETS,
    "geometry + ExtraTrees": _TREES,
    "geometry + boosting": _TREES,
    LITE: ("training/evaluation/lite.py", _VIEWS),
}
"""Each with the source files that its answers come from: a change of these makes them stale."""
CONTENDERS = tuple(CODE)


def contender(name: str) -> Contender:
    """A fresh classifier.

    Raises:
        ModuleNotFoundError: if a library it needs is not installed.
        ValueError: if there is no classifier of this name.
    """
    if name == OURS:
        from training.evaluation.ours import Ours

        return Ours()
    if name in ("cnn-gru-thesis", "svm"):
        from training.evaluation.thesis import ThesisMachine, ThesisNetwork

        return ThesisMachine() if name == "svm" else ThesisNetwork()
    if name.startswith("geometry"):
        from training.evaluation.trees import GeometryTrees

        return GeometryTrees(boosted=name.endswith("boosting"))
    if name == LITE:
        from training.evaluation.lite import Lite

        return Lite()
    if name in CODE:
        from training.evaluation import kernels

        if name == "QUANT":
            return kernels.Quant()
        return kernels.minirocket() if name == "MiniRocket" else kernels.multirocket_hydra()
    raise ValueError(f"classifier {name!r} is unknown; use {', '.join(CONTENDERS)}")
