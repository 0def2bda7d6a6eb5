"""Checks the result of each function on images and points with known truth."""

import threading
import time

import numpy as np
import pytest
import twoview as tv


def angle_deg(R):
    return np.degrees(np.arccos(np.clip((np.trace(R) - 1) / 2, -1, 1)))


def test_extract_is_detect_orient_describe(context, image):
    corners = tv.detect(context, image, max_keypoints=400)
    oriented = tv.orient(context, image, corners, max_keypoints=500)
    keypoints, descriptors = tv.extract(context, image, max_keypoints=500)
    assert corners.dtype == tv.KEYPOINT and 50 < len(corners) <= 400
    assert (np.diff(corners["score"]) <= 0).all()
    assert len(oriented) >= len(corners)
    assert descriptors.shape == (len(keypoints), tv.DESCRIPTOR_BYTES)
    again = tv.describe(context, image, keypoints, max_keypoints=500)
    assert np.array_equal(again, descriptors)


def test_a_mask_keeps_corners_out(context, image):
    mask = np.zeros_like(image)
    mask[:, 160:] = 255
    keypoints = tv.detect(context, image, mask, max_keypoints=500)
    assert len(keypoints) > 20 and keypoints["x"].min() > 155
    assert np.array_equal(tv.detect(context, image, mask > 0, max_keypoints=500), keypoints)
    by_bool, _ = tv.extract(context, image, mask > 0, max_keypoints=500)
    assert by_bool["x"].min() > 155


def test_rows_may_lie_apart_and_are_not_copied(context, image):
    wide = np.zeros((240, 400), np.uint8)
    wide[:, 40:360] = image
    crop = wide[:, 40:360]
    assert not crop.flags.c_contiguous
    expected = tv.extract(context, image, max_keypoints=500)
    actual = tv.extract(context, crop, max_keypoints=500)
    assert all(np.array_equal(a, b) for a, b in zip(expected, actual))
    assert tv._abi.check_image("image", crop).data == crop.ctypes.data


def test_results_outlive_the_context(image):
    with tv.Context(max_width=320, max_height=240, max_keypoints=100) as context:
        keypoints, _ = tv.extract(context, image, max_keypoints=100)
        kept = keypoints.tobytes()
    assert keypoints.tobytes() == kept


def test_match_is_the_definition(context):
    random = np.random.default_rng(1)
    a = random.integers(0, 60, (90, 128), dtype=np.uint8)
    b = random.integers(0, 60, (70, 128), dtype=np.uint8)
    b[:50] = a[10:60] ^ random.integers(0, 4, (50, 128), dtype=np.uint8)
    squares = ((a[:, None].astype(int) - b[None]) ** 2).sum(2)
    found = tv.match(context, a, b, ratio=0.9)
    expected = []
    for i in range(len(a)):
        j = int(squares[i].argmin())
        row, column = np.sort(squares[i]), np.sort(squares[:, j])
        if squares[:, j].argmin() == i and np.sqrt(row[0] / min(row[1], column[1])) < 0.9:
            expected.append((i, j, row[0]))
    assert len(expected) >= 50
    assert [(m["idx0"], m["idx1"], m["dist_sq"]) for m in found] == expected


def test_estimate_finds_the_pose(context, scene):
    result, inliers = tv.estimate_two_view(context, scene.camera, scene.camera, scene.pixels0,
                                           scene.pixels1)
    assert result.kind == tv.Kind.CALIBRATED and result.verdict == tv.Verdict.OK
    assert result.reasons == tv.Reason(0) and inliers.dtype == bool and inliers.all()
    assert angle_deg(result.R @ scene.R.T) < 1e-3 and result.t @ scene.t > 1 - 1e-8
    assert result.covariance.shape == (5, 5) and result.H is None
    uncalibrated, _ = tv.estimate_two_view(context, None, None, scene.pixels0, scene.pixels1,
                                           method=tv.Solver.EIGHT_POINT)
    assert uncalibrated.R is None and uncalibrated.F.shape == (3, 3)


def test_a_result_is_of_the_corrected_camera(context):
    right = tv.Camera(640, 480, 500.0, 500.0, 325.0, 236.0)
    wrong = tv.Camera(640, 480, 500.0, 500.0, 319.5, 239.5)
    random = np.random.default_rng(9)
    points = np.column_stack([random.uniform(-2, 2, 400), random.uniform(-1.5, 1.5, 400),
                              random.uniform(4, 9, 400)])
    yaw, roll = (np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) for a in (0.3, 0.4))
    R = np.eye(3)
    R[::2, ::2] = yaw
    R[:2] = roll @ R[:2]
    t = np.array([1.2, 0.3, 0.6])
    pixels = [tv.camera_project_points(right, np.ascontiguousarray(part))[0]
              + random.normal(0, 0.1, (400, 2)) for part in (points, points @ R.T + t)]
    doubtful = tv.Calibration(center_sigma=0.01, refine=tv.Refine.PRINCIPAL_POINT)
    found, inliers = tv.estimate_two_view(context, wrong, wrong, *pixels, calibration1=doubtful)
    assert np.abs(found.principal_point_shift - (5.5, -3.5)).max() < 1.5
    corrected = tv.corrected_camera(found, wrong)
    dx, dy = found.principal_point_shift
    assert corrected == tv.Camera(640, 480, 500.0, 500.0, 319.5 + dx, 239.5 + dy)
    errors = [np.median(tv.triangulate(camera, camera, found.R, found.t, pixels[0][inliers],
                                       pixels[1][inliers])["error_px"])
              for camera in (corrected, wrong)]
    assert errors[0] < 0.15 and errors[1] > 2 * errors[0]
    as_told, _ = tv.estimate_two_view(context, wrong, wrong, *pixels)
    assert not as_told.principal_point_shift.any()
    assert tv.corrected_camera(as_told, wrong) == wrong
    assert angle_deg(found.R @ R.T) < angle_deg(as_told.R @ R.T)
    for result in (found, as_told):
        assert result.principal_point_chi2 > 13.8
        off = result.principal_point_asked_px - (5.5, -3.5)
        assert off @ np.linalg.solve(result.principal_point_asked_covariance, off) < 13.8
    other = tv.Camera(640, 480, 500.0, 501.0, 319.5, 239.5)
    unknown, _ = tv.estimate_two_view(context, wrong, other, *pixels)
    assert unknown.principal_point_chi2 is None and unknown.principal_point_asked_px is None
    assert unknown.principal_point_asked_covariance is None
    with pytest.raises(tv.TV_ERR_ARGUMENT):
        tv.estimate_two_view(context, wrong, wrong, *pixels,
                             calibration0=doubtful._replace(center_sigma=0.2))
    for value in (0.01, (0.01, 0), tv.Calibration("0.01"), tv.Calibration(refine=0.5)):
        with pytest.raises(TypeError, match="option calibration1: .* is not what it takes"):
            tv.EstimateOptions(calibration1=value)
            tv.estimate_two_view(context, wrong, wrong, *pixels, calibration1=value)


def test_pixels_that_are_not_finite_are_no_inliers(context, scene):
    pixels = scene.pixels0.copy()
    pixels[7] = np.nan
    result, inliers = tv.estimate_two_view(context, scene.camera, scene.camera, pixels,
                                           scene.pixels1)
    assert result.verdict == tv.Verdict.OK and not inliers[7] and inliers.sum() == 199


def test_sigmas_weigh_the_matches(context, scene):
    random = np.random.default_rng(3)
    sigmas = [np.where(np.arange(200) % 2 == 0, 4, 1).astype(np.float32) for _ in range(2)]
    errors = {True: [], False: []}
    for _ in range(40):
        noisy = [p + 0.3 * s[:, None] * random.normal(0, 1, p.shape)
                 for p, s in zip((scene.pixels0, scene.pixels1), sigmas)]
        for known in errors:
            given = {"sigmas0": sigmas[0], "sigmas1": sigmas[1]} if known else {}
            found, _ = tv.estimate_two_view(context, scene.camera, scene.camera, *noisy, **given)
            errors[known].append(angle_deg(found.R @ scene.R.T) ** 2)
            if known:
                assert found.noise_px == pytest.approx(0.3, rel=0.3)
    assert np.mean(errors[True]) < 0.8 * np.mean(errors[False])
    ones = np.ones(200, np.float32)
    plain, _ = tv.estimate_two_view(context, scene.camera, scene.camera, *noisy)
    same, _ = tv.estimate_two_view(context, scene.camera, scene.camera, *noisy, sigmas0=ones)
    assert np.array_equal(plain.R, same.R)
    for bad, error in ((ones[:199], ValueError), (ones.astype(complex), TypeError),
                       (0 * ones, tv.TV_ERR_ARGUMENT), (np.nan * ones, tv.TV_ERR_NOT_FINITE)):
        with pytest.raises(error):
            tv.estimate_two_view(context, scene.camera, scene.camera, *noisy, sigmas1=bad)


def test_an_adjustment_divides_errors_by_sigmas(context, scene):
    points = tv.triangulate(scene.camera, scene.camera, scene.R, scene.t, scene.pixels0,
                            scene.pixels1)
    noise = np.random.default_rng(2).normal(0, 0.3, scene.pixels0.shape)
    halves = np.full(200, 0.5, np.float32)
    plain, weighted = (tv.adjust_two_view(context, scene.camera, scene.camera,
                                          scene.pixels0 + noise, scene.pixels1 - noise, scene.R,
                                          scene.t, points, loss=tv.Loss.NONE, **given)
                       for given in ({}, {"sigmas0": halves, "sigmas1": halves}))
    assert weighted.final_cost == pytest.approx(4 * plain.final_cost, rel=1e-9)
    assert np.allclose(plain.R, weighted.R, atol=1e-9)


def test_keypoint_sigmas_are_powers_of_the_size(context, image):
    keypoints, _ = tv.extract(context, image, levels=3, scale_factor=2, max_keypoints=400)
    assert len(set(keypoints["level"])) == 3
    sigmas = tv.keypoint_sigmas(keypoints, 0.75)
    assert sigmas.dtype == np.float32
    assert np.allclose(sigmas, 2.0 ** (0.75 * keypoints["level"]), rtol=1e-6)
    assert (tv.keypoint_sigmas(keypoints, 1, size_of_one=1) == keypoints["size"]).all()
    with pytest.raises(tv.TV_ERR_ARGUMENT):
        tv.keypoint_sigmas(keypoints, 3)


def test_aligned_matches_are_those_of_reconstruct(context, image):
    shifted = np.ascontiguousarray(np.roll(image, (3, 5), (0, 1)))
    (points0, rows0), (points1, rows1) = (tv.extract(context, picture, max_keypoints=500)
                                          for picture in (image, shifted))
    links = tv.match(context, rows0, rows1, keypoints0=points0, keypoints1=points1)
    before = points0.tobytes(), points1.tobytes()
    points1["x"][links["idx1"]] += 0.2
    moved0, moved1, aligned, factors = tv.align_matches(context, image, shifted, points0, points1,
                                                        links)
    assert aligned.dtype == bool and aligned.mean() > 0.5
    assert factors.dtype == np.float32 and (factors[~aligned] == 1).all()
    assert factors.min() > 0 and np.median(factors[aligned]) < 0.5
    assert points0.tobytes() == before[0] and points1.tobytes() != before[1]
    changed = (moved0 != points0)[links["idx0"]].astype(int) + (moved1 != points1)[links["idx1"]]
    assert (changed == aligned).all()
    offsets = np.hypot(moved1["x"][links["idx1"]] - moved0["x"][links["idx0"]] - 5,
                       moved1["y"][links["idx1"]] - moved0["y"][links["idx0"]] - 3)
    assert np.median(offsets[aligned]) < 0.02
    _, cloud = tv.reconstruct(context, image, None, shifted, None,
                              feature=tv.FeatureOptions(max_keypoints=500))
    points1 = np.frombuffer(before[1], tv.KEYPOINT)
    moved = tv.align_matches(context, image, shifted, points0, points1, links)
    assert all(np.array_equal(a, b) for a, b in zip(moved, cloud.keypoints))
    with pytest.raises(tv.TV_ERR_ARGUMENT):
        tv.align_matches(context, image, shifted, points0, points1[:3], links)
    with pytest.raises(tv.TV_ERR_ARGUMENT):
        tv.align_matches(context, image, shifted, points0, points1, links, size_of_one=0)
    with pytest.raises(TypeError):
        tv.align_matches(context, image, shifted, rows0, points1, links)


def test_triangulate_adjust_and_covariances(context, scene):
    points = tv.triangulate(scene.camera, scene.camera, scene.R, scene.t, scene.pixels0,
                            scene.pixels1)
    assert (points["status"] == tv.PointStatus.OK).all()
    assert np.allclose(points["position"], scene.points, atol=1e-6)
    start = points.tobytes()
    noise = np.random.default_rng(2).normal(0, 0.3, scene.pixels0.shape)
    adjusted = tv.adjust_two_view(context, scene.camera, scene.camera, scene.pixels0 + noise,
                                  scene.pixels1 - noise, scene.R, scene.t, points)
    assert points.tobytes() == start and adjusted.converged
    assert adjusted.final_cost < adjusted.initial_cost and angle_deg(adjusted.R @ scene.R.T) < 1
    covariances = tv.point_covariances(scene.camera, scene.camera, adjusted.R, adjusted.t,
                                       adjusted.points, adjusted.noise_px, adjusted.covariance)
    assert covariances.shape == (200, 3, 3) and (covariances[:, 2, 2] > 0).all()
    corrected0, corrected1, valid = tv.correct_matches(scene.camera, scene.camera, scene.R, scene.t,
                                                       scene.pixels0 + noise, scene.pixels1)
    assert valid.all() and np.abs(corrected0 - scene.pixels0).max() < 5
    assert corrected1.shape == (200, 2)


def test_guided_matching_finds_what_the_epipolar_lines_allow(context, scene):
    random = np.random.default_rng(4)
    keypoints = [np.zeros(200, tv.KEYPOINT) for _ in range(2)]
    for rows, pixels in zip(keypoints, (scene.pixels0, scene.pixels1)):
        rows["x"], rows["y"], rows["size"] = pixels[:, 0], pixels[:, 1], 4
    descriptors = random.integers(0, 60, (200, 128), dtype=np.uint8)
    found, _ = tv.estimate_two_view(context, scene.camera, scene.camera, scene.pixels0,
                                    scene.pixels1)
    links = tv.match_guided(context, scene.camera, scene.camera, found.E, keypoints[0],
                            descriptors, keypoints[1], descriptors)
    assert len(links) == 200 and (links["idx0"] == links["idx1"]).all()


def test_cameras_go_there_and_back():
    camera = tv.Camera(640, 480, 500, 510, 320, 240, tv.CameraModel.BROWN_CONRADY, (-0.2, 0.05))
    pixels = np.array([[10.0, 20.0], [320.0, 240.0], [600.0, 400.0]])
    rays, inside = tv.camera_unproject_points(camera, pixels)
    back, seen = tv.camera_project_points(camera, rays)
    assert inside.all() and seen.all() and np.allclose(back, pixels, atol=1e-9)
    assert tv.camera_undistort(camera, pixels[1]) == pytest.approx((320, 240))
    half = tv.camera_scale(camera, 0.5)
    assert (half.width, half.fx, half.cx) == (320, 250, 0.5 * 320.5 - 0.5)
    assert 0 < tv.camera_valid_angle(camera) <= np.pi / 2
    tv.camera_check(camera)


def test_reconstruct_is_the_stages(context, image):
    camera = tv.Camera(320, 240, 300, 300, 159.5, 119.5)
    options = tv.FeatureOptions(max_keypoints=500)
    result, cloud = tv.reconstruct(context, image, camera, image, camera, feature=options)
    assert result.kind == tv.Kind.NO_MOTION and result.verdict == tv.Verdict.REFUSED
    keypoints, descriptors = tv.extract(context, image, options=options)
    assert np.array_equal(cloud.keypoints[0], keypoints)
    assert np.array_equal(cloud.descriptors[1], descriptors)
    assert np.array_equal(cloud.matches, tv.match(context, descriptors, descriptors))
    assert cloud.inlier_mask.dtype == bool and len(cloud.points) == len(cloud.matches)


def test_other_threads_run_during_a_call():
    """Checks that ctypes releases the interpreter's lock: another Python thread counts while C
    matches."""
    random = np.random.default_rng(6)
    descriptors = random.integers(0, 60, (6000, 128), dtype=np.uint8)
    context = tv.Context(max_keypoints=6000, kernels=tv.Kernels.C)
    done, longest = threading.Event(), 0.0

    def work():
        tv.match(context, descriptors, descriptors)
        done.set()

    thread = threading.Thread(target=work)
    start = time.perf_counter()
    thread.start()
    turns = 0
    while not done.is_set():
        time.sleep(0.0005)
        turns += 1
    longest = time.perf_counter() - start
    thread.join()
    assert turns > 5, f"{turns} turns in {longest:.3f} s"


def test_a_context_may_be_shared_by_threads(context, image):
    expected = tv.extract(context, image, max_keypoints=500)[1]
    wrong = []

    def work():
        for _ in range(5):
            if not np.array_equal(tv.extract(context, image, max_keypoints=500)[1], expected):
                wrong.append(1)

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_gravity_and_seed_reach_the_library(context, scene):
    down = (0.0, 1.0, 0.0)
    result, _ = tv.estimate_two_view(
        context, scene.camera, scene.camera, scene.pixels0, scene.pixels1,
        method=tv.Solver.UPRIGHT, gravity0=down, gravity1=down, gravity_sigma_rad=0.01, seed=77)
    assert result.seed == 77 and result.verdict == tv.Verdict.OK
    assert angle_deg(result.R @ scene.R.T) < 0.01


def test_a_context_for_matching_alone_is_small_and_only_matches():
    rng = np.random.default_rng(5)
    descriptors = rng.integers(0, 90, (1000, tv.DESCRIPTOR_BYTES), np.uint8)
    with tv.Context(max_keypoints=1000, purposes=tv.Purpose.MATCH) as context:
        assert context.size_bytes <= 300 * 1024
        assert len(tv.match(context, descriptors, descriptors)) == 1000
        with pytest.raises(tv.TV_ERR_LIMITS):
            tv.detect(context, np.zeros((100, 100), np.uint8))


def test_defaults_fit_any_context_with_and_without_cameras():
    rng = np.random.default_rng(6)
    image = rng.integers(0, 255, (100, 120), np.uint8)
    pixels = rng.uniform(0, 100, (30, 2))
    camera = tv.Camera(120, 100, 100.0, 100.0, 59.5, 49.5)
    with tv.Context(max_width=120, max_height=100, max_keypoints=70) as context:
        assert len(tv.extract(context, image)[0]) == 70
        assert len(tv.detect(context, image)) == 70
        for cameras in ((None, None), (camera, camera)):
            tv.estimate_two_view(context, *cameras, pixels, pixels + 3.0)


def test_matches_beyond_the_limit_are_left_out(image):
    height, width = image.shape
    camera = tv.Camera(width, height, 300.0, 300.0, width / 2, height / 2)
    limits = {"max_width": width, "max_height": height, "max_keypoints": 300}
    with tv.Context(**limits) as context:
        _, whole = tv.reconstruct(context, image, camera, image, camera)
    with tv.Context(max_matches=20, **limits) as context:
        _, part = tv.reconstruct(context, image, camera, image, camera)
    assert whole.num_matches_left_out == 0
    assert len(part.matches) == 20
    assert part.num_matches_left_out == len(whole.matches) - 20


def test_a_context_with_effort_climbs_unless_told_not_to():
    """The second image is the first one with its columns averaged by four: a wall at 76 degrees."""
    rng = np.random.default_rng(3)
    patches = rng.integers(20, 236, (50, 120)).astype(np.uint8)
    wide = np.kron(patches, np.ones((4, 4), np.uint8))
    slim = np.ascontiguousarray(wide.reshape(200, 120, 4).mean(axis=2).astype(np.uint8))
    slim = np.ascontiguousarray(slim.reshape(200, 60, 2).mean(axis=2).astype(np.uint8))
    limits = {"max_width": 480, "max_height": 200, "max_keypoints": 500}
    with tv.Context(max_effort=3, **limits) as context:
        assert context.max_effort == 3
        climbed = tv.reconstruct(context, wide, None, slim, None)[1]
        held = tv.reconstruct(context, wide, None, slim, None, max_effort=0)[1]
        alone = tv.reconstruct(context, wide, None, slim, None, effort=2)[1]
    assert climbed.effort >= 2 and climbed.num_rungs >= 2
    assert (held.effort, held.num_rungs, alone.effort, alone.num_rungs) == (0, 1, 2, 1)
    with tv.Context(**limits) as context:
        assert tv.reconstruct(context, wide, None, slim, None)[1].effort == 0
