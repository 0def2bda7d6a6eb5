#!/usr/bin/env python3
"""Makes the pictures of examples/README.md, docs/images/examples/, from the examples' output.
usage: PYTHONPATH=test/cli scripts/python -m twoview_tools.docs.example_pictures \\
  FOLDER_OF_THE_BUILT_EXAMPLES PROGRAM_twoview

The photographs show the simulated drone's rendered room, so that no photographs with rights of
other people are committed.
"""

import contextlib
import os
import pathlib
import re
import subprocess
import sys
import tempfile

import boards  # test/cli/boards.py draws chessboards
import cv2
import numpy as np

from .. import ROOT

OUT = ROOT / "docs" / "images" / "examples"
WIDTH = 320
CAMERA = ["560", "560", "319.5", "319.5", "179.5"]
GREEN, RED, WHITE = (80, 200, 80), (60, 60, 230), (240, 240, 240)



def run(name, *arguments):
    done = subprocess.run(
        [str(BIN / name), *map(str, arguments)], capture_output=True, text=True, cwd=FOLDER
    )
    return done.stdout


def save(name, picture):
    height = round(picture.shape[0] * WIDTH / picture.shape[1])
    small = cv2.resize(picture, (WIDTH, height), interpolation=cv2.INTER_AREA)
    cv2.imwrite(
        str(OUT / f"{name}.jpg"),
        small,
        [cv2.IMWRITE_JPEG_QUALITY, 72, cv2.IMWRITE_JPEG_OPTIMIZE, 1],
    )


def terminal(name, text, columns=58):
    lines = [line[:columns] for line in text.strip().split("\n")][:11]
    picture = np.full((2 * (18 * len(lines) + 14), 2 * (columns * 7 + 20), 3), 32, np.uint8)
    for k, line in enumerate(lines):
        for column, letter in enumerate(line):
            cv2.putText(
                picture,
                letter,
                (20 + 14 * column, 2 * (18 * k + 22)),
                cv2.FONT_HERSHEY_DUPLEX,
                0.62,
                WHITE,
                1,
                cv2.LINE_AA,
            )
    save(name, picture)


def beside(left, right):
    return np.hstack([left, np.full((left.shape[0], 6, 3), 255, np.uint8), right])


def calibrate():
    files, shown = [], None
    rng = np.random.default_rng(7)
    rays = boards.ray_table(boards.MILD)
    for k, (R, t) in enumerate(boards.poses(boards.MILD, 8, rng)):
        image = boards.render(rays, R, t, rng)
        files.append(FOLDER / f"board{k}.png")
        cv2.imwrite(str(files[-1]), image)
        if k == 3:
            shown = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
            found, corners = cv2.findChessboardCorners(image, boards.INNER)
            cv2.drawChessboardCorners(shown, boards.INNER, corners, found)
    print(run("01_calibrate", FOLDER / "camera.yaml", *boards.INNER, *files))
    save("01", shown)
    return files


def undistort(board):
    model, (fx, fy, cx, cy), k = boards.MILD
    pgm = FOLDER / "board.pgm"
    cv2.imwrite(str(pgm), cv2.imread(str(board), 0))
    run("02_undistort", pgm, FOLDER / "flat.pgm", fx, fy, cx, cy, *k)
    save("02", beside(cv2.imread(str(pgm)), cv2.imread(str(FOLDER / "flat.pgm"))))


def detect(image):
    run("03_detect", image[0], FOLDER / "corners.ppm")
    save("03", cv2.imread(str(FOLDER / "corners.ppm")))


def match_lines(rows, colour, picture, shift):
    for x0, y0, x1, y1, *_ in rows:
        cv2.line(
            picture, (round(x0), round(y0)), (round(x1), round(y1 + shift)), colour, 1, cv2.LINE_AA
        )


def main():
    OUT.mkdir(exist_ok=True)
    colour = [photograph(0.3 * k) for k in range(2)]
    image = []
    for side, picture in zip(("left", "right"), colour):
        image.append(FOLDER / f"{side}.pgm")
        cv2.imwrite(str(image[-1]), cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY))
    undistort(calibrate()[3])
    detect(image)

    matches = FOLDER / "matches.txt"
    matches.write_text(run("04_match", *image))
    rows = np.loadtxt(matches)
    shift = colour[0].shape[0] + 6
    picture = np.vstack(
        [colour[0] // 2 + 60, np.full((6, 640, 3), 255, np.uint8), colour[1] // 2 + 60]
    )
    match_lines(rows[::24], GREEN, picture, shift)
    save("04", picture)

    text = run("05_fundamental", matches)
    F = np.array(text.split("\n")[1:4])
    F = np.array([[float(number) for number in line.split()] for line in F])
    ones = np.ones((len(rows), 1))
    line1 = np.hstack([rows[:, :2], ones]) @ F.T
    line0 = np.hstack([rows[:, 2:4], ones]) @ F
    far = np.abs((np.hstack([rows[:, 2:4], ones]) * line1).sum(1)) / \
        np.sqrt((line0[:, :2] ** 2).sum(1) + (line1[:, :2] ** 2).sum(1))
    picture = colour[0] // 2 + 60
    for good, shade in ((far < 1, GREEN), (far >= 1, RED)):
        match_lines(rows[good], shade, picture, 0)
    save("05", picture)

    picture = colour[1] // 2 + 60
    for k in range(0, len(rows), 60):
        a, b, c = line1[k]
        shade = tuple(
            int(v)
            for v in cv2.cvtColor(
                np.uint8([[[k * 180 // len(rows), 200, 255]]]), cv2.COLOR_HSV2BGR
            )[0, 0]
        )
        ends = [(x, round(-(a * x + c) / b)) for x in (0, picture.shape[1])]
        cv2.line(picture, *ends, shade, 1, cv2.LINE_AA)
        cv2.circle(picture, (round(rows[k, 2]), round(rows[k, 3])), 5, shade, 2, cv2.LINE_AA)
    save("06", picture)

    terminal("07", run("07_imu", matches, *CAMERA[:3], CAMERA[4], 1, 0, 0, 0, 1, 0, 0, 0, 1), 72)
    terminal("08", run("08_triangulate", matches, *CAMERA), 44)

    run("09_reconstruct", *image, FOLDER / "cloud.ply", *CAMERA)
    points = np.array(
        [
            [float(v) for v in line.split()[:3]]
            for line in (FOLDER / "cloud.ply").read_text().split("end_header\n")[1].splitlines()
        ]
    )
    from_above("09", points, f"{len(points)} points, from above")
    terminal("10", re.sub(r"(.{58,}?) ", r"\1\n", run("10_static_memory")), 72)
    absolute_pose()
    drone()
    colmap()


def absolute_pose():
    """300 simulated matches of pixels and points, a third of them wrong."""
    random = np.random.default_rng(15)
    R = cv2.Rodrigues(np.array([0.2, -0.5, 0.1]))[0]
    pixels = random.uniform((0, 0), (640, 480), (300, 2))
    rays = np.column_stack([(pixels - (320, 240)) / 500, np.ones(300)])
    points = (rays * random.uniform(2, 8, (300, 1)) - (0.3, -1, 2)) @ R
    pixels += 0.5 * random.normal(size=pixels.shape)
    pixels[200:] = random.uniform((0, 0), (640, 480), (100, 2))
    np.savetxt(FOLDER / "points.txt", np.column_stack([pixels, points]))
    terminal("15", run("15_absolute_pose", "points.txt", 500, 500, 320, 240), 58)


def from_above(name, points, words):
    """A view from above: x to the right, z away from the camera."""
    low, high = np.percentile(points, 4, axis=0), np.percentile(points, 96, axis=0)
    near = points[((points >= low) & (points <= high)).all(1)]
    low, high = near.min(0), near.max(0)
    scale = min(700 / (high[0] - low[0]), 440 / (high[2] - low[2]))
    picture = np.full((500, 741, 3), 32, np.uint8)
    for x, y, z in near[near[:, 1].argsort()[::-1]]:
        shade = np.clip((y - low[1]) / (high[1] - low[1]), 0, 1)
        place = (round(370 + scale * (x - (low[0] + high[0]) / 2)),
                 round(270 - scale * (z - (low[2] + high[2]) / 2)))
        cv2.circle(
            picture,
            place,
            3,
            (int(250 - 130 * shade), 190, int(110 + 140 * shade)),
            -1,
            cv2.LINE_AA,
        )
    cv2.putText(picture, words, (16, 36), cv2.FONT_HERSHEY_DUPLEX, 0.9, WHITE, 1, cv2.LINE_AA)
    save(name, picture)


def colmap():
    """Runs the example on eleven images of a fountain, if the data set is present. It needs colmap
    and pycolmap."""
    data = (
        pathlib.Path(os.environ.get("TWOVIEW_DATA", ROOT / ".." / "shared" / "data"))
        / "strecha_fountain_P11"
    )
    if not data.exists():
        return
    import pycolmap
    import yaml
    (camera,) = yaml.safe_load((data / "cameras.yaml").read_text()).values()
    K = [camera["fx"], 0, camera["cx"], 0, camera["fy"], camera["cy"], 0, 0, 1]
    (FOLDER / "camera.yaml").write_text(yaml.safe_dump({
        "image_width": camera["image_width"], "image_height": camera["image_height"],
        "camera_matrix": {"rows": 3, "cols": 3, "data": [float(k) for k in K]}}))
    environment = dict(
        os.environ,
        PATH=f"{os.path.dirname(PROGRAM)}:{os.environ['PATH']}",
        TWOVIEW_PYTHON=sys.executable,
    )
    subprocess.run(
        [
            ROOT / "examples" / "12_colmap.sh",
            data / "images",
            FOLDER / "camera.yaml",
            FOLDER / "model",
        ],
        check=True,
        env=environment,
        capture_output=True,
    )
    model = pycolmap.Reconstruction(str(next((FOLDER / "model").rglob("points3D.*")).parent))
    points = np.array([point.xyz for point in model.points3D.values()])
    from_above("12", points, f"{model.num_reg_images()} images, {len(points)} points, from above")


@contextlib.contextmanager
def simulated(*options):
    """Yields the ports (commands, navdata, video, control) of a simulated drone, which the system
    chooses. The drone is ended at the end of the block."""
    ports = [
        word
        for channel in ("at", "navdata", "video", "control", "recording")
        for word in (f"--{channel}-port", "0")
    ]
    drone = subprocess.Popen(
        [PROGRAM, "drone", "simulate", "--duration", "60", *ports, *options],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        words = drone.stdout.readline().replace(",", "").split()
        yield [words[words.index(name) + 1] for name in ("commands", "navdata", "video", "control")]
    finally:
        drone.kill()
        drone.communicate()


def photograph(y):
    """The upper half of what the drone's camera sees before take-off, y metres to the right of the
    start. The lower half shows only bare floor."""
    lens, folder = FOLDER / "pinhole.yaml", FOLDER / f"flight{y}"
    fx, fy, cx, _, cy = CAMERA
    lens.write_text(
        "image_width: 640\nimage_height: 360\n"
        f"camera_matrix: {{rows: 3, cols: 3, data: [{fx}, 0, {cx}, 0, {fy}, {cy}, 0, 0, 1.0]}}\n"
    )
    with simulated("--start", f"0,{y}", "--camera", str(lens), "--pixel-noise", "1") as (
        at,
        navdata,
        video,
        control,
    ):
        subprocess.run(
            [
                PROGRAM,
                "drone",
                "record",
                "--host",
                "127.0.0.1",
                "--at-port",
                at,
                "--navdata-port",
                navdata,
                "--video-port",
                video,
                "--control-port",
                control,
                "--duration",
                "4",
                "--frames",
                "--quiet",
                "-o",
                str(folder),
            ],
            check=True,
        )
    return cv2.imread(str(max((folder / "frames").glob("*.png"), key=lambda path: int(path.stem))))[
        :180
    ]


def drone():
    with simulated() as ports:
        terminal("11", run("11_ardrone", "127.0.0.1", "8", *ports), 60)


BIN, PROGRAM = pathlib.Path(sys.argv[1]).resolve(), os.path.abspath(sys.argv[2])
with tempfile.TemporaryDirectory() as folder:
    FOLDER = pathlib.Path(folder)
    main()
print(sum(path.stat().st_size for path in OUT.iterdir()), "bytes in", OUT)
