"""Exports images to a COLMAP database: features, matches and verified geometry, which COLMAP's
mapper then uses."""

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
from .images import list_images, read_luma, shrunk
from .masks import Masks, shrunk_mask
from .pairs import exhaustive, read_pairs, sequential
from .progress import progress
from .settings import PRINCIPAL_POINT_SIGMA_OF_A_DATABASE


@dataclass(frozen=True)
class View:
    """An image to be exported: its camera, keypoints and descriptors."""

    camera: Any
    keypoints: np.ndarray
    descriptors: np.ndarray


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


def _describe_images(job, pairs, engine):
    """{name: View} of the pairs' images. One that cannot be read is left out, and named in a note;
    BadInput where no pair is left."""
    folders = [os.path.dirname(os.path.abspath(job.pairs))] if job.pairs else []
    folders += [job.images, os.path.dirname(os.path.abspath(job.images))]
    choice = CameraChoice(job.cameras, folders, job.focal_35mm)
    views, masks, left_out = {}, Masks(job.mask), []
    intrinsics = _intrinsics(job, pairs)
    for name, K in progress(intrinsics.items(), "image", job.quiet):
        path = os.path.join(job.images, name)
        try:
            luma = read_luma(path)
        except BadInput as error:
            left_out.append((name, str(error).removeprefix(f"image {path}").lstrip(": ")))
            continue
        if job.resize is None and not views:
            _advise_on_size(name, luma)
        camera = choice.of(name, luma.shape[1], luma.shape[0], K)
        mask = masks.of(name, luma)
        if job.resize:
            mask = shrunk_mask(mask, job.resize)
            luma = shrunk(luma, job.resize)
            camera = resized(camera, luma.shape[1], luma.shape[0])
        views[name] = View(camera, *engine.extract(luma, name, mask))
    words = left_out_words(left_out, job.images)
    if not any(pair.name0 in views and pair.name1 in views for pair in pairs):
        raise BadInput(f"no pair of images can be read: {words}")
    if words:
        print(f"twoview: note: {words}", file=sys.stderr)
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
        refer to other keypoints."""
        image_id, camera_id = self.images[name]
        if self.cameras.get(camera_id) != camera:
            raise BadInput(f"{self.path}: image {name} is there with another camera")
        with reading(self.path) as database:
            stored = read_keypoints(database, self.path, image_id)
        if stored.shape != keypoints.shape or not np.array_equal(stored, keypoints):
            raise BadInput(f"{self.path}: image {name} is there with other keypoints")
        return image_id


def _write_images(writer, known, views):
    """Writes the images that the database does not hold yet, and checks the others. Returns
    {name: image_id}."""
    ids = {}
    for name, view in views.items():
        camera = conventions.camera_to_colmap(view.camera)
        keypoints = conventions.keypoints_to_colmap(view.keypoints)
        if name in known.images:
            ids[name] = known.check_image(name, camera, keypoints)
            continue
        camera_id = known.camera_id(camera)
        if camera_id is None:
            camera_id = writer.add_camera(camera)
            known.cameras[camera_id] = camera
        ids[name] = writer.add_image(name, camera_id)
        writer.add_features(ids[name], keypoints, view.descriptors)
    return ids


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
    matches = np.column_stack([one_keypoint_a_place(view.keypoints)[matches[:, i]]
                               for i, view in enumerate((view0, view1))])
    kept = one_to_one(matches, np.lexsort((found["ratio"], ~inliers)))
    return matches[kept], result, inliers[kept]


def export(job, feature=None, match=None, estimate=None):
    """Exports, and returns {what: how many}. On failure the database is as it was before."""
    schema = SCHEMAS[job.schema]
    engine = Engine(feature, match, estimate or
                    tv.EstimateOptions(principal_point_sigma=PRINCIPAL_POINT_SIGMA_OF_A_DATABASE))
    with (appended_database if job.append else new_database)(job.database, schema) as writer:
        pairs = choose_pairs(job)
        views = _describe_images(job, pairs, engine)
        pairs = [pair for pair in pairs if pair.name0 in views and pair.name1 in views]
        known = _Known(job)
        ids = _write_images(writer, known, views)
        counts = {"images": len(views), "new_images": len(set(views) - set(known.images)),
                  "keypoints": sum(len(view.keypoints) for view in views.values()), "pairs": 0,
                  "pairs_verified": 0, "inlier_matches": 0, "configurations": {}}
        for pair in progress(pairs, "pair", job.quiet):
            id0, id1 = ids[pair.name0], ids[pair.name1]
            if tuple(sorted((id0, id1))) in known.pairs:
                continue
            matches, result, inliers = two_view(engine, views[pair.name0], views[pair.name1])
            row = conventions.geometry_to_colmap(result, matches[inliers])
            writer.add_pair(id0, id1, matches, row)
            name = result.kind.name.lower()
            counts["pairs"] += 1
            counts["pairs_verified"] += row.config != conventions.DEGENERATE
            counts["inlier_matches"] += len(row.inlier_matches)
            counts["configurations"][name] = counts["configurations"].get(name, 0) + 1
    return counts
