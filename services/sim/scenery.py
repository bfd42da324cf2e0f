"""What stands in a world, as one body of pybullet."""

import tempfile
from pathlib import Path

import pybullet
from scipy.spatial.transform import Rotation

from worlds import Body

MOST = 5000
"""Parts of one body; pybullet gives back the shapes of 7488 at most."""


def add_bodies(bodies: tuple[Body, ...], **on: int) -> int:
    """Put at most MOST bodies as one into the pybullet that `on` names; its number there.

    At each step pybullet visits each of its bodies, 0.2 us a time, but not their parts. By calls a
    body has at most 16 parts; by a URDF file as many as one likes.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scenery.urdf"
        path.write_text(_urdf_of(bodies), encoding="utf-8")
        return int(
            pybullet.loadURDF(
                str(path), useFixedBase=True, flags=pybullet.URDF_USE_IMPLICIT_CYLINDER, **on
            )
        )


def _urdf_of(bodies: tuple[Body, ...]) -> str:
    # Pybullet's reader breaks lines of more than 1023 characters wherever it may be.
    parts = "\n".join(_collision_of(body) for body in bodies)
    return (
        '<robot name="scenery"><link name="scenery"><inertial><mass value="0"/>\n'
        '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>\n'
        f"{parts}\n</link></robot>\n"
    )


def _collision_of(body: Body) -> str:
    x, y, z = (float(side) for side in body.size_m)
    form = {
        "box": f'<box size="{x} {y} {z}"/>',
        "cylinder": f'<cylinder radius="{x / 2.0}" length="{z}"/>',
        "sphere": f'<sphere radius="{x / 2.0}"/>',
    }[body.shape]
    at = " ".join(str(float(each)) for each in body.position_m)
    turn = " ".join(str(each) for each in Rotation.from_quat(body.orientation).as_euler("xyz"))
    return f'<collision><origin xyz="{at}" rpy="{turn}"/>\n<geometry>{form}</geometry></collision>'
