"""Cameras, keypoints, poses and pair geometry compared with pycolmap's."""

import numpy as np
import pytest
import twoview as tv
from twoview_tools.colmap import conventions, schema38
from conftest import HEIGHT, WIDTH, K, camera_pose, relative_pose

pycolmap = pytest.importorskip("pycolmap")

LENSES = {
    "PINHOLE": (tv.CameraModel.PINHOLE, ()),
    "OPENCV": (tv.CameraModel.BROWN_CONRADY, (-0.2, 0.05, 0.001, -0.002)),
    "FULL_OPENCV": (
        tv.CameraModel.BROWN_CONRADY,
        (-0.2, 0.05, 0.001, -0.002, 0.01, 0.02, -0.01, 0.003),
    ),
    "OPENCV_FISHEYE": (tv.CameraModel.KANNALA_BRANDT, (0.02, -0.01, 0.003, 0.001)),
}


def camera_of(model):
    kind, k = LENSES[model]
    return tv.Camera(WIDTH, HEIGHT, 520.0, 500.0, 330.0, 235.0, kind, k)


def pycolmap_camera(row):
    return pycolmap.Camera(
        model=row.model, width=row.width, height=row.height, params=list(row.params)
    )


@pytest.mark.parametrize("model", LENSES)
def test_a_pixel_has_the_same_ray_in_both(model):
    camera = camera_of(model)
    row = conventions.camera_to_colmap(camera)
    assert row.model == model
    pixels = np.random.default_rng(1).uniform((40, 40), (600, 440), (50, 2))
    rays, inside = tv.camera_unproject_points(camera, pixels)
    assert inside.all()
    theirs = pycolmap_camera(row).cam_from_img(pixels + 0.5)
    np.testing.assert_allclose(rays[:, :2] / rays[:, 2:], theirs, atol=1e-9)


@pytest.mark.parametrize("model", LENSES)
def test_a_camera_comes_back(model):
    camera = camera_of(model)
    back = conventions.camera_from_colmap(conventions.camera_to_colmap(camera), "x")
    assert (back.model, back.fx, back.fy, back.cx, back.cy) == (camera.model, 520, 500, 330, 235)
    k = list(camera.k) + [0.0] * (8 - len(camera.k))
    assert model == "PINHOLE" or list(back.k) == k


@pytest.mark.parametrize("model, params", [
    ("SIMPLE_PINHOLE", (500, 320, 240)), ("SIMPLE_RADIAL", (500, 320, 240, -0.1)),
    ("RADIAL", (500, 320, 240, -0.1, 0.02)), ("RADIAL_FISHEYE", (300, 320, 240, 0.01, 0.002)),
    ("SIMPLE_RADIAL_FISHEYE", (300, 320, 240, 0.01)), ("SIMPLE_FISHEYE", (300, 320, 240)),
    ("FISHEYE", (300, 310, 320, 240)), ("DIVISION", (500, 510, 320, 240, 0)),
    ("THIN_PRISM_FISHEYE", (300, 310, 320, 240, 0.01, 0.002, 0, 0, 1e-3, -2e-4, 0, 0)),
    ("RAD_TAN_THIN_PRISM_FISHEYE", (300, 310, 320, 240, 0.01, 0.002, 1e-3, -2e-4, *[0] * 8))])
def test_colmaps_other_cameras_are_read(model, params):
    if not hasattr(pycolmap.CameraModelId, model):
        pytest.skip(f"this pycolmap has no {model}")
    row = conventions.ColmapCamera(model, WIDTH, HEIGHT, params)
    pixels = np.random.default_rng(1).uniform((40, 40), (600, 440), (50, 2))
    rays, _ = tv.camera_unproject_points(conventions.camera_from_colmap(row, "x"), pixels)
    theirs = pycolmap_camera(row).cam_from_img(pixels + 0.5)
    np.testing.assert_allclose(rays[:, :2] / rays[:, 2:], theirs, atol=1e-9)


def test_other_lenses_are_named():
    with pytest.raises(ValueError, match="a.jpg: COLMAP's model FOV"):
        conventions.camera_from_colmap(
            conventions.ColmapCamera("FOV", 9, 9, (1, 1, 1, 1, 1)), "a.jpg"
        )


def test_the_numbers_of_models_are_colmaps():
    theirs = {name: int(value) for name, value in pycolmap.CameraModelId.__members__.items()}
    assert len(theirs) > 9
    for name, number in conventions.MODEL_IDS.items():
        assert theirs.get(name, number) == number


def test_keypoints_have_six_columns_with_colmaps_scale_and_angle():
    ours = np.zeros(3, tv.KEYPOINT)
    ours["x"], ours["y"], ours["size"], ours["angle_rad"] = (
        (0, 10.25, 5),
        (0, 7.5, 6),
        (4, 3, 8),
        (0, 0.5, -2),
    )
    rows = conventions.keypoints_to_colmap(ours)
    assert rows.dtype == np.float32 and rows.shape == (3, 6)
    theirs = pycolmap.keypoints_from_matrix(np.column_stack(
        [ours["x"] + 0.5, ours["y"] + 0.5, ours["size"] / 2, ours["angle_rad"]]).astype(np.float32))
    np.testing.assert_allclose(
        rows, [[k.x, k.y, k.a11, k.a12, k.a21, k.a22] for k in theirs], atol=1e-6
    )
    np.testing.assert_array_equal(
        conventions.pixels_from_colmap(rows)[:, 0], ours["x"].astype(float)
    )


@pytest.mark.parametrize("columns", [2, 4, 6])
def test_keypoints_of_any_width_are_read(columns):
    rows = np.full((2, columns), 7.5, np.float32)
    np.testing.assert_array_equal(conventions.pixels_from_colmap(rows), np.full((2, 2), 7.0))


def test_configuration_codes_are_colmaps():
    codes = pycolmap.TwoViewGeometryConfiguration
    for ours, name in ((tv.Kind.DEGENERATE, "DEGENERATE"), (tv.Kind.CALIBRATED, "CALIBRATED"),
                       (tv.Kind.UNCALIBRATED, "UNCALIBRATED"), (tv.Kind.PLANAR, "PLANAR"),
                       (tv.Kind.PANORAMIC, "PANORAMIC"), (tv.Kind.NO_MOTION, "PANORAMIC"),
                       (tv.Kind.PLANAR_OR_PANORAMIC, "PLANAR_OR_PANORAMIC")):
        assert conventions.CONFIGURATIONS[ours] == getattr(codes, name).value
    assert set(conventions.CONFIGURATIONS) == set(tv.Kind)


def test_pair_ids_are_colmaps():
    for pair in ((1, 2), (7, 3), (2, 2147483646)):
        assert schema38.pair_id(*pair) == pycolmap.image_pair_to_pair_id(*pair)


def test_rotations_are_quaternions_w_first():
    R, _ = camera_pose(0)
    x, y, z, w = pycolmap.Rotation3d(R).quat
    np.testing.assert_allclose(conventions.quaternion(R), [w, x, y, z], atol=1e-15)
    np.testing.assert_allclose(conventions.rotation(conventions.quaternion(R)), R, atol=1e-15)


CAMERA = tv.Camera(WIDTH, HEIGHT, K[0, 0], K[1, 1], K[0, 2], K[1, 2])


def two_views(R, t, plane=False, noise_px=0.2):
    """(pixels0, pixels1): the pixels of random points that both views see."""
    random = np.random.default_rng(7)
    points = np.column_stack(
        [random.uniform(-1.5, 1.5, 300), random.uniform(-1, 1, 300), random.uniform(4, 8, 300)]
    )
    if plane:
        points[:, 2] = 6 + 0.3 * points[:, 0]
    pixels = []
    for part in (points, points @ R.T + t):
        found, inside = tv.camera_project_points(CAMERA, np.ascontiguousarray(part))
        assert inside.all()
        pixels.append(found + random.normal(0, noise_px, found.shape))
    return pixels


def estimate(pixels0, pixels1):
    with tv.Context(max_width=8, max_height=8, max_keypoints=400) as context:
        found, inliers = tv.estimate_two_view(context, CAMERA, CAMERA, pixels0, pixels1)
    matches = np.column_stack([np.arange(len(pixels0)), np.arange(len(pixels0)) + 1000])
    return found, conventions.geometry_to_colmap(found, matches[inliers])


def epipolar_distances(F, pixels0, pixels1):
    """The distances of the second image's pixels from the epipolar lines of the first one's."""
    p0, p1 = (np.column_stack([p, np.ones(len(p))]) for p in (pixels0, pixels1))
    lines = p0 @ F.T
    return np.abs((p1 * lines).sum(axis=1)) / np.linalg.norm(lines[:, :2], axis=1)


def test_F_is_of_colmaps_pixels():
    # COLMAP's coordinates are half a pixel larger than twoview's. With a rotation about the optical
    # axis, this half pixel does not cancel in an epipolar distance.
    R = pycolmap.Rotation3d(np.array([0, 0, np.sin(0.5), np.cos(0.5)])).matrix()
    pixels = two_views(R, np.array([0.5, 0.1, 0.2]), noise_px=0.02)
    found, row = estimate(*pixels)
    assert row.config == 2 and len(row.inlier_matches) > 280
    in_colmap = np.median(epipolar_distances(row.F, pixels[0] + 0.5, pixels[1] + 0.5))
    in_ours = np.median(epipolar_distances(row.F, *pixels))
    assert in_colmap < 0.05 and in_ours > 0.15
    calibration = pycolmap_camera(conventions.camera_to_colmap(CAMERA)).calibration_matrix()
    inverse = np.linalg.inv(calibration)
    F = inverse.T @ row.E @ inverse
    np.testing.assert_allclose(row.F / np.linalg.norm(row.F), F / np.linalg.norm(F), atol=1e-9)
    E = pycolmap.essential_matrix_from_pose(pycolmap.Rigid3d(pycolmap.Rotation3d(row.R), row.t))
    np.testing.assert_allclose(row.E / np.linalg.norm(row.E), E / np.linalg.norm(E), atol=1e-9)


def test_H_is_of_colmaps_pixels():
    R, t = relative_pose(0, 1)
    pixels = two_views(R, t, plane=True)
    _, row = estimate(*pixels)
    assert row.config == 4
    mapped = np.column_stack([pixels[0] + 0.5, np.ones(len(pixels[0]))]) @ row.H.T
    gap = mapped[:, :2] / mapped[:, 2:] - (pixels[1] + 0.5)
    assert (
        np.abs(np.median(gap, axis=0)).max() < 0.05 and np.median(np.linalg.norm(gap, axis=1)) < 0.6
    )


@pytest.mark.parametrize("plane", [False, True])
def test_swapped_images_give_the_swapped_row(plane):
    pixels0, pixels1 = two_views(*relative_pose(0, 2), plane)
    _, forward = estimate(pixels0, pixels1)
    _, backward = estimate(pixels1, pixels0)
    swapped = backward.swapped()
    assert swapped.config == forward.config
    np.testing.assert_array_equal(swapped.inlier_matches[:, 1] + 1000, forward.inlier_matches[:, 1])
    np.testing.assert_array_equal(swapped.R, forward.R)
    for ours, theirs in ((swapped.t, forward.t), (swapped.F, forward.F), (swapped.E, forward.E)):
        np.testing.assert_allclose(ours, theirs, atol=1e-12)
    if plane:
        np.testing.assert_allclose(swapped.H, forward.H, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(
            forward.swapped().H @ forward.H / (forward.swapped().H @ forward.H)[2, 2],
            np.eye(3),
            atol=1e-9,
        )


def test_a_rotation_is_a_panorama_without_translation():
    R, _ = relative_pose(0, 1)
    _, row = estimate(*two_views(R, np.zeros(3)))
    assert row.config == 5 and row.E is None
    np.testing.assert_array_equal(row.t, np.zeros(3))
    np.testing.assert_allclose(row.R, R, atol=2e-3)


def test_no_geometry_keeps_no_match():
    random = np.random.default_rng(2)
    found, row = estimate(
        *(np.ascontiguousarray(random.uniform(0, 400, (40, 2))) for _ in range(2))
    )
    assert found.kind == tv.Kind.DEGENERATE
    assert row.config == 1 and row.inlier_matches.shape == (0, 2) and row.F is None
