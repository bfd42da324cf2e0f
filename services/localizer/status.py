"""How far a pose is to be trusted: `ok`, `degraded` or `lost`, and why."""

import math
from dataclasses import dataclass

from common.clock import seconds
from common.messages import PoseStatus
from services.localizer.config import Config
from services.localizer.filter import POSITION, VELOCITY, ErrorStateFilter


@dataclass(frozen=True)
class Verdict:
    """A status and its reason (empty for `ok`)."""

    status: PoseStatus
    reason: str = ""


OK = Verdict("ok")


def judge(
    state: ErrorStateFilter, config: Config, flow_ns: int, altimeter_ns: int, now_ns: int
) -> Verdict:
    """The status of the pose.

    Args:
        state: the filter.
        config: the limits.
        flow_ns: arrival of the last flow that was used.
        altimeter_ns: arrival of the last reading that was believed.
        now_ns: on the same clock.
    """
    variances = state.covariance.diagonal()
    place_sigma = math.sqrt(max(variances[POSITION]))
    speed_sigma = math.sqrt(max(variances[VELOCITY]))
    no_flow_s = seconds(now_ns - flow_ns)
    no_altimeter_s = seconds(now_ns - altimeter_ns)
    if no_flow_s > config.flow_lost_s:
        return Verdict("lost", f"no flow for {no_flow_s:.1f} s")
    if place_sigma > config.lost_position_sigma_m:
        return Verdict("lost", "place unknown")
    if speed_sigma > config.lost_velocity_sigma_mps:
        return Verdict("lost", "speed unknown")
    if no_flow_s > config.stale_s:
        return Verdict("degraded", f"no flow for {no_flow_s:.1f} s")
    if no_altimeter_s > config.stale_s:
        return Verdict("degraded", f"no altimeter for {no_altimeter_s:.1f} s")
    if place_sigma > config.degraded_position_sigma_m:
        return Verdict("degraded", "place not well known")
    return OK
