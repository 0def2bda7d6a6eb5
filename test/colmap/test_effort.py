"""Tests of --effort of twoview colmap export: a wall at a slant."""

import contextlib
import json
import sqlite3

import numpy as np
import pytest
from twoview_tools.colmap.database import read_keypoints
from conftest import CAMERA, HEIGHT, K, WIDTH

pycolmap = pytest.importorskip("pycolmap")
ANGLE = np.radians(68)
CORNERS = np.array([[-6, -4, 6], [6, -4, 6], [6, 4, 6], [-6, 4, 6]], float)


def wall_from(angle):
    """The wall at distance 6 from a camera that is turned about its middle by this angle; rendered
    four times as large, so that what is far away is averaged."""
    import cv2
    random = np.random.default_rng(11)
    patches = random.integers(20, 236, (200, 300)).astype(np.uint8)
    texture = np.kron(patches, np.full((6, 6), 1, np.uint8))
    R = np.array([[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0],
                  [np.sin(angle), 0, np.cos(angle)]])
    middle = np.array([0, 0, 6.0])
    seen = ((CORNERS - middle) @ R.T + middle) @ K.T
    pixels = 4 * (seen[:, :2] / seen[:, 2:] + 0.5) - 0.5
    height, width = texture.shape
    inside = np.array([[0, 0], [width - 1, 0], [width - 1, height - 1], [0, height - 1]],
                      np.float32)
    H = cv2.getPerspectiveTransform(inside, pixels.astype(np.float32))
    large = cv2.warpPerspective(texture, H, (4 * WIDTH, 4 * HEIGHT), borderValue=128)
    return cv2.resize(large, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)


@pytest.fixture(scope="module")
def walls(tmp_path_factory):
    import cv2
    folder = tmp_path_factory.mktemp("walls")
    (folder / "images").mkdir()
    (folder / "cameras.yaml").write_text(CAMERA)
    for name, angle in (("a.png", 0.0), ("b.png", ANGLE), ("c.png", 0.9 * ANGLE)):
        cv2.imwrite(str(folder / "images" / name), wall_from(angle))
    (folder / "pairs.txt").write_text("a.png b.png\n")
    return folder


def export(call, walls, database, *more):
    status, out, err = call("export", "--database", database, "--images", walls / "images",
                            "--max-keypoints", "1000", "--json", *more)
    assert status == 0, err
    return json.loads(out)


def inliers_of(path):
    """{(image_id, image_id): pixels of both images (n, 2, 2)}"""
    with pycolmap.Database.open(path) as database:
        found = {}
        for pair, row in zip(*database.read_two_view_geometries()):
            ids = pycolmap.pair_id_to_image_pair(pair)
            found[ids] = np.stack([database.read_keypoints(i)[row.inlier_matches[:, k], :2]
                                   for k, i in enumerate(ids)], axis=1)
        for image in database.read_all_images():  # a descriptor for each keypoint
            assert (len(database.read_descriptors(image.image_id).data)
                    == len(database.read_keypoints(image.image_id)))
        return found


def on_the_wall(pixels):
    """Which matches of a.png and b.png are of one place of the wall."""
    rays = np.linalg.solve(K, np.column_stack([pixels[:, 0] - 0.5, np.ones(len(pixels))]).T).T
    c, s = np.cos(ANGLE), np.sin(ANGLE)
    R = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    middle = np.array([0, 0, 6.0])
    seen = ((6 * rays - middle) @ R.T + middle) @ K.T
    return np.abs(seen[:, :2] / seen[:, 2:] - (pixels[:, 1] - 0.5)).max(axis=1) < 3


@pytest.mark.parametrize("schema", ["4", "3.8"])
def test_a_wall_at_a_slant_gets_keypoints_of_squeezed_views(walls, tmp_path, call, schema):
    pairs = ("--pairs", walls / "pairs.txt", "--schema", schema)
    plain = export(call, walls, tmp_path / "plain.db", *pairs, "--effort", "fixed")
    hard = export(call, walls, tmp_path / "hard.db", *pairs)
    assert plain["efforts"] == {"0": 1} and set(hard["efforts"]) <= {"2", "3"}
    assert hard["inlier_matches"] > plain["inlier_matches"] + 20
    assert hard["keypoints"] > plain["keypoints"]
    for name in ("a.png", "b.png"):  # what rung 0 found is there unchanged, and stands in front
        tables = []
        for path in (tmp_path / "plain.db", tmp_path / "hard.db"):
            with contextlib.closing(sqlite3.connect(path)) as database:
                [[key]] = database.execute("SELECT image_id FROM images WHERE name = ?", (name,))
                tables.append(read_keypoints(database, path, key))
        np.testing.assert_array_equal(tables[1][:len(tables[0])], tables[0])
    if schema == "4":
        [pixels] = inliers_of(tmp_path / "hard.db").values()
        assert on_the_wall(pixels).mean() > 0.9
        for k in (0, 1):  # no keypoint has two matches
            assert len(np.unique(pixels[:, k], axis=0)) == len(pixels)


def test_append_keeps_the_keypoints_of_squeezed_views(walls, tmp_path, call):
    path = tmp_path / "x.db"
    first = export(call, walls, path, "--pairs", walls / "pairs.txt")
    before = inliers_of(path)
    (tmp_path / "more.txt").write_text("a.png b.png\na.png c.png\n")
    second = export(call, walls, path, "--pairs", tmp_path / "more.txt", "--append")
    assert (second["new_images"], second["pairs"]) == (1, 1)
    after = inliers_of(path)
    assert len(after) == 2 and second["keypoints"] > first["keypoints"]
    for pair, pixels in before.items():
        np.testing.assert_array_equal(after[pair], pixels)
