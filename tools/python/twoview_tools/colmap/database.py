"""Writes a database file so that it appears, or grows, completely or not at all; and reads a
database with SQL that works for every COLMAP version."""

import contextlib
import os
import sqlite3
import tempfile
from dataclasses import dataclass

import numpy as np

from . import schema4, schema38
from .conventions import MODEL_IDS, WATERMARK, ColmapCamera
from .errors import BadInput

SCHEMAS = {schema.NAME: schema for schema in (schema4, schema38)}
_LEFT_BEHIND = ("-wal", "-journal", "-shm")
# The column `type` of COLMAP 4's descriptors; -1 is "undefined".
_FEATURE_KINDS = {0: "SIFT", 1: "ALIKED_N16ROT", 2: "ALIKED_N32", 3: "LOMA_B", 4: "LOMA_B128"}
_NOBODY = "no COLMAP"
_BUSY, _LOCKED = 5, 6  # SQLite's error codes, which Python's module names from 3.11 on


def _columns(database):
    """Returns {table: columns} of all tables of the database except SQLite's own."""
    tables = [row[0] for row in database.execute(
        "SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite_%'")]
    return {
        table: [row[1] for row in database.execute(f"PRAGMA table_info('{table}')")]
        for table in tables
    }


def maker_of(database):
    """A description of the COLMAP version that made the database; _NOBODY if none did."""
    version = database.execute("PRAGMA user_version").fetchone()[0]
    if not {"cameras", "images", "two_view_geometries"} <= set(_columns(database)):
        return _NOBODY
    if version >= 1000000:
        return f"COLMAP {version // 1000000}.{version // 10000 % 100}.{version // 100 % 100}"
    return (
        f"COLMAP {version // 1000}.{version // 100 % 10}"
        if version
        else "a COLMAP that gives no version"
    )


def _explain(path, error):
    words = str(error)
    if "locked" in words or "busy" in words:
        return BadInput(f"{path}: locked by another program")
    if "not a database" in words or "malformed" in words:
        return BadInput(f"{path}: not a database")
    return BadInput(f"{path}: {words}")


@contextlib.contextmanager
def reading(path):
    """An sqlite3 connection that is read-only; errors become BadInput with a clear message."""
    if not os.path.isfile(path):
        raise BadInput(f"{path}: no such file")
    try:
        uri = "file:" + os.path.abspath(path).replace("%", "%25").replace("?", "%3f").replace(
            "#", "%23"
        )
        with contextlib.closing(sqlite3.connect(uri + "?mode=ro", uri=True, timeout=1)) as database:
            database.execute("SELECT count(*) FROM sqlite_master")
            yield database
    except sqlite3.Error as error:
        raise _explain(path, error) from None


def _series(database):
    """The first number of the COLMAP version that stamped the database; 0 where none did."""
    version = database.execute("PRAGMA user_version").fetchone()[0]
    return version // 1000000 or version // 1000


def _difference(database, fresh):
    """What keeps rows from being added as to `fresh`; empty where nothing does. The order of the
    columns does not: COLMAP that brings an older database over adds its new columns at the end and
    drops none. A column that is there besides must take rows that do not name it."""
    found, wanted = _columns(database), _columns(fresh)
    for table in sorted(found.keys() ^ wanted.keys()):
        return f"{'another' if table in found else 'no'} table {table}"
    for table, columns in wanted.items():
        for name in sorted(set(columns) - set(found[table])):
            return f"no column {name} in {table}"
        for _, name, _, not_null, default, is_key in database.execute(
                f"PRAGMA table_info('{table}')"):
            if name not in columns and not_null and default is None and not is_key:
                return f"a column {name} in {table} that must be filled"
    return ""


def _require_schema(made, path, schema, folder):
    """Brings `made`, a copy of the database `path`, over to this schema if it is an older one of
    the same series, and refuses a database of another COLMAP, whose tables differ."""
    fresh_path = os.path.join(folder, "fresh.db")
    schema.create(fresh_path)
    with contextlib.closing(sqlite3.connect(fresh_path)) as fresh:
        with contextlib.closing(sqlite3.connect(made)) as copy:
            maker, wanted = maker_of(copy), maker_of(fresh)
            series = _series(copy) if maker != _NOBODY else 0
        if series == _series(fresh):
            schema.bring_over(made)
            with contextlib.closing(sqlite3.connect(made)) as copy:
                words = _difference(copy, fresh)
        else:
            words = (f"COLMAP {_series(fresh)} brings it over when it opens it"
                     if 0 < series < _series(fresh) else "its tables differ")
    if words:
        raise BadInput(f"{path}: made by {maker}, and --schema {schema.NAME} is for {wanted}: "
                       f"{words}")


def _settle(path):
    """Moves the data that COLMAP 4 keeps in path-wal into the database file, so that one file holds
    all."""
    with contextlib.closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA journal_mode = DELETE")


@contextlib.contextmanager
def new_database(path, schema):
    """A context manager with a Writer. The database appears at `path` if the block ends without an
    exception; there must be no database before."""
    if os.path.lexists(path):
        raise BadInput(f"{path}: there already (--append adds to it)")
    for suffix in _LEFT_BEHIND:  # SQLite would apply an old journal to the new database
        if os.path.lexists(path + suffix):
            raise BadInput(f"{path}{suffix}: left there by another database; remove it first")
    schema.prepare()
    with _scratch_folder(path) as scratch:
        made = os.path.join(scratch, "made.db")
        schema.create(made)
        with schema.Writer(made) as writer:
            yield writer
            writer.commit()
        _settle(made)
        try:
            os.link(made, path)  # unlike rename, link never overwrites an existing file
        except FileExistsError:
            raise BadInput(f"{path}: there already (--append adds to it)") from None
        except OSError:  # raised by a file system without hard links
            os.rename(made, path)


def _give_up_when_locked(status, _remaining, _total):
    if status in (_BUSY, _LOCKED):
        raise sqlite3.OperationalError("database is locked")


@contextlib.contextmanager
def appended_database(path, schema):
    """A context manager with a Writer on a copy of the database. If the block ends without an
    exception, the copy replaces the content of `path` in one transaction."""
    if not os.path.isfile(path):
        raise BadInput(f"{path}: no such file, nothing to append to")
    schema.prepare()
    try:
        with _scratch_folder(path) as scratch, contextlib.closing(
            sqlite3.connect(path, timeout=1)
        ) as target:
            made = os.path.join(scratch, "made.db")
            target.execute("BEGIN IMMEDIATE")  # raises sqlite3.Error if it cannot be written
            target.rollback()
            before = target.execute("PRAGMA data_version").fetchone()
            with contextlib.closing(sqlite3.connect(made)) as copy:
                target.backup(copy)
            _require_schema(made, path, schema, scratch)
            with schema.Writer(made) as writer:
                yield writer
                writer.commit()
            _settle(made)
            if target.execute("PRAGMA data_version").fetchone() != before:
                raise BadInput(f"{path}: changed by another program meanwhile; nothing was written")
            with contextlib.closing(sqlite3.connect(made)) as copy:
                # Without this callback, backup() would retry for ever.
                copy.backup(target, progress=_give_up_when_locked)
    except sqlite3.Error as error:
        raise _explain(path, error) from None


@contextlib.contextmanager
def _scratch_folder(path):
    """A hidden folder beside `path`, which is removed at the end in every case."""
    folder = os.path.dirname(os.path.abspath(path))
    if not os.path.isdir(folder):
        raise BadInput(f"{folder}: no such folder")
    try:
        scratch = tempfile.TemporaryDirectory(prefix=f".{os.path.basename(path)}.", dir=folder)
    except OSError as error:
        raise BadInput(f"{folder}: {error.strerror}") from None
    with scratch as name:
        yield name


def read_cameras(database):
    """Reads the table `cameras` as {camera_id: ColmapCamera}."""
    names = {number: name for name, number in MODEL_IDS.items()}
    rows = database.execute("SELECT camera_id, model, width, height, params FROM cameras")
    return {camera_id: ColmapCamera(names.get(model, f"model {model}"), width, height,
                                    tuple(np.frombuffer(params, np.float64).tolist()))
            for camera_id, model, width, height, params in rows}


def read_guessed_cameras(database):
    """The ids of the cameras whose focal length COLMAP guessed from the image's size: the column
    prior_focal_length is 0. Elsewhere EXIF data or the user gave it."""
    rows = database.execute("SELECT camera_id FROM cameras WHERE NOT prior_focal_length")
    return {row[0] for row in rows}


def read_images(database):
    """Reads the table `images` as {name: (image_id, camera_id)}."""
    return {name: (image_id, camera_id) for image_id, name, camera_id in
            database.execute("SELECT image_id, name, camera_id FROM images ORDER BY image_id")}


def _table(row, dtype, path, what):
    if row is None or row[0] == 0:
        return np.zeros((0, row[1] if row else 2), dtype)
    rows, columns, data = row
    if len(data or b"") != rows * columns * np.dtype(dtype).itemsize:
        raise BadInput(f"{path}: {what}: not {rows} x {columns} values")
    return np.frombuffer(data, dtype).reshape(rows, columns)


def read_keypoints(database, path, image_id):
    """Reads keypoints (n, 2), (n, 4) or (n, 6) float32, in COLMAP's pixels."""
    row = database.execute(
        "SELECT rows, cols, data FROM keypoints WHERE image_id = ?", (image_id,)
    ).fetchone()
    return _table(row, np.float32, path, f"keypoints of image {image_id}")


@dataclass(frozen=True)
class Descriptors:
    """The descriptors of an image as its row has them."""

    kind: str  #: the name of the feature; empty where the database does not say it
    rows: np.ndarray  #: (n, bytes of one) uint8

    def not_sift(self):
        """Why they are not SIFT's 128 bytes; empty where they are, or where there are none to
        judge. SIFT's have a length of 512 in COLMAP, OpenCV and VLFeat, and other numbers of 128
        bytes, such as 32 floats, lengths above 1400: databases of COLMAP 3 do not say the kind,
        and those that were brought over call all of them SIFT's."""
        if self.kind not in ("", "SIFT"):
            return self.kind
        if not len(self.rows):
            return ""
        if self.rows.shape[1] != 128:
            return f"{self.rows.shape[1]} bytes each, not 128"
        length = np.median(np.linalg.norm(self.rows.astype(np.float64), axis=1))
        return "" if 256 <= length <= 1024 else f"their length is {length:.0f}, not about 512"


def read_descriptors(database, path, image_id):
    """Reads the Descriptors of an image, one row for each keypoint."""
    says_kind = "type" in _columns(database).get("descriptors", ())
    row = database.execute(
        f"SELECT {'type' if says_kind else -1}, rows, cols, data FROM descriptors "
        "WHERE image_id = ?", (image_id,)
    ).fetchone()
    kind, *row = row or (-1, 0, 128, None)
    name = "" if kind == -1 else _FEATURE_KINDS.get(kind, f"features of type {kind}")
    return Descriptors(name, _table(row, np.uint8, path, f"descriptors of image {image_id}"))


def _read_pairs(database, path, what, query):
    """Reads [(image_id0, image_id1, matches (n, 2) uint32)] with image_id0 < image_id1."""
    found = []
    for pair, *row in database.execute(query):
        id0, id1 = divmod(pair, schema38.MAX_IMAGES)
        table = _table(row, np.uint32, path, f"{what} of images {id0} and {id1}")
        if len(table) and table.shape[1] != 2:
            raise BadInput(f"{path}: {what} of images {id0} and {id1}: {table.shape[0]} x "
                           f"{table.shape[1]} indices, not 2 in a row")
        found.append((id0, id1, table))
    return found


def read_matches(database, path):
    """Reads the table `matches`, COLMAP's matches before their verification."""
    return _read_pairs(database, path, "matches",
                       "SELECT pair_id, rows, cols, data FROM matches ORDER BY pair_id")


def read_verified_matches(database, path):
    """Reads the inlier matches of `two_view_geometries` but for those of a watermark, which do not
    tell how the camera moved."""
    return _read_pairs(database, path, "verified matches",
                       "SELECT pair_id, rows, cols, data FROM two_view_geometries "
                       f"WHERE rows > 0 AND config != {WATERMARK} ORDER BY pair_id")


def read_pair_ids(database):
    """The pairs of image ids, smaller first, that have matches or a geometry."""
    rows = database.execute(
        "SELECT pair_id FROM matches UNION SELECT pair_id FROM two_view_geometries"
    )
    return {divmod(row[0], schema38.MAX_IMAGES) for row in rows}
