"""colmap/ of `twoview odometry` as other programs read it: the models load in pycolmap, every image
is found, and what it shows is what a pinhole would have taken."""

import json
import pathlib
import subprocess

import numpy as np
import pytest

pycolmap = pytest.importorskip("pycolmap")

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = ROOT / "build" / "release" / "bin" / "twoview"
WIDTH, HEIGHT, FOCAL, COUNT = 320, 240, 260.0, 24
K = np.array([[FOCAL, 0, 163.0], [0, FOCAL, 117.0], [0, 0, 1]])
LENSES = {"brown_conrady": ("plumb_bob", (-0.25, 0.06, 0.002, -0.003, 0)),
          "kannala_brandt": ("equidistant", (0.03, -0.01, 0.003, 0)),
          "none": ("plumb_bob", (0, 0, 0, 0, 0))}


def scene(k, K, size):
    """What a pinhole sees that flies past a wall with a nearer half, in colour."""
    import cv2
    random = np.random.default_rng(5)
    tiles = random.integers(0, 256, (2, 60, 160, 3)).astype(np.uint8)
    picture = np.zeros((size[1], size[0], 3), np.uint8)
    # A tile is 0.08 wide, at the depths 4 and 2.5; the nearer wall is below the horizon.
    for depth, tile, top in ((4.0, tiles[0], -2.4), (2.5, tiles[1], 0.0)):
        from_tile = np.array([[0.08, 0, -4 - 0.12 * k], [0, 0.08, top], [0, 0, depth]])
        warped = cv2.warpPerspective(tile, K @ from_tile, size, flags=cv2.INTER_AREA)
        mask = cv2.warpPerspective(np.full(tile.shape[:2], 255, np.uint8), K @ from_tile, size,
                                   flags=cv2.INTER_NEAREST)
        picture[mask > 0] = warped[mask > 0]
    return picture


def film(folder, name):
    """A folder of pictures through the lens, made from larger ones of a pinhole."""
    import cv2
    model, k = LENSES[name]
    u, v = np.meshgrid(np.arange(WIDTH, dtype=np.float64), np.arange(HEIGHT))
    pixels = np.stack([u, v], -1).reshape(-1, 1, 2)
    undistort = cv2.fisheye.undistortPoints if model == "equidistant" else cv2.undistortPoints
    rays = undistort(pixels, K, np.array(k)).reshape(HEIGHT, WIDTH, 2)
    wide = np.array([[300.0, 0, 299.5], [0, 300, 249.5], [0, 0, 1]])
    places = (rays * 300 + (299.5, 249.5)).astype(np.float32)
    folder.mkdir()
    for i in range(COUNT):
        picture = cv2.remap(scene(i, wide, (600, 500)), places, None, cv2.INTER_LINEAR)
        cv2.imwrite(str(folder / f"{i:03}.png"), picture)
    camera = folder.parent / f"{name}.yaml"
    camera.write_text(
        f"image_width: {WIDTH}\nimage_height: {HEIGHT}\ncamera_name: c\n"
        f"camera_matrix: {{rows: 3, cols: 3, data: {K.ravel().tolist()}}}\n"
        f"distortion_model: {model}\n"
        f"distortion_coefficients: {{rows: 1, cols: {len(k)}, data: {list(k)}}}\n")
    return camera


@pytest.mark.parametrize("name", LENSES)
def test_the_models_load_and_the_pictures_are_a_pinholes(name, tmp_path):
    import cv2
    if not PROGRAM.is_file():
        pytest.skip("the program is not built")
    source, out = tmp_path / "film", tmp_path / "out"
    camera_file = film(source, name)
    run = subprocess.run([PROGRAM, "odometry", source, "--fps", "15", "--camera", camera_file, "-o",
                          out, "--keep-camera", "--quiet"], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    if json.loads((out / "result.json").read_text())["colmap_pictures"] is None:
        pytest.fail("no pictures")
    frames = pycolmap.Reconstruction(out / "colmap")
    for folder in "sparse", "sparse/0":
        model = pycolmap.Reconstruction(out / "colmap" / folder)
        assert model.num_reg_images() == frames.num_reg_images() > 2
        (camera,) = model.cameras.values()
        assert camera.model.name == "PINHOLE"
        f, _, cx, cy = camera.params
        assert (cx, cy) == (camera.width / 2, camera.height / 2)
        assert f == FOCAL
    errors = []
    for number, image in model.images.items():
        # As taken by this pinhole: the wall, drawn again.
        picture = cv2.imread(str(out / "colmap" / "images" / image.name))
        assert picture.shape == (camera.height, camera.width, 3)
        index = int(frames.images[number].name[:3])
        pinhole = np.array([[f, 0, cx - 0.5], [0, f, cy - 0.5], [0, 0, 1]])
        true = scene(index, pinhole, (camera.width, camera.height))
        blurred = [cv2.GaussianBlur(p, (0, 0), 2).astype(float) for p in (picture, true)]
        assert np.abs(blurred[0] - blurred[1]).mean() < 6, image.name
        for point in image.get_observation_points2D():
            X = model.points3D[point.point3D_id].xyz
            errors.append(np.linalg.norm(image.project_point(X) - point.xy))
    assert np.median(errors) < 0.7
    assert model.compute_mean_reprojection_error() < 1.5
    transforms = json.loads((out / "colmap" / "transforms.json").read_text())
    for frame in transforms["frames"]:
        matrix = np.array(frame["transform_matrix"]) @ np.diag([1.0, -1, -1, 1])
        pose = model.images[frame["colmap_im_id"]].cam_from_world()
        np.testing.assert_allclose(np.linalg.inv(matrix)[:3], pose.matrix(), atol=1e-9)
