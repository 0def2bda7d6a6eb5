"""Matches and poses of other programs: .npz, .npy and tables of matched pixels, a folder with a
file for each pair, and lists of poses. docs/formats.md has the forms; the program's readers are
matches_file.cc, matches_arrays.cc, match_folder.cc and own_poses.cc of tools/twoview/files."""

import io
import os
import pathlib
import re
import zipfile
from dataclasses import dataclass, field
from typing import Optional

import numpy as np

from .rotations import made_rotation

# In the order in which they are preferred; tools/twoview/files/matches_arrays.cc has the same.
MATCHED = (("mkpts0_f", "mkpts1_f"), ("mkeypoints0_orig", "mkeypoints1_orig"),
           ("mkpts0", "mkpts1"), ("mkpts1", "mkpts2"), ("matched_kpts0", "matched_kpts1"),
           ("matched_keypoints0", "matched_keypoints1"), ("mkeypoints0", "mkeypoints1"),
           ("points0", "points1"), ("points1", "points2"), ("pts0", "pts1"), ("pts1", "pts2"),
           ("kptsA", "kptsB"), ("mkpts0_c", "mkpts1_c"))
KEYPOINTS = (("keypoints0_orig", "keypoints1_orig"), ("keypoints0", "keypoints1"),
             ("keypoints1", "keypoints2"), ("kpts0", "kpts1"), ("kpts1", "kpts2"),
             ("kps0", "kps1"), ("kp0", "kp1"))
INDICES = ("matches", "matches0", "matches01", "match_indices")
ROWS = ("matches", "correspondences", "corrs", "arr_0")
BATCHES = "batch_indexes"
LOWER = ("ratio", "ratios", "distance", "distances")
HIGHER = ("score", "scores", "mscores", "match_scores", "confidence", "match_confidence", "conf",
          "mconf", "certainty", "matching_scores", "matching_scores0")
COLUMNS = (("x0", "y0", "x1", "y1"), ("x1", "y1", "x2", "y2"))
OWN_COLUMNS = ("dist_sq", "idx0", "idx1")
MOST_MATCHES = 1000000
MOST_NORMALISED = 2.0  # beyond this a coordinate is a pixel, and no ray's slope
TELLING = 20  # matches, of which all would lie in one corner by chance
BETWEEN, BEHIND = ("_", "-", "__", "--", "+", " "), ("_matches", "-matches", "")
ENDINGS = (".npz", ".npy", ".csv", ".txt", ".tsv")


class Refused(ValueError):
    """A file that is refused. The message is one line that names the file and what is wrong."""


@dataclass
class Matches:
    pixels0: np.ndarray  # (n, 2)
    pixels1: np.ndarray
    ratios: Optional[np.ndarray] = None  # (n,) in [0, 1], the lower the more certain
    left_out: list = field(default_factory=list)  # columns or arrays that were not used

    def __len__(self):
        return len(self.pixels0)


def _ratios(scores, lower, name):
    scores = np.asarray(scores, float)
    bad = np.flatnonzero(~np.isfinite(scores))
    if len(bad):
        raise Refused(f"{name}: the score of match {bad[0]} is not finite")
    low, high = min(0.0, scores.min(initial=0)), max(1.0, scores.max(initial=1))
    return ((scores - low if lower else high - scores) / (high - low)).astype(np.float32)


# ---- tables --------------------------------------------------------------------------------------

def _fields(line):
    """The fields of a line; a comma directly followed by another one gives an empty field."""
    line = line.strip(" \t\r")
    return re.split(r"[ \t\r]*[,;][ \t\r]*|[ \t\r]+", line) if line else []


def _number(text, what):
    try:
        return float(text)
    except ValueError:
        raise Refused(f"{what} is no number: '{text[:40]}'") from None


def _columns(names):
    """(indices of the pixels, index of the score or None, whether a lower one is better, the names
    of the others)"""
    wanted = COLUMNS["x0" not in names and "x2" in names]
    for column in wanted:
        if column not in names:
            raise Refused(f"no column {column} among the names")
    pixels = [names.index(column) for column in wanted]
    score = next((i for group in (LOWER, HIGHER) for i, n in enumerate(names) if n in group), None)
    others = [n for i, n in enumerate(names)
              if i not in pixels and i != score and n not in OWN_COLUMNS]
    return pixels, score, score is not None and names[score] in LOWER, others


def _parse_table(text, name):
    rows, scores, lower, left_out = [], [], False, []
    pixels, score, first, counts, fifths = [0, 1, 2, 3], None, True, set(), []
    has_names = False
    for number, line in enumerate(text.removeprefix("\ufeff").split("\n"), 1):
        fields = _fields(line)
        if not fields or fields[0].startswith("#"):
            continue
        try:
            if first and not _is_number(fields[0]):
                pixels, score, lower, left_out = _columns(fields)
                has_names = True
            else:
                for column, what in zip((*pixels, score), (*COLUMNS[0], "the score")):
                    if column is not None and column >= len(fields):
                        raise Refused(f"{len(fields)} fields, {what} is missing")
                rows.append([_number(fields[c], w) for c, w in zip(pixels, COLUMNS[0])])
                if score is not None:
                    scores.append(_number(fields[score], "the score"))
                if len(fields) == 5 and _is_number(fields[4]):
                    fifths.append(float(fields[4]))
                counts.add(len(fields))
        except Refused as error:
            raise Refused(f"{name}: line {number}: {error}") from None
        first = False
    if not rows:
        raise Refused(f"{name}: no match in it")
    if not has_names and counts == {5} and len(fifths) == len(rows):
        scores = fifths
    elif not has_names and max(counts) > 4:
        left_out = ["the columns behind the fourth"]
    rows = np.array(rows)
    return Matches(rows[:, :2], rows[:, 2:], _ratios(scores, lower, name) if scores else None,
                   left_out)


def _is_number(text):
    try:
        float(text)
    except ValueError:
        return False
    return True


# ---- arrays --------------------------------------------------------------------------------------

class _Arrays:
    """The arrays of a .npz, each read when it is first used."""

    def __init__(self, archive, name):
        self.archive, self.name, self.used = archive, name, set()

    def has(self, array):
        return array in self.archive.files

    def get(self, array, most_axes=2):
        self.used.add(array)
        try:
            values = self.archive[array]
        except ValueError as error:
            what = "holds pickled objects and no numbers" if "pickle" in str(error) else str(error)
            raise Refused(f"{self.name}: {array} {what}") from None
        except (zipfile.BadZipFile, OSError, EOFError) as error:
            raise Refused(f"{self.name} is damaged: {array}: {error}") from None
        if values.dtype.kind not in "fiub":
            raise Refused(f"{self.name}: {array} holds no numbers: {values.dtype}")
        while values.ndim > most_axes and values.shape[0] == 1:
            values = values[0]
        return values

    def points(self, array):
        values = self.get(array)
        if values.ndim != 2 or values.shape[1] != 2:
            raise Refused(f"{self.name}: {array} has the shape {values.shape}, not (n, 2)")
        return values.astype(float)

    def scores(self, count, of_keypoint0=None, num_keypoints=-1):
        for array in (*LOWER, *HIGHER):
            if not self.has(array):
                continue
            values = self.get(array, 1)
            if values.shape == (num_keypoints,) != (count,):
                values = values[of_keypoint0]
            if values.shape != (count,):
                raise Refused(f"{self.name}: {array} has the shape {values.shape}, not ({count},), "
                              "one for each match")
            return _ratios(values, array in LOWER, f"{self.name}: {array}")
        return None


def _rows(values, what):
    if values.ndim != 2 or values.shape[1] not in (4, 5):
        raise Refused(f"{what} has the shape {values.shape}, not (n, 4) or (n, 5), x0 y0 x1 y1 and "
                      "a score")
    values = values.astype(float)
    return Matches(values[:, :2], values[:, 2:4],
                   _ratios(values[:, 4], False, what) if values.shape[1] == 5 else None)


def _matched(arrays, names):
    points = [arrays.points(name) for name in names]
    if len(points[0]) != len(points[1]):
        raise Refused(f"{arrays.name}: {names[0]} and {names[1]} have the shapes "
                      f"{points[0].shape} and {points[1].shape}")
    arrays.used.add(BATCHES)
    return Matches(*points, arrays.scores(len(points[0])))


def _indexed(arrays, names, indices):
    points = [arrays.points(name) for name in names]
    index, what = arrays.get(indices), f"{arrays.name}: {indices}"
    if index.ndim == 2 and index.shape[1] == 2:
        pairs = index
    elif index.shape in ((len(points[0]),), (len(points[0]), 1)):
        index = index.ravel()
        pairs = np.column_stack([np.arange(len(index)), index])[index != -1]
    else:
        raise Refused(f"{what} has the shape {index.shape}, not (n, 2), nor ({len(points[0])},), "
                      "one for each keypoint of image 0")
    for side in range(2):
        values = pairs[:, side]
        bad = np.flatnonzero((values != np.floor(values)) | (values < 0)
                             | (values >= len(points[side])))
        if len(bad):
            raise Refused(f"{what} holds the index {values[bad[0]]:g}, and there are "
                          f"{len(points[side])} keypoints")
    pairs = pairs.astype(int)
    return Matches(points[0][pairs[:, 0]], points[1][pairs[:, 1]],
                   arrays.scores(len(pairs), pairs[:, 0], len(points[0])))


def _parse_arrays(archive, name):
    arrays = _Arrays(archive, name)
    for names in MATCHED:
        if all(map(arrays.has, names)):
            return _matched(arrays, names), arrays
    for names in KEYPOINTS:
        if not all(map(arrays.has, names)):
            continue
        for indices in INDICES:
            if arrays.has(indices):
                return _indexed(arrays, names, indices), arrays
        if arrays.has(BATCHES):
            return _matched(arrays, names), arrays
        raise Refused(f"{name}: {names[0]} and {names[1]} without matches: no array is called "
                      f"{', '.join(INDICES)}")
    for array in ROWS:
        if arrays.has(array):
            return _rows(arrays.get(array), f"{name}: {array}"), arrays
    raise Refused(f"{name}: no matches are read from the arrays {', '.join(archive.files)}; "
                  "docs/formats.md has the names of those that are")


def read_matches(path):
    """Reads a file of matches. Refused names what is wrong; OSError is not caught."""
    with open(path, "rb") as file:
        data = file.read()
    again = "which is not read: save its arrays with numpy.savez"
    if data.startswith(b"\x89HDF"):
        raise Refused(f"{path} is HDF5, {again}")
    if data[:1] == b"\x80":
        raise Refused(f"{path} is pickled, {again}")
    if data.startswith(b"\x93NUMPY"):
        try:
            matches = _rows(np.load(io.BytesIO(data), allow_pickle=False), path)
        except ValueError as error:
            raise error if isinstance(error, Refused) else Refused(f"{path}: {error}") from None
    elif data.startswith((b"PK\x03\x04", b"PK\x05\x06")):
        try:
            archive = np.load(io.BytesIO(data), allow_pickle=False)
        except (zipfile.BadZipFile, OSError) as error:
            raise Refused(f"{path} is damaged: {error}") from None
        if any(member.endswith("data.pkl") for member in archive.files):
            raise Refused(f"{path} is of torch.save, {again}")
        matches, arrays = _parse_arrays(archive, path)
        matches.left_out = [a for a in archive.files if a not in arrays.used]
    else:
        matches = _parse_table(data.decode("utf-8", "surrogateescape"), path)
    if not len(matches):
        raise Refused(f"{path}: no match in it")
    if len(matches) > MOST_MATCHES:
        raise Refused(f"{path}: more than {MOST_MATCHES} matches")
    return matches


def require_pixels(matches, sizes, name, may_be_smaller=True):
    """Refused for matches that are no pixels of images of these sizes, [(width, height)] of both:
    not finite, outside, normalised, or, with may_be_smaller, apparently of smaller pictures."""
    both = (matches.pixels0, matches.pixels1)
    for image, (pixels, size) in enumerate(zip(both, sizes)):
        if max(size) > 2 * MOST_NORMALISED and (np.abs(pixels) <= MOST_NORMALISED).all():
            raise Refused(f"{name} has normalised coordinates in image {image} (none is above 2), "
                          "and pixels are needed")
    for image, (pixels, (width, height)) in enumerate(zip(both, sizes)):
        inside = ((pixels >= -1) & (pixels <= [width, height])).all(axis=1)
        if inside.all():
            continue
        match = np.flatnonzero(~inside)[0]
        x, y = pixels[match]
        what = (f"has the pixel ({x:g}, {y:g}), which is not in the {width}x{height} pixels of the "
                "picture" if np.isfinite(pixels[match]).all() else
                "has a coordinate that is not finite")
        raise Refused(f"{name}: match {match} (the first is 0) {what} in image {image}")
    if may_be_smaller and len(matches) >= TELLING and all((2 * pixels < size).all()
                                       for pixels, size in zip(both, sizes)):
        raise Refused(f"{name} has no match in the right or the lower half of either picture: were "
                      "they matched smaller? --matches-resize L says their longer side then, 0 "
                      "that they were not")


# Of squares around two pixels that look alike: their side, the least deviation of each in grey
# levels, and the least correlation. tools/twoview/pair/own_matches.cc has the same rule.
SIDE, LEAST_SIGMA, ALIKE = 11, 3.0, 0.7
MOST_LOOKED_AT = 400  # matches
SHARE, CLEARLY = 0.2, 5  # alike with the sides exchanged, of all, and times those as they stand


def _squares(image, pixels):
    """(n, SIDE * SIDE) normalised grey levels around pixels; NaN where there is nothing to see."""
    out = np.full((len(pixels), SIDE * SIDE), np.nan)
    half = SIDE // 2
    for k, (x, y) in enumerate(np.floor(np.asarray(pixels, float) + 0.5).astype(int)):
        if min(x, y) < half or x + half >= image.shape[1] or y + half >= image.shape[0]:
            continue
        square = image[y - half:y + half + 1, x - half:x + half + 1].astype(float).ravel()
        if square.std() >= LEAST_SIGMA:
            out[k] = (square - square.mean()) / square.std()
    return out


def _num_alike(images, pixels0, pixels1):
    correlation = (_squares(images[0], pixels0) * _squares(images[1], pixels1)).mean(1)
    return int((correlation > ALIKE).sum())  # a comparison with NaN is False


def require_order(pixels0, pixels1, images, name):
    """Refused where the pictures (grey, of the size that the pixels are of) agree at the matches
    only with the sides exchanged: the geometry is as good then, but of the other direction."""
    step = 1 + len(pixels0) // MOST_LOOKED_AT
    pixels0, pixels1 = pixels0[::step], pixels1[::step]
    if len(pixels0) < TELLING:
        return
    as_given = _num_alike(images, pixels0, pixels1)
    exchanged = _num_alike(images, pixels1, pixels0)
    if exchanged >= SHARE * len(pixels0) and exchanged >= CLEARLY * (as_given + 1):
        raise Refused(f"{name}: the pictures look alike at its matches where the sides are "
                      f"exchanged ({exchanged} of {len(pixels0)}; as they stand, {as_given}): "
                      "exchange both, or name the pictures in the other order")


# ---- folders -------------------------------------------------------------------------------------

def _forms(name0, name1):
    """How the two names of a pair are written in the name of a file."""
    forms = set()
    for keep in (False, True):
        a, b = (name if keep else os.path.splitext(name)[0] for name in (name0, name1))
        forms |= {(a.replace("/", slash), b.replace("/", slash)) for slash in "-_"}
        base0, base1 = a.rsplit("/", 1)[-1], b.rsplit("/", 1)[-1]
        forms.add((base0, base1))
        if "/" in a:
            forms.add((a, base1))
    return forms


class MatchFolder:
    """A folder with a file of matches for each pair."""

    def __init__(self, folder):
        self.folder, self.used = folder, {}
        if not os.path.isdir(folder):
            raise Refused(f"{folder} is not a folder: it needs a file for each pair")
        root = pathlib.Path(folder)
        self.files = {path.relative_to(root).as_posix() for path in root.rglob("*")
                      if path.suffix in ENDINGS}
        if not self.files:
            raise Refused(f"{folder} has no file of matches (.npz, .npy, .csv, .txt) in it")

    def _fitting(self, name0, name1):
        found = sorted({file for a, b in _forms(name0, name1) for between in BETWEEN
                        for behind in BEHIND for ending in ENDINGS
                        if (file := a + between + b + behind + ending) in self.files})
        if len(found) > 1:
            raise Refused(f"{found[0]} and {found[1]} both fit {name0} and {name1}")
        return found[0] if found else None

    def find(self, name0, name1):
        """(the path of the file of a pair, whether it is of the other order); the path is None
        where there is none."""
        file = self._fitting(name0, name1)
        exchanged = file is None and name0 != name1
        file = file or self._fitting(name1, name0)
        if file is None:
            return None, False
        pair = self.used.setdefault(file, {name0, name1})
        if pair != {name0, name1}:
            raise Refused(f"{os.path.join(self.folder, file)} fits {name0} and {name1} as well as "
                          f"{' and '.join(sorted(pair))}")
        return os.path.join(self.folder, file), exchanged


# ---- poses ---------------------------------------------------------------------------------------

def _pose(fields):
    numbers = fields[2:]
    if not numbers:
        return None
    if len(numbers) not in (12, 16, 36):
        raise Refused(f"{len(numbers)} numbers behind the names, not 12 ([R t] in rows), 16 (4x4) "
                      "or none (no pose)")
    values = []
    for text in numbers[-16:]:
        value = float(text) if _is_number(text) else np.nan
        if not np.isfinite(value):
            raise Refused(f"'{text}' is no finite number")
        values.append(value)
    matrix = np.array(values).reshape(-1, 4)
    if len(matrix) == 4 and matrix[3].tolist() != [0, 0, 0, 1]:
        raise Refused("the last row of the matrix is not 0 0 0 1")
    try:
        return made_rotation(matrix[:3, :3], "the matrix"), matrix[:3, 3]
    except ValueError as error:
        raise Refused(str(error)) from None


def read_poses(path):
    """{(name0, name1): (R, t) or None} of a file of poses. Refused names the line."""
    poses = {}
    with open(path, encoding="utf-8-sig", errors="surrogateescape") as file:
        for number, line in enumerate(file, 1):
            fields = line.replace(",", " ").split()
            if not fields or fields[0].startswith("#"):
                continue
            try:
                if len(fields) < 2:
                    raise Refused("one field, where two names are needed")
                key = fields[0], fields[1]
                if key in poses or key[::-1] in poses:
                    raise Refused("the pair is there already")
                poses[key] = _pose(fields)
            except Refused as error:
                raise Refused(f"{path}: line {number}: {error}") from None
    if not poses:
        raise Refused(f"{path}: no pair in it")
    return poses


def pose_of_pair(poses, name0, name1):
    """The pose (R, t) of a pair in what read_poses returned, the inverse one where it has the pair
    in the other order; None without one."""
    if (name0, name1) in poses:
        return poses[name0, name1]
    pose = poses.get((name1, name0))
    return pose and (pose[0].T, -pose[0].T @ pose[1])
