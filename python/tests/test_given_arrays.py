"""Arrays of another number type, lists and strided arrays become what C reads, with the same
result; a Camera is made of a matrix."""

import copy
import dataclasses
import gc

import numpy as np
import pytest
import twoview as tv
from conftest import needs


def estimate(context, scene, pixels0, pixels1, **more):
    return tv.estimate_two_view(context, scene.camera, scene.camera, pixels0, pixels1, **more)


FORMS = {
    "float32": lambda a: a.astype(np.float32),
    "list": lambda a: a.astype(np.float32).astype(float).tolist(),
    "tuple": lambda a: tuple(map(tuple, a.astype(np.float32).astype(float))),
    "strided": lambda a: np.repeat(a.astype(np.float32).astype(float), 2, axis=0)[::2],
    "columns": lambda a: np.asfortranarray(a.astype(np.float32).astype(float)),
    "big-endian": lambda a: a.astype(np.float32).astype(">f8"),
    "negative stride": lambda a: a.astype(np.float32).astype(float)[::-1].copy()[::-1],
}


@pytest.mark.parametrize("form", FORMS)
def test_pixels_of_any_form_give_the_same_bits(context, scene, form):
    exact = [pixels.astype(np.float32).astype(float) for pixels in (scene.pixels0, scene.pixels1)]
    expected, _ = estimate(context, scene, *exact)
    given = [FORMS[form](pixels) for pixels in (scene.pixels0, scene.pixels1)]
    found, inliers = estimate(context, scene, *given)
    assert found == expected and inliers.sum() > 100
    points = tv.triangulate(scene.camera, scene.camera, scene.R, scene.t, *given)
    assert np.array_equal(points, tv.triangulate(scene.camera, scene.camera, scene.R, scene.t,
                                                 *exact))
    rays = tv.camera_unproject_points(scene.camera, given[0])[0]
    assert np.array_equal(rays, tv.camera_unproject_points(scene.camera, exact[0])[0])


def test_whole_pixels_and_rotations_of_float32(context, scene):
    whole = [np.rint(pixels).astype(int) for pixels in (scene.pixels0, scene.pixels1)]
    expected, _ = estimate(context, scene, *(pixels.astype(float) for pixels in whole))
    assert estimate(context, scene, *whole)[0] == expected
    points = tv.triangulate(scene.camera, scene.camera, scene.R.astype(np.float32).tolist(),
                            scene.t.tolist(), *whole)
    assert (points["status"] == tv.PointStatus.OK).any()


def test_converted_arrays_live_as_long_as_the_call(context, scene):
    """Ratios and sigmas of float64 and lists are copies that C reads after the next conversions."""
    n = len(scene.pixels0)
    ratios = np.linspace(0.1, 0.9, n)
    sigmas = np.linspace(0.5, 2, n)
    expected, _ = estimate(context, scene, scene.pixels0, scene.pixels1,
                           ratios=ratios.astype(np.float32), sigmas0=sigmas.astype(np.float32),
                           sigmas1=sigmas.astype(np.float32))
    for form in (lambda a: a, lambda a: a.tolist()):
        gc.collect()
        found, _ = estimate(context, scene, scene.pixels0.tolist(), scene.pixels1.tolist(),
                            ratios=form(ratios), sigmas0=form(sigmas), sigmas1=form(sigmas))
        assert found == expected
    with pytest.raises(ValueError, match="sigmas0"):
        estimate(context, scene, scene.pixels0, scene.pixels1, sigmas0=[1.0], sigmas1=[1.0])


def test_descriptors_of_opencv_are_floats_of_whole_numbers(context, image):
    keypoints, descriptors = tv.extract(context, image, max_keypoints=200)
    moved = np.ascontiguousarray(np.roll(image, 3, axis=1))
    others, more = tv.extract(context, moved, max_keypoints=200)
    expected = tv.match(context, descriptors, more)
    assert len(expected) > 20
    for form in (np.float32, np.float64, np.int64):
        assert np.array_equal(tv.match(context, descriptors.astype(form), more.tolist()), expected)
    found, _ = tv.reconstruct(context, image, None, moved, None)
    matrix = found.F if found.F is not None else np.array([[0, 0, 0], [0, 0, -1], [0, 1, 0]])
    guided = tv.match_guided(context, None, None, matrix, keypoints, descriptors, others, more)
    again = tv.match_guided(context, None, None, matrix, keypoints[::1],
                            descriptors.astype(np.float32), others, more.astype(float))
    assert np.array_equal(guided, again)


def test_numbers_that_do_not_fit_are_refused(scene):
    with pytest.raises(TypeError, match="points.*complex"):
        tv.camera_project_points(scene.camera, scene.points.astype(complex))
    with pytest.raises(ValueError, match=r"points: shape \(n, 3\)"):
        tv.camera_project_points(scene.camera, scene.points[:, :2].tolist())
    assert len(tv.camera_project_points(scene.camera, [])[0]) == 0


@needs("tv_room_add")
def test_a_room_takes_lists_and_doubles(scene):
    camera = tv.Camera(32, 24, 30, 30, 15.5, 11.5)
    distance = np.full((24, 32), 2.0, np.float32)
    meshes = []
    for form in (lambda a: a, lambda a: a.astype(float), lambda a: a.tolist()):
        with tv.Room(1 << 24, voxel=0.05) as room:
            room.add(camera, np.eye(3), np.zeros(3), form(distance), form(0 * distance + 0.01),
                     pixels=form(np.full((24, 32), 77, np.uint8)))
            meshes.append(room.mesh().vertices)
    assert np.array_equal(meshes[0], meshes[1]) and np.array_equal(meshes[0], meshes[2])


# ---- Camera(K) -----------------------------------------------------------------------------------

K = [[300.0, 0, 159.5], [0, 310, 119.5], [0, 0, 1]]


def test_a_camera_of_a_matrix():
    assert tv.Camera(K) == tv.Camera(320, 240, 300, 310, 159.5, 119.5)
    assert tv.Camera(np.array(K, np.float32)) == tv.Camera(K)
    assert np.array_equal(tv.Camera(K).K, K)
    assert tv.Camera(K, size=(640, 360)) == tv.Camera(640, 360, 300, 310, 159.5, 119.5)
    lens = tv.Camera(K, distortion=np.array([[0.1, -0.05, 1e-3, 2e-3, 0.01]]))
    assert lens == tv.Camera(320, 240, 300, 310, 159.5, 119.5, tv.CameraModel.BROWN_CONRADY,
                             (0.1, -0.05, 1e-3, 2e-3, 0.01))
    fisheye = tv.Camera(K, distortion=[0.01, 0, 0, 0], model=tv.CameraModel.KANNALA_BRANDT)
    assert fisheye.model == tv.CameraModel.KANNALA_BRANDT and fisheye.k == (0.01,)
    assert tv.Camera(K, distortion=np.zeros((14, 1))) == tv.Camera(K)
    for camera in (lens, fisheye, tv.Camera(K)):
        tv.camera_check(camera)
        assert copy.deepcopy(camera) == camera and hash(camera) == hash(copy.copy(camera))
    moved = dataclasses.replace(lens, cx=160.0)
    assert (moved.cx, moved.k) == (160.0, lens.k) and "cx=160.0" in repr(moved)
    with pytest.raises(dataclasses.FrozenInstanceError):
        lens.cx = 3


@pytest.mark.parametrize("arguments, keywords, kind, words", [
    ((np.eye(4),), {}, ValueError, r"K: shape \(3, 3\)"),
    (([[300, 1, 160], [0, 300, 120], [0, 0, 1]],), {}, ValueError, "skew"),
    (([[300, 0, 160], [0, 300, 120], [0, 0, 2]],), {}, ValueError, "K: not"),
    (([[0, 0, 160], [0, 300, 120], [0, 0, 1]],), {}, ValueError, "focal length"),
    (([[np.nan, 0, 160], [0, 300, 120], [0, 0, 1]],), {}, ValueError, "not finite"),
    (([[300, 0, -9], [0, 300, 120], [0, 0, 1]],), {}, ValueError, "principal point"),
    (([[0.9, 0, 0.5], [0, 1.2, 0.5], [0, 0, 1]],), {"size": (640, 480)}, ValueError, "normalised"),
    (([[300, 0, 1600], [0, 300, 120], [0, 0, 1]],), {"size": (320, 240)}, ValueError, "cx is 1600"),
    ((K, 640, 480), {}, TypeError, "size="),
    ((K,), {"size": 640}, ValueError, "size"),
    ((K,), {"distortion": [0.1] * 12}, ValueError, "12 coefficients"),
    ((640, 480), {}, TypeError, "fx, fy, cx, cy missing"),
    ((640, 480, 1, 1, 1, 1), {"distortion": [0.1]}, TypeError, "Camera\\(K\\)"),
])
def test_what_is_no_camera_is_named(arguments, keywords, kind, words):
    with pytest.raises(kind, match=words):
        tv.Camera(*arguments, **keywords)
