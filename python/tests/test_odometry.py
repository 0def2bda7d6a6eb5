"""Odometry: a flight past textured walls, whose path is known."""

from dataclasses import replace

import numpy as np
import pytest
import twoview as tv
from conftest import needs

pytestmark = needs("tv_odometry_track")

WIDTH, HEIGHT, FOCAL, STEP = 320, 240, 300.0, 0.08
DEPTHS = (2.5, 6.0, 3.5, 8.0, 4.5)  # of the walls, one above the other in the image, in units
CAMERA = tv.Camera(WIDTH, HEIGHT, FOCAL, FOCAL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2)


def flown_frames():
    """Twenty frames of a camera that flies to the right, 0.08 units a frame."""
    noise = np.random.default_rng(11).integers(0, 256, (HEIGHT + 4, 3 * WIDTH + 4))
    wide = sum(noise[y:y + HEIGHT, x:x + 3 * WIDTH] for y in range(5) for x in range(5)) / 25
    wide = np.clip((wide - 127) * 4 + 127, 0, 255)
    rows = np.arange(HEIGHT)
    depth = np.array(DEPTHS)[rows * len(DEPTHS) // HEIGHT]
    made = []
    for i in range(20):
        at = np.arange(WIDTH) + (FOCAL * STEP * i / depth)[:, None]
        left = at.astype(int)
        share = at - left
        row = rows[:, None]
        frame = (1 - share) * wide[row, left] + share * wide[row, left + 1]
        made.append(np.rint(frame).astype(np.uint8))
    return made


@pytest.fixture(scope="module")
def frames():
    return flown_frames()


@pytest.fixture(scope="module")
def flight(frames):
    odometry = tv.Odometry(CAMERA, max_keypoints=800)
    return odometry, [odometry.track(frame, i / 30) for i, frame in enumerate(frames)]


def test_the_path_is_the_flown_one(flight):
    odometry, states = flight
    assert states[-1].status == tv.OdometryStatus.TRACKING and states[-1].num_frames == 20
    known = [(i, *odometry.pose_of(s)) for i, s in enumerate(states) if s.R is not None]
    assert len(known) >= 10 and {segment for *_, segment in known} == {0}
    steps = np.array([t for _, _, t, _ in known])
    numbers = np.array([i for i, *_ in known], float)
    # The unit is free: one scale and one offset for all frames, along the camera's x axis.
    a = np.column_stack([numbers, np.ones_like(numbers)])
    scale = np.linalg.lstsq(a, steps[:, 0], rcond=None)[0]
    assert scale[0] > 0
    error = steps - np.column_stack([a @ scale, np.zeros((len(steps), 2)) + steps[0, 1:]])
    assert np.abs(error).max() < 0.05 * abs(steps[-1, 0] - steps[0, 0])
    for _, R, _, _ in known:
        assert np.abs(R - np.eye(3)).max() < 0.02


def test_the_camera_is_as_given_where_nothing_contradicts_it(flight):
    odometry, states = flight
    assert odometry.camera == CAMERA and not states[-1].principal_point_shift_px.any()
    with tv.Odometry(CAMERA, refine=tv.Refine.NOTHING) as kept:
        assert kept.camera == CAMERA
    with pytest.raises(tv.TV_ERR_ARGUMENT):
        tv.Odometry(CAMERA, refine=tv.Refine.FOCAL_LENGTH)


def test_the_map_is_consistent(flight):
    odometry, states = flight
    points = odometry.points()
    assert points.dtype == tv.MAP_POINT and len(points) == states[-1].num_points > 100
    first = odometry.keyframe(0)
    assert first.id == 0 and first.R.shape == (3, 3)
    seen = odometry.observations(0)
    assert seen.dtype == tv.MAP_OBSERVATION and len(seen) == first.num_observations
    x = (points["position"][seen["idx_point"]] - first.t) @ first.R
    pixels = FOCAL * x[:, :2] / x[:, 2:] + [CAMERA.cx, CAMERA.cy]
    error = np.hypot(pixels[:, 0] - seen["x"], pixels[:, 1] - seen["y"])
    assert np.median(error) < 1
    frame = odometry.last_frame()
    assert len(frame) == states[-1].num_keypoints
    assert (frame["idx_point"] >= 0).sum() >= states[-1].num_inliers


def test_the_same_frames_give_the_same_states(frames, flight):
    with tv.Odometry(CAMERA, tv.OdometryOptions(max_keypoints=800)) as odometry:
        for i, frame in enumerate(frames):
            state = odometry.track(frame, i / 30)
        last = flight[1][-1]
        assert (state.R.tobytes(), state.t.tobytes()) == (last.R.tobytes(), last.t.tobytes())
        odometry.reset()
        assert odometry.track(frames[0], 0.0).num_frames == 1


def test_a_known_frame_is_located(frames, flight):
    odometry, states = flight
    found = odometry.locate(frames[15])
    assert found.status == tv.OdometryStatus.TRACKING
    _, t, _ = odometry.pose_of(states[15])
    assert np.linalg.norm(found.t - t) < 0.05 * np.linalg.norm(states[-1].t)
    blank = odometry.locate(np.full((HEIGHT, WIDTH), 128, np.uint8))
    assert blank.status == tv.OdometryStatus.LOST and blank.t is None
    with pytest.raises(ValueError, match="no pose"):
        odometry.pose_of(blank)
    mask = np.ones((HEIGHT, WIDTH), bool)
    assert np.array_equal(odometry.locate(frames[15], mask=mask).t, found.t)
    mask[:, 2 * WIDTH // 3:] = False
    assert odometry.locate(frames[15], mask=mask).num_inliers < found.num_inliers
    assert odometry.locate(frames[15], mask=mask & False).num_keypoints == 0
    with pytest.raises(ValueError, match="mask"):
        odometry.locate(frames[15], mask=mask[1:])


def test_the_path_has_frames_that_tracking_had_no_pose_for(frames, flight):
    odometry, states = flight
    missing = next(i for i, s in enumerate(states[10:], 10) if not s.is_keyframe)
    path = tv.Path(odometry)
    for i, state in enumerate(states):
        path.add(replace(state, reference_id=None) if i == missing else state, i / 30)
    poses = path.poses()
    assert len(path) == 20 and poses[missing].origin == tv.PathOrigin.UNKNOWN
    assert poses[missing].R is None and poses[missing].segment is None
    # The first frame became a keyframe when a later one completed the start.
    assert states[0].R is None and poses[0].origin == tv.PathOrigin.TRACKED
    for i, state in enumerate(states):
        if state.R is None or i == missing:
            continue
        R, t, segment = odometry.pose_of(state)
        assert poses[i].origin == tv.PathOrigin.TRACKED and poses[i].segment == segment
        assert np.array_equal(poses[i].R, R) and np.array_equal(poses[i].t, t)
    assert not path.locate(missing, np.full((HEIGHT, WIDTH), 128, np.uint8))
    assert not path.locate(missing, frames[0])  # it cannot have flown there
    assert path.locate(missing, frames[missing])
    found = path.poses()[missing]
    _, t, segment = odometry.pose_of(states[missing])
    assert found.origin == tv.PathOrigin.LOCATED and found.segment == segment
    assert np.linalg.norm(found.t - t) < 0.05 * np.linalg.norm(poses[19].t)
    with pytest.raises(ValueError, match="comes after"):
        path.add(states[0], 0)


def test_bad_input_is_refused(frames):
    with tv.Odometry(CAMERA) as odometry:
        odometry.track(frames[0], 1.0)
        with pytest.raises(tv.TV_ERR_TIME):
            odometry.track(frames[1], 1.0)  # the time stands
        with pytest.raises(tv.TV_ERR_NOT_FINITE):
            odometry.track(frames[1], float("nan"))
        with pytest.raises(tv.TV_ERR_CAMERA):
            odometry.track(frames[1][:100], 2.0)
        with pytest.raises(TypeError, match="uint8"):
            odometry.track(frames[1].astype(float), 2.0)
        with pytest.raises(ValueError, match="world_from_cam"):
            odometry.track(frames[1], 2.0, world_from_cam=np.eye(4))
        assert odometry.track(frames[1], 2.0).num_frames == 2
        assert odometry.track(frames[2], 0.0, gap=True).num_frames == 3  # the stream began anew
    with pytest.raises(ValueError, match="closed"):
        odometry.track(frames[1], 3.0)
    with pytest.raises(tv.TV_ERR_ARGUMENT):
        tv.Odometry(CAMERA, max_keypoints=5)
    with pytest.raises(TypeError, match="no option|unexpected"):
        tv.Odometry(CAMERA, keypoints=5)


def test_a_mask_leaves_a_part_of_the_frames_out(frames):
    mask = np.ones((HEIGHT, WIDTH), bool)
    mask[:, 220:] = False
    with tv.Odometry(CAMERA, max_keypoints=800) as odometry:
        states = [odometry.track(frame, i / 30, mask=mask) for i, frame in enumerate(frames)]
        assert states[-1].status == tv.OdometryStatus.TRACKING
        assert states[-1].map_reasons == tv.MapReason(0)
        begun = next(s for s in states if s.R is not None)
        assert begun.map_reasons == tv.MapReason.UNCONFIRMED
        assert begun.reasons == tv.Reason.LOW_PARALLAX
        assert odometry.last_frame()["x"].max() < 221
        assert odometry.still_mask().all() and states[-1].still_share == 0
        with pytest.raises(ValueError, match="mask"):
            odometry.track(frames[0], 9.0, mask=mask[:100])


def test_text_that_stands_still_is_left_out():
    """The camera turns by 0.015 radians a frame as it flies past, with text over its picture."""
    random = np.random.default_rng(3)
    wide = np.kron(random.integers(0, 256, (HEIGHT // 4 + 30, WIDTH)), np.ones((4, 4)))
    lines = np.kron(random.integers(0, 2, (5, 4, 12)), np.ones((1, 5, 5))).astype(np.uint8) * 255
    x, y = np.meshgrid(np.arange(WIDTH) - CAMERA.cx, np.arange(HEIGHT) - CAMERA.cy)
    with tv.Odometry(CAMERA) as odometry:
        for i in range(12):
            c, s = np.cos(0.015 * i), np.sin(0.015 * i)
            # Where the camera saw the ray before it turned, and so the wall and its depth.
            z = c - s * x / FOCAL
            at_x, at_y = (c * x + s * FOCAL) / z + CAMERA.cx, y / z + CAMERA.cy
            band = np.clip(at_y * len(DEPTHS) // HEIGHT, 0, len(DEPTHS) - 1).astype(int)
            shift = FOCAL * STEP * i / np.array(DEPTHS)[band]
            frame = wide[np.rint(at_y + 40).astype(int), np.rint(at_x + 60 + shift).astype(int)]
            frame = frame.astype(np.uint8)
            for top, line in zip(range(10, HEIGHT, 50), lines):
                frame[top:top + 20, 20:80] = line
            state = odometry.track(frame, i / 30)
        left_out = ~odometry.still_mask()
    assert 0.01 < state.still_share < 0.2
    assert left_out.mean() == pytest.approx(state.still_share)
    assert not left_out[:, 110:].any()


def test_a_map_is_added(flight):
    odometry, states = flight
    data = odometry.save()
    with tv.Odometry(CAMERA, max_keypoints=800, max_keyframes=400) as other:
        assert other.add(data) == 0  # there is nothing to meet
        assert other.save() == data
        assert other.add(data) == 1  # the same place
        num = states[-1].num_keyframes
        keys = [other.keyframe(k) for k in range(2 * num)]
        assert {key.segment for key in keys} == {0}
        assert [key.id for key in keys] == list(range(2 * num))
        assert [np.linalg.norm(a.t - b.t) < 1e-2
                for a, b in zip(keys[:num], keys[num:])] == [True] * num
        with pytest.raises(tv.TV_ERR_MAP):
            other.add(data[:-1])


def test_a_map_is_saved_and_loaded(frames, flight):
    odometry, states = flight
    data = odometry.save()
    assert data == odometry.save()
    with tv.Odometry(CAMERA, max_keypoints=800) as other:
        other.load(data)
        assert other.save() == data
        assert np.array_equal(other.points()["position"], odometry.points()["position"])
        for wrong in (b"", data[:-1], data[:40], b"x" + data[1:], data[:-1] + b"\0" + data[-1:]):
            with pytest.raises(tv.TV_ERR_MAP):
                other.load(wrong)
        assert other.save() == data
        assert other.locate(frames[15]).status == tv.OdometryStatus.TRACKING
    camera = tv.Camera(WIDTH, HEIGHT, FOCAL + 1, FOCAL, CAMERA.cx, CAMERA.cy)
    with tv.Odometry(camera, max_keypoints=800) as other, pytest.raises(tv.TV_ERR_CAMERA):
        other.load(data)


def test_locate_leaves_the_map_as_it_is(frames, flight):
    odometry, _ = flight
    data = odometry.save()
    assert odometry.locate(frames[15]).status == tv.OdometryStatus.TRACKING
    assert odometry.save() == data


def test_a_gyro_at_a_constant_rate_turns_by_rate_times_time():
    R, sigma = tv.integrate_gyro([0, 0.05, 0.1], [[0, 2, 0]] * 3, 0.01, 0, 0.1)
    angle = 0.2
    expected = [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
    np.testing.assert_allclose(R, expected, atol=1e-14)
    assert sigma == pytest.approx(0.01 * np.sqrt(2 * 0.025**2 + 0.05**2))
    with pytest.raises(ValueError, match="rates_rad_s"):
        tv.integrate_gyro([0, 1], [[0, 2, 0]] * 3, 0.01, 0, 0.1)
