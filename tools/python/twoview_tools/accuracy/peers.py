"""Front ends of the peers, and complete rows of peers, whose results are stored in .cache/accuracy.

OpenCV's FAST + SIFT is run as a user who knows it would: the cap's strongest corners, KeyPoint size
5 (the default 7 loses 6 points of AUC5), plain SIFT, ratio 0.8 and mutual neighbours, pixel
coordinates. OpenCV has no arc 12 and no public orientation: `gradient` is Lowe's histogram on
SIFT's base level, in numpy here.
"""

import hashlib
import json
import os
import time

import numpy as np

from . import datasets, estimators, leaveout, learned, metrics, parallel, tables

CAP = 2048  # most descriptors of an image; a keypoint with two orientations has two
RATIO = 0.8
BLOCK = 64  # rows of a matrix of distances that are processed together
CACHE_FORMAT = 4  # increase it if a change here changes the cached results

CACHE_DIR = os.path.join(datasets.ROOT, ".cache", "accuracy")

FAST = {"front": "fast", "threshold": 10, "size": 5, "orientation": "upright", "grid": 0,
        "descriptor": "sift"}
SIFT = {"front": "sift", "contrast": 0.02, "descriptor": "rootsift"}
# What OpenCV has against wide baselines: ASIFT's 43 views (J.-M. Morel, G. Yu, SIAM J. Imaging
# Sciences 2009), the strongest 20 000 keypoints of all of them.
ASIFT = {**SIFT, "front": "asift", "contrast": 0.04, "cap": 20000}
COLMAP = {"front": "pycolmap"}
LEARNED = {"front": "learned", "long_side": 0}  # 0: images as they are; the packages' own is 1024
_FASTS = [FAST, {**FAST, "size": 4}, {**FAST, "orientation": "gradient"},
          {**FAST, "threshold": 5, "orientation": "gradient", "grid": 64}]
_SIFTS = [SIFT, {**SIFT, "contrast": 0.04}, {**SIFT, "descriptor": "sift"},
          {**SIFT, "contrast": 0.04, "descriptor": "sift"}]
# The peers that --peers can name: an estimator, and the front ends among which it may choose. Each
# counts at its best front end, ratio and inlier threshold over all sets together. The first front
# end, RATIO and 1 px are "the usual options".
FAMILIES = {
    "fast": ("magsac", _FASTS),
    "fast_poselib": ("poselib", _FASTS),
    "sift": ("magsac", _SIFTS),
    "poselib": ("poselib", _SIFTS[:2]),
    "sift8192": ("poselib", [{**SIFT, "cap": 8192}]),
    "asift": ("poselib", [ASIFT]),
    "asift_magsac": ("magsac", [ASIFT]),
    "xfeat": ("poselib", [{**LEARNED, "kind": "xfeat"}]),
    "xfeat_lighterglue": ("poselib", [{**LEARNED, "kind": "lighterglue"}]),
    "aliked_lightglue": ("poselib", [{**LEARNED, "kind": "aliked"},
                                     {**LEARNED, "kind": "aliked", "long_side": 1024}]),
    "disk_lightglue": ("poselib", [{**LEARNED, "kind": "disk"},
                                   {**LEARNED, "kind": "disk", "long_side": 1024}]),
    "colmap": ("poselib", [COLMAP]),
    "pycolmap": ("pycolmap", [COLMAP]),
    "pycolmap_tvg": ("pycolmap_tvg", [COLMAP]),
}
RATIOS = (0.75, 0.8, 0.85, 0.9)
THRESHOLDS_PX = (0.5, 1.0, 2.0)


def describe(config, threshold_px=1.0, ratio=RATIO):
    """The name of a row, with the versions of the software that it runs."""
    version = estimators.module_version
    if config["front"] == "fast":
        front = (f"OpenCV {version('cv2')} FAST9 t{config['threshold']} s{config['size']} "
                 f"{config['orientation']}{' grid' if config['grid'] else ''}")
    elif config["front"] in ("sift", "asift"):
        kind = {"sift": "SIFT", "rootsift": "RootSIFT"}[config["descriptor"]]
        views = "AffineFeature of " if config["front"] == "asift" else ""
        cap = f" {config['cap']}" if config.get("cap", CAP) != CAP else ""
        front = f"OpenCV {version('cv2')} {views}{kind} c{config['contrast']:g}{cap}"
    elif config["front"] == "learned":
        front = learned.describe(config)
    else:
        front = f"COLMAP {version('pycolmap')} SIFT"
    title, module, _ = estimators.PEERS[config["estimator"]]
    title = title.replace("OpenCV ", "")
    if module == "poselib":
        title = title.replace("PoseLib", f"PoseLib {version(module)}")
    tested = "" if config["front"] == "learned" else f" r{ratio:g}"
    return f"{front}{tested} + {title} {threshold_px:.1f}"


# ---- keypoints and descriptors of the peers ---------------------------------------------------

def orientations(gray, points, size):
    """[(index of the point, degrees clockwise from x)] by D. G. Lowe, IJCV 2004, section 5: a
    histogram of 36 bins under a Gaussian window of 1.5 times the scale (size / 2); the highest peak
    and all peaks above 80 % of it, refined by a parabola through three bins."""
    import cv2
    base = cv2.GaussianBlur(gray.astype(np.float32), (0, 0), np.sqrt(1.6**2 - 0.5**2))
    sigma = 1.5 * size / 2
    radius = int(round(3 * sigma))
    dx = np.zeros_like(base)
    dy = np.zeros_like(base)
    dx[:, 1:-1] = base[:, 2:] - base[:, :-2]
    # Positive downwards, so that angles increase clockwise in the image.
    dy[1:-1] = base[2:] - base[:-2]
    dx[[0, -1]] = dy[[0, -1]] = dx[:, [0, -1]] = dy[:, [0, -1]] = 0
    magnitude = np.pad(np.hypot(dx, dy), radius)
    bins = np.pad(np.round(np.degrees(np.arctan2(dy, dx)) / 10).astype(int) % 36, radius)
    offset = np.arange(-radius, radius + 1)
    window = np.exp(-(offset[:, None] ** 2 + offset**2) / (2 * sigma**2))
    found = []
    rows = offset[:, None] + radius
    for start in range(0, len(points), 256):
        centre = np.round(points[start:start + 256]).astype(int)
        y = centre[:, 1, None, None] + rows
        x = centre[:, 0, None, None] + (offset + radius)[None]
        slots = bins[y, x] + 36 * np.arange(len(centre))[:, None, None]
        histogram = np.bincount(slots.ravel(), (magnitude[y, x] * window).ravel(),
                                36 * len(centre)).reshape(-1, 36)
        roll = lambda k: np.roll(histogram, k, axis=1)
        histogram = (roll(2) + roll(-2) + 4 * (roll(1) + roll(-1)) + 6 * histogram) / 16
        left, right = np.roll(histogram, 1, axis=1), np.roll(histogram, -1, axis=1)
        top = histogram.max(axis=1, keepdims=True)
        peak = (histogram > left) & (histogram > right) & (histogram >= 0.8 * top)
        index, slot = np.nonzero(peak)
        h, l, r = (a[index, slot] for a in (histogram, left, right))
        degrees = (slot + 0.5 * (l - r) / (l - 2 * h + r)) * 10 % 360
        found += zip(start + index, degrees)
    return found


def _strongest(points, scores, grid, shape, cap=CAP):
    """The order of the points to keep: strongest first. With a grid, each cell's share of strongest
    points comes first."""
    order = np.lexsort((points[:, 0], points[:, 1], -scores))
    if not grid or len(order) <= cap:
        return order[:cap]
    cells_x = -(-shape[1] // grid)
    cells = (points[:, 1] // grid).astype(int) * cells_x + (points[:, 0] // grid).astype(int)
    share = -(-cap // (cells_x * -(-shape[0] // grid)))
    sorted_cells = cells[order]
    by_cell = np.argsort(sorted_cells, kind="stable")
    starts = np.searchsorted(sorted_cells[by_cell], sorted_cells[by_cell])
    rank = np.empty(len(order), int)
    rank[by_cell] = np.arange(len(order)) - starts
    return np.concatenate([order[rank < share], order[rank >= share]])[:cap]


def _root(descriptors):
    descriptors = descriptors / np.maximum(descriptors.sum(axis=1, keepdims=True), 1e-12)
    return np.sqrt(descriptors).astype(np.float32)


def extract(gray, config):
    """(points n x 2, descriptors n x 128 float32), at most config["cap"] (default CAP) of them."""
    cap = config.get("cap", CAP)
    if config["front"] == "pycolmap":
        return _extract_pycolmap(gray, cap)
    import cv2
    cv2.setNumThreads(1)
    if config["front"] in ("sift", "asift"):
        sift = cv2.SIFT_create(nfeatures=cap, contrastThreshold=config["contrast"])
        if config["front"] == "asift":
            sift = cv2.AffineFeature_create(sift)
        keypoints, descriptors = sift.detectAndCompute(gray, None)
        if len(keypoints) > cap:  # OpenCV returns more than cap if scores are equal
            best = np.argsort([-k.response for k in keypoints], kind="stable")[:cap]
            keypoints, descriptors = [keypoints[i] for i in best], descriptors[best]
    else:
        detector = cv2.FastFeatureDetector_create(config["threshold"], True,
                                                  cv2.FAST_FEATURE_DETECTOR_TYPE_9_16)
        corners = detector.detect(gray, None)
        points = np.array([k.pt for k in corners], float).reshape(-1, 2)
        scores = np.array([k.response for k in corners], float)
        points = points[_strongest(points, scores, config["grid"], gray.shape, cap)]
        if config["orientation"] == "gradient":
            oriented = orientations(gray, points, config["size"])[:cap]
        else:
            oriented = [(i, 0.0) for i in range(len(points))]
        keypoints = [cv2.KeyPoint(float(points[i][0]), float(points[i][1]), float(config["size"]),
                                  float(angle), 0.0, 0) for i, angle in oriented]
        keypoints, descriptors = cv2.SIFT_create().compute(gray, keypoints)
    if not keypoints:
        return np.zeros((0, 2)), np.zeros((0, 128), np.float32)
    if config["descriptor"] == "rootsift":
        descriptors = _root(descriptors)
    return np.array([k.pt for k in keypoints], float), descriptors


def _extract_pycolmap(gray, cap):
    """COLMAP's own SIFT (RootSIFT by default). Its pixel origin is the corner of a pixel. The
    descriptors stay COLMAP's objects, which its matcher needs."""
    pycolmap = estimators.pycolmap_module()
    options = pycolmap.FeatureExtractionOptions()
    options.num_threads, options.use_gpu = 1, False
    options.sift.max_num_features = cap
    extractor = pycolmap.FeatureExtractor.create(options, pycolmap.Device.cpu)
    keypoints, descriptors = extractor.extract_from_uint8_array(gray)
    points = np.array([(k.x, k.y) for k in keypoints], float).reshape(-1, 2) - 0.5
    return points, (keypoints, descriptors)


def masked(points, descriptors, used):
    """What extract() returned, without the points on pixels where `used`, (height, width) bool, is
    False."""
    if not len(points):
        return points, descriptors
    x, y = (np.clip(np.rint(points[:, k]).astype(int), 0, used.shape[1 - k] - 1) for k in (0, 1))
    kept = used[y, x]
    if isinstance(descriptors, tuple):
        pycolmap = estimators.pycolmap_module()
        keypoints, own = descriptors
        return points[kept], (
            pycolmap.FeatureKeypoints([k for k, is_kept in zip(keypoints, kept) if is_kept]),
            pycolmap.FeatureDescriptors(type=own.type, data=own.data[kept]))
    return points[kept], descriptors[kept]


def _two_nearest(products, distances):
    """For each row the nearest column, its distance and the smallest distance to another column;
    for each column the nearest row. distances(rows, products of these rows): their distances, an
    array that is overwritten. Blocks of rows stay in the CPU's cache."""
    num0, num1 = products.shape
    nearest, back = np.empty(num0, int), np.zeros(num1, int)
    first, second = np.empty(num0, np.float32), np.empty(num0, np.float32)
    least = np.full(num1, np.inf, np.float32)
    for start in range(0, num0, BLOCK):
        rows = slice(start, min(start + BLOCK, num0))
        block = distances(rows, products[rows])
        index = np.arange(len(block))
        smallest = block.min(axis=0)
        nearer = np.nonzero(smallest < least)[0]  # of equal distances the first row counts
        least[nearer] = smallest[nearer]
        back[nearer] = start + block[:, nearer].argmin(axis=0)
        nearest[rows] = block.argmin(axis=1)
        first[rows] = block[index, nearest[rows]]
        block[index, nearest[rows]] = np.inf
        second[rows] = block.min(axis=1)
    return nearest, first, second, back


def match(descriptors0, descriptors1, ratio=RATIO):
    """(idx0, idx1, ratio) of mutual nearest neighbours; the ratio test is from image 0 to image
    1."""
    if len(descriptors0) < 2 or len(descriptors1) < 2:
        return np.zeros(0, int), np.zeros(0, int), np.zeros(0)
    d0, d1 = descriptors0.astype(np.float32), descriptors1.astype(np.float32)
    lengths0, lengths1 = (d0**2).sum(1)[:, None], (d1**2).sum(1)
    nearest, first, second, back = _two_nearest(
        d0 @ d1.T,
        lambda rows, part: np.maximum(lengths0[rows] + lengths1 - 2 * part, 0))
    index = np.arange(len(d0))
    keep = (back[nearest] == index) & (first < ratio**2 * second)
    return (index[keep], nearest[keep],
            np.sqrt(first[keep] / np.maximum(second[keep], 1e-30)))


def match_pycolmap(features0, features1, ratio=RATIO):
    """COLMAP's matcher with its defaults (ratio 0.8, distance 0.7, mutual), or another ratio."""
    pycolmap = estimators.pycolmap_module()
    options = pycolmap.FeatureMatchingOptions()
    options.sift.max_ratio = ratio
    options.num_threads, options.use_gpu = 1, False
    matcher = pycolmap.FeatureMatcher.create(options, pycolmap.Device.cpu)
    found = np.asarray(matcher.match(*features0, *features1), int).reshape(-1, 2)
    return found[:, 0], found[:, 1], None


def match_angles(features0, features1):
    """(idx0, idx1, ratio) as COLMAP's matcher finds them, but for the ratio test: mutual nearest
    neighbours by the angle between descriptors, at most 0.7 rad; the ratio is the larger of both
    directions'. Those with a ratio below r are what match_pycolmap returns for r, in a tenth of its
    time (a test compares both)."""
    d0, d1 = (np.asarray(f[1].data).astype(np.float32) for f in (features0, features1))
    if len(d0) < 2 or len(d1) < 2:
        return np.zeros(0, int), np.zeros(0, int), np.zeros(0)
    angles = np.arccos(np.clip((d0 @ d1.T) / np.float32(512.0**2), 0, 1))
    nearest, back = angles.argmin(axis=1), angles.argmin(axis=0)
    index = np.nonzero(back[nearest] == np.arange(len(d0)))[0]
    other = nearest[index]
    first = angles[index, other]
    angles[index, other] = np.inf  # of a mutual pair, the nearest in its row and in its column
    second = np.minimum(angles[index].min(axis=1), angles[:, other].min(axis=0))
    keep = first <= 0.7
    return index[keep], other[keep], (first / np.maximum(second, 1e-30))[keep]


# ---- rows -------------------------------------------------------------------------------------

class Peer:
    """A row of the table: a configuration that is evaluated on pairs, with stored results where
    they exist."""

    def __init__(self, config, num_seeds=3, threshold_px=1.0, use_cache=True, ratio=RATIO):
        self.config, self.num_seeds, self.threshold_px = config, num_seeds, threshold_px
        self.ratio, self.use_cache = ratio, use_cache
        self.name = describe(config, threshold_px, ratio)
        modules = {"cv2", {"pycolmap": "pycolmap"}.get(config["front"], "cv2"),
                   estimators.PEERS[config["estimator"]][1]}
        versions = {m: estimators.module_version(m) for m in sorted(modules)}
        if config["front"] == "learned":
            versions |= learned.versions()
        self.key = {"config": config, "threshold_px": threshold_px, "cap": CAP, "ratio": ratio,
                    "confidence": estimators.CONFIDENCE,
                    "max_iterations": estimators.MAX_ITERATIONS, "format": CACHE_FORMAT,
                    "numpy": np.__version__,
                    "versions": versions}

    def pair_key(self, data, pair):
        cameras = [data.camera(pair, i) for i in (0, 1)]
        text = json.dumps([self.key, data.resize, pair.text, data.pixel_hash(pair.name0),
                           data.pixel_hash(pair.name1),
                           [[K.tolist(), list(d)] for K, d in cameras]], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    def run(self, data, progress=None, shared=None):
        """A list of rows in the form of pipeline.evaluate_matches, seed by seed. `shared`: a dict
        in which peers with the same front end keep features and matches of this set."""
        shared = {} if shared is None else shared
        name = hashlib.sha256(json.dumps(self.key, sort_keys=True).encode()).hexdigest()[:16]
        path = os.path.join(CACHE_DIR, f"{data.name}-{name}.json")
        stored = {}
        if self.use_cache and os.path.isfile(path):
            with open(path, encoding="utf-8") as f:
                stored = json.load(f)
        rows, changed = [], False
        for number, pair in enumerate(data.pairs):
            key = self.pair_key(data, pair)
            have = stored.get(key, [])
            if len(have) < self.num_seeds:
                have = self._run_pair(data, pair, shared)
                stored[key], changed = have, True
            rows += [{**row, "set": data.name, "name0": pair.name0, "name1": pair.name1,
                      **{k: np.inf if row[k] is None else row[k] for k in row
                         if k.endswith("error_deg") or k.endswith("signed_deg")}}
                     for row in have[:self.num_seeds]]
            if progress:
                progress(number + 1, len(data.pairs))
        if changed and self.use_cache:
            os.makedirs(CACHE_DIR, exist_ok=True)
            with open(path + ".part", "w", encoding="utf-8") as f:
                json.dump(stored, f, allow_nan=False)
            os.replace(path + ".part", path)
        return rows

    def matches(self, data, pair, shared):
        """(estimators.Matches, ms of extraction, ms of matching, mean number of keypoints) of a
        pair, in CPU time. `shared`: as in run."""
        if self.config["front"] == "learned":
            return self._learned_matches(data, pair, shared)
        features = shared.setdefault("features", {})
        for name in (pair.name0, pair.name1):
            if name not in features:
                start = time.process_time()
                found = extract(data.gray(name)[0], self.config)
                features[name] = found, 1e3 * (time.process_time() - start)
        ((points0, d0), ms0), ((points1, d1), ms1) = features[pair.name0], features[pair.name1]
        colmap = self.config["front"] == "pycolmap"
        links = shared.setdefault("links", {})
        if pair.text not in links:  # found once without a ratio test; they serve every ratio
            start = time.process_time()
            found = match_angles(d0, d1) if colmap else match(d0, d1, 1.0)
            links[pair.text] = found, 1e3 * (time.process_time() - start)
        (index0, index1, ratios), match_ms = links[pair.text]
        keep = ratios < self.ratio
        index0, index1, ratios = index0[keep], index1[keep], ratios[keep]
        sizes = [data.gray(n)[0].shape[::-1] for n in (pair.name0, pair.name1)]
        found = estimators.Matches(points0[index0], points1[index1],
                                   (data.camera(pair, 0), data.camera(pair, 1)), sizes, ratios)
        return found, ms0 + ms1, match_ms, (len(points0) + len(points1)) / 2

    def _learned_matches(self, data, pair, shared):
        links = shared.setdefault("links", {})
        names = pair.name0, pair.name1
        grays = [data.gray(name)[0] for name in names]
        if pair.text not in links:
            if "learned" not in shared:
                shared["learned"] = learned.Matcher(
                    learned.command(self.config, self.config.get("cap", CAP)))
            links[pair.text] = shared["learned"].match(names, grays)
        points0, points1, *figures = links[pair.text]
        return (estimators.Matches(points0, points1, (data.camera(pair, 0), data.camera(pair, 1)),
                                   [gray.shape[::-1] for gray in grays]), *figures)

    def _run_pair(self, data, pair, shared):
        matches, extract_ms, match_ms, num_keypoints = self.matches(data, pair, shared)
        share = metrics.precision(matches.rays0, matches.rays1, pair.R, pair.t)
        rows = []
        for seed in range(self.num_seeds):
            start = time.process_time()
            found = estimators.run_peer(self.config["estimator"], matches, self.threshold_px, seed)
            estimate_ms = 1e3 * (time.process_time() - start)
            R, t, inliers = found or (None, None, 0)
            rows.append(metrics.finite(
                {"seed": seed, "num_keypoints": num_keypoints, "num_matches": len(matches),
                 "num_inliers": inliers, "precision": share,
                 "ms": {"extract": extract_ms, "match": match_ms, "estimate": estimate_ms},
                 **metrics.pose_error(R, t, pair.R, pair.t)}))
        return rows


# ---- the best options of a peer ------------------------------------------------------------------

def options_of(family, best, cap=CAP):
    """[(config, ratio, threshold_px)] of a family; only the usual options unless `best`."""
    estimator, fronts = FAMILIES[family]
    capped = {} if cap == CAP else {"cap": cap}
    if not best:
        return [({**fronts[0], **capped, "estimator": estimator}, RATIO, 1.0)]
    return [({**front, **capped, "estimator": estimator}, ratio, threshold)
            for front in fronts for ratio in ((RATIO,) if front["front"] == "learned" else RATIOS)
            for threshold in THRESHOLDS_PX]


def _run_front(job):
    set_dir, flagged, max_pairs, num_seeds, use_cache, options = job
    data = datasets.load(set_dir, flagged, max_pairs)
    shared = {}
    return [Peer(config, num_seeds, threshold, use_cache, ratio).run(data, shared=shared)
            for config, ratio, threshold in options]


def evaluate(options, sets, num_seeds, use_cache=True, jobs=1):
    """[{set: rows}], one for each of options_of's options. The features of an image and the matches
    of a pair are computed once for all options with the same front end."""
    by_front = {}
    for index, (config, _, _) in enumerate(options):
        front = {k: v for k, v in config.items() if k != "estimator"}
        by_front.setdefault(json.dumps(front, sort_keys=True), []).append(index)
    work, places = [], []
    for data in sets:
        for indices in by_front.values():
            work.append((data.dir, len(data.pair_files) > 1, data.max_pairs, num_seeds, use_cache,
                         [options[i] for i in indices]))
            places.append((data.name, indices))
    found = [{} for _ in options]
    report = tables.progress(options[0][0]["estimator"], log=True)
    for done, ((name, indices), parts) in enumerate(
            zip(places, parallel.run(_run_front, work, jobs)), 1):
        for i, rows in zip(indices, parts):
            found[i][name] = rows
        report(done, len(work))
    return found


def best_options(options, rows):
    """The index of the options with the best mean of AUC5, 10 and 20 over both groups
    (leaveout.criterion), and that mean for each option. rows: of evaluate."""
    table = {name: np.array([[metrics.auc_of_runs(tables.runs_of(part[name]), t)
                              for t in metrics.THRESHOLDS_DEG] for part in rows])
             for name in rows[0]}
    return leaveout.choose(table), leaveout.criterion(table)


def choose(family, sets, num_seeds, best=True, use_cache=True, jobs=1, cap=CAP):
    """(the family's Peer at its best options, {set: rows}, text that says how it was chosen). The
    choice is made with one seed."""
    options = options_of(family, best, cap)
    index, text = 0, "the usual options"
    if len(options) > 1:
        index, scores = best_options(options, evaluate(options, sets, 1, use_cache, jobs))
        usual = options.index(options_of(family, False, cap)[0])
        text = (f"best of {len(options)} options, {scores[index]:.1f} "
                f"(usual options {scores[usual]:.1f}, worst {scores.min():.1f})")
    config, ratio, threshold = options[index]
    rows, = evaluate([options[index]], sets, num_seeds, use_cache, jobs)
    return Peer(config, num_seeds, threshold, use_cache, ratio), rows, text
