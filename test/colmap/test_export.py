"""Tests of twoview colmap export: both schemas, the choice of pairs, --append, bad input,
interruption."""

import contextlib
import hashlib
import json
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import twoview as tv
from twoview_tools.colmap import exporter, schema38, settings
from twoview_tools.colmap.database import appended_database
from twoview_tools.colmap.errors import BadInput
from twoview_tools.colmap.images import decode, holds_more
from conftest import CAMERA, CX, CY, HEIGHT, NAMES, WIDTH, run, start

pycolmap = pytest.importorskip("pycolmap")
SCHEMAS = ("4", "3.8")
SHARED_COLUMNS = {
    "cameras": "*", "images": "image_id, name, camera_id", "keypoints": "*", "matches": "*",
    "descriptors": "image_id, rows, cols, data",
    "two_view_geometries": "pair_id, rows, cols, data, config, qvec, tvec, F, E, H"}


def rows_of(path, table):
    with contextlib.closing(sqlite3.connect(path)) as database:
        return database.execute(f"SELECT {SHARED_COLUMNS[table]} FROM {table}").fetchall()


def pairs_of(path):
    """The pairs of a database, as pairs of image names."""
    with contextlib.closing(sqlite3.connect(path)) as database:
        names = dict(database.execute("SELECT image_id, name FROM images"))
        return [
            tuple(names[i] for i in divmod(row[0], schema38.MAX_IMAGES))
            for row in database.execute("SELECT pair_id FROM two_view_geometries ORDER BY pair_id")
        ]


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def assert_nothing_else(folder, *names):
    assert sorted(os.listdir(folder)) == sorted(names)


# ---- tests of the database's content -----------------------------------------------------------

@pytest.mark.parametrize("table", SHARED_COLUMNS)
def test_both_schemas_hold_the_same_rows(exported, table):
    ours, theirs = (rows_of(exported[schema], table) for schema in SCHEMAS)
    assert len(ours) == len(theirs) > 0
    for row4, row38 in zip(ours, theirs):
        for value4, value38 in zip(row4, row38):
            if value4 is None:  # where schema 4 has NULL, that of 3.8 has zeros
                assert not any(np.frombuffer(value38))
            elif (
                table == "two_view_geometries"
                and isinstance(value4, bytes)
                and len(value4) in (24, 32, 72)
            ):
                np.testing.assert_allclose(
                    np.frombuffer(value4), np.frombuffer(value38), atol=1e-15
                )
            else:
                assert value4 == value38


def test_schema_38_is_that_of_debians_colmap(exported, tmp_path):
    if not shutil.which("colmap"):
        pytest.skip("no colmap: scripts/bootstrap test installs it")
    subprocess.run(
        ["colmap", "database_creator", "--database_path", tmp_path / "their.db"],
        check=True,
        capture_output=True,
        env={**os.environ, "QT_QPA_PLATFORM": "offscreen"},
    )

    def shape(path):
        with contextlib.closing(sqlite3.connect(path)) as database:
            tables = [
                row[0]
                for row in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")
            ]
            indices = database.execute(
                "SELECT name, tbl_name FROM sqlite_master WHERE type = 'index'"
            ).fetchall()
            return (
                database.execute("PRAGMA user_version").fetchone(),
                sorted(indices),
                {
                    t: (
                        database.execute(f"PRAGMA table_info({t})").fetchall(),
                        database.execute(f"PRAGMA foreign_key_list({t})").fetchall(),
                    )
                    for t in tables
                },
            )
    assert shape(exported["3.8"]) == shape(tmp_path / "their.db")


def test_features_are_the_librarys(exported, photographs):
    import cv2
    with pycolmap.Database.open(exported["4"]) as database:
        for name in NAMES:
            image = database.read_image_with_name(name)
            luma = cv2.imread(str(photographs / "images" / name), cv2.IMREAD_GRAYSCALE)
            most = settings.MAPPING_KEYPOINTS
            with tv.Context(max_width=WIDTH, max_height=HEIGHT, max_keypoints=most) as context:
                keypoints, descriptors = tv.extract(context, luma, max_keypoints=most)
            found = database.read_keypoints(image.image_id)
            np.testing.assert_array_equal(
                found[:, :2], np.column_stack([keypoints["x"], keypoints["y"]]) + 0.5
            )
            np.testing.assert_array_equal(
                database.read_descriptors(image.image_id).data, descriptors
            )
            camera = database.read_camera(image.camera_id)
            assert camera.has_prior_focal_length and camera.model.name == "PINHOLE"
            assert camera.params.tolist() == [520, 500, 330.5, 235.5]
        assert database.num_cameras() == database.num_rigs() == 1 and database.num_frames() == len(
            NAMES
        )


def test_geometries_are_there_and_agree_with_their_matches(exported):
    with pycolmap.Database.open(exported["4"]) as database:
        ids, rows = database.read_two_view_geometries()
        assert len(ids) == 6
        for pair, row in zip(ids, rows):
            id0, id1 = pycolmap.pair_id_to_image_pair(pair)
            matches = database.read_matches(id0, id1)
            assert row.config in (2, 4)  # COLMAP: 2 calibrated, 4 planar (most matches on the wall)
            assert {tuple(m) for m in row.inlier_matches} <= {tuple(m) for m in matches}
            pixels = [
                database.read_keypoints(i)[row.inlier_matches[:, k], :2]
                for k, i in enumerate((id0, id1))
            ]
            p0, p1 = (np.column_stack([p, np.ones(len(p))]) for p in pixels)
            lines = p0 @ row.F.T
            distance = np.abs((p1 * lines).sum(axis=1)) / np.linalg.norm(lines[:, :2], axis=1)
            assert len(distance) >= 25 and np.median(distance) < 0.5


@pytest.mark.parametrize("by", ["program", "function"])
def test_a_geometry_is_of_the_databases_camera(bend, tmp_path, call, by):
    """The exported geometry belongs to the database's camera, which all pairs share, even where the
    matches would move its principal point."""
    if by == "program":
        assert (
            call(
                "export",
                "--database",
                tmp_path / "x.db",
                "--images",
                bend / "images",
                "--camera",
                bend / "cam.yaml",
            )[0]
            == 0
        )
    else:
        exporter.export(
            exporter.Job(
                str(tmp_path / "x.db"),
                str(bend / "images"),
                cameras=(str(bend / "cam.yaml"),),
                quiet=True,
            )
        )
    with pycolmap.Database.open(tmp_path / "x.db") as database:
        [camera], (_, [row]) = database.read_all_cameras(), database.read_two_view_geometries()
        inverse = np.linalg.inv(camera.calibration_matrix())
        F = inverse.T @ row.E @ inverse
        np.testing.assert_allclose(row.F / np.linalg.norm(row.F), F / np.linalg.norm(F), atol=1e-9)


@pytest.mark.parametrize("schema", SCHEMAS)
def test_a_pair_that_is_named_the_other_way_round_is_the_same_row(
    exported, photographs, tmp_path, schema, call
):
    (tmp_path / "pairs.txt").write_text("c.png a.png\nd.png b.png\na.png c.png\n")
    assert (
        call(
            "export",
            "--database",
            tmp_path / "x.db",
            "--images",
            photographs / "images",
            "--pairs",
            tmp_path / "pairs.txt",
            "--schema",
            schema,
        )[0]
        == 0
    )
    assert pairs_of(tmp_path / "x.db") == [("a.png", "c.png"), ("b.png", "d.png")]
    expected = {row[0]: row for row in rows_of(exported[schema], "two_view_geometries")}
    for row in rows_of(tmp_path / "x.db", "two_view_geometries"):
        wanted = expected[row[0]]
        assert sorted(np.frombuffer(row[3], np.uint64)) == sorted(
            np.frombuffer(wanted[3], np.uint64)
        )
        assert row[4] == wanted[4]
        for mine, theirs in zip(row[5:], wanted[5:]):
            if mine is not None:
                np.testing.assert_allclose(
                    np.frombuffer(mine), np.frombuffer(theirs), rtol=1e-9, atol=1e-12
                )


def test_sequential_pairs_follow_the_names(photographs, tmp_path, call):
    assert (
        call(
            "export",
            "--database",
            tmp_path / "x.db",
            "--images",
            photographs / "images",
            "--sequential",
            "2",
            "--schema",
            "3.8",
        )[0]
        == 0
    )
    assert pairs_of(tmp_path / "x.db") == [
        ("a.png", "b.png"),
        ("a.png", "c.png"),
        ("b.png", "c.png"),
        ("b.png", "d.png"),
        ("c.png", "d.png"),
    ]


@pytest.mark.parametrize("schema", SCHEMAS)
def test_images_that_show_different_things_are_degenerate(tmp_path, schema, call):
    import cv2
    (tmp_path / "images").mkdir()
    for seed in (1, 2):
        noise = np.random.default_rng(seed).integers(0, 256, (120, 160)).astype(np.uint8)
        cv2.imwrite(str(tmp_path / "images" / f"{seed}.png"), cv2.GaussianBlur(noise, (0, 0), 1.5))
    (tmp_path / "cameras.yaml").write_text(
        CAMERA.replace(str(WIDTH), "160").replace(str(HEIGHT), "120")
        .replace(str(CX), "79.5").replace(str(CY), "59.5")
    )
    status, _, err = call(
        "export",
        "--database",
        tmp_path / "x.db",
        "--images",
        tmp_path / "images",
        "--schema",
        schema,
    )
    assert (status, err) == (3, "twoview: no pair has a geometry\n")
    [(_, rows, _, _, config, *_)] = rows_of(tmp_path / "x.db", "two_view_geometries")
    assert (rows, config) == (0, 1)


# ---- tests of the option --append --------------------------------------------------------------

@pytest.mark.parametrize("schema", SCHEMAS)
def test_append_adds_what_is_not_there(exported, photographs, tmp_path, schema, call):
    path = tmp_path / "x.db"
    (tmp_path / "pairs.txt").write_text("a.png b.png\n")
    arguments = (
        "export",
        "--database",
        path,
        "--images",
        photographs / "images",
        "--schema",
        schema,
    )
    assert call(*arguments, "--pairs", tmp_path / "pairs.txt")[0] == 0
    assert call(*arguments, "--append")[0] == 0
    for table in SHARED_COLUMNS:
        assert sorted(rows_of(path, table)) == sorted(rows_of(exported[schema], table))
    assert_nothing_else(tmp_path, "x.db", "pairs.txt")


@pytest.mark.parametrize("change", [
    "",  # made of 3.8's by COLMAP 4: its new columns stand at the end, and the old ones stay
    "ALTER TABLE two_view_geometries DROP COLUMN camera1;"  # as COLMAP 4.0 made it
    "ALTER TABLE two_view_geometries DROP COLUMN camera2; PRAGMA user_version = 4000400;",
    "ALTER TABLE images ADD COLUMN note TEXT;",
])
def test_append_takes_what_colmap_brought_over(exported, photographs, tmp_path, change, call):
    pycolmap = pytest.importorskip("pycolmap")
    path = shutil.copy(exported["3.8"], tmp_path / "x.db")
    pycolmap.Database.open(path).close()
    with contextlib.closing(sqlite3.connect(path)) as database:
        if sqlite3.sqlite_version_info < (3, 35) and "DROP" in change:
            pytest.skip("SQLite without DROP COLUMN")
        database.executescript(change)
    arguments = ("export", "--database", path, "--images", photographs / "images", "--append")
    status, out, err = call(*arguments)
    assert status == 0 and "4 images (0 new), 0 pairs (none new)" in out, err
    with pycolmap.Database.open(path) as database:
        assert len(database.read_all_images()) == 4 == len(database.read_all_frames())


def test_the_mapper_takes_what_was_appended_to_a_migrated_database(photographs, tmp_path, call):
    """Images of before, which COLMAP gives no frame, beside one that was added with a frame."""
    pycolmap = pytest.importorskip("pycolmap")
    (tmp_path / "three.txt").write_text("a.png b.png\na.png c.png\nb.png c.png\n")
    arguments = ("export", "--database", tmp_path / "x.db", "--images", photographs / "images")
    assert call(*arguments, "--pairs", tmp_path / "three.txt", "--schema", "3.8")[0] == 0
    pycolmap.Database.open(tmp_path / "x.db").close()
    status, out, err = call(*arguments, "--append")
    assert status == 0 and "4 images (1 new), 3 pairs" in out, err
    (tmp_path / "models").mkdir()
    models = pycolmap.incremental_mapping(tmp_path / "x.db", photographs / "images",
                                          tmp_path / "models")
    assert models[0].num_reg_images() == 4


@pytest.mark.parametrize("change, words", [
    ("CREATE TABLE other (x INTEGER)", "another table other"),
    ("ALTER TABLE images ADD COLUMN kind INTEGER NOT NULL DEFAULT 3", ""),
    ("CREATE TABLE new (image_id INTEGER PRIMARY KEY, name TEXT, camera_id INTEGER, "
     "kind TEXT NOT NULL); DROP TABLE images; ALTER TABLE new RENAME TO images",
     "a column kind in images that must be filled"),
    ("ALTER TABLE keypoints RENAME COLUMN data TO d", "does not open it"),
])
def test_append_names_the_table_that_differs(exported, photographs, tmp_path, change, words, refuse,
                                             call):
    path = shutil.copy(exported["4"], tmp_path / "x.db")
    with contextlib.closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA legacy_alter_table = ON")
        database.executescript(change)
    before = digest(path)
    arguments = ("export", "--database", path, "--images", photographs / "images", "--append")
    if not words:
        assert call(*arguments)[0] == 0
        return
    refuse(words, *arguments)
    assert digest(path) == before


def test_append_refuses_what_contradicts(exported, photographs, tmp_path, refuse):
    path = shutil.copy(exported["3.8"], tmp_path / "x.db")
    before = digest(path)
    arguments = (
        "export",
        "--database",
        path,
        "--images",
        photographs / "images",
        "--schema",
        "3.8",
        "--append",
    )
    refuse("a.png is there with other keypoints", *arguments, "--max-keypoints", 100)
    (tmp_path / "cam.yaml").write_text(CAMERA.replace("fx: 520", "fx: 521"))
    refuse("a.png is there with another camera", *arguments, "--camera", tmp_path / "cam.yaml")
    refuse("no such file", *(arguments[:2] + (tmp_path / "none.db",) + arguments[3:]))
    assert digest(path) == before
    assert_nothing_else(tmp_path, "x.db", "cam.yaml")


# ---- tests with bad input, which export must refuse --------------------------------------------

@pytest.mark.parametrize("schema", SCHEMAS)
def test_a_database_that_is_there_is_left_alone(exported, photographs, tmp_path, schema, refuse):
    path = shutil.copy(exported[schema], tmp_path / "x.db")
    before = digest(path)
    refuse(
        "x.db: there already (--append",
        "export",
        "--database",
        path,
        "--images",
        photographs / "images",
        "--schema",
        schema,
    )
    assert digest(path) == before
    assert_nothing_else(tmp_path, "x.db")


def test_a_journal_of_another_database_is_refused(photographs, tmp_path, refuse):
    (tmp_path / "x.db-wal").write_bytes(b"old")
    refuse(
        "x.db-wal: left there",
        "export",
        "--database",
        tmp_path / "x.db",
        "--images",
        photographs / "images",
    )
    assert_nothing_else(tmp_path, "x.db-wal")


@pytest.mark.parametrize("schema", SCHEMAS)
def test_a_locked_database_is_refused(exported, photographs, tmp_path, schema, refuse):
    path = shutil.copy(exported[schema], tmp_path / "x.db")
    with contextlib.closing(sqlite3.connect(path)) as other:
        other.execute("BEGIN IMMEDIATE")
        refuse(
            "x.db: locked",
            "export",
            "--database",
            path,
            "--images",
            photographs / "images",
            "--schema",
            schema,
            "--append",
        )
    assert_nothing_else(tmp_path, "x.db")


def test_a_lock_that_comes_during_the_work_is_told(exported, tmp_path):
    path = shutil.copy(exported["3.8"], tmp_path / "x.db")
    with contextlib.closing(sqlite3.connect(path)) as other:
        with pytest.raises(BadInput, match="x.db: locked"):
            with appended_database(str(path), schema38):
                other.execute("BEGIN IMMEDIATE")
    assert_nothing_else(tmp_path, "x.db")


def test_another_versions_database_is_refused(exported, photographs, tmp_path, refuse):
    arguments = ("--images", photographs / "images", "--append")
    for schema, other in (("4", "3.8"), ("3.8", "4")):
        path = shutil.copy(exported[other], tmp_path / "x.db")
        before = digest(path)
        refuse(
            ("x.db: made by COLMAP " + other, "--schema " + schema),
            "export",
            "--database",
            path,
            "--schema",
            schema,
            *arguments,
        )
        assert digest(path) == before
    refuse("COLMAP 4 brings it over", "export", "--database",
           shutil.copy(exported["3.8"], tmp_path / "x.db"), *arguments)
    (tmp_path / "x.db").write_bytes(b"nothing that SQLite knows" * 100)
    refuse("x.db: not a database", "export", "--database", tmp_path / "x.db", *arguments)
    (tmp_path / "x.db").write_bytes(b"")
    refuse("made by no COLMAP", "export", "--database", tmp_path / "x.db", *arguments)


@pytest.mark.parametrize("line, words", [
    ("a.png\n", "1 fields, not "
                "38"), ("a.png b.png 0 0 "
                        "1\n", "5 fields"), ("a.png b.png x 0\n", "'x' is no number"),
    ("a.png b.png 0 nan\n", "not finite"), ("a.png a.png\n", "paired with itself"),
    ("a.png b.png 0 0 " + "1 0 0 0 1 0 0 0 2 " * 2 + "\n", "K0 is not"),
    ("a.png b.png 0 0 " + "500 0 9 0 500 9 0 0 1 " * 2 + "1 " * 16 + "\n", "no rotation"),
    ("a.png b.png 0 0 " + "1 0 0 0 1 0 0 0 1 " * 2 + "\n", "K0 is normalised"),
    ("a.png missing.png\n", "no image missing.png in"),
    ("a.png b.png 0 0 "
     "" + "500 0 9 0 500 9 0 0 1 " * 2 + "\na.png c.png 0 0 " + "501 0 9 0 501 9 0 0 1 " * 2,
     "a.png has another K"),
])
def test_a_broken_line_is_named_by_its_number(photographs, tmp_path, line, words, refuse):
    (tmp_path / "pairs.txt").write_text("# heading\n\nb.png c.png\n" + line)
    number = "line 5: " if "another K" in words else "line 4: "
    refuse(("pairs.txt: " + number, words), "export", "--database", tmp_path / "x.db", "--images",
           photographs / "images", "--pairs", tmp_path / "pairs.txt")
    assert_nothing_else(tmp_path, "pairs.txt")


def test_images_and_folders_that_are_missing_or_broken(photographs, tmp_path, refuse):
    images = tmp_path / "images"
    arguments = ("export", "--database", tmp_path / "x.db", "--images", images)
    refuse("images: no such folder", *arguments)
    images.mkdir()
    refuse("0 images in it", *arguments)
    shutil.copy(photographs / "images" / "a.png", images)
    (images / "b.png").write_bytes((photographs / "images" / "b.png").read_bytes()[:100])
    refuse("no camera for it", *arguments)
    (tmp_path / "cameras.yaml").write_text(CAMERA)
    refuse("b.png is no image", *arguments)
    (tmp_path / "cameras.yaml").write_text(CAMERA.replace(str(WIDTH), "641"))
    refuse("a.png is 640x480, but its camera is for 641x480", *arguments)
    (tmp_path / "cameras.yaml").write_text(CAMERA.replace("fx: 520", "fx: wide"))
    refuse("cameras.yaml: camera: fx is no number", *arguments)
    refuse(
        "none: no such folder",
        "export",
        "--database",
        tmp_path / "none" / "x.db",
        "--images",
        images,
    )
    assert_nothing_else(tmp_path, "images", "cameras.yaml")


def test_a_focal_length_and_a_size_stand_in_for_a_camera_file(photographs, tmp_path, call):
    from twoview_tools.colmap.database import read_cameras, read_keypoints, reading
    for name in NAMES[:2]:
        shutil.copy(photographs / "images" / name, tmp_path / name)
    database = tmp_path / "x.db"
    status, _, err = call("export", "--database", database, "--images", tmp_path, "--focal-35mm",
                          "28", "--resize", WIDTH // 2, "--schema", "3.8")
    assert status == 0, err
    half, height = WIDTH // 2, HEIGHT // 2
    with reading(str(database)) as found:
        (camera,) = read_cameras(found).values()
        keypoints = read_keypoints(found, str(database), 1)
    assert (camera.model, camera.width, camera.height) == ("PINHOLE", half, height)
    focal = 28 * np.hypot(WIDTH, HEIGHT) / np.hypot(36, 24) / 2
    np.testing.assert_allclose(camera.params, [focal, focal, half / 2, height / 2], atol=1e-9)
    assert keypoints[:, 0].max() < half and keypoints[:, 1].max() < height


@pytest.mark.parametrize("more", [(), ("--resize", WIDTH // 2)])
def test_a_mask_leaves_a_part_of_the_images_out(photographs, tmp_path, call, refuse, more):
    import cv2
    from twoview_tools.colmap.database import read_keypoints, reading
    edge = 400
    mask = np.full((HEIGHT, WIDTH), 255, np.uint8)
    mask[:, edge:] = 0
    (tmp_path / "masks").mkdir()
    for name, suffix in ((NAMES[0], ".png"), (os.path.splitext(NAMES[1])[0], ".png")):
        cv2.imwrite(str(tmp_path / "masks" / (name + suffix)), mask)
    cv2.imwrite(str(tmp_path / "one.png"), mask)
    (tmp_path / "images").mkdir()
    for name in NAMES[:2]:
        shutil.copy(photographs / "images" / name, tmp_path / "images" / name)
    base = ("export", "--images", tmp_path / "images", "--focal-35mm", "28", "--schema", "3.8",
            *more)
    for given in ("masks", "one.png"):
        database = tmp_path / f"{given}.db"
        status, _, err = call(*base, "--database", database, "--mask", tmp_path / given)
        assert status == 0, err
        with reading(str(database)) as found:
            for image in (1, 2):
                x = read_keypoints(found, str(database), image)[:, 0]
                assert len(x) > 100 and x.max() < (edge / 2 if more else edge) + 2
    database = ("--database", tmp_path / "x.db")
    refuse(("--mask", "no such file"), *base, *database, "--mask", tmp_path / "none")
    cv2.imwrite(str(tmp_path / "one.png"), mask[:100])
    refuse(("640x100", "640x480"), *base, *database, "--mask", tmp_path / "one.png")
    cv2.imwrite(str(tmp_path / "one.png"), mask * 0)
    refuse("black all over", *base, *database, "--mask", tmp_path / "one.png")
    cv2.imwrite(str(tmp_path / "one.png"), np.zeros((HEIGHT, WIDTH, 4), np.uint8))
    refuse("transparent", *base, *database, "--mask", tmp_path / "one.png")
    (tmp_path / "masks" / (NAMES[0] + ".png")).unlink()
    refuse(("no mask of", NAMES[0]), *base, *database, "--mask", tmp_path / "masks")


@pytest.mark.parametrize("edge,words", [(400, ""), (WIDTH, "leaves nothing out"),
                                        (160, "leaves 75 % of the picture out: black is")])
def test_masks_without_black_and_of_much_of_a_picture_are_noted(tmp_path, capfd, edge, words):
    import cv2
    from twoview_tools.colmap.masks import Masks
    mask = np.full((HEIGHT, WIDTH), 255, np.uint8)
    mask[:, edge:] = 0
    cv2.imwrite(str(tmp_path / "one.png"), mask)
    masks = Masks(str(tmp_path / "one.png"))
    for name in NAMES[:2]:  # one line for all
        assert masks.of(name, mask) is not None
    said = capfd.readouterr().err
    assert said.count("\n") == bool(words) and words in said


def test_large_photographs_get_the_advice_to_make_them_smaller(tmp_path, call):
    import cv2
    random = np.random.default_rng(1)
    for name in "ab":
        image = random.integers(0, 256, (8, 345), np.uint8)
        cv2.imwrite(str(tmp_path / f"{name}.png"), cv2.resize(image, (2070, 48)))
    base = ("export", "--images", tmp_path, "--focal-35mm", "28", "--schema", "3.8", "--json")
    for number, more in enumerate(((), ("--resize", "0"), ("--resize", "1600"))):
        status, out, err = call(*base, *more, "--database", tmp_path / f"{number}.db")
        assert status in (0, 3) and json.loads(out)["images"] == 2, err
        notes = [line for line in err.splitlines() if "note" in line]
        assert notes == ([] if more else [
            "twoview: note: images above 2048 pixels a side are used as they are: a.png is "
            "2070x48; --resize 1600 is advised"])


def test_pictures_that_are_not_read_are_named(photographs, tmp_path, call, refuse):
    heic = b"\0\0\0\x18ftypheic\0\0\0\0mif1miaf" + bytes(64)
    (tmp_path / "p.heic").write_bytes(heic)
    base = ("export", "--database", tmp_path / "x.db", "--images", tmp_path, "--focal-35mm", "28",
            "--schema", "3.8")
    refuse(("0 images in it", "p.heic is a HEIC picture, which is not read", "JPEG"), *base)
    for name in NAMES[:2]:
        shutil.copy(photographs / "images" / name, tmp_path / name)
    status, _, err = call(*base)
    assert status == 0, err
    assert f"twoview: note: 1 picture of {tmp_path} is left out: p.heic is a HEIC picture" in err
    (tmp_path / NAMES[0]).write_bytes(heic)
    (tmp_path / "x.db").unlink()
    status, _, err = call(*base)
    assert status == 2 and f"{NAMES[0]} is a HEIC picture" in err


def test_hidden_and_damaged_pictures_are_left_out(photographs, tmp_path, call):
    cv2 = pytest.importorskip("cv2")
    for name in NAMES[:2]:
        shutil.copy(photographs / "images" / name, tmp_path / name)
    (tmp_path / f"._{NAMES[0]}").write_bytes(b"\0\5\x16\7")
    (tmp_path / "zz.png").write_bytes((tmp_path / NAMES[0]).read_bytes()[:900])
    first = Path(NAMES[0])
    shutil.copy(tmp_path / first, tmp_path / f"{first.stem} (1){first.suffix}")
    cv2.imwrite(str(tmp_path / f"{first.stem} - Copy{first.suffix}"),
                cv2.imread(str(tmp_path / first)) // 2)
    shutil.copy(tmp_path / first, tmp_path / f"{first.stem}.pgm")
    status, out, err = call("export", "--database", tmp_path / "x.db", "--images", tmp_path,
                            "--focal-35mm", "28", "--schema", "3.8", "--json")
    assert status == 0, err
    assert json.loads(out)["images"] == 2 and json.loads(out)["pairs"] == 1
    assert f"4 pictures of {tmp_path} are left out: ._{NAMES[0]} is a hidden file" in err
    assert f"{first.stem}.pgm has the name of another picture, but for the ending" in err
    assert "is a copy of another picture, by its name and its look (so are 1 more)" in err
    assert f"1 picture of {tmp_path} is left out: zz.png " in err


def test_files_of_several_pictures_are_named(tmp_path):
    Image = pytest.importorskip("PIL.Image")
    pages = [Image.new("L", (32, 24), grey) for grey in (10, 200)]
    for ending in ("tif", "png", "webp"):
        for more in ([], pages[1:]):
            path = tmp_path / f"{len(more)}.{ending}"
            pages[0].save(path, save_all=bool(more), append_images=more)
            assert holds_more(path) == bool(more), path


def test_a_picture_of_360_degrees_is_refused(tmp_path):
    Image = pytest.importorskip("PIL.Image")
    path = tmp_path / "theta.jpg"
    for kind, is_refused in (("equirectangular", True), ("rectilinear", False)):
        Image.new("L", (32, 24), 9).save(
            path, xmp=f'<x GPano:ProjectionType="{kind}"/>'.encode())
        if is_refused:
            with pytest.raises(BadInput, match="a panorama .equirectangular, by its XMP"):
                decode(str(path))
        else:
            assert decode(str(path)).shape == (24, 32)


def test_bad_arguments_are_one_line(tmp_path, refuse):
    base = ("export", "--database", tmp_path / "x.db", "--images", tmp_path)
    refuse("--orientation", *base, "--orientation", "sideways")
    refuse("--sequential", *base, "--sequential", "0")
    refuse("not allowed with", *base, "--exhaustive", "--sequential", "2")
    refuse("--schema", *base, "--schema", "3.9")
    for text in ("nan", "32,34", "0"):
        refuse(("--focal-35mm", "decimal point", text), *base, "--focal-35mm", text)
    refuse(("--resize", "-3"), *base, "--resize=-3")
    refuse("either --camera or --focal-35mm", *base, "--camera", "c", "--focal-35mm", "30")
    refuse("--images", "export", "--database", tmp_path / "x.db")


def test_a_package_that_is_missing_is_told(photographs, tmp_path, refuse, monkeypatch):
    arguments = ("export", "--database", tmp_path / "x.db", "--images", photographs / "images")
    for package, schema, words in (
        ("pycolmap", "4", "needs pycolmap (pip install pycolmap"),
        ("cv2", "3.8", "cv2"),
    ):
        monkeypatch.setitem(sys.modules, package, None)
        refuse(words, *arguments, "--schema", schema)
    assert_nothing_else(tmp_path)


@pytest.mark.parametrize("append", [False, True])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_leaves_what_was_there(exported, photographs, tmp_path, append, number):
    images = tmp_path / "images"
    images.mkdir()
    for i in range(60):
        shutil.copy(photographs / "images" / NAMES[i % 4], images / f"{i:02}_{NAMES[i % 4]}")
    (tmp_path / "cameras.yaml").write_text(CAMERA)
    before = None
    if append:
        shutil.copy(exported["4"], tmp_path / "x.db")
        before = digest(tmp_path / "x.db")
    process = start(
        "export", "--database", tmp_path / "x.db", "--images", images, *["--append"] * append
    )
    deadline = time.monotonic() + 30
    # The file .x.db.* shows that the export has begun to write.
    while not any(name.startswith(".x.db.") for name in os.listdir(tmp_path)):
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)
    time.sleep(0.3)
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    assert (process.returncode, out, err) == (-number, "", "")
    assert_nothing_else(tmp_path, "images", "cameras.yaml", *["x.db"] * append)
    assert not append or digest(tmp_path / "x.db") == before


def test_json_is_alone_on_stdout(photographs, tmp_path):
    import json
    out = run(
        "export", "--database", tmp_path / "x.db", "--images", photographs / "images", "--json"
    )
    assert sum(json.loads(out)["configurations"].values()) == json.loads(out)["pairs_verified"] == 6


# ---- tests that a corner is exported as one keypoint -------------------------------------------

def test_a_corner_with_two_orientations_is_one_keypoint_to_the_mapper():
    keypoints = np.zeros(5, tv.KEYPOINT)
    keypoints["x"], keypoints["y"] = (4, 7, 4, 4, 7), (1, 2, 1, 2, 2)
    keypoints["angle_rad"] = range(5)
    assert exporter.one_keypoint_a_place(keypoints).tolist() == [0, 1, 0, 3, 1]
    matches = np.array([[0, 5], [0, 6], [1, 5], [2, 7], [0, 5]])
    assert exporter.one_to_one(matches, [1, 0, 2, 3, 4]).tolist() == [1, 2, 3]
    assert exporter.one_to_one(matches, [0, 1, 2, 3, 4]).tolist() == [0, 3]
    assert exporter.one_to_one(matches[:0], []).tolist() == []


def test_no_keypoint_is_in_two_matches_of_a_pair(exported):
    with pycolmap.Database.open(exported["4"]) as database:
        for pair, row in zip(*database.read_two_view_geometries()):
            ids = pycolmap.pair_id_to_image_pair(pair)
            for matches in (row.inlier_matches, database.read_matches(*ids)):
                for k, image_id in enumerate(ids):
                    places = database.read_keypoints(image_id)[matches[:, k], :2]
                    assert len(np.unique(places, axis=0)) == len(places)
