"""Tests of twoview colmap import and model: models as reference poses, databases as input, and
results written as models."""

import contextlib
import json
import os
import shutil
import sqlite3
import subprocess

import numpy as np
import pytest
import twoview as tv
from twoview_tools.colmap import conventions, importer, trajectory
from twoview_tools.colmap.cameras import read_camera_set
from twoview_tools.colmap.model import TwoViewModel, read_model, text_model
from twoview_tools.colmap.pairs import read_pairs
from conftest import CAMERA, CX, CY, FX, FY, HEIGHT, NAMES, WIDTH, K, camera_pose, relative_pose

pycolmap = pytest.importorskip("pycolmap")
OPENCV_CAMERA = f"""%YAML:1.0
---
image_width: {WIDTH}
image_height: {HEIGHT}
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ {FX}, 0., {CX}, 0., {FY}, {CY}, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ 0., 0., 0., 0., 0. ]
"""


def scene_points(count):
    random = np.random.default_rng(9)
    return np.column_stack(
        [random.uniform(-1, 1, count), random.uniform(-1, 1, count), random.uniform(4, 7, count)]
    )


@pytest.fixture(scope="module")
def models(tmp_path_factory):
    """{format: folder} of the scene's cameras as a COLMAP model that pycolmap wrote; the last image
    sees 10 points."""
    made = pycolmap.Reconstruction()
    camera = pycolmap.Camera(model="OPENCV", width=WIDTH, height=HEIGHT, camera_id=1,
                             params=[FX, FY, CX + 0.5, CY + 0.5, -0.1, 0.01, 0.001, 0])
    made.add_camera_with_trivial_rig(camera)
    points = scene_points(40)
    ids = [made.add_point3D(point, pycolmap.Track(), np.zeros(3, np.uint8)) for point in points]
    for i, name in enumerate(NAMES):
        R, t = camera_pose(i)
        seen = points[:10] if i == 3 else points
        pixels = camera.img_from_cam(seen @ R.T + t)
        image = pycolmap.Image(name=name, keypoints=pixels, camera_id=1, image_id=i + 1)
        made.add_image_with_trivial_frame(image, pycolmap.Rigid3d(pycolmap.Rotation3d(R), t))
        for k in range(len(seen)):
            made.add_observation(ids[k], pycolmap.TrackElement(i + 1, k))
    folder = tmp_path_factory.mktemp("models")
    for form in ("text", "binary"):
        (folder / form).mkdir()
    made.write_text(folder / "text")
    made.write_binary(folder / "binary")
    return {form: folder / form for form in ("text", "binary")}


@pytest.mark.parametrize("form", ["text", "binary"])
def test_a_models_poses_are_a_pairs_files_truth(models, tmp_path, form, call):
    status, out, _ = call("import", "--model", models[form], "-o", tmp_path / "out", "--json")
    assert (status, json.loads(out)) == (
        0, {"images": 4, "pairs": 3, "contradicted_images": []})
    pairs = read_pairs(tmp_path / "out" / "pairs.txt")
    assert [(p.name0, p.name1) for p in pairs] == [
        ("a.png", "b.png"),
        ("a.png", "c.png"),
        ("b.png", "c.png"),
    ]
    for pair in pairs:
        R, t = relative_pose(NAMES.index(pair.name0), NAMES.index(pair.name1))
        np.testing.assert_allclose(pair.R, R, atol=1e-12)
        np.testing.assert_allclose(pair.t, t, atol=1e-12)
        # The importer subtracts half a pixel from COLMAP's principal point.
        np.testing.assert_allclose(pair.K0, K, rtol=1e-15)
    camera = read_camera_set(tmp_path / "out" / "cameras.yaml")["camera_1"]
    assert (camera.cx, camera.cy, tuple(camera.k[:5])) == (CX, CY, (-0.1, 0.01, 0.001, 0, 0))


def test_the_choice_of_pairs(models, tmp_path, call, refuse):
    arguments = ("import", "--model", models["text"], "-o", tmp_path / "out")
    assert json.loads(call(*arguments, "--min-common-points", 10, "--json")[1])["pairs"] == 6
    assert (
        json.loads(call(*arguments, "--min-common-points", 0, "--sequential", 1, "--json")[1])[
            "pairs"
        ]
        == 3
    )
    (tmp_path / "pairs.txt").write_text("d.png a.png\n")
    assert (
        json.loads(call(*arguments, "--pairs", tmp_path / "pairs.txt", "--json")[1])["pairs"] == 1
    )
    [pair] = read_pairs(tmp_path / "out" / "pairs.txt")
    np.testing.assert_allclose(pair.R, relative_pose(3, 0)[0], atol=1e-12)
    (tmp_path / "pairs.txt").write_text("a.png b.png\na.png e.png\n")
    refuse("pairs.txt: line 2: e.png is not in", *arguments, "--pairs", tmp_path / "pairs.txt")
    refuse("no two images", *arguments, "--min-common-points", 41)


def test_trajectories_come_back(models, tmp_path, call):
    assert call("import", "--model", models["binary"], "-o", tmp_path)[0] == 0
    poses = trajectory.read_trajectory(tmp_path / "trajectory.tum")
    assert [time for time, _, _ in poses] == [0, 1, 2, 3]
    for i, (_, R, centre) in enumerate(poses):
        expected_R, t = camera_pose(i)
        np.testing.assert_allclose(R, expected_R, atol=1e-12)
        np.testing.assert_allclose(centre, -expected_R.T @ t, atol=1e-12)
    assert trajectory.times_of(["images/12.5.png", "13.25.png"]) == [12.5, 13.25]


def turned_about(line, pose):
    """A line of images.txt with another pose, from its eight numbers; else the line."""
    words = line.split()
    if line.startswith("#") or len(words) != 10:
        return line
    number, *q_and_t = map(float, words[:8])
    return " ".join([words[0], *map(repr, pose(q_and_t)), *words[8:]])


def as_centre(pose):
    R = conventions.rotation(pose[:4])
    return pose[:4] + (-R.T @ pose[4:]).tolist()


@pytest.mark.parametrize("pose", [
    lambda p: p[1:4] + p[:1] + p[4:],  # x y z w
    lambda p: [2 * v for v in p[:4]] + p[4:],
    as_centre,
    lambda p: p[:4] + [1000 * v for v in p[4:]]])
def test_a_model_whose_points_contradict_its_poses_is_refused(models, tmp_path, pose, refuse):
    for name in ("cameras.txt", "images.txt", "points3D.txt"):  # COLMAP 4 has poses in frames.txt
        shutil.copy(models["text"] / name, tmp_path)
    lines = (tmp_path / "images.txt").read_text().splitlines()
    (tmp_path / "images.txt").write_text("\n".join(turned_about(l, pose) for l in lines) + "\n")
    refuse("contradict the model's own points", "import", "--model", tmp_path, "-o", tmp_path / "o")


def test_one_image_that_its_points_contradict_is_named(models, tmp_path, call, refuse):
    for name in ("cameras.txt", "images.txt", "points3D.txt"):
        shutil.copy(models["text"] / name, tmp_path)
    lines = (tmp_path / "images.txt").read_text().splitlines()
    at = next(i for i, line in enumerate(lines) if line.endswith(NAMES[1]))
    lines[at] = turned_about(lines[at], lambda p: p[:4] + [p[4] + 1] + p[5:])
    (tmp_path / "images.txt").write_text("\n".join(lines) + "\n")
    arguments = ("import", "--model", tmp_path, "-o", tmp_path / "o")
    status, out, _ = call(*arguments)
    assert status == 0 and f"1 images contradict the model's own points ({NAMES[1]}: " in out
    assert json.loads(call(*arguments, "--json")[1])["contradicted_images"] == [NAMES[1]]
    text = (tmp_path / "cameras.txt").read_text()
    (tmp_path / "cameras.txt").write_text(text.replace(f" {WIDTH} ", f" {WIDTH // 4} "))
    refuse("outside its picture", *arguments)


def test_our_tools_read_the_pairs(exported, photographs, tmp_path, call):
    """Our own poses agree with a model that COLMAP made from our matches."""
    program = os.environ.get("TWOVIEW_PROGRAM", "")
    if not os.path.isfile(program):
        pytest.skip("TWOVIEW_PROGRAM names no program")
    from twoview_tools.colmap import mapping
    shutil.copy(exported["4"], tmp_path / "x.db")
    [model] = mapping.MAPPERS["4"](
        str(tmp_path / "x.db"), str(photographs / "images"), str(tmp_path / "m"), True
    )
    assert call("import", "--model", model, "-o", tmp_path / "out")[0] == 0
    subprocess.run(
        [
            program,
            "evaluate",
            tmp_path / "out" / "pairs.txt",
            "--images",
            photographs / "images",
            "-o",
            tmp_path / "report.json",
            "--quiet",
        ],
        check=True,
    )
    pairs = json.loads((tmp_path / "report.json").read_text())["pairs"]
    assert len(pairs) == 6 and max(pair["rotation_error_deg"] for pair in pairs) < 0.3


@pytest.mark.parametrize("schema", ["4", "3.8"])
def test_a_databases_matches_are_our_input(exported, models, tmp_path, schema, call):
    status, out, _ = call(
        "import",
        "--database",
        exported[schema],
        "--model",
        models["text"],
        "-o",
        tmp_path,
        "--json",
    )
    report = json.loads(out)
    assert status == 0 and report["num_pairs"] == 6 and report["auc"]["5"] > 85
    assert report == json.loads((tmp_path / "report.json").read_text())
    for pair in report["pairs"]:
        assert pair["rotation_error_deg"] < 0.3 and pair["num_inliers"] >= 25
        assert len(pair["R"]) == 9 and len(pair["t"]) == 3


def write_database(path, pixels, columns=6, with_matches=True, descriptors=None):
    """Writes a database with two images of one camera as pycolmap does."""
    with pycolmap.Database.open(path) as database:
        camera = pycolmap.Camera(
            model="PINHOLE", width=WIDTH, height=HEIGHT, params=[FX, FY, CX + 0.5, CY + 0.5]
        )
        camera.has_prior_focal_length = True
        camera.camera_id = database.write_camera(camera)
        for i in range(2):
            image_id = database.write_image(
                pycolmap.Image(name=NAMES[i], camera_id=camera.camera_id)
            )
            rows = np.ones((len(pixels[i]), columns), np.float32)
            rows[:, :2] = pixels[i] + 0.5
            database.write_keypoints(image_id, rows)
            if descriptors is not None:
                database.write_descriptors(image_id, pycolmap.FeatureDescriptors(
                    type=pycolmap.FeatureExtractorType.SIFT, data=descriptors))
        if with_matches:
            both = np.repeat(np.arange(len(pixels[0]), dtype=np.uint32)[:, None], 2, axis=1)
            database.write_matches(1, 2, both)


def views_of(points):
    camera = tv.Camera(WIDTH, HEIGHT, FX, FY, CX, CY)
    R, t = relative_pose(0, 1)
    return [
        tv.camera_project_points(camera, np.ascontiguousarray(p))[0]
        for p in (points, points @ R.T + t)
    ]


@pytest.mark.parametrize("schema", ["4", "3.8"])
def test_a_focal_length_that_colmap_guessed_is_no_truth(exported, models, tmp_path, schema, call):
    path = tmp_path / "x.db"
    shutil.copy(exported[schema], path)
    guess = np.array([1.3 * FX, 1.3 * FY, CX + 0.5, CY + 0.5])

    def errors(flag, *options):
        with contextlib.closing(sqlite3.connect(path)) as database:
            database.execute("UPDATE cameras SET params = ?, prior_focal_length = ?",
                             (guess.tobytes(), flag))
            database.commit()
        arguments = ("import", "--database", path, "--model", models["text"], "-o", tmp_path / "o")
        assert call(*arguments, *options)[0] == 0
        report = json.loads((tmp_path / "o" / "report.json").read_text())
        return report, np.median([pair["rotation_error_deg"] for pair in report["pairs"]])

    report, error = errors(0)
    assert report["guessed_focal_lengths"] == list(NAMES) and error < 0.5
    assert all(pair["focal_sigma"] == [0.3, 0.3] for pair in report["pairs"])
    exact, worse = errors(1)  # somebody gave it: it is the truth, however wrong
    assert exact["guessed_focal_lengths"] == [] and worse > 1.5
    assert all(pair["focal_sigma"] == [0, 0] for pair in exact["pairs"])
    # What the user states comes before the flag, in both directions.
    assert errors(0, "--focal-sigma", "0")[1] == worse
    assert errors(1, "--focal-sigma", "0.3")[1] == error
    assert errors(0, "--focal-sigma0", "0", "--focal-sigma1", "0")[1] == worse
    (tmp_path / "camera.yaml").write_text(OPENCV_CAMERA)
    given, best = errors(0, "--camera", tmp_path / "camera.yaml")
    assert given["guessed_focal_lengths"] == [] and best < 0.3


def test_the_summary_says_what_counts_as_guessed(exported, models, tmp_path, call, refuse):
    shutil.copy(exported["3.8"], tmp_path / "x.db")
    arguments = ("import", "--database", tmp_path / "x.db", "-o", tmp_path / "o")
    assert "guessed" not in call(*arguments)[1]
    with contextlib.closing(sqlite3.connect(tmp_path / "x.db")) as database:
        database.execute("UPDATE cameras SET prior_focal_length = 0")
        database.commit()
    assert "of 4 images was guessed (prior_focal_length 0) and counts as known to 30 %" in call(
        *arguments)[1]
    assert "counts as known to 20 %" in call(*arguments, "--focal-sigma", "0.2")[1]
    refuse("--focal-sigma", *arguments, "--focal-sigma", "0.6")
    # A model has no flag.
    assert "a model does not say which were guessed" in call(
        "import", "--model", models["text"], "-o", tmp_path / "m")[1]


@pytest.mark.parametrize("columns", [2, 4, 6])
def test_half_a_pixel_and_the_columns_of_keypoints(tmp_path, columns, call):
    write_database(tmp_path / "x.db", views_of(scene_points(80)), columns)
    status, out, _ = call(
        "import", "--database", tmp_path / "x.db", "-o", tmp_path / "out", "--json"
    )
    [pair] = json.loads(out)["pairs"]
    R, t = relative_pose(0, 1)
    assert status == 0 and pair["num_inliers"] == 80
    # Exact matches give the exact pose; an error of half a pixel in the principal point would give
    # 1e-3.
    np.testing.assert_allclose(np.reshape(pair["R"], (3, 3)), R, atol=2e-6)
    np.testing.assert_allclose(pair["t"], t / np.linalg.norm(t), atol=2e-5)


def test_without_matches_ours_are_made(tmp_path, call):
    descriptors = np.random.default_rng(1).integers(0, 120, (80, 128)).astype(np.uint8)
    write_database(
        tmp_path / "x.db", views_of(scene_points(80)), with_matches=False, descriptors=descriptors
    )
    status, out, _ = call(
        "import", "--database", tmp_path / "x.db", "-o", tmp_path / "out", "--json"
    )
    assert status == 0 and json.loads(out)["pairs"][0]["num_inliers"] == 80


ALIKED = "ALIKED_N16ROT"


@pytest.mark.parametrize("kind, columns, values, words", [
    (1, 512, "floats", ALIKED),
    (1, 128, "floats", ALIKED),  # 32 floats are 128 bytes, as SIFT's
    (4, 128, "sift", "LOMA_B128"),
    (99, 128, "sift", "features of type 99"),
    (0, 128, "floats", "their length is"),  # COLMAP 4 calls all descriptors of 3.8 SIFT's
    (None, 128, "floats", "their length is"),
    (None, 256, "floats", "256 bytes each, not 128"),
    (0, 64, "sift", "64 bytes each, not 128"),
    (0, 128, "none", "there are no descriptors"),
    (0, 128, "fewer", "80 keypoints and 79 descriptors"),
])
def test_descriptors_of_other_features_need_matches(tmp_path, kind, columns, values, words, refuse,
                                                    call):
    path = tmp_path / "x.db"
    write_database(path, views_of(scene_points(80)), with_matches=False,
                   descriptors=sift_like(80))
    random = np.random.default_rng(3)
    rows = random.standard_normal((80, columns // 4)).astype(np.float32)
    rows /= np.linalg.norm(rows, axis=1, keepdims=True)
    rows = sift_like(80)[:, :columns] if values != "floats" else rows
    rows = {"none": rows[:0], "fewer": rows[:79]}.get(values, rows)
    with contextlib.closing(sqlite3.connect(path)) as database:
        database.execute("UPDATE descriptors SET type = ?, rows = ?, cols = ?, data = ?",
                         (kind or 0, len(rows), columns, rows.tobytes()))
        if kind is None:  # a database of COLMAP 3 does not say it
            database.execute("ALTER TABLE descriptors DROP COLUMN type")
        database.commit()
    arguments = ("import", "--database", path, "-o", tmp_path / "out")
    refuse((words, "matches are needed"), *arguments)
    assert not (tmp_path / "out").exists()
    # With matches the descriptors are not needed, whatever they are.
    both = np.repeat(np.arange(80, dtype=np.uint32)[:, None], 2, axis=1)
    with contextlib.closing(sqlite3.connect(path)) as database:
        database.execute("INSERT INTO matches VALUES (?, 80, 2, ?)",
                         (2147483647 + 2, both.tobytes()))
        database.commit()
    [pair] = json.loads(call(*arguments, "--json")[1])["pairs"]
    assert pair["num_inliers"] == 80 and pair["matches_from"] == "matches"


def sift_like(count):
    rows = np.random.default_rng(1).exponential(1, (count, 128))
    return np.rint(rows / np.linalg.norm(rows, axis=1, keepdims=True) * 512).clip(0, 255).astype(
        np.uint8)


def test_pairs_without_matches_beside_pairs_with_them(exported, tmp_path, call):
    path = shutil.copy(exported["4"], tmp_path / "x.db")
    with contextlib.closing(sqlite3.connect(path)) as database:
        for table in ("matches", "two_view_geometries"):
            database.execute(f"DELETE FROM {table} WHERE pair_id != 2147483647 + 2")
        database.execute("UPDATE descriptors SET type = 2")
        database.commit()
    status, out, err = call("import", "--database", path, "-o", tmp_path / "out", "--sequential",
                            "1")
    assert status == 0, err
    assert "; 2 pairs have no matches: the descriptors are not SIFT's (ALIKED_N32)" in out
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert [pair["matches_from"] for pair in report["pairs"]] == ["matches", None, None]


def test_keypoints_that_are_no_numbers_are_counted(exported, tmp_path, call):
    path = tmp_path / "nan.db"
    shutil.copy(exported["4"], path)
    with contextlib.closing(sqlite3.connect(path)) as database, database:
        rows, cols = database.execute("SELECT rows, cols FROM keypoints WHERE image_id = 1"
                                      ).fetchone()
        database.execute("UPDATE keypoints SET data = ? WHERE image_id = 1",
                         (np.full((rows, cols), np.nan, np.float32).tobytes(),))
    status, out, _ = call("import", "--database", path, "-o", tmp_path / "out")
    assert status == 0 and f"{rows} keypoints of {NAMES[0]} are NaN or infinite" in out
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["invalid_keypoints"] == {NAMES[0]: rows}
    assert f"6 pairs, 3 with a pose, {sum(p['verdict'] == 'ok' for p in report['pairs'])} of" in out


def test_keypoints_outside_and_matches_of_other_columns_are_named(tmp_path, call, refuse):
    path = tmp_path / "x.db"
    write_database(path, views_of(scene_points(80)))
    arguments = ("import", "--database", path, "-o", tmp_path / "out")
    assert json.loads(call(*arguments, "--json")[1])["keypoints_outside"] == {}
    with contextlib.closing(sqlite3.connect(path)) as database, database:
        database.execute("UPDATE cameras SET width = width / 2")
    status, out, _ = call(*arguments)
    assert status == 0 and "is the camera of pictures of another size?" in out
    outside = json.loads((tmp_path / "out" / "report.json").read_text())["keypoints_outside"]
    assert sorted(outside) == list(NAMES[:2]) and 20 < outside[NAMES[0]] < 80
    with contextlib.closing(sqlite3.connect(path)) as database, database:
        database.execute("UPDATE matches SET rows = 2, cols = 80")
    refuse("2 x 80 indices, not 2 in a row", *arguments)


def test_a_fisheye_of_a_model_is_written_and_read_back(models, tmp_path, call):
    shutil.copytree(models["text"], tmp_path / "model")
    cameras = tmp_path / "model" / "cameras.txt"
    cameras.write_text(f"1 OPENCV_FISHEYE {WIDTH} {HEIGHT} {FX} {FY} {CX + 0.5} {CY + 0.5} "
                       "0.1 0.02 0 -0.001\n")
    status, _, err = call("import", "--model", tmp_path / "model", "-o", tmp_path / "out")
    assert status == 0, err
    (camera,) = read_camera_set(tmp_path / "out" / "cameras.yaml").values()
    assert camera.model == tv.CameraModel.KANNALA_BRANDT
    assert tuple(camera.k[:4]) == (0.1, 0.02, 0, -0.001)


@pytest.mark.parametrize("matches", ["no row", "a row of none", "as they were"])
def test_verified_geometries_alone_are_used(exported, models, tmp_path, matches, call, refuse):
    """As pipelines write them that verify their own matches; a pair of a watermark is none."""
    path = shutil.copy(exported["4"], tmp_path / "x.db")
    with contextlib.closing(sqlite3.connect(path)) as database:
        if matches == "no row":
            database.execute("DELETE FROM matches")
        elif matches == "a row of none":
            database.execute("UPDATE matches SET rows = 0, data = NULL")
        database.execute("UPDATE two_view_geometries SET F = NULL, E = NULL, H = NULL, "
                         "qvec = NULL, tvec = NULL, config = 9 WHERE pair_id = 2147483647 + 2")
        database.execute("UPDATE two_view_geometries SET config = 7 "
                         "WHERE pair_id = 2147483647 + 3")
        database.execute("UPDATE descriptors SET type = 1")
        database.commit()
    arguments = ("import", "--database", path, "--model", models["text"], "-o", tmp_path / "out")
    status, out, err = call(*arguments)
    assert status == 0, err
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    used = {(row["name0"], row["name1"]): row for row in report["pairs"]}
    origin = "matches" if matches == "as they were" else "two_view_geometries"
    assert used["a.png", "b.png"]["matches_from"] == origin
    assert used["a.png", "b.png"]["rotation_error_deg"] < 0.3
    words = "5 pairs are those that COLMAP has verified already"
    assert (words in out) == (matches != "as they were")
    watermark = used.get(("a.png", "c.png"))
    assert (watermark is None if matches == "no row" else
            watermark["num_matches"] == 0 if matches == "a row of none" else
            watermark["num_inliers"] > 25)
    with contextlib.closing(sqlite3.connect(path)) as database:
        database.execute("UPDATE keypoints SET rows = 0, data = NULL WHERE image_id = 2")
        database.commit()
    refuse("a match of a.png and b.png has no keypoint", *arguments)


BLANKS = {"a.png": "my a.png", "b.png": "my b.png", "c.png": "sub folder/c d.png",
          "d.png": "e\tf.png"}


@pytest.mark.parametrize("form, newline", [("text", "\n"), ("text", "\r\n"), ("binary", "\n")])
def test_names_with_blanks_are_whole_or_named(exported, models, tmp_path, form, newline, call,
                                              refuse):
    folder = shutil.copytree(models["text"], tmp_path / "model")
    lines = (folder / "images.txt").read_text().split("\n")
    lines = [" ".join([*line.split()[:9], BLANKS[line.split()[9]]])
             if line.endswith(".png") else line for line in lines]
    lines.insert(4, "# a comment")
    (folder / "images.txt").write_text("\n".join(lines), newline=newline)
    assert set(read_model(folder).images) == set(BLANKS.values())
    if form == "binary":
        found = pycolmap.Reconstruction(models["text"])
        for image in found.images.values():
            image.name = BLANKS[image.name]
        folder = tmp_path / "binary"
        folder.mkdir()
        found.write_binary(folder)
    refuse("a blank in its name", "import", "--model", folder, "-o", tmp_path / "out")
    assert not (tmp_path / "out").exists()
    # A database's report can hold them, and finds their truth.
    path = shutil.copy(exported["4"], tmp_path / "x.db")
    with contextlib.closing(sqlite3.connect(path)) as database:
        for name, other in BLANKS.items():
            database.execute("UPDATE images SET name = ? WHERE name = ?", (other, name))
        database.commit()
    status, out, _ = call("import", "--database", path, "--model", folder, "-o", tmp_path / "out",
                          "--json")
    report = json.loads(out)
    assert status == 0 and len(report["pairs"]) == 6
    assert all(pair["rotation_error_deg"] < 0.3 for pair in report["pairs"])


def test_an_images_line_without_points_is_followed_by_an_empty_one(models, tmp_path, refuse):
    folder = shutil.copytree(models["text"], tmp_path / "model")
    lines = (folder / "images.txt").read_text().split("\n")
    at = next(k for k, line in enumerate(lines) if line.endswith("b.png"))
    (folder / "points3D.txt").write_text("")
    lines = [("" if k and lines[k - 1].endswith(".png") else line) for k, line in enumerate(lines)]
    (folder / "images.txt").write_text("\n".join(lines))
    assert set(read_model(folder).images) == set(NAMES)
    lines[at] = lines[at].replace("b.png", "a.png")
    (folder / "images.txt").write_text("\n".join(lines))
    refuse("two images are called a.png", "import", "--model", folder, "-o", tmp_path / "out")


def test_what_is_no_model_or_no_database(models, tmp_path, refuse):
    refuse("no COLMAP model in it", "import", "--model", tmp_path, "-o", tmp_path / "out")
    broken = shutil.copytree(models["binary"], tmp_path / "broken")
    (broken / "images.bin").write_bytes((broken / "images.bin").read_bytes()[:40])
    refuse("broken: not a COLMAP model", "import", "--model", broken, "-o", tmp_path / "out")
    refuse("no such file", "import", "--database", tmp_path / "none.db", "-o", tmp_path / "out")
    (tmp_path / "x.db").write_bytes(b"no database at all" * 99)
    refuse("not a database", "import", "--database", tmp_path / "x.db", "-o", tmp_path / "out")
    refuse("needs --model or --database", "import", "-o", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_match_without_a_keypoint_is_named(tmp_path, refuse):
    write_database(tmp_path / "x.db", views_of(scene_points(20)))
    database = sqlite3.connect(tmp_path / "x.db")
    database.execute(
        "UPDATE keypoints SET rows = 19, data = substr(data, 1, 19 * 24) WHERE image_id = 2"
    )
    database.commit()
    database.close()
    refuse(
        "a match of a.png and b.png has no keypoint",
        "import",
        "--database",
        tmp_path / "x.db",
        "-o",
        tmp_path,
    )


def test_colmap_takes_the_clouds(photographs, tmp_path):
    """The clouds of reconstruct and odometry, which COLMAP and other programs import."""
    program = os.environ.get("TWOVIEW_PROGRAM", "")
    if not os.path.isfile(program):
        pytest.skip("TWOVIEW_PROGRAM names no program")
    (tmp_path / "cam.yaml").write_text(OPENCV_CAMERA)
    pictures = [photographs / "images" / name for name in NAMES[:2]]
    options = ("--camera", tmp_path / "cam.yaml", "--quiet", "-o", tmp_path / "out")
    for more in ((), ("--dense", "2000")):
        subprocess.run([program, "reconstruct", *pictures, *options, *more], check=True)
        points = read_ply(tmp_path / "out" / "cloud.ply")
        found = pycolmap.Reconstruction()
        found.import_PLY(tmp_path / "out" / "cloud.ply")
        assert found.num_points3D() == len(points) > 100
        colours = sorted(point.color.tolist() for point in found.points3D.values())
        assert colours == sorted([int(p["red"]), int(p["green"]), int(p["blue"])] for p in points)


# ---- tests of results written as COLMAP models -------------------------------------------------

def read_ply(path):
    """The vertices of a binary PLY: x y z, colour, angle, error."""
    data = path.read_bytes()
    head, body = data.split(b"end_header\n", 1)
    kinds = {"float": "<f4", "uchar": "u1"}
    fields = [(line.split()[2].decode(), kinds[line.split()[1].decode()])
              for line in head.split(b"\n") if line.startswith(b"property")]
    return np.frombuffer(body, np.dtype(fields))


@pytest.fixture(scope="module")
def result(photographs, tmp_path_factory):
    from twoview_tools.colmap.cli import main
    folder = tmp_path_factory.mktemp("result")
    (folder / "cam.yaml").write_text(OPENCV_CAMERA)
    assert (
        main(
            [
                "model",
                str(photographs / "images" / "a.png"),
                str(photographs / "images" / "c.png"),
                "--camera",
                str(folder / "cam.yaml"),
                "-o",
                str(folder / "out"),
                "--quiet",
            ]
        )
        == 0
    )
    return folder


def test_pycolmap_reads_a_result_and_reprojects_it(result):
    found = pycolmap.Reconstruction(result / "out")
    assert found.num_reg_images() == 2 and found.num_points3D() > 100
    assert found.cameras[1].params.tolist() == [FX, FY, CX + 0.5, CY + 0.5]
    stored = np.mean([point.error for point in found.points3D.values()])
    found.update_point_3d_errors()
    again = np.mean([point.error for point in found.points3D.values()])
    assert again < 0.5 and again == pytest.approx(stored, rel=0.5)
    pose = read_model(result / "out").images["c.png"]
    R, t = relative_pose(0, 2)
    assert (
        np.linalg.norm(pose.R - R) < 3e-3 and np.linalg.norm(pose.t - t / np.linalg.norm(t)) < 1e-2
    )


def test_a_focal_length_for_film_is_uncertain_in_a_model(photographs, tmp_path, call):
    images = photographs / "images"
    focal = 1.1 * np.sqrt(FX * FY) * np.hypot(36, 24) / np.hypot(WIDTH, HEIGHT)
    arguments = ("model", images / "a.png", images / "c.png", "--focal-35mm", f"{focal:.3f}")
    written = []
    for number, sigma in enumerate(((), ("--focal-sigma0", "0", "--focal-sigma1", "0"))):
        assert call(*arguments, "-o", tmp_path / str(number), *sigma)[0] == 0
        written.append(pycolmap.Reconstruction(tmp_path / str(number)).cameras[1].params[0])
    assert abs(written[0] / FX - 1) < 0.06 and abs(written[1] / FX - 1) > 0.06


def test_a_model_has_the_camera_that_its_points_are_of(bend, tmp_path, call):
    images = bend / "images"
    status, out, _ = call(
        "model",
        images / "000106.png",
        images / "000110.png",
        "--camera",
        bend / "cam.yaml",
        "-o",
        tmp_path,
        "--principal-point-sigma",
        "0.01",
        "--json",
    )
    shift = np.array(json.loads(out)["principal_point_shift_px"])
    assert status == 0 and -18 < shift[0] < -5 and abs(shift[1]) < 9
    found = pycolmap.Reconstruction(tmp_path)
    assert found.num_cameras() == 1
    np.testing.assert_allclose(
        found.cameras[1].params[2:], np.array([607.6928, 185.7157]) + shift, atol=1e-9
    )
    found.update_point_3d_errors()
    assert np.mean([point.error for point in found.points3D.values()]) < 0.5


def test_a_model_of_a_focal_length_and_of_smaller_images(photographs, tmp_path, call):
    images = [photographs / "images" / name for name in ("a.png", "c.png")]
    focal_35mm = FX * np.hypot(36, 24) / np.hypot(WIDTH, HEIGHT)
    status, _, err = call("model", *images, "--focal-35mm", focal_35mm, "--resize", WIDTH // 2,
                          "--focal-sigma0", 0, "--focal-sigma1", 0, "-o", tmp_path, "--quiet")
    assert status == 0, err
    found = read_model(tmp_path)
    camera = next(iter(found.cameras.values()))
    assert (camera.width, camera.height) == (WIDTH // 2, HEIGHT // 2)
    assert camera.params[0] == pytest.approx(FX / 2)
    R, _ = relative_pose(0, 2)
    trace = np.trace(found.images["c.png"].R @ R.T)
    angle = np.degrees(np.arccos(np.clip((trace - 1) / 2, -1, 1)))
    assert angle < 1


def test_a_model_comes_back_with_half_a_pixel_more(tmp_path):
    pixels = views_of(scene_points(5))
    R, t = relative_pose(0, 1)
    camera = tv.Camera(
        WIDTH, HEIGHT, FX, FY, CX, CY, tv.CameraModel.KANNALA_BRANDT, (0.1, 0.02, 0, 0)
    )
    model = TwoViewModel(
        ("a.png", "b c.png".replace(" ", "_")),
        (tv.Camera(WIDTH, HEIGHT, FX, FY, CX, CY), camera),
        R,
        t,
        tuple(pixels),
        scene_points(5),
        np.full((5, 3), 7, np.uint8),
        np.full(5, 0.25),
    )
    for name, text in text_model(model).items():
        (tmp_path / name).write_text(text)
    found = pycolmap.Reconstruction(tmp_path)
    for i, name in enumerate(model.names):
        image = found.find_image_with_name(name)
        np.testing.assert_array_equal([point.xy for point in image.points2D], pixels[i] + 0.5)
        assert [point.point3D_id for point in image.points2D] == [1, 2, 3, 4, 5]
        back = conventions.camera_from_colmap(read_model(tmp_path).cameras[image.camera_id], name)
        assert (back.cx, back.cy, back.model) == (CX, CY, model.cameras[i].model)
    np.testing.assert_array_equal([found.points3D[i + 1].xyz for i in range(5)], scene_points(5))
    np.testing.assert_allclose(
        importer.relative(*read_model(tmp_path).images.values())[0], R, atol=1e-15
    )


def test_the_cloud_of_reconstruct_is_the_models(result, photographs):
    """cloud.ply has the same points and colours as the COLMAP model of the same pair."""
    program = os.environ.get("TWOVIEW_PROGRAM", "")
    if not os.path.isfile(program):
        pytest.skip("TWOVIEW_PROGRAM names no program")
    images = photographs / "images"
    subprocess.run(
        [
            program,
            "reconstruct",
            images / "a.png",
            images / "c.png",
            "--camera",
            result / "cam.yaml",
            "-o",
            result / "cloud",
            "--quiet",
        ],
        check=True,
    )
    cloud = read_ply(result / "cloud" / "cloud.ply")
    found = pycolmap.Reconstruction(result / "out")
    points = [found.points3D[key] for key in sorted(found.points3D)]
    np.testing.assert_array_equal(np.array([p.xyz for p in points], np.float32),
                                  np.column_stack([cloud["x"], cloud["y"], cloud["z"]]))
    np.testing.assert_array_equal([p.color for p in points],
                                  np.column_stack([cloud["red"], cloud["green"], cloud["blue"]]))


def test_a_pair_without_a_pose_is_told(result, photographs, tmp_path, call, refuse):
    image = photographs / "images" / "a.png"
    copy = shutil.copy(image, tmp_path / "copy.png")
    status, _, err = call(
        "model", image, copy, "--camera", result / "cam.yaml", "-o", tmp_path / "out"
    )
    assert (status, err) == (3, "twoview: no full pose: no_motion\n") and not (
        tmp_path / "out"
    ).exists()
    refuse(
        "both images are called a.png",
        "model",
        image,
        image,
        "--camera",
        result / "cam.yaml",
        "-o",
        tmp_path,
    )
    without_width = "".join(
        line for line in CAMERA.splitlines(keepends=True) if "image_width" not in line
    )
    (tmp_path / "cam.yaml").write_text(without_width)
    refuse(
        "image_width",
        "model",
        image,
        copy,
        "--camera",
        tmp_path / "cam.yaml",
        "-o",
        tmp_path / "out",
    )
