"""Wiring of synthesis: poses and intents in, suggestions out, `synthesis/fit` answered."""

from common import messages as m
from common.node import Node, RefusedError
from services.synthesis.config import Config
from services.synthesis.core import RefusalError, Synthesizer

POSE_DEPTH = 256
"""Poses are a history here, not a newest value: few may be lost while a fit runs."""


def wire(node: Node, config: Config) -> None:
    """Connect the core to its topics."""
    synthesizer = Synthesizer(config)
    node.publishes("suggestion", "refusal")

    def on_intent(intent: m.Intent, arrival_ns: int) -> None:
        answer = synthesizer.on_intent(intent, arrival_ns)
        if answer is not None:
            node.publish("refusal" if isinstance(answer, m.Refusal) else "suggestion", answer)

    def on_vehicle(vehicle: m.VehicleStatus, _arrival_ns: int) -> None:
        synthesizer.on_vehicle(vehicle)

    def fit(request: m.FitRequest, now_ns: int) -> m.Suggestion:
        try:
            return synthesizer.fit(request, node.clock.utc_ns(), now_ns)
        except RefusalError as refusal:
            raise RefusedError(str(refusal), refusal.field) from None

    def health() -> tuple[m.HealthState, str]:
        refusal = synthesizer.last_refusal
        detail = f"no suggestion: {refusal}" if refusal else ""
        trouble = synthesizer.pose_trouble(node.clock.monotonic_ns()) or synthesizer.world_trouble
        return ("ok", detail) if trouble is None else ("degraded", detail or trouble)

    # Poses before intents: those that wait together belong to the intent's window.
    node.on("pose", synthesizer.on_pose, depth=POSE_DEPTH)
    node.on("vehicle", on_vehicle)
    node.on("intent", on_intent, timed=True)
    node.answer("synthesis/fit", fit)
    node.reports(health)
