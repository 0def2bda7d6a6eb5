"""Figures 14 and 15: epipolar lines, epipoles and camera poses for sideways and forward motion."""

import json
from dataclasses import dataclass, replace

import cv2
import numpy as np

from . import drawing, flight
from .experiment import Experiment, Missing, Result, Table, available
from .inputs import Pair, grey, library, read_colour

NUM_LINES, FLIGHTS = 14, 3
# The rotation of a camera that looks forward: from camera axes to body axes (forward, right, down).
BODY_FROM_CAMERA = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])


@dataclass
class Study:
    """A pair that was reconstructed with the library's defaults, and its errors."""

    pair: Pair
    pose: object  # the result of the estimate, a twoview.TwoView
    pixels: tuple  # for each image the undistorted pixels of the inliers
    points: np.ndarray  # positions of the inliers in camera 0's frame, in baselines
    numbers: dict


def angle_deg(a, b):
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), np.dot(a, b))))


def rotation_deg(R):
    """The angle of a rotation in degrees."""
    return float(np.degrees(np.linalg.norm(cv2.Rodrigues(np.asarray(R, float))[0])))


def to_pinhole(camera, pixels):
    """Moves each pixel to where a pinhole camera of the same K sees the same scene point."""
    rays, _ = library().camera_unproject_points(camera, np.ascontiguousarray(pixels, float))
    seen = rays @ camera.K.T
    return seen[:, :2] / seen[:, 2:]


def undistorted_image(camera, image):
    if camera.model == library().CameraModel.PINHOLE:
        return image
    x, y = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    rays = np.linalg.solve(camera.K, np.stack([x.ravel(), y.ravel(), np.ones(x.size)])).T
    pixels, _ = library().camera_project_points(camera, np.ascontiguousarray(rays))
    where = pixels.astype(np.float32).reshape(camera.height, camera.width, 2)
    return cv2.remap(image, where, None, cv2.INTER_LINEAR)


def epipole(K, direction):
    """The pixel in which a direction of the camera's frame, or its opposite, is seen; 1e9 pixels
    away if the direction is parallel to the image."""
    seen = K @ direction
    return seen[:2] / seen[2] if abs(seen[2]) > 1e-12 else np.sign(seen[:2]) * 1e9


def reconstructed(pair):
    tv = library()
    height, width = np.max([image.shape for image in pair.grey], axis=0)
    with tv.Context(max_width=int(width), max_height=int(height)) as context:
        pose, cloud = tv.reconstruct(
            context, pair.grey[0], pair.cameras[0], pair.grey[1], pair.cameras[1]
        )
    if pose.R is None or pose.t is None:
        raise Missing(f"a pose of {pair.name}")
    # The pixels, epipoles and lines of F all refer to the cameras of the pose.
    pair = replace(
        pair, cameras=tuple(tv.corrected_camera(pose, camera) for camera in pair.cameras)
    )
    chosen = cloud.matches[cloud.inlier_mask]
    pixels = tuple(to_pinhole(camera, np.column_stack([keys["x"], keys["y"]])[chosen[index]])
                   for camera, keys, index in zip(pair.cameras, cloud.keypoints, ("idx0", "idx1")))
    return Study(pair, pose, pixels, cloud.points[cloud.inlier_mask], numbers_of(pair, pose))


def numbers_of(pair, pose):
    center1 = -pose.R.T @ pose.t
    ends = [epipole(pair.cameras[0].K, center1), epipole(pair.cameras[1].K, pose.t)]
    inside = [
        bool(0 <= e[0] < c.width and 0 <= e[1] < c.height) for e, c in zip(ends, pair.cameras)
    ]
    return {
        "matches": pose.num_matches,
        "inliers": pose.num_inliers,
        "verdict": pose.verdict.name.lower(),
        "rotation_error_deg": rotation_deg(pose.R @ pair.R.T),
        "translation_error_deg": angle_deg(pose.t, pair.t),
        "motion_off_axis_deg": min(angle_deg(center1, [0, 0, 1]), angle_deg(center1, [0, 0, -1])),
        "epipoles_px": [np.clip(e, -1e9, 1e9).tolist() for e in ends],
        "epipoles_inside": inside,
    }


# ---- the drone's flights ----

def rotation_of_quaternion(x, y, z, w):
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def true_motion(rows):
    """The pose cam1_from_cam0 from two rows of the simulator's truth: R, and t in metres."""
    turns = [rotation_of_quaternion(*row[5:9]) @ BODY_FROM_CAMERA for row in rows]
    return turns[1].T @ turns[0], turns[1].T @ (rows[0][2:5] - rows[1][2:5])


def frames_apart(recorded, numbers, metres):
    """Chooses two decoded pictures taken `metres` apart, within 20 %; the second one is the fifth
    from the end. Returns their indices and their rows of the truth."""
    rows = {int(row[0]): row for row in recorded.truth}
    known = [k for k, number in enumerate(numbers) if number in rows]
    last = len(known) - 5
    if last < 1:
        raise Missing("enough pictures of the flight")
    places = np.array([rows[numbers[k]][2:5] for k in known])
    off = np.linalg.norm(places - places[last], axis=1)
    first = int(np.argmin(np.abs(off[:last] - metres)))
    if abs(off[first] - metres) > 0.2 * metres:
        raise Missing(f"two pictures of the flight {metres} m apart")
    return [known[first], known[last]], [rows[numbers[known[k]]] for k in (first, last)]


def pair_of_flight(inputs, recorded, plan, metres):
    """(pair with truth, result.json of the same two frames with the IMU's values)."""
    pictures = recorded.folder.parent / "frames"
    inputs.program("drone", "replay", recorded.folder, "--frames", pictures, "--quiet")
    files = sorted(pictures.glob("*.png"))  # a file's name is the drone's frame number
    indices, rows = frames_apart(recorded, [int(f.stem) for f in files], metres)
    told = json.loads(
        inputs.program(
            "reconstruct",
            "--recording",
            recorded.folder,
            "--frames",
            *indices,
            "--camera",
            recorded.camera,
            "--json",
            "-o",
            recorded.folder.parent / "out",
        )
    )
    if told["recording"]["frame_numbers"] != [int(row[0]) for row in rows]:
        raise RuntimeError("reconstruct took other frames than those asked for")
    if told["imu"] is None or told["imu"]["rotation_difference_deg"] is None:
        raise Missing("the IMU's attitude at the two pictures")
    colour = tuple(read_colour(files[k]) for k in indices)
    tv = library()
    height, width = colour[0].shape[:2]
    camera = tv.Camera(
        width, height, 560, 560, 320, 180, tv.CameraModel.BROWN_CONRADY, (-0.5, 0.25)
    )
    R, t = true_motion(rows)
    baseline = float(np.linalg.norm(t))
    return (
        Pair(f"Simulated drone, {plan.name}", colour, (camera, camera), R, t / baseline, baseline),
        told,
    )


def flown_pair(inputs, plan, metres):
    """Flies the plan and returns pair_of_flight of the recording. A flight that fails, as it may on
    a machine that is too busy for real time, is repeated, up to FLIGHTS flights in all."""
    for attempt in range(FLIGHTS):
        try:
            return pair_of_flight(inputs, flight.fly(inputs, plan, attempt), plan, metres)
        except (Missing, RuntimeError) as told:
            problem = told
    raise Missing(f"a flight: {problem}")


def imu_numbers(pair, told):
    imu = told["imu"]
    metric = told["scale"] == "metric"
    return {"imu_difference_deg": imu["rotation_difference_deg"], "imu_sigma_deg": imu["sigma_deg"],
            "true_baseline_m": pair.baseline_m,
            "baseline_m": float(np.linalg.norm(told["t"])) if metric else None,
            "baseline_source": imu["scale_source"] if metric else None}


# ---- drawing ----

def spread(pixels, count):
    """Indices of at most `count` points that are far from each other."""
    chosen = [int(np.argmin(pixels[:, 0] + pixels[:, 1]))]
    near = np.linalg.norm(pixels - pixels[chosen[0]], axis=1)
    while len(chosen) < min(count, len(pixels)):
        chosen.append(int(near.argmax()))
        near = np.minimum(near, np.linalg.norm(pixels - pixels[chosen[-1]], axis=1))
    return chosen


def draw_view(axis, study, view, chosen):
    """Draws a picture with some of its points and the epipolar lines of the other picture's
    points."""
    camera = study.pair.cameras[view]
    drawing.show(axis, grey(undistorted_image(camera, study.pair.colour[view])))
    F = study.pose.F if view == 1 else study.pose.F.T
    other = np.column_stack([study.pixels[1 - view][chosen], np.ones(len(chosen))])
    colours = drawing.pyplot.get_cmap("hsv")(np.linspace(0, 0.92, len(chosen)))
    for (a, b, c), pixel, colour in zip(other @ F.T, study.pixels[view][chosen], colours):
        foot = np.array([-a * c, -b * c]) / (a * a + b * b)
        along = np.array([-b, a]) / np.hypot(a, b) * 3000
        axis.plot(*np.array([foot - along, foot + along]).T, color=colour, linewidth=0.9)
        axis.plot(
            *pixel, "o", color=colour, markersize=4, markeredgecolor="black", markeredgewidth=0.5
        )
    end = np.array(study.numbers["epipoles_px"][view])
    if study.numbers["epipoles_inside"][view]:
        axis.plot(*end, "*", color="#ffe14d", markersize=15, markeredgecolor="black")
        where = "inside"
    else:
        off = np.hypot(*(end - (camera.width / 2, camera.height / 2))) / camera.width
        where = f"{off:.0f} image widths away" if off < 1000 else "at infinity"
    axis.set_title(f"Image {view}: epipole {where}")


def draw_cameras(axis, study):
    """Draws camera 0 at the origin, camera 1 and the cloud, from above."""
    ok = study.points["status"] == library().PointStatus.OK
    points = study.points["position"][ok]
    # More distant points would make the baseline too small to see.
    depth = min(np.percentile(points[:, 2], 90), 30.0)
    near = points[(points[:, 2] < 1.3 * depth)]
    axis.plot(near[:, 0], near[:, 2], ".", color=drawing.GREY, markersize=1.5)
    size = 0.16 * depth
    for R, centre, colour, name in (
        (np.eye(3), np.zeros(3), drawing.BLUE, "camera 0"),
        (study.pose.R, -study.pose.R.T @ study.pose.t, drawing.BAD, "camera 1"),
    ):
        half = 0.5 * study.pair.cameras[0].width / study.pair.cameras[0].fx
        corners = (
            np.array([(-half, 0, 1), (0, 0, 0), (half, 0, 1), (-half, 0, 1)]) * size @ R + centre
        )
        axis.plot(corners[:, 0], corners[:, 2], color=colour, label=name)
    axis.set_aspect("equal", adjustable="datalim")
    axis.set_title("From above, in baselines")
    axis.legend(loc="lower right")


def draw_study(study, alt):
    height = max(4.3 * study.pair.colour[0].shape[0] / study.pair.colour[0].shape[1], 2.3)
    sheet, axes = drawing.sheet(12, height + 0.4, 1, 3, width_ratios=(1.25, 1.25, 1))
    sheet.suptitle(study.pair.name, x=0.01, ha="left", fontsize=10, fontweight="bold")
    chosen = spread(study.pixels[0], NUM_LINES)
    draw_view(axes[0], study, 0, chosen)
    draw_view(axes[1], study, 1, chosen)
    draw_cameras(axes[2], study)
    return drawing.finish(sheet, f"{study.pair.name}: {alt}")


# ---- the figures ----

def study_of(pair, told=None):
    study = reconstructed(pair)
    if told is not None:
        study.numbers.update(imu_numbers(pair, told))
    return study


def table_of(studies):
    rows = []
    for study in studies:
        n = study.numbers
        imu = metres = "–"
        if "imu_difference_deg" in n:
            imu = f"{n['imu_difference_deg']:.2f} (sigma {n['imu_sigma_deg']:.2f})"
        if n.get("baseline_m"):
            metres = (
                f"{n['baseline_m']:.3f} by {n['baseline_source']}, true {n['true_baseline_m']:.3f}"
            )
        rows.append(
            [
                study.pair.name,
                f"{n['inliers']} of {n['matches']}",
                f"{n['rotation_error_deg']:.3f}",
                f"{n['translation_error_deg']:.2f}",
                f"{n['motion_off_axis_deg']:.1f}",
                imu,
                metres,
            ]
        )
    return Table(
        "The pose against the truth, and against the IMU",
        [
            "pair",
            "inliers",
            "rotation error [deg]",
            "direction error [deg]",
            "motion off the optical axis [deg]",
            "rotation against the IMU [deg]",
            "baseline [m]",
        ],
        rows,
    )


def figure(real, flown, lead, alt):
    studies, missing = available(lambda: study_of(real()), lambda: study_of(*flown()))
    numbers = {s.pair.name: s.numbers for s in studies}
    parts = []
    for name, n in numbers.items():
        text = (f"{name}: rotation off by {n['rotation_error_deg']:.3f} degrees, direction by "
                f"{n['translation_error_deg']:.2f}")
        if "imu_difference_deg" in n:
            text += (
                f"; the IMU's rotation differs by {n['imu_difference_deg']:.2f} degrees, its sigma "
                f"is "
                f"{n['imu_sigma_deg']:.2f}"
            )
        parts.append(text)
    found = lead + " " + ". ".join(parts) + "."
    return Result(
        numbers, found, [draw_study(study, alt) for study in studies], [table_of(studies)], missing
    )


def figure14(inputs):
    return figure(
        lambda: inputs.motorcycle,
        lambda: flown_pair(inputs, flight.SIDEWAYS, 0.6),
        "The lines run along the motion and the epipoles lie far outside the images, to the side; "
        "the "
        "drone leans while it flies, so that its lines are tilted.",
        "parallel epipolar lines, and both cameras from above",
    )


def figure15(inputs):
    return figure(
        lambda: inputs.listed_pair(
            "kitti00_turn", "000100.png", "000101.png", "KITTI, 0.43 m forward"
        ),
        lambda: flown_pair(inputs, flight.FORWARD, 0.8),
        "The lines meet in the epipole, which lies inside both images: there the camera flies to.",
        "epipolar lines that meet in the epipole, and both cameras from above",
    )


DIFFERS = (
    "The paper compares with the real drone's IMU. We found no recording of a real flight with "
    "pictures "
    "and IMU that may be used, so the flight here is the simulator's, recorded and read as a real "
    "one; "
    "its IMU has noise and its truth is known. The sigma of the attitude, a degree or so, is the "
    "driver's "
    "assumption for the real sensor."
)
EXPERIMENTS = [
    Experiment(
        "figure14",
        "Camera motion",
        "Figure 14: sideways motion",
        "The drone flies sideways: epipolar lines, epipole and the relative camera pose, held "
        "against "
        "the IMU.",
        DIFFERS,
        figure14,
    ),
    Experiment(
        "figure15",
        "Camera motion",
        "Figure 15: forward motion",
        "The drone flies forward: epipolar lines that meet in the epipole, and the relative camera "
        "pose, "
        "held against the IMU.",
        "The same; the street pair has its reference from GPS and an inertial unit, good to a "
        "degree or "
        "two in direction over so short a baseline. Forward motion is the hard case: points near "
        "the "
        "epipole have no parallax, and their depth is hardly known.",
        figure15,
    ),
]
