"""Exports images to a COLMAP database: features, matches and verified geometry, which COLMAP's
mapper then uses. Pairs that are not "ok" are tried with effort: the keypoints of squeezed views
that their inliers need stand behind those of the image."""

import functools
import os
import sys
from dataclasses import dataclass
from typing import Any, Optional

import numpy as np
import twoview as tv

from ..folders import left_out_words
from ..sizes import LARGE_SIDE, USUAL_SIDE
from . import conventions
from .cameras import CameraChoice, resized
from .database import (
    SCHEMAS,
    appended_database,
    new_database,
    read_cameras,
    read_images,
    read_keypoints,
    read_pair_ids,
    reading,
)
from .engine import Engine, pixels_of
from .errors import BadInput
from .images import MORE, holds_more, list_images, read_luma, shrunk
from .masks import Masks, shrunk_mask
from .pairs import exhaustive, read_pairs, sequential
from .progress import progress
from .settings import EFFORTS

PICTURES_IN_MEMORY = 16
# A keypoint of a squeezed view that is as near to one of the database is that one, so that tracks
# of several pairs meet.
ONE_KEYPOINT_PX = 1.0


@dataclass(frozen=True)
class View:
    """An image to be exported: its camera, keypoints and descriptors."""

    camera: Any
    keypoints: np.ndarray
    descriptors: np.ndarray

    @functools.cached_property
    def places(self):
        return one_keypoint_a_place(self.keypoints)


@dataclass(frozen=True)
class Job:
    database: str
    images: str
    pairs: str = ""  #: path of a pairs file; if empty, `overlap` chooses the pairs
    overlap: int = 0  #: of --sequential: pairs each image with this many next ones; 0: all pairs
    cameras: tuple = ()
    schema: str = "4"
    append: bool = False
    quiet: bool = False
    focal_35mm: float = 0  #: makes the cameras, in place of files; 0: not given
    #: longer side to which images and cameras are scaled down; 0: as they are; None: not given,
    #: which is as 0 with a note where the first image is large
    resize: Optional[int] = None
    mask: str = ""  #: a file for all images, or a folder of masks; empty: none
    effort: str = "auto"  #: of settings.EFFORTS


class Pictures:
    """The pixels and masks of the images, the last few of which stay in memory."""

    def __init__(self, job):
        self.job, self.masks = job, Masks(job.mask)
        self.used = functools.lru_cache(PICTURES_IN_MEMORY)(self._used)

    def whole(self, name):
        return read_luma(os.path.join(self.job.images, name))

    def at_size(self, name, luma):
        """(luma, mask or None) as they are used, of the whole image."""
        mask = self.masks.of(name, luma)
        if not self.job.resize:
            return luma, mask
        return shrunk(luma, self.job.resize), shrunk_mask(mask, self.job.resize)

    def _used(self, name):
        return self.at_size(name, self.whole(name))


def choose_pairs(job):
    """The [Pair] to match, each pair once; all images must exist."""
    if not job.pairs:
        names, left_out, name_note = list_images(job.images)
        words = left_out_words(left_out, job.images)
        if len(names) < 2:
            raise BadInput(f"{job.images}: {len(names)} images in it, two and more are needed"
                           + (f"; {words}" if words else ""))
        for note in filter(None, (words, name_note)):
            print(f"twoview: note: {note}", file=sys.stderr)
        return sequential(names, job.overlap) if job.overlap else exhaustive(names)
    pairs, seen = [], set()
    for pair in read_pairs(job.pairs):
        for name in (pair.name0, pair.name1):
            if not os.path.isfile(os.path.join(job.images, name)):
                raise BadInput(f"{job.pairs}: line {pair.number}: no image {name} in {job.images}")
        if frozenset((pair.name0, pair.name1)) not in seen:
            seen.add(frozenset((pair.name0, pair.name1)))
            pairs.append(pair)
    return pairs


def _intrinsics(job, pairs):
    """{name: K or None} in the order of the names. An image must have the same K in all of its
    lines."""
    given = {}
    for pair in pairs:
        for name, K in ((pair.name0, pair.K0), (pair.name1, pair.K1)):
            if given.get(name) is not None and K is not None and not np.array_equal(given[name], K):
                raise BadInput(f"{job.pairs}: line {pair.number}: {name} has another K than before")
            given[name] = given.get(name) if K is None else K
    return dict(sorted(given.items()))


def _advise_on_size(name, luma):
    """Says that the images are used as they are, where the first of them, `name`, is large."""
    height, width = luma.shape
    if max(width, height) > LARGE_SIDE:
        print(f"twoview: note: images above {LARGE_SIDE} pixels a side are used as they are: "
              f"{name} is {width}x{height}; --resize {USUAL_SIDE} is advised", file=sys.stderr)


def _describe_images(job, pairs, engine, pictures):
    """{name: View} of the pairs' images. One that cannot be read is left out, and named in a note;
    BadInput where no pair is left."""
    folders = [os.path.dirname(os.path.abspath(job.pairs))] if job.pairs else []
    folders += [job.images, os.path.dirname(os.path.abspath(job.images))]
    choice = CameraChoice(job.cameras, folders, job.focal_35mm)
    views, left_out, has_more = {}, [], False
    intrinsics = _intrinsics(job, pairs)
    for name, K in progress(intrinsics.items(), "image", job.quiet):
        path = os.path.join(job.images, name)
        try:
            luma = pictures.whole(name)
        except BadInput as error:
            left_out.append((name, str(error).removeprefix(f"image {path}").lstrip(": ")))
            continue
        has_more = has_more or holds_more(path)
        if job.resize is None and not views:
            _advise_on_size(name, luma)
        camera = choice.of(name, luma.shape[1], luma.shape[0], K)
        luma, mask = pictures.at_size(name, luma)
        if job.resize:
            camera = resized(camera, luma.shape[1], luma.shape[0])
        views[name] = View(camera, *engine.extract(luma, name, mask))
    words = left_out_words(left_out, job.images)
    if not any(pair.name0 in views and pair.name1 in views for pair in pairs):
        raise BadInput(f"no pair of images can be read: {words}")
    for note in filter(None, (words, has_more and MORE)):
        print(f"twoview: note: {note}", file=sys.stderr)
    return views


class _Known:
    """What the database already holds in a run with --append."""

    def __init__(self, job):
        self.path, self.cameras, self.images, self.pairs = job.database, {}, {}, set()
        if job.append:
            with reading(job.database) as database:
                self.cameras, self.images = read_cameras(database), read_images(database)
                self.pairs = read_pair_ids(database)

    def camera_id(self, camera):
        return next((key for key, known in self.cameras.items() if known == camera), None)

    def check_image(self, name, camera, keypoints):
        """Refuses an image in the database that differs from this run's, since its matches would
        refer to other keypoints. Returns its id and its keypoints; behind this run's stand those
        that earlier runs needed of squeezed views."""
        image_id, camera_id = self.images[name]
        if self.cameras.get(camera_id) != camera:
            raise BadInput(f"{self.path}: image {name} is there with another camera")
        with reading(self.path) as database:
            stored = read_keypoints(database, self.path, image_id)
        if not np.array_equal(stored[:len(keypoints)], keypoints):
            raise BadInput(f"{self.path}: image {name} is there with other keypoints")
        return image_id, stored


class Keypoints:
    """The keypoints of an image as the database gets them, in COLMAP's form: its own, and behind
    them those of squeezed views that an inlier needs. `stored`: those of an image that is in the
    database already, to which none is added."""

    def __init__(self, view, stored=None):
        self.is_stored = stored is not None
        own = conventions.keypoints_to_colmap(view.keypoints)
        self.rows = [stored if self.is_stored else own]
        self.descriptors = [view.descriptors]

    @property
    def table(self):
        if len(self.rows) > 1:
            self.rows, self.descriptors = ([np.concatenate(parts)] for parts in
                                           (self.rows, self.descriptors))
        return self.rows[0]

    def indices_of(self, keypoints, tilts, descriptors):
        """For each keypoint of any view its index, -1 where there is none and none is added."""
        from scipy.spatial import cKDTree
        rows = conventions.keypoints_to_colmap(keypoints, tilts)
        known = len(self.table)
        far, found = np.full(len(rows), np.inf), np.full(len(rows), -1)
        if known and len(rows):
            far, found = cKDTree(self.table[:, :2]).query(rows[:, :2])
        found = np.where(far <= ONE_KEYPOINT_PX, found, -1)
        if self.is_stored:
            return found
        new, added = np.flatnonzero(found < 0), []
        for k in new:
            near = [i for i in added if np.hypot(*(rows[i, :2] - rows[k, :2])) <= ONE_KEYPOINT_PX]
            found[k] = found[near[0]] if near else known + len(added)
            if not near:
                added.append(k)
        if added:
            self.rows.append(rows[added])
            self.descriptors.append(descriptors[added])
        return found


def _write_images(writer, known, views):
    """Writes the images that the database does not hold yet, without their keypoints, and checks
    the others. Returns {name: image_id} and {name: Keypoints}."""
    ids, tables = {}, {}
    for name, view in views.items():
        camera = conventions.camera_to_colmap(view.camera)
        if name in known.images:
            keypoints = conventions.keypoints_to_colmap(view.keypoints)
            ids[name], stored = known.check_image(name, camera, keypoints)
            tables[name] = Keypoints(view, stored)
            continue
        camera_id = known.camera_id(camera)
        if camera_id is None:
            camera_id = writer.add_camera(camera)
            known.cameras[camera_id] = camera
        ids[name] = writer.add_image(name, camera_id)
        tables[name] = Keypoints(view)
    return ids, tables


def _write_keypoints(writer, ids, tables):
    for name, found in tables.items():
        if not found.is_stored:
            table = found.table
            writer.add_features(ids[name], table, found.descriptors[0])


def one_keypoint_a_place(keypoints):
    """(n,): for each keypoint, the index of the first keypoint at the same position. A corner with
    two orientations is two keypoints; without this the mapper would make two tracks of it, each
    with half of the corner's matches."""
    places = np.column_stack([keypoints["x"], keypoints["y"]])
    _, first, inverse = np.unique(places, axis=0, return_index=True, return_inverse=True)
    return first[inverse.reshape(-1)]


def one_to_one(matches, order):
    """The indices of the matches that share no keypoint with a better match; `order` lists the
    matches, best first."""
    used, kept = (set(), set()), []
    for k in order:
        idx0, idx1 = matches[k]
        if idx0 not in used[0] and idx1 not in used[1]:
            used[0].add(idx0)
            used[1].add(idx1)
            kept.append(k)
    return np.array(sorted(kept), np.int64)


def two_view(engine, view0, view1):
    """(matches (n, 2), TwoView, inliers (n,) bool), with one keypoint for each corner."""
    found = engine.match(view0.descriptors, view1.descriptors, view0.keypoints, view1.keypoints)
    matches = np.column_stack([found["idx0"], found["idx1"]]).astype(np.uint32)
    result, inliers = engine.estimate(
        view0.camera, view1.camera, pixels_of(view0.keypoints)[matches[:, 0]],
        pixels_of(view1.keypoints)[matches[:, 1]], found["ratio"].copy())
    matches = np.column_stack([view.places[matches[:, i]]
                               for i, view in enumerate((view0, view1))])
    kept = one_to_one(matches, np.lexsort((found["ratio"], ~inliers)))
    return matches[kept], result, inliers[kept]


class Climber:
    """two_view, and after it the rungs of effort where it is not "ok"."""

    def __init__(self, engine, pictures, views, tables):
        self.engine, self.pictures, self.views, self.tables = engine, pictures, views, tables

    def two_view(self, name0, name1):
        """(matches (n, 2), TwoView, inliers (n,) bool, rung)."""
        first = two_view(self.engine, self.views[name0], self.views[name1])
        lowest, highest = self.engine.rungs
        if highest == 0 or (lowest == 0 and first[1].verdict == tv.Verdict.OK):
            return *first, 0
        result, cloud = self.engine.climb([(*self.pictures.used(name), self.views[name].camera)
                                           for name in (name0, name1)])
        is_better = (result.verdict >= first[1].verdict
                     and result.num_inliers > first[1].num_inliers)
        if cloud.effort == 0 or (lowest == 0 and not is_better):
            return *first, 0
        return *self._in_database(name0, name1, result, cloud), cloud.effort

    def _in_database(self, name0, name1, result, cloud):
        """The inliers of a higher rung; its other matches are left out, so that no keypoint is
        added for them."""
        inliers = cloud.matches[cloud.inlier_mask]
        columns = []
        for v, name in enumerate((name0, name1)):
            chosen = inliers[f"idx{v}"]
            columns.append(self.tables[name].indices_of(
                cloud.keypoints[v][chosen], cloud.tilts[v][chosen], cloud.descriptors[v][chosen]))
        matches = np.column_stack(columns).astype(np.int64)
        there = np.flatnonzero((matches >= 0).all(axis=1))
        kept = one_to_one(matches, there[np.argsort(inliers["ratio"][there], kind="stable")])
        return matches[kept].astype(np.uint32), result, np.ones(len(kept), bool)


def export(job, feature=None, match=None, estimate=None):
    """Exports, and returns {what: how many}. On failure the database is as it was before."""
    schema = SCHEMAS[job.schema]
    engine = Engine(feature, match, estimate, rungs=EFFORTS[job.effort])
    pictures = Pictures(job)
    with (appended_database if job.append else new_database)(job.database, schema) as writer:
        pairs = choose_pairs(job)
        views = _describe_images(job, pairs, engine, pictures)
        pairs = [pair for pair in pairs if pair.name0 in views and pair.name1 in views]
        known = _Known(job)
        ids, tables = _write_images(writer, known, views)
        climber = Climber(engine, pictures, views, tables)
        counts = {"images": len(views), "new_images": len(set(views) - set(known.images)),
                  "pairs": 0, "pairs_verified": 0, "inlier_matches": 0, "configurations": {},
                  "efforts": {}}
        for pair in progress(pairs, "pair", job.quiet):
            id0, id1 = ids[pair.name0], ids[pair.name1]
            if tuple(sorted((id0, id1))) in known.pairs:
                continue
            matches, result, inliers, rung = climber.two_view(pair.name0, pair.name1)
            row = conventions.geometry_to_colmap(result, matches[inliers])
            writer.add_pair(id0, id1, matches, row)
            name = result.kind.name.lower()
            counts["pairs"] += 1
            counts["pairs_verified"] += row.config != conventions.DEGENERATE
            counts["inlier_matches"] += len(row.inlier_matches)
            counts["configurations"][name] = counts["configurations"].get(name, 0) + 1
            counts["efforts"][str(rung)] = counts["efforts"].get(str(rung), 0) + 1
        _write_keypoints(writer, ids, tables)
        counts["keypoints"] = sum(len(found.table) for found in tables.values())
    return counts
