"""Wiring of the classifier."""

import logging
from pathlib import Path

from common.config import ConfigError
from common.messages import ClassifyRequest, HealthState, Intent
from common.node import Node, RefusedError
from services.classifier.config import Config
from services.classifier.core import Classifier, UnusableSamplesError
from services.classifier.model import ModelError, OnnxModel
from services.classifier.reload import LOOK_PERIOD_S, ModelFile

STICKS_WAITING = 64
"""A shape is made of every stick, not of the newest: more than half a second of them may wait."""

_logger = logging.getLogger(__name__)


def check(config: Config, _vehicle: str) -> None:
    """See that the model can be used, before there is a network to serve.

    Raises:
        ConfigError: if it cannot.
    """
    try:
        OnnxModel(Path(config.model))
    except ModelError as error:
        raise ConfigError(f"classifier: {error}") from None


def wire(node: Node, config: Config) -> None:
    """Connect the classifier to its topics.

    Raises:
        ConfigError: if the model cannot be used.
    """
    try:
        file = ModelFile(Path(config.model))
    except ModelError as error:
        raise ConfigError(f"classifier: {error}") from None
    core = Classifier(config, file.model)

    def look(_now_ns: int) -> None:
        fault = file.fault
        file.look()
        if file.fault and file.fault != fault:
            _logger.warning("%s; %s stays", file.fault, file.model.name)
        if file.model is not core.model:
            core.model = file.model
            _logger.info("%s is in use", file.model.name)

    def publish_intent(now_ns: int) -> None:
        node.publish("intent", core.intent(now_ns, node.clock.utc_ns()))

    def classify(request: ClassifyRequest, _now_ns: int) -> Intent:
        try:
            return core.classify(request, node.clock.utc_ns())
        except UnusableSamplesError as error:
            raise RefusedError(str(error), error.field) from None

    def health() -> tuple[HealthState, str]:
        faults = [fault for fault in (file.fault, core.fault) if fault]
        return ("degraded" if faults else "ok"), "; ".join([core.model.name, *faults])

    node.publishes("intent")
    node.on("stick", core.on_stick, depth=STICKS_WAITING)
    node.on("vehicle", core.on_vehicle)
    node.every(LOOK_PERIOD_S, look)
    node.every(config.period_s, publish_intent, timed=True)
    node.answer("classifier/classify", classify)
    node.reports(health)
