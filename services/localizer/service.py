"""Wires the localizer: IMU, altimeter, downward camera and vehicle state in, `pose` out."""

import logging

from common.log import RateLimited
from common.messages import Image, Imu, Pose
from common.node import Node
from services.localizer.config import Config
from services.localizer.core import Localizer

WATCH_PERIOD_S = 0.02
IMU_DEPTH = 64
"""Every sample is integrated: 0.3 s of them may wait while a picture is looked at."""


def wire(node: Node, config: Config) -> None:
    """Connect a localizer to its topics."""
    localizer = Localizer(config)
    warn = RateLimited(logging.getLogger(__name__), node.clock)

    def publish(pose: Pose | None) -> None:
        if pose is not None:
            node.publish("pose", pose)

    def on_imu(imu: Imu, arrival_ns: int) -> None:
        publish(localizer.on_imu(imu, arrival_ns))

    def on_picture(image: Image, arrival_ns: int) -> None:
        try:
            localizer.on_picture(image, arrival_ns)
        except ValueError as error:
            warn.warning(f"camera/down: picture not used: {error}")

    node.on("vehicle", localizer.on_vehicle)
    node.on("imu", on_imu, depth=IMU_DEPTH, timed=True)
    node.on("altimeter", localizer.on_altimeter)
    node.on("camera/down", on_picture)
    node.every(WATCH_PERIOD_S, lambda now_ns: publish(localizer.on_tick(now_ns)))
    node.reports(localizer.health)
    node.publishes("pose")
