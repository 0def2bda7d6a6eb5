"""A scene of tilted textured planes, photographed from four known places, and fixtures that run the
program's verbs."""

import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
os.environ.setdefault("TWOVIEW_LIBRARY", str(ROOT / "build" / "release" / "lib" / "libtwoview.so"))
SCRIPT = ROOT / "tools" / "compare_colmap" / "twoview_colmap"

WIDTH, HEIGHT, FX, FY, CX, CY = 640, 480, 520.0, 500.0, 330.0, 235.0
K = np.array([[FX, 0, CX], [0, FY, CY], [0, 0, 1]])
NAMES = ("a.png", "b.png", "c.png", "d.png")
CAMERA = f"""camera:
  image_width: {WIDTH}
  image_height: {HEIGHT}
  fx: {FX}
  fy: {FY}
  cx: {CX}
  cy: {CY}
"""


def camera_pose(index):
    """R, t (camera from world) of the camera with this index, on an arc around the scene."""
    angle = np.radians(-12 + 8 * index)
    R = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    centre = np.array([6 * np.sin(-angle), 0.15 * (index % 2), 6 - 6 * np.cos(angle)])
    return R, -R @ centre


# Each plane: the position of its middle and two half sides, from far to near.
PLANES = [((0, 0, 8), (5.5, 0, 0.8), (0, 4, 0)), ((-1.6, 0.6, 6.3), (0.9, 0, -0.5), (0, 1, 0.2)),
          ((1.5, -0.7, 5.6), (0.8, 0.1, 0.5), (0, 0.8, 0)),
          ((0.2, 1.0, 5), (1, 0, 0), (0, 0.3, -0.8))]


def _texture(random, cv2):
    """Blobs of several sizes, so that there are corners everywhere."""
    total = np.zeros((512, 512))
    for sigma in (1.5, 3, 8):
        layer = cv2.GaussianBlur(random.normal(size=(512, 512)), (0, 0), sigma)
        total += layer / layer.std()
    return np.clip(128 + 40 * total, 0, 255).astype(np.uint8)


def render(index):
    import cv2
    random = np.random.default_rng(3)
    R, t = camera_pose(index)
    image = np.full((HEIGHT, WIDTH), 128, np.uint8)
    corners = np.array([[0, 0], [511, 0], [511, 511], [0, 511]], np.float32)
    for middle, u, v in PLANES:
        texture = _texture(random, cv2)
        world = np.array(middle) + np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) @ np.array([u, v])
        seen = (world @ R.T + t) @ K.T
        H = cv2.getPerspectiveTransform(corners, (seen[:, :2] / seen[:, 2:]).astype(np.float32))
        mask = cv2.warpPerspective(np.full_like(texture, 255), H, (WIDTH, HEIGHT))
        warped = cv2.warpPerspective(texture, H, (WIDTH, HEIGHT))
        image = np.where(mask > 127, warped, image)
    return image


@pytest.fixture(scope="session")
def photographs(tmp_path_factory):
    """A folder with images/, cameras.yaml, and pairs.txt with the true poses. Tests must not write
    to it."""
    import cv2
    from twoview_tools.colmap.pairs import write_pair
    folder = tmp_path_factory.mktemp("scene")
    (folder / "images").mkdir()
    for index, name in enumerate(NAMES):
        cv2.imwrite(str(folder / "images" / name), render(index))
    (folder / "cameras.yaml").write_text(CAMERA)
    lines = ["# all pairs"]
    for i in range(len(NAMES)):
        for j in range(i + 1, len(NAMES)):
            lines.append(write_pair(NAMES[i], NAMES[j], K, K, *relative_pose(i, j)))
    (folder / "pairs.txt").write_text("\n".join(lines) + "\n")
    return folder


@pytest.fixture(scope="session")
def bend(tmp_path_factory):
    """A folder with images/ and cam.yaml: a car in a bend; the camera file's principal point is off
    by about ten pixels."""
    folder = os.environ.get("TWOVIEW_DATA") or ROOT.parent / "shared" / "data"
    data = pathlib.Path(folder) / "kitti00_turn" / "images"
    if not data.is_dir():
        pytest.skip(f"no {data}")
    folder = tmp_path_factory.mktemp("bend")
    (folder / "images").mkdir()
    for name in ("000106.png", "000110.png"):
        (folder / "images" / name).write_bytes((data / name).read_bytes())
    (folder / "cam.yaml").write_text(
        "image_width: 1241\nimage_height: 376\n"
        "camera_matrix: {rows: 3, cols: 3, data: [718.856, 0, 607.1928, 0, 718.856, "
        "185.2157, 0, 0, 1]}\ndistortion_coefficients: [0, 0, 0, 0, 0]\n"
    )
    return folder


def relative_pose(i, j):
    (R0, t0), (R1, t1) = camera_pose(i), camera_pose(j)
    R = R1 @ R0.T
    return R, t1 - R @ t0


def start(*arguments, **options):
    return subprocess.Popen(
        [sys.executable, "-B", str(SCRIPT), *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


def run(*arguments, status=0):
    """The stdout of the program, run in a process of its own."""
    process = start(*arguments)
    out, err = process.communicate(timeout=120)
    assert process.returncode == status, out + err
    return out


@pytest.fixture
def call(capfd):
    """A function that runs a verb in this process and returns (exit status, stdout, stderr)."""
    from twoview_tools.colmap.cli import main

    def called(*arguments):
        capfd.readouterr()
        status = main([str(argument) for argument in arguments])
        return (status, *capfd.readouterr())
    return called


@pytest.fixture
def refuse(call):
    """Runs a verb that must be refused with one line on stderr that contains these words."""
    def refused(words, *arguments):
        status, out, err = call(*arguments)
        assert (
            status == 2 and out == "" and err.startswith("twoview: ") and err.count("\n") == 1
        ), err
        for word in words if isinstance(words, tuple) else (words,):
            assert word in err
    return refused


@pytest.fixture(scope="session")
def exported(photographs, tmp_path_factory):
    """{schema: database} of all pairs. Tests must not write to it."""
    pytest.importorskip("pycolmap")
    folder = tmp_path_factory.mktemp("exported")
    for schema in ("4", "3.8"):
        run(
            "export",
            "--database",
            folder / f"{schema}.db",
            "--images",
            photographs / "images",
            "--schema",
            schema,
            "--quiet",
        )
    return {schema: folder / f"{schema}.db" for schema in ("4", "3.8")}
