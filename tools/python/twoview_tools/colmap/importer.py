"""Imports COLMAP's models as reference poses, and its features and matches as input."""

import dataclasses
import json
import os

import numpy as np
import twoview as tv

from ..accuracy import metrics  # pose errors have the definition of the accuracy tables
from ..folders import foreign_words
from . import database as db
from .cameras import read_calibration, read_camera
from .conventions import HALF_PIXEL, camera_from_colmap, pixels_from_colmap
from .engine import Engine
from .errors import BadInput
from .output import require_own, write_files
from .pairs import exhaustive, read_pairs, sequential, write_pair
from .progress import progress
from .trajectory import write_trajectory


# How sure a focal length is that COLMAP guessed: 1.2 times the longer side, 43 mm as for 35 mm film
# at 3:2. Photographs are taken with 24 to 85 mm as a rule, which is 0.6 below and 0.7 above in the
# logarithm: two deviations of 0.3.
GUESSED = tv.Calibration(0.3, 0.01, tv.Refine.FOCAL_LENGTH)
EXACT = tv.Calibration()


def _choose(names, pairs_file, overlap):
    """The pairs to import: those of pairs_file, whose images must all be among `names`. Without a
    file: each image with the next `overlap` images, or all pairs if overlap is 0."""
    if not pairs_file:
        return sequential(names, overlap) if overlap else exhaustive(names)
    pairs = read_pairs(pairs_file)
    for pair in pairs:
        for name in (pair.name0, pair.name1):
            if name not in names:
                raise BadInput(
                    f"{pairs_file}: line {pair.number}: {name} is not in the model or database"
                )
    return pairs


def _camera(row, name):
    try:
        return camera_from_colmap(row, name)
    except ValueError as error:
        raise BadInput(str(error)) from None


def _named_cameras(model):
    """Returns ({entry: camera}, the text of a cameras.yaml with these entries). In a pairs file fx
    and cx of K select the entry, so BadInput if cameras with equal fx and cx differ in image size
    or lens."""
    used = sorted({image.camera_id for image in model.images.values()})
    cameras = {f"camera_{key}": _camera(model.cameras[key], f"camera {key}") for key in used}
    by_K = {}
    for name, camera in cameras.items():
        same = by_K.setdefault((camera.fx, camera.cx), camera)
        if (same.width, same.height, same.model, tuple(same.k)) != (
            camera.width,
            camera.height,
            camera.model,
            tuple(camera.k),
        ):
            raise BadInput(
                f"{name}: another camera has its fx and cx, and a pairs file could not tell them "
                f"apart"
            )
    try:
        return cameras, tv.format_cameras(cameras, "cameras.yaml")
    except ValueError as error:
        raise BadInput(str(error)) from None


def relative(image0, image1):
    """R and t of cam1_from_cam0, in the unit of the model."""
    R = image1.R @ image0.R.T
    return R, image1.t - R @ image0.t


def import_model(model, folder, pairs_file="", overlap=0, min_common_points=30):
    """Writes pairs.txt (with the truth), cameras.yaml and trajectory.tum of a model. Without a
    pairs file, pairs with fewer than min_common_points points in common are left out. Returns the
    number of pairs."""
    names = ("pairs.txt", "cameras.yaml", "trajectory.tum")
    require_own(folder, "colmap import --model", names, names)
    for name in model.images:
        if any(c.isspace() for c in name):
            raise BadInput(f"image '{name}': a blank in its name, which a pairs file cannot hold; "
                           f"rename the picture, or give --database, too, for a report.json")
    cameras, cameras_text = _named_cameras(model)
    lines = []
    for pair in _choose(list(model.images), pairs_file, overlap):
        image0, image1 = model.images[pair.name0], model.images[pair.name1]
        if not pairs_file and len(image0.point_ids & image1.point_ids) < min_common_points:
            continue
        K0, K1 = (cameras[f"camera_{image.camera_id}"].K for image in (image0, image1))
        lines.append(write_pair(pair.name0, pair.name1, K0, K1, *relative(image0, image1)))
    if not lines:
        raise BadInput(
            f"no two images of the model have {min_common_points} points in common "
            f"(--min-common-points)"
        )
    head = "# name0 name1 rot0 rot1 K0 K1 T_0to1; the truth is a COLMAP model's, in its unit\n"
    write_files(folder, {"pairs.txt": head + "\n".join(lines) + "\n", "cameras.yaml": cameras_text,
                         "trajectory.tum": write_trajectory(model.poses())})
    return len(lines)


class Features:
    """The contents of a database: pixels and descriptors by image, matches by pair of names."""

    MATCHES, VERIFIED, DESCRIPTORS = "matches", "two_view_geometries", "descriptors"

    def __init__(self, path, camera_files=()):
        self.path = path
        given = [read_camera(file) for file in camera_files]
        self._calibration_given = [read_calibration(file) for file in camera_files]
        self.pixels, self.descriptors, self.cameras = {}, {}, {}
        self.matches, self.verified = {}, {}  #: by pair of names, as two tables of the database
        self.calibrations = {}  #: Calibration by image
        self.invalid = {}  #: by image: how many of its keypoints are not finite, where any is
        self.outside = {}  #: by image: how many of its keypoints lie outside its picture
        with db.reading(path) as database:
            try:
                self._read(database, given)
            except KeyError as error:
                raise BadInput(f"{path}: no camera or image {error} in it") from None

    def _read(self, database, given):
        rows = db.read_cameras(database)
        guessed = set() if given else db.read_guessed_cameras(database)
        names = {}
        for name, (image_id, camera_id) in db.read_images(database).items():
            names[image_id] = name
            self.cameras[name] = given[0] if given else _camera(rows[camera_id], f"image {name}")
            self.calibrations[name] = (self._calibration_given[0] if given else
                                       GUESSED if camera_id in guessed else EXACT)
            self.pixels[name] = pixels_from_colmap(db.read_keypoints(database, self.path, image_id))
            camera = self.cameras[name]
            place = self.pixels[name] + HALF_PIXEL
            num_outside = int(((place < 0) | (place > (camera.width, camera.height))).any(
                axis=1).sum())
            if num_outside:
                self.outside[name] = num_outside
            num_invalid = int((~np.isfinite(self.pixels[name])).any(axis=1).sum())
            if num_invalid:
                self.invalid[name] = num_invalid
            self.descriptors[name] = db.read_descriptors(database, self.path, image_id)
        self._read_matches(db.read_matches(database, self.path), names, self.matches)
        self._read_matches(db.read_verified_matches(database, self.path), names, self.verified)

    def _read_matches(self, rows, names, into):
        for id0, id1, matches in rows:
            name0, name1 = names[id0], names[id1]
            if (
                len(matches)
                and (
                    matches.max(axis=0) >= [len(self.pixels[name0]), len(self.pixels[name1])]
                ).any()
            ):
                raise BadInput(f"{self.path}: a match of {name0} and {name1} has no keypoint")
            into[name0, name1] = matches

    def guessed(self):
        """The names of the images whose focal length COLMAP guessed."""
        return sorted(name for name, known in self.calibrations.items() if known is GUESSED)

    def has_pair(self, name0, name1):
        """Whether a table has matches of the pair."""
        return any(pair in table for table in (self.matches, self.verified)
                   for pair in ((name0, name1), (name1, name0)))

    def no_matches(self, name0, name1):
        """Why matches of the pair cannot be made from the descriptors; empty where they can."""
        for name in (name0, name1):
            found, pixels = self.descriptors[name], self.pixels[name]
            if found.not_sift():
                return f"the descriptors are not SIFT's ({found.not_sift()})"
            if len(found.rows) != len(pixels):
                return ("there are no descriptors" if not len(found.rows) else
                        f"image {name} has {len(pixels)} keypoints and {len(found.rows)} "
                        f"descriptors")
            if not len(pixels):
                return f"image {name} has no keypoints"
        return ""

    def matches_of(self, name0, name1, engine):
        """(matches (n, 2), their ratios or None, what they are from or None) in this order of the
        names. The database's matches have no ratios: those of `matches`, or the verified ones alone
        where that table has none. If the database has no row for the pair, our matcher makes the
        matches from its descriptors, if they are SIFT's."""
        def row(table):
            if (name1, name0) in table:
                return table[name1, name0][:, ::-1]
            return table.get((name0, name1))

        given, verified = row(self.matches), row(self.verified)
        if verified is not None and (given is None or not len(given)):
            return verified, None, self.VERIFIED
        if given is not None:
            return given, None, self.MATCHES
        if self.no_matches(name0, name1):
            return np.zeros((0, 2), np.uint32), None, None
        found = engine.match(self.descriptors[name0].rows, self.descriptors[name1].rows)
        return (np.column_stack([found["idx0"], found["idx1"]]), found["ratio"].copy(),
                self.DESCRIPTORS)


def _as_known(calibrations):
    return {f"calibration{i}": known for i, known in enumerate(calibrations)}


def _pair_report(name0, name1, features, engine, truth, options):
    matches, ratios, origin = features.matches_of(name0, name1, engine)
    result, inliers = engine.estimate(
        features.cameras[name0], features.cameras[name1], features.pixels[name0][matches[:, 0]],
        features.pixels[name1][matches[:, 1]], ratios, options)
    row = {"name0": name0, "name1": name1}
    errors = (
        metrics.pose_error(result.R, result.t, *truth)
        if truth
        else dict.fromkeys(
            (
                "rotation_error_deg",
                "translation_error_deg",
                "translation_error_signed_deg",
                "pose_error_deg",
            )
        )
    )
    row.update(errors)
    row.update(
        {
            "num_matches": len(matches),
            "matches_from": origin,
            "num_inliers": int(inliers.sum()),
            "precision": None,
            "config": result.kind.name.lower(),
            "verdict": result.verdict.name.lower(),
            "time_ms": None,
            "focal_sigma": [options.calibration0.focal_sigma, options.calibration1.focal_sigma],
        }
    )
    row.update({key: None if value is None else np.ravel(value).tolist()
                for key, value in (("R", result.R), ("t", result.t),
                                   ("principal_point_shift_px", result.principal_point_shift))})
    return row


def _require_own_report(folder):
    """Refuses a folder whose report.json is that of another verb (evaluate, compare)."""
    try:
        with open(os.path.join(folder, "report.json"), encoding="utf-8") as file:
            report = json.load(file)
    except OSError:
        return
    except ValueError:
        report = {}
    if not isinstance(report, dict) or "database" not in report.get("options", {}):
        raise BadInput(foreign_words(folder, "report.json", "colmap import --database"))


def _without_matches(path, features, pairs):
    """{reason: number} of the pairs that no table has matches of and that none can be made for;
    BadInput where that is each of them."""
    if not pairs:
        raise BadInput(f"{path}: {len(features.pixels)} images in it, two and more are needed")
    reasons = [features.no_matches(pair.name0, pair.name1) for pair in pairs
               if not features.has_pair(pair.name0, pair.name1)]
    counts = {reason: reasons.count(reason) for reason in reasons if reason}
    if sum(counts.values()) == len(pairs):
        reason = max(counts, key=counts.get)
        raise BadInput(f"{path}: {reason}, and matches are needed: the database has none of these "
                       f"images (COLMAP's matcher of its features makes them)")
    return counts


def import_database(
    path,
    folder,
    pairs_file="",
    overlap=0,
    model=None,
    camera_files=(),
    match=None,
    estimate=None,
    quiet=False,
    calibrations_of=None,
):
    """Estimates from a database's features and matches, and writes report.json in the form of
    `twoview evaluate`. Without a pairs file and an overlap it takes the pairs that have matches in
    the database, or all pairs if none has. The truth is that of `model`, else that of the pairs
    file. calibrations_of: from the Calibrations of two cameras to the calibrations of
    EstimateOptions, {name: value}; None: as the cameras say."""
    _require_own_report(folder)
    features = Features(path, camera_files)
    if pairs_file or overlap or not (features.matches or features.verified):
        pairs = _choose(list(features.pixels), pairs_file, overlap)
    else:
        pairs = [pair for pair in exhaustive(list(features.pixels))
                 if features.has_pair(pair.name0, pair.name1)]
    without = _without_matches(path, features, pairs)
    most = max([len(pixels) for pixels in features.pixels.values()] + [1])
    engine = Engine(tv.FeatureOptions(max_keypoints=most), match, estimate,
                    max_matches=max([len(m) for table in (features.matches, features.verified)
                                     for m in table.values()] + [most]))
    estimate = estimate or tv.EstimateOptions()
    calibrations_of = calibrations_of or _as_known
    rows = []
    for pair in progress(pairs, "pair", quiet):
        truth = None if pair.R is None else (pair.R, pair.t)
        if model and pair.name0 in model.images and pair.name1 in model.images:
            truth = relative(model.images[pair.name0], model.images[pair.name1])
        known = [features.calibrations[name] for name in (pair.name0, pair.name1)]
        options = dataclasses.replace(estimate, **calibrations_of(known))
        rows.append(_pair_report(pair.name0, pair.name1, features, engine, truth, options))
    report = {
        key: {f"{limit:g}": _auc(rows, error, limit) for limit in metrics.THRESHOLDS_DEG}
        for key, error in (
            ("auc", "translation_error_deg"),
            ("auc_signed", "translation_error_signed_deg"),
        )
    }
    report.update(num_pairs=len(rows), pairs=rows, options={"database": os.path.basename(path)},
                  guessed_focal_lengths=features.guessed(), without_matches=without,
                  invalid_keypoints=features.invalid, keypoints_outside=features.outside,
                  seed=estimate.seed, version=tv.version_string())
    write_files(folder, {"report.json": json.dumps(metrics.finite(report), indent=1) + "\n"})
    return report


def _auc(rows, translation, limit):
    errors = [max(row["rotation_error_deg"], row[translation]) for row in rows
              if row["rotation_error_deg"] is not None]
    return metrics.auc(errors, limit) if errors else None
