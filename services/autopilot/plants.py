"""How fast each plant's speeds follow the sticks: the lags that the follower leads by."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Lags:
    """Mean delays of the speed behind the stick."""

    plane_s: float
    vertical_s: float
    yaw_s: float


LAGS: dict[str, Lags] = {
    # tum_simulator a020d89: velocity loop 5 over attitude loop 10, 5: s3 + 5 s2 + 20 s + 50, so
    # 20/50 s; climb 1/5 s; yaw rate 1/2 s.
    "tum": Lags(0.4, 0.2, 0.5),
    # tum_ardrone 6bcfb34, c1..c8: 1/0.58 + 1/7 s; 1/0.8 s; 1/90 s.
    "ardrone": Lags(1.87, 1.25, 0.01),
}
