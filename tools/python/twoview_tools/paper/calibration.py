"""Figures 1b and 4: calibration of an AR.Drone's camera from chessboards, and a view with its
distortion removed."""

from dataclasses import dataclass
from pathlib import Path
from typing import Callable

import cv2
import numpy as np

from . import drawing
from .experiment import Experiment, Missing, Result, Table, available
from .inputs import library, read_colour, read_json

PAPER_RANGE_PX = (0.1, 0.5)  # the paper's usual range of the reprojection error


@dataclass(frozen=True)
class Boards:
    """Pictures of one chessboard, taken by one camera."""

    title: str
    folder: Callable  # folder(inputs) is the Path of the folder of the pictures
    pattern: str
    size: tuple  # inner corners in a row and in a column
    square_m: float
    shown: str  # the name of the picture that figure 1b shows

    def calibrated(self, inputs):
        """The output folder of `twoview calibrate`, which is run only once."""
        folder = Path(inputs.scratch) / self.shown
        if not (folder / "calibration.json").exists():
            inputs.program(
                "calibrate",
                *sorted(self.folder(inputs).glob(self.pattern)),
                "--board",
                "x".join(map(str, self.size)),
                "--square",
                self.square_m,
                "--quiet",
                "-o",
                folder,
            )
        return folder


ARDRONE = Boards(
    "AR.Drone 1",
    lambda inputs: inputs.of_fixtures("chessboard_ardrone1"),
    "image_*.png",
    (8, 6),
    0.02485,
    "image_000004.png",
)
OPENCV = Boards(
    "OpenCV's sample camera",
    lambda inputs: inputs.of_data("chessboard_opencv", "images"),
    "left*.jpg",
    (9, 6),
    0.025,
    "left12.jpg",
)


def used(calibration):
    return [view for view in calibration["views"] if view["status"] == "used"]


def camera_of(calibration):
    """Converts the camera of a calibration.json to a twoview.Camera."""
    tv = library()
    i = calibration["intrinsics"]
    width, height = calibration["image_size"]
    return tv.Camera(
        width,
        height,
        i["fx"],
        i["fy"],
        i["cx"],
        i["cy"],
        tv.CameraModel.BROWN_CONRADY,
        [i[name] for name in ("k1", "k2", "p1", "p2", "k3")],
    )


def board_points(boards):
    """The positions of the board's corners in metres, row by row."""
    grid = np.mgrid[:boards.size[0], :boards.size[1]].T.reshape(-1, 2) * boards.square_m
    return np.column_stack([grid, np.zeros(len(grid))])


def residuals(boards, calibration):
    """{view: (n, 2) measured corners minus projected corners}, with the library's projection."""
    camera, found = camera_of(calibration), {}
    for view in used(calibration):
        points = board_points(boards) @ np.reshape(view["R"], (3, 3)).T + view["t"]
        pixels, seen = library().camera_project_points(camera, np.ascontiguousarray(points))
        assert seen.all(), view["name"]
        found[view["name"]] = np.array(view["corners"]) - pixels
    return found


def rms(vectors):
    return float(np.sqrt((np.sum(np.square(vectors), axis=1)).mean()))


def straightness(corners, size):
    """The root mean square distance, in pixels, of a board's corners from the best lines through
    its rows and columns."""
    grid = np.reshape(corners, (size[1], size[0], 2))
    off = []
    for line in (*grid, *grid.transpose(1, 0, 2)):
        centred = line - line.mean(axis=0)
        off.append(centred @ np.linalg.svd(centred, full_matrices=False)[2][-1])
    return float(np.sqrt(np.mean(np.concatenate(off) ** 2)))


def undistorted(camera, pixels):
    return np.array([library().camera_undistort(camera, p) for p in np.asarray(pixels, float)])


def draw_lines(axis, corners, size):
    """Draws straight chords between the first and last corners of the outer rows and columns."""
    grid = np.reshape(corners, (size[1], size[0], 2))
    for line in (grid[0], grid[-1], grid[:, 0], grid[:, -1]):
        axis.plot(*line[[0, -1]].T, "-", color="#ffd34d", linewidth=1.1)
        axis.plot(*line.T, ".", color=drawing.BAD, markersize=4)


def straightened(inputs, boards, axes):
    """Draws a view before and after undistortion. Returns {"raw", "undistorted"}: the deviation
    from straight lines in pixels, over all views."""
    folder = boards.calibrated(inputs)
    calibration = read_json(folder / "calibration.json")
    source = boards.folder(inputs) / boards.shown
    inputs.program(
        "undistort", source, "--camera", folder / "camera.yaml", "--quiet", "-o", folder / "flat"
    )
    flat = next((folder / "flat").glob(Path(boards.shown).stem + ".*"))
    camera = camera_of(calibration)
    moves = {"raw": lambda p: np.array(p), "undistorted": lambda p: undistorted(camera, p)}
    view = next(v for v in used(calibration) if v["name"] == boards.shown)
    for axis, image, (name, move) in zip(axes, (source, flat), moves.items()):
        corners = move(view["corners"])
        drawing.show(
            axis,
            read_colour(image),
            f"{boards.title}, {name}: {straightness(corners, boards.size):.2f} px off straight "
            f"lines",
        )
        draw_lines(axis, corners, boards.size)
    return {
        name: float(
            np.sqrt(
                np.mean(
                    [straightness(move(v["corners"]), boards.size) ** 2 for v in used(calibration)]
                )
            )
        )
        for name, move in moves.items()
    }


def pictured(inputs, boards):
    """Returns the same Boards if their pictures are present; raises Missing otherwise."""
    boards.folder(inputs)
    return boards


def figure1b(inputs):
    listed, missing = available(*(lambda b=b: pictured(inputs, b) for b in (ARDRONE, OPENCV)))
    sheet, axes = drawing.sheet(9.5, 3.85 * len(listed), len(listed), 2, squeeze=False)
    off = {boards.title: straightened(inputs, boards, row) for boards, row in zip(listed, axes)}
    words = [
        f"{title} {e['raw']:.2f} px before and {e['undistorted']:.2f} px after"
        for title, e in off.items()
    ]
    found = (
        "Rows and columns of the boards' corners off straight lines, rms over all views: "
        f"{'; '.join(words)}."
    )
    return Result(
        {"off_straight_px": off},
        found,
        [
            drawing.finish(
                sheet,
                "Raw and undistorted views of chessboards, with straight lines through "
                "the corners",
            )
        ],
        missing=missing,
    )


def draw_residuals(axis, found):
    for name, vectors in found.items():
        axis.plot(*vectors.T, ".", markersize=3, label=name)
    limit = max(1.0, np.abs(np.concatenate(list(found.values()))).max() * 1.05)
    axis.set_xlim(-limit, limit)
    axis.set_ylim(limit, -limit)
    axis.set_aspect("equal")
    axis.set_title("Corner minus reprojection [px]")


def draw_error_by_view(axis, per_view):
    axis.bar(range(len(per_view)), list(per_view.values()), color=drawing.BLUE)
    axis.axhspan(*PAPER_RANGE_PX, color=drawing.GOOD, alpha=0.12, label="the paper's usual error")
    axis.set_xticks(range(len(per_view)), [name[-6:-4] for name in per_view])
    axis.set_xlabel("view")
    axis.set_ylim(0, 0.6)
    axis.set_title("Error by view [px rms]")
    axis.legend(loc="upper right")


def draw_calibration(inputs, views, found, per_view):
    """Draws two views with their corners, the residuals, and the error of each view."""
    sheet = drawing.pyplot.figure(figsize=(11, 3.1))
    grid = sheet.add_gridspec(1, 4, width_ratios=(1.35, 1.35, 1, 1.1))
    for place, view in enumerate(views[:4:3]):
        image = read_colour(ARDRONE.folder(inputs) / view["name"])
        corners = np.array(view["corners"], np.float32).reshape(-1, 1, 2)
        cv2.drawChessboardCorners(image, ARDRONE.size, corners, True)
        drawing.show(sheet.add_subplot(grid[place]), image, view["name"])
    draw_residuals(sheet.add_subplot(grid[2]), found)
    draw_error_by_view(sheet.add_subplot(grid[3]), per_view)
    return drawing.finish(sheet, "Detected corners, residuals and the error of each view")


def figure4(inputs):
    calibration = read_json(ARDRONE.calibrated(inputs) / "calibration.json")
    found = residuals(ARDRONE, calibration)
    per_view = {name: rms(vectors) for name, vectors in found.items()}
    overall = rms(np.concatenate(list(found.values())))
    published = published_error(inputs)
    numbers = {"rms_px": overall, "program_rms_px": calibration["rms_px"], "views": per_view,
               "intrinsics": calibration["intrinsics"], "sigma": calibration["sigma"],
               "published_rms_px": published, "paper_range_px": list(PAPER_RANGE_PX),
               "opencv_board_rms_px": None}
    text = (
        f"twoview calibrate on {len(found)} pictures of an AR.Drone 1 (320 x 240): {overall:.3f} "
        f"px "
        f"rms; the paper's range is {PAPER_RANGE_PX[0]} to {PAPER_RANGE_PX[1]} px. Those who took "
        f"the "
        f"pictures published {published:.2f} px for the same ones."
    )
    missing = []
    try:
        other = read_json(OPENCV.calibrated(inputs) / "calibration.json")["rms_px"]
        numbers["opencv_board_rms_px"] = other
        text += f" OpenCV's own sample pictures give {other:.3f} px."
    except Missing as told:
        missing.append(str(told))
    picture = draw_calibration(inputs, used(calibration), found, per_view)
    return Result(numbers, text, [picture], [intrinsics_table(calibration)], missing)


def published_error(inputs):
    """avg_reprojection_error of the calibration file published with the pictures."""
    text = inputs.of_fixtures("chessboard_ardrone1", "ardrone_camera.yml").read_text(
        encoding="utf-8"
    )
    return float(text.split("avg_reprojection_error:")[1].split()[0])


def intrinsics_table(calibration):
    names = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")
    rows = [[title, *(f"{calibration[key][n]:.{2 if n[0] in 'fc' else 4}f}" for n in names)]
            for title, key in (("value", "intrinsics"), ("standard deviation", "sigma"))]
    return Table("The camera: pixels, and Brown-Conrady's coefficients", ["", *names], rows)


EXPERIMENTS = [
    Experiment(
        "figure1b",
        "Camera calibration",
        "Figure 1b: a raw and an undistorted view",
        "A picture of the drone's camera as it comes, and the same after undistortion.",
        "Undistortion goes through the lens model by Newton steps, with a known radius up to which "
        "the "
        "model holds. Estimation needs no undistorted image: matches become rays, and thresholds "
        "stay "
        "pixels of the image as it is.",
        figure1b,
    ),
    Experiment(
        "figure4",
        "Camera calibration",
        "Figure 4: chessboards and the calibration's error",
        "The chessboard calibration, by Zhang's method; its error is usually 0.1 to 0.5 px.",
        "The mathematics is the paper's (Zhang, by OpenCV). twoview calibrate leaves out blurred, "
        "partial and duplicate views, tells standard deviations, and warns when the answer is not "
        "to be "
        "trusted (docs/calibrate.md).",
        figure4,
    ),
]
