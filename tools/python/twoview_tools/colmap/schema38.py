"""Writes the database of COLMAP 3.8, Debian's `colmap`. Matrices are row-major doubles, matches
uint32, keypoints float32. The id of a pair is id1 * 2147483647 + id2 with id1 < id2."""

import contextlib
import sqlite3

import numpy as np

from .conventions import MODEL_IDS, quaternion

NAME = "3.8"
USER_VERSION = 3800
MAX_IMAGES = 2147483647

_TABLES = """
CREATE TABLE cameras (
  camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, model INTEGER NOT NULL, width INTEGER NOT \
NULL,
  height INTEGER NOT NULL, params BLOB, prior_focal_length INTEGER NOT NULL);
CREATE TABLE images (
  image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, name TEXT NOT NULL UNIQUE, camera_id \
INTEGER NOT NULL,
  prior_qw REAL, prior_qx REAL, prior_qy REAL, prior_qz REAL, prior_tx REAL, prior_ty REAL, \
prior_tz REAL,
  CONSTRAINT image_id_check CHECK(image_id >= 0 and image_id < 2147483647),
  FOREIGN KEY(camera_id) REFERENCES cameras(camera_id));
CREATE UNIQUE INDEX index_name ON images(name);
CREATE TABLE keypoints (
  image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB,
  FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE descriptors (
  image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB,
  FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE matches (
  pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB);
CREATE TABLE two_view_geometries (
  pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB,
  config INTEGER NOT NULL, F BLOB, E BLOB, H BLOB, qvec BLOB, tvec BLOB);
"""


def prepare():
    """Does nothing: this schema needs only SQLite, which Python always has."""


def create(path):
    with contextlib.closing(sqlite3.connect(path)) as database, database:
        database.executescript(_TABLES)
        database.execute(f"PRAGMA user_version = {USER_VERSION}")


def bring_over(path):
    """Does nothing: no older database becomes one of this schema."""


def pair_id(id0, id1):
    return min(id0, id1) * MAX_IMAGES + max(id0, id1)


def _doubles(values, absent):
    """The bytes of a matrix. COLMAP 3.8 reads every matrix of a pair, so an unknown one is stored
    as COLMAP's default."""
    return np.ascontiguousarray(absent if values is None else values, np.float64).tobytes()


class Writer:
    """Adds rows to a COLMAP 3.8 database; commit() makes them permanent."""

    def __init__(self, path):
        self.database = sqlite3.connect(path)
        self.database.execute("PRAGMA foreign_keys = ON")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.database.close()

    def commit(self):
        self.database.commit()

    def add_camera(self, camera):
        params = np.array(camera.params, np.float64).tobytes()
        return self.database.execute(
            "INSERT INTO cameras (model, width, height, params, prior_focal_length) VALUES (?, ?, "
            "?, ?, 1)",
            (MODEL_IDS[camera.model], camera.width, camera.height, params)).lastrowid

    def add_image(self, name, camera_id):
        return self.database.execute("INSERT INTO images (name, camera_id) VALUES (?, ?)",
                                     (name, camera_id)).lastrowid

    def add_features(self, image_id, keypoints, descriptors):
        for table, rows in (("keypoints", keypoints), ("descriptors", descriptors)):
            self.database.execute(f"INSERT INTO {table} (image_id, rows, cols, data) VALUES (?, ?, "
                                  f"?, ?)",
                                  (image_id, *rows.shape, rows.tobytes()))

    def add_pair(self, id0, id1, matches, geometry):
        if id0 > id1:
            id0, id1, matches, geometry = id1, id0, matches[:, ::-1], geometry.swapped()
        matches = np.ascontiguousarray(matches, np.uint32)
        self.database.execute("INSERT INTO matches (pair_id, rows, cols, data) VALUES (?, ?, 2, ?)",
                              (pair_id(id0, id1), len(matches), matches.tobytes()))
        g = geometry
        qvec = None if g.R is None else quaternion(g.R)
        self.database.execute(
            "INSERT INTO two_view_geometries (pair_id, rows, cols, data, config, F, E, H, qvec, "
            "tvec) "
            "VALUES (?, ?, 2, ?, ?, ?, ?, ?, ?, ?)",
            (pair_id(id0, id1), len(g.inlier_matches), g.inlier_matches.tobytes(), g.config,
             *(_doubles(m, np.zeros((3, 3))) for m in (g.F, g.E, g.H)),
             _doubles(qvec, [1, 0, 0, 0]),
             _doubles(g.t, np.zeros(3))))
