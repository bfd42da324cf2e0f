"""Follows the ground's texture through the downward camera's pictures.

Corners of a key picture are searched for in each later one, so the displacement against the key
does not add up errors as frame-to-frame flow does. The geometry of it is in ground.py.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from common.frames import Array
from common.messages import Image

Grey = NDArray[np.uint8]

WINDOW_PX = 15
PYRAMID_LEVELS = 2
CORNER_QUALITY = 0.02
CORNER_DISTANCE_PX = 16
BORDER_PX = 8
MOST_ZOOM = 20.0
"""Focal lengths between the 20th part of a picture's width and 20 times that."""
MOST_DIFFERENCE = 0.7
"""Of a corner's surroundings in two pictures, as a share of their contrast."""
_STOP = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 15, 0.01)
_EXACT = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 50, 1e-9)
"""The five steps that are the default miss the corners of a wide lens by 0.03 pixels."""
_REDUCED = {
    1: cv2.IMREAD_GRAYSCALE,
    2: cv2.IMREAD_REDUCED_GRAYSCALE_2,
    4: cv2.IMREAD_REDUCED_GRAYSCALE_4,
    8: cv2.IMREAD_REDUCED_GRAYSCALE_8,
}
_WIDTH_WANTED_PX = 400
"""Larger pictures are decoded at a fraction: QVGA is enough, and cheap."""

# One picture takes half a millisecond; more threads would only take turns on the machine.
cv2.setNumThreads(1)


class Picture:
    """A grey picture and its lens.

    Raises:
        ValueError: if the data is no picture of the size it claims.
    """

    def __init__(self, image: Image) -> None:
        divisor = next((d for d in _REDUCED if image.width / d <= _WIDTH_WANTED_PX), 8)
        if not image.data:
            raise ValueError("no data")
        try:
            grey: Any = cv2.imdecode(np.frombuffer(image.data, np.uint8), _REDUCED[divisor])
        except cv2.error as error:
            raise ValueError(f"not decoded: {error}") from None
        if grey is None:
            raise ValueError("not a JPEG")
        width = grey.shape[1]
        if abs(width * divisor - image.width) >= divisor:
            raise ValueError(f"{width * divisor} pixels wide, not {image.width}")
        fx, fy, cx, cy = (value / divisor for value in image.intrinsics)
        if not all(width / MOST_ZOOM < focal < width * MOST_ZOOM for focal in (fx, fy)):
            raise ValueError(f"no lens has focal lengths of {fx} and {fy} pixels")
        self.grey: Grey = grey
        self.matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
        self.distortion = np.array(image.distortion)
        self.capture_ns = image.capture

    @property
    def focal_px(self) -> float:
        """The focal length across."""
        return float(self.matrix[0, 0])

    def rays(self, pixels: Array) -> Array:
        """Optical rays (N, 3) with z = 1 of pixels (N, 2)."""
        if np.any(self.distortion):
            plane = cv2.undistortPoints(
                pixels.reshape(-1, 1, 2), self.matrix, self.distortion, criteria=_EXACT
            ).reshape(-1, 2)
        else:
            plane = (pixels - self.matrix[:2, 2]) / self.matrix.diagonal()[:2]
        return np.column_stack([plane, np.ones(len(pixels))])

    def pixels(self, rays: Array) -> Array:
        """Pixels (N, 2) of optical rays (N, 3)."""
        if np.any(self.distortion):
            zero = np.zeros(3)
            found, _ = cv2.projectPoints(rays, zero, zero, self.matrix, self.distortion)
            return np.asarray(found.reshape(-1, 2), dtype=np.float64)
        plane = rays[:, :2] / rays[:, 2:]
        return np.asarray(plane * self.matrix.diagonal()[:2] + self.matrix[:2, 2])


class Key:
    """A picture whose corners are searched for in later ones.

    Args:
        picture: the picture.
        most: how many corners at most.

    Attributes:
        corners: well-textured pixels (N, 2), spread over the picture.
        rays: their optical rays (N, 3).
    """

    def __init__(self, picture: Picture, most: int) -> None:
        self._grey = picture.grey
        found: Any = cv2.goodFeaturesToTrack(
            picture.grey, most, CORNER_QUALITY, CORNER_DISTANCE_PX, blockSize=5
        )
        corners = np.zeros((0, 2)) if found is None else found.reshape(-1, 2).astype(np.float64)
        self.corners: Array = corners[_inside(corners, picture)]
        self.rays = picture.rays(self.corners)
        mean = cv2.blur(picture.grey, (WINDOW_PX, WINDOW_PX))
        rough = cv2.blur(cv2.absdiff(picture.grey, mean), (WINDOW_PX, WINDOW_PX))
        column, row = np.rint(self.corners).astype(int).T
        self._contrast = rough[row, column]

    def follow(self, picture: Picture, expected: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Where the corners are in another picture, pixels (N, 2), and which were found.

        Args:
            picture: a later picture.
            expected: pixels in it (N, 2) near which to search.
        """
        seen = _inside(expected, picture)
        found = expected.copy()
        if np.any(seen):
            there, status, difference = cv2.calcOpticalFlowPyrLK(
                self._grey,
                picture.grey,
                self.corners[seen].astype(np.float32).reshape(-1, 1, 2),
                expected[seen].astype(np.float32).reshape(-1, 1, 2),
                winSize=(WINDOW_PX, WINDOW_PX),
                maxLevel=PYRAMID_LEVELS,
                criteria=_STOP,
                flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
            )
            found[seen] = there.reshape(-1, 2)
            # Found is not recognised: on a blank floor the search stops where it began.
            tracked = status.reshape(-1) == 1
            unlike = np.where(tracked, difference.reshape(-1), np.inf) / MOST_DIFFERENCE
            seen[seen] = unlike < self._contrast[seen]
        return found, seen & _inside(found, picture)


def _inside(pixels: Array, picture: Picture) -> NDArray[np.bool_]:
    height, width = picture.grey.shape
    return np.asarray(
        (pixels[:, 0] >= BORDER_PX)
        & (pixels[:, 0] < width - BORDER_PX)
        & (pixels[:, 1] >= BORDER_PX)
        & (pixels[:, 1] < height - BORDER_PX)
    )
