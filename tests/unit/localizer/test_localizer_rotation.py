"""The inner loop's rotations are scipy's."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from services.localizer.rotation import cross_matrix, orthonormal, quaternion_of, rotation_by

vectors = st.tuples(*[st.floats(-3.2, 3.2)] * 3).map(np.array)


@settings(max_examples=60, deadline=None)
@given(vector=vectors, scale=st.sampled_from([1.0, 1e-3, 1e-5, 0.0]))
def test_rotations_are_those_of_scipy(vector, scale):
    expected = Rotation.from_rotvec(vector * scale)
    rotation = rotation_by(vector * scale)
    np.testing.assert_allclose(rotation, expected.as_matrix(), atol=1e-12)
    quaternion = np.array(quaternion_of(rotation))
    np.testing.assert_allclose(
        quaternion, expected.as_quat(canonical=True) * np.sign(quaternion[3] or 1.0), atol=1e-9
    )


@settings(max_examples=30, deadline=None)
@given(vector=vectors, other=vectors)
def test_the_cross_matrix_multiplies_like_a_cross_product(vector, other):
    np.testing.assert_allclose(cross_matrix(vector) @ other, np.cross(vector, other), atol=1e-12)


@settings(max_examples=30, deadline=None)
@given(vector=vectors)
def test_rounding_errors_are_taken_out(vector):
    rotation = rotation_by(vector)
    spoilt = rotation + 1e-5 * np.sin(np.arange(9.0)).reshape(3, 3)
    mended = orthonormal(spoilt)
    np.testing.assert_allclose(mended.T @ mended, np.eye(3), atol=1e-9)
    np.testing.assert_allclose(mended, rotation, atol=3e-5)
