"""Wiring of the classifier."""

from pathlib import Path

from common.config import ConfigError
from common.messages import ClassifyRequest, Intent
from common.node import Node, RefusedError
from services.classifier.config import Config
from services.classifier.core import Classifier, UnusableSamplesError
from services.classifier.model import ModelError, OnnxModel

STICKS_WAITING = 64
"""A shape is made of every stick, not of the newest: more than a second of them may wait."""


def wire(node: Node, config: Config) -> None:
    """Connect the classifier to its topics.

    Raises:
        ConfigError: if the model cannot be used.
    """
    try:
        model = OnnxModel(Path(config.model))
    except ModelError as error:
        raise ConfigError(f"classifier: {error}") from None
    core = Classifier(config, model)

    def publish_intent(now_ns: int) -> None:
        node.publish("intent", core.intent(now_ns, node.clock.utc_ns()))

    def classify(request: ClassifyRequest, _now_ns: int) -> Intent:
        try:
            return core.classify(request, node.clock.utc_ns())
        except UnusableSamplesError as error:
            raise RefusedError(str(error), error.field) from None

    node.publishes("intent")
    node.on("stick", core.on_stick, depth=STICKS_WAITING)
    node.every(config.period_s, publish_intent, timed=True)
    node.answer("classifier/classify", classify)
    node.reports(lambda: ("ok", model.name))
