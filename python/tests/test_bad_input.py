"""Checks that Python refuses what C could not read, and that a status of C is raised as the
exception of its name."""

import numpy as np
import pytest
import twoview as tv


@pytest.mark.parametrize("bad, kind, words", [
    (np.zeros((240, 320), np.float32), TypeError, "uint8"),
    (np.zeros((240, 320, 3), np.uint8), ValueError, "height, width"),
    (np.zeros((240, 320, 3), np.uint8)[..., 0], ValueError, "side by side"),
    (np.zeros((240, 320), np.uint8)[::-1], ValueError, "upwards"),
    (np.zeros((0, 320), np.uint8), ValueError, "height, width"),
    ([[1, 2], [3, 4]], TypeError, "numpy array"),
    (None, TypeError, "numpy array"),
])
def test_images(context, bad, kind, words):
    with pytest.raises(kind, match=words):
        tv.detect(context, bad, max_keypoints=100)


def test_an_image_above_the_limits(context):
    with pytest.raises(tv.TV_ERR_LIMITS, match="tv_detect: TV_ERR_LIMITS: .*limits") as caught:
        tv.detect(context, np.zeros((241, 320), np.uint8), max_keypoints=100)
    assert caught.value.status == tv.Status.ERR_LIMITS and caught.value.function == "tv_detect"
    assert isinstance(caught.value, (tv.StatusError, ValueError))


def test_an_image_of_another_size_than_its_camera(context, image):
    camera = tv.Camera(320, 240, 300, 300, 159.5, 119.5)
    half = np.ascontiguousarray(image[::2, ::2])
    for bad in ((image, camera, half, camera), (half, camera, image, camera)):
        with pytest.raises(tv.TV_ERR_CAMERA, match="image[01] is 160x120, but camera[01] is for "
                                                   "320x240.*camera_scale") as caught:
            tv.reconstruct(context, *bad)
        assert isinstance(caught.value, ValueError) and "\n" not in str(caught.value)
    tv.reconstruct(context, image, camera, half, tv.camera_scale(camera, 0.5))


def test_a_mask_of_another_shape(context, image):
    with pytest.raises(ValueError, match="mask"):
        tv.detect(context, image, image[:-1], max_keypoints=100)


@pytest.mark.parametrize("bad, kind, words", [
    (np.full((4, 128), 0.5, np.float32), TypeError, "uint8.*float32 do not fit"),
    (np.full((4, 128), 256), TypeError, "uint8.*do not fit"),
    (np.full((4, 128), -1), TypeError, "uint8.*do not fit"),
    (np.zeros((4, 128), bool), TypeError, "uint8.*bool"),
    (np.zeros((4, 64), np.uint8), ValueError, r"\(n, 128\)"),
    (np.zeros(128, np.uint8), ValueError, r"\(n, 128\)"),
])
def test_descriptors(context, bad, kind, words):
    good = np.zeros((4, 128), np.uint8)
    with pytest.raises(kind, match="descriptors0.*" + words):
        tv.match(context, bad, good)
    with pytest.raises(kind, match="descriptors1.*" + words):
        tv.match(context, good, bad)


@pytest.mark.parametrize("bad, kind, words", [
    (np.zeros((200, 2), complex), TypeError, "float64.*complex"),
    ([["1", "2"]] * 200, TypeError, "float64.*list"),
    ([[1, 2], [3]] * 100, TypeError, "float64.*list"),
    (None, TypeError, "float64.*None"),
    (np.zeros((200, 3), np.float32), ValueError, r"\(n, 2\)"),
    (np.zeros((199, 2)), ValueError, "199"),
])
def test_pixels(context, scene, bad, kind, words):
    with pytest.raises(kind, match=words):
        tv.estimate_two_view(context, scene.camera, scene.camera, bad, scene.pixels1)
    with pytest.raises(kind, match=words):
        tv.triangulate(scene.camera, scene.camera, scene.R, scene.t, bad, scene.pixels1)


def test_keypoints_of_another_type(context, image):
    with pytest.raises(TypeError, match="keypoints"):
        tv.describe(context, image, np.zeros((3, 2), np.float32), max_keypoints=100)
    nan = np.full(3, np.nan, np.float32).astype(np.float32)
    keypoints = np.zeros(3, tv.KEYPOINT)
    keypoints["x"], keypoints["size"] = nan, 4
    with pytest.raises(tv.TV_ERR_NOT_FINITE):
        tv.describe(context, image, keypoints, max_keypoints=100)


def test_poses_and_cameras_that_are_not_finite(scene):
    nan = np.full(3, np.nan)
    with pytest.raises(tv.TV_ERR_NOT_FINITE):
        tv.triangulate(scene.camera, scene.camera, scene.R, nan, scene.pixels0, scene.pixels1)
    with pytest.raises(tv.TV_ERR_ARGUMENT):
        tv.triangulate(scene.camera, scene.camera, 2 * scene.R, scene.t, scene.pixels0,
                       scene.pixels1)
    with pytest.raises(ValueError, match="R: shape"):
        tv.triangulate(scene.camera, scene.camera, scene.R[:2], scene.t, scene.pixels0,
                       scene.pixels1)
    with pytest.raises(tv.TV_ERR_CAMERA):
        tv.camera_check(tv.Camera(320, 240, float("nan"), 300, 160, 120))
    with pytest.raises(TypeError, match="camera1"):
        tv.triangulate(scene.camera, None, scene.R, scene.t, scene.pixels0, scene.pixels1)
    with pytest.raises(ValueError, match="at most 8"):
        tv.camera_check(tv.Camera(320, 240, 300, 300, 160, 120, k=[0] * 9))


def test_options(context, image):
    with pytest.raises(TypeError, match="arcs"):
        tv.detect(context, image, arcs=9)
    with pytest.raises(TypeError, match="arc"):
        tv.detect(context, image, arc="nine")
    with pytest.raises(TypeError, match="arc"):
        tv.detect(context, image, arc=9.5)
    with pytest.raises(TypeError, match="scale_factor"):
        tv.detect(context, image, scale_factor="2")
    with pytest.raises(ValueError, match="gravity0: shape"):
        tv.estimate_two_view(context, None, None, np.zeros((9, 2)), np.zeros((9, 2)),
                             gravity0=(0, 1))
    with pytest.raises(ValueError, match="out of range"):
        tv.detect(context, image, arc=2**40)
    with pytest.raises(tv.TV_ERR_ARGUMENT):
        tv.detect(context, image, arc=13, max_keypoints=100)
    with pytest.raises(TypeError, match="not both"):
        tv.detect(context, image, options=tv.FeatureOptions(), arc=9)
    with pytest.raises(TypeError, match="FeatureOptions"):
        tv.detect(context, image, options=tv.MatchOptions())
    with pytest.raises(tv.TV_ERR_ARGUMENT):
        tv.match(context, np.zeros((4, 128), np.uint8), np.zeros((4, 128), np.uint8), ratio=2)


def test_contexts(image):
    with pytest.raises(tv.TV_ERR_ARGUMENT):
        tv.Context(max_width=0)
    with pytest.raises(tv.StatusError):
        tv.Context(kernels=99)
    with pytest.raises(TypeError, match="context"):
        tv.detect(None, image)
    context = tv.Context(max_width=320, max_height=240)
    assert context.kernels != tv.Kernels.AUTO and context.high_water < context.size_bytes
    context.close()
    context.close()
    with pytest.raises(ValueError, match="closed"):
        tv.detect(context, image)
    assert context.kernels == tv.Kernels.AUTO and context.high_water == 0
