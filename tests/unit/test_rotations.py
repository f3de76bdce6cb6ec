import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from foottrack_service import rotations as rot

component = st.floats(-1.0, 1.0)
vectors = st.tuples(component, component, component).map(np.array)
quaternions = st.tuples(component, component, component, component).filter(lambda q: np.linalg.norm(q) > 0.01)


@given(quaternions, quaternions, vectors)
def test_agrees_with_scipy(a, b, v):
    a, b = rot.normalised(a), rot.normalised(b)
    ra, rb = Rotation.from_quat(a), Rotation.from_quat(b)
    assert np.allclose(rot.rotate(a, v), ra.apply(v))
    assert np.allclose(rot.unrotate(a, v), ra.inv().apply(v))
    assert np.allclose(rot.to_matrix(rot.multiply(a, b)), (ra * rb).as_matrix())
    assert np.allclose(rot.angle_between(a, b), (ra.inv() * rb).magnitude())


@given(quaternions)
def test_matrix_and_rotation_vector_round_trip(q):
    q = rot.normalised(q)
    assert rot.angle_between(q, rot.from_matrix(rot.to_matrix(q))) < 1e-7
    assert np.allclose(np.abs(q @ rot.from_rotation_vector(rot.to_rotation_vector(q))), 1.0)


@given(vectors)
def test_rotation_vector_agrees_with_scipy(v):
    assert np.allclose(rot.to_matrix(rot.from_rotation_vector(v)), Rotation.from_rotvec(v).as_matrix())


def test_tiny_rotation_vectors_survive():
    tiny = np.array([1e-15, -2e-15, 3e-15])
    assert np.allclose(rot.to_rotation_vector(rot.from_rotation_vector(tiny)), tiny, rtol=1e-6, atol=0)


def test_yaw_is_positive_to_the_left():
    assert np.allclose(rot.rotate(rot.from_yaw(np.pi / 2), [0, 0, -1]), [-1, 0, 0])
    assert np.allclose(rot.yaw_of(rot.from_yaw(np.array([0.3, -2.0]))), [0.3, -2.0])


@given(quaternions, st.floats(-3.0, 3.0))
def test_twist_keeps_only_the_turn_about_up(q, yaw):
    tilt_free = rot.twist_about_up(rot.from_yaw(yaw))
    assert rot.angle_between(tilt_free, rot.from_yaw(yaw)) < 1e-7
    assert np.allclose(rot.rotate(rot.twist_about_up(rot.normalised(q)), [0, 1, 0]), [0, 1, 0])


@given(quaternions, quaternions, st.floats(0.0, 1.0))
def test_slerp_divides_the_angle(a, b, share):
    a, b = rot.normalised(a), rot.normalised(b)
    whole = rot.angle_between(a, b)
    assert np.allclose(rot.angle_between(a, rot.slerp(a, b, share)), share * whole, atol=1e-6)


def test_continuous_tracks_never_jump():
    track = rot.from_yaw(np.linspace(0, 20, 500)) * np.where(np.arange(500) % 7 == 0, -1.0, 1.0)[:, None]
    smooth = rot.continuous(track)
    assert np.max(np.linalg.norm(np.diff(smooth, axis=0), axis=1)) < 0.05
    assert np.allclose(np.abs(np.sum(smooth * track, axis=1)), 1.0)


@pytest.mark.parametrize("bad", [[0, 0, 0, 0], [np.nan, 0, 0, 1], [np.inf, 0, 0, 1]])
def test_normalising_refuses_what_is_no_rotation(bad):
    with pytest.raises(ValueError, match="zero or not finite"):
        rot.normalised(bad)


@given(quaternions, quaternions, vectors)
def test_one_and_many_give_the_same(a, b, v):
    a, b = rot.normalised(a), rot.normalised(b)
    assert np.allclose(rot.normalised(a[None])[0], a, rtol=0, atol=1e-15)
    assert np.allclose(rot.multiply(a[None], b)[0], rot.multiply(a, b), rtol=0, atol=1e-15)
    assert np.allclose(rot.rotate(a[None], v)[0], rot.rotate(a, v), rtol=0, atol=1e-15)
    assert np.allclose(rot.from_rotation_vector(v[None])[0], rot.from_rotation_vector(v), rtol=0, atol=1e-15)
    assert np.allclose(rot.to_rotation_vector(a[None])[0], rot.to_rotation_vector(a), rtol=1e-12, atol=1e-15)
