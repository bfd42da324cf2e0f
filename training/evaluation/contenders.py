"""Every classifier by its name; what it needs is imported when it is asked for."""

from training.evaluation.contender import Contender
from training.evaluation.names import OURS

PEERS = (
    "cnn-gru-thesis",
    "svm",
    "MiniRocket",
    "MultiRocketHydra",
    "QUANT",
    "geometry + ExtraTrees",
    "geometry + boosting",
)
CONTENDERS = (OURS, *PEERS)


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
    if name in PEERS:
        from training.evaluation import kernels

        if name == "QUANT":
            return kernels.Quant()
        return kernels.minirocket() if name == "MiniRocket" else kernels.multirocket_hydra()
    raise ValueError(f"classifier {name!r} is unknown; use {', '.join(CONTENDERS)}")
