"""Writes a database file so that it appears, or grows, completely or not at all; and reads a
database with SQL that works for every COLMAP version."""

import contextlib
import os
import sqlite3
import tempfile

import numpy as np

from . import schema4, schema38
from .conventions import MODEL_IDS, ColmapCamera
from .errors import BadInput

SCHEMAS = {schema.NAME: schema for schema in (schema4, schema38)}
_LEFT_BEHIND = ("-wal", "-journal", "-shm")
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
    """A description of the COLMAP version that made the database; "no COLMAP" if none did."""
    version = database.execute("PRAGMA user_version").fetchone()[0]
    if not {"cameras", "images", "two_view_geometries"} <= set(_columns(database)):
        return "no COLMAP"
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


def _require_schema(database, path, schema, folder):
    """Refuses a database of another COLMAP version, whose tables differ from those of this
    schema."""
    fresh = os.path.join(folder, "fresh.db")
    schema.create(fresh)
    with contextlib.closing(sqlite3.connect(fresh)) as expected:
        wanted, maker = _columns(expected), maker_of(expected)
    if _columns(database) != wanted:
        raise BadInput(
            f"{path}: made by {maker_of(database)}, and --schema {schema.NAME} is for {maker}"
        )


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
            _require_schema(target, path, schema, scratch)
            before = target.execute("PRAGMA data_version").fetchone()
            with contextlib.closing(sqlite3.connect(made)) as copy:
                target.backup(copy)
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


def read_descriptors(database, path, image_id):
    """Reads the descriptors of an image as uint8, one row for each keypoint; SIFT's have 128
    columns."""
    row = database.execute(
        "SELECT rows, cols, data FROM descriptors WHERE image_id = ?", (image_id,)
    ).fetchone()
    return _table(row, np.uint8, path, f"descriptors of image {image_id}")


def read_matches(database, path):
    """Reads [(image_id0, image_id1, matches (n, 2) uint32)] with image_id0 < image_id1."""
    found = []
    for pair, *row in database.execute(
        "SELECT pair_id, rows, cols, data FROM matches ORDER BY pair_id"
    ):
        id0, id1 = divmod(pair, schema38.MAX_IMAGES)
        found.append((id0, id1, _table(row, np.uint32, path, f"matches of images {id0} and {id1}")))
    return found


def read_pair_ids(database):
    """The pairs of image ids, smaller first, that have matches or a geometry."""
    rows = database.execute(
        "SELECT pair_id FROM matches UNION SELECT pair_id FROM two_view_geometries"
    )
    return {divmod(row[0], schema38.MAX_IMAGES) for row in rows}
