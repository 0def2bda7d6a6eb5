"""The peers that are called from Python; our library is called through ctypes in the same process,
in turn with them.

OpenCV 5 (wheels), faiss, PoseLib, pycolmap. A time includes the call from Python on both sides.
"""

import ctypes
import json
import os
import random
import sys
import time

import numpy as np

from rows import OURS, Measure
from twoview_tools.accuracy import metrics, robust500, twoview_ctypes

MAX_KEYPOINTS = 2048
RATIO = 0.8
PAIRS = ("640x480", "1280x720")


def _import(name):
    """The imported module, or None if it is not installed."""
    try:
        module = __import__(name)
    except ImportError:
        return None
    if name == "cv2":
        module.setNumThreads(1)
    if name == "faiss":
        module.omp_set_num_threads(1)
    if name == "pycolmap":
        module.logging.minloglevel = 2
    return module


cv2, faiss, poselib, pycolmap = map(_import, ("cv2", "faiss", "poselib", "pycolmap"))
OPENCV = f"OpenCV {cv2.__version__} (Python)"


def _version(module, name):
    if module is None:
        return name
    if not hasattr(module, "__version__"):
        from importlib import metadata
        return f"{name} {metadata.version(name)}"
    return f"{name} {module.__version__}"


FAISS, POSELIB, COLMAP = (_version(m, n) for m, n in (
    (faiss, "faiss-cpu"), (poselib, "poselib"), (pycolmap, "pycolmap")))
POSELIB = POSELIB.replace("poselib", "PoseLib")


class Case:
    """The systems that are measured on one case; run() times them in random order."""

    def __init__(self, stage, case, units=1):
        self.stage, self.case, self.units = stage, case, units
        self.systems = []   # tuples: (system, names of its cases, work, found)
        self.missing = []
        self.round = 0  # number of the repetition; work() may choose its data by it

    def add(self, system, work, found=lambda result: {}, cases=None):
        """Adds a system. work() is timed; found(its last result) describes the result. `cases`
        replaces the case's own name if the system belongs to another case or to several."""
        self.systems.append((system, cases or [self.case], work, found))

    def add_if(self, module, system, work, found=lambda result: {}):
        if module is None:
            self.missing.append(system)
        else:
            self.add(system, work, found)

    def run(self, scale, rounds, least_seconds):
        """Measures all systems. `scale` converts seconds to the unit of the stage."""
        times = [[] for _ in self.systems]
        results = [work() for _, _, work, _ in self.systems]
        turn = random.Random(1)
        calls = [None] * len(self.systems)
        for self.round in range(rounds):
            for k in turn.sample(range(len(self.systems)), len(self.systems)):
                work = self.systems[k][2]
                if calls[k] is None:
                    calls[k] = max(1, int(least_seconds / max(_seconds(work), 1e-7)))
                start = time.process_time()
                for _ in range(calls[k]):
                    results[k] = work()
                seconds = (time.process_time() - start) / calls[k]
                times[k].append(scale * seconds / self.units)
        return [Measure(self.stage, name, system, times[k], found(results[k]))
                for k, (system, names, _, found) in enumerate(self.systems) for name in names] + [
            Measure(self.stage, self.case, system, [], note="peer missing")
            for system in self.missing]


def _seconds(work):
    start = time.process_time()
    work()
    return time.process_time() - start


class Pair:
    def __init__(self, folder, name):
        with open(os.path.join(folder, name + ".json"), encoding="utf-8") as f:
            text = json.load(f)
        self.name = name
        self.R = np.reshape(text["R"]["data"], (3, 3))
        self.t = np.array(text["t"]["data"])
        self.images, self.K = [], []
        for v in (0, 1):
            path = os.path.join(folder, f"{name}_{v}.pgm")
            self.images.append(cv2.imread(path, cv2.IMREAD_GRAYSCALE))
            fx, fy, cx, cy = text[f"K{v}"]["data"]
            self.K.append(np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]))

    def error_deg(self, R, t):
        if R is None:
            return 180.0
        return metrics.pose_error(R, t, self.R, self.t)["pose_error_deg"]


class Ours:
    """Calls for which twoview_ctypes has no wrapper, with arrays that are allocated before the
    timing."""

    def __init__(self, library, pair, max_keypoints=MAX_KEYPOINTS):
        height, width = pair.images[0].shape
        self.library, self.pair = library, pair
        self.context = twoview_ctypes.Context(library, max_width=width, max_height=height,
                                              max_keypoints=max_keypoints)
        self.views = [twoview_ctypes.STRUCTS["tv_image"](i.ctypes.data, width, height, i.strides[0])
                      for i in pair.images]
        self.keypoints = np.zeros(max_keypoints, twoview_ctypes.KEYPOINT)
        self.count = ctypes.c_int32()

    def detect(self, options):
        wanted = self.library.feature_options(options)

        def work():
            self.library.call("tv_detect", self.context._pointer, ctypes.byref(self.views[0]), None,
                              ctypes.byref(wanted), ctypes.c_void_p(self.keypoints.ctypes.data),
                              ctypes.c_int32(len(self.keypoints)), ctypes.byref(self.count))
            return self.count.value
        return work

    def describe(self, keypoints, options):
        wanted = self.library.feature_options(options)
        descriptors = np.zeros((len(keypoints), 128), np.uint8)

        def work():
            self.library.call("tv_describe", self.context._pointer, ctypes.byref(self.views[0]),
                              ctypes.c_void_p(keypoints.ctypes.data),
                              ctypes.c_int32(len(keypoints)), ctypes.byref(wanted),
                              ctypes.c_void_p(descriptors.ctypes.data))
            return descriptors
        return work

    def reconstruct(self, feature=None, match=None):
        library = self.library
        height, width = self.pair.images[0].shape
        cameras = [twoview_ctypes.make_camera(K, width, height) for K in self.pair.K]
        views = [library._init_struct("tv_view") for _ in cameras]
        for view, image, camera in zip(views, self.views, cameras):
            view.image, view.camera = image, ctypes.addressof(camera)
        stages = [library.feature_options(feature), library.match_options(match)]
        options = library._init_struct("tv_reconstruct_options")
        options.feature, options.match = map(ctypes.addressof, stages)
        result = library._init_struct("tv_two_view")
        found = library._init_struct("tv_reconstruction")

        # The default argument keeps the arrays alive as long as `work` exists.
        def work(keep=(cameras, views, stages)):
            del keep
            library.call("tv_reconstruct", self.context._pointer, ctypes.byref(views[0]),
                         ctypes.byref(views[1]), ctypes.byref(options), ctypes.byref(result), None,
                         ctypes.byref(found))
            R = np.reshape(result.R, (3, 3)) if result.has_R and result.has_t else None
            return {"keypoints": found.num_keypoints[0], "matches": found.num_matches,
                    "inliers": result.num_inliers, "points": found.num_points,
                    "error_deg": self.pair.error_deg(R, np.array(result.t))}
        return work


# ---- stages ------------------------------------------------------------------------------------

def _threshold_for(ours, corners):
    """The highest threshold that gives at least the requested number of corners."""
    enough, too_few = 1, 128
    while too_few - enough > 1:
        middle = (enough + too_few) // 2
        count = ours.detect({"threshold": middle, "min_threshold": 0, "subpixel": 0,
                             "max_keypoints": len(ours.keypoints)})()
        enough, too_few = (middle, too_few) if count >= corners else (enough, middle)
    return enough


def fast_cases(library, pairs):
    for pair in pairs:
        ours = Ours(library, pair, 20000)
        for corners in (1000, 4000):
            threshold = _threshold_for(ours, corners)
            detector = cv2.FastFeatureDetector_create(threshold, True)
            case = Case("fast", f"FAST-9 {pair.name} about {corners}")
            case.add(OURS, ours.detect({"threshold": threshold, "min_threshold": 0, "subpixel": 0,
                                        "max_keypoints": 20000}), lambda n: {"corners": n})
            case.add(OPENCV, lambda d=detector, i=pair.images[0]: d.detect(i),
                     lambda k: {"corners": len(k)})
            yield case


def describe_cases(library, pairs):
    for pair in pairs:
        ours = Ours(library, pair)
        for size in (5, 7):
            options = {"keypoint_size": size, "descriptor": "sift"}
            keypoints, _ = ours.context.extract(pair.images[0], options)
            height, width = pair.images[0].shape
            rim = 6 * size
            keypoints = keypoints[(keypoints["x"] > rim) & (keypoints["x"] < width - rim) &
                                  (keypoints["y"] > rim) & (keypoints["y"] < height - rim)]
            for count in (200, 1000):
                chosen = keypoints[np.linspace(0, len(keypoints) - 1, count).astype(int)].copy()
                points = [cv2.KeyPoint(float(k["x"]), float(k["y"]), float(size),
                                       float(np.degrees(k["angle_rad"]) % 360)) for k in chosen]
                for point in points:
                    point.octave = 0
                sift = cv2.SIFT_create()
                case = Case("describe", f"{pair.name} size {size} at {count}", count)
                case.add(OURS, ours.describe(chosen, options), lambda d: {"keypoints": len(d)})
                case.add(OPENCV, lambda s=sift, i=pair.images[0], p=points: s.compute(i, p)[1],
                         lambda d: {"keypoints": len(d)})
                yield case


def extract_cases(library, pairs):
    for pair in pairs:
        ours = Ours(library, pair)
        case = Case("extract", f"{pair.name} defaults")
        image = pair.images[0]
        case.add(OURS, lambda o=ours, i=image: o.context.extract(i),
                 lambda f: {"keypoints": len(f[0])})
        sift = cv2.SIFT_create(MAX_KEYPOINTS)
        case.add(OPENCV + " SIFT", lambda s=sift, i=image: s.detectAndCompute(i, None),
                 lambda f: {"keypoints": len(f[0])})
        extractor = _colmap_extractor()
        case.add_if(pycolmap, COLMAP, lambda e=extractor, i=image: e.extract_from_uint8_array(i),
                    lambda f: {"keypoints": len(f[0])})
        yield case


def _opencv_match(floats, matcher):
    """OpenCV matching with the rules of tv_match: ratio test in both directions, one-to-one."""
    def passing(pairs):
        return {a.queryIdx: a.trainIdx for a, b in pairs if a.distance < RATIO * b.distance}
    forward = passing(matcher.knnMatch(floats[0], floats[1], k=2))
    back = passing(matcher.knnMatch(floats[1], floats[0], k=2))
    return [(i, j) for i, j in forward.items() if back.get(j) == i]


def _faiss_match(floats):
    found = []
    for query, base in ((floats[0], floats[1]), (floats[1], floats[0])):
        index = faiss.IndexFlatL2(base.shape[1])
        index.add(base)
        found.append(index.search(query, 2))
    passing = [squared[:, 0] < RATIO**2 * squared[:, 1] for squared, _ in found]
    nearest = [indices[:, 0] for _, indices in found]
    i = np.arange(len(nearest[0]))
    return np.flatnonzero(passing[0] & passing[1][nearest[0]] & (nearest[1][nearest[0]] == i))


def _faiss_one_way(floats):
    index = faiss.IndexFlatL2(floats[1].shape[1])
    index.add(floats[1])
    return index.search(floats[0], 2)


def match_cases(library, pairs):
    pair = pairs[-1]
    for count in (1000, 4000):
        ours = Ours(library, pair, count)
        bytes_ = [ours.context.extract(i, {"max_keypoints": count})[1].copy() for i in pair.images]
        floats = [b.astype(np.float32) for b in bytes_]
        case = Case("match", "x".join(str(len(b)) for b in bytes_))

        def matches(found):
            return {"matches": len(found)}
        case.add(OURS, lambda o=ours, b=bytes_: o.context.match(*b, {"ratio": RATIO}), matches)
        case.add_if(faiss, FAISS + " both ways", lambda f=floats: _faiss_match(f), matches)
        case.add_if(faiss, FAISS + " one way, 2-NN only", lambda f=floats: _faiss_one_way(f))
        case.add(OPENCV + " both ways",
                 lambda f=floats: _opencv_match(f, cv2.BFMatcher(cv2.NORM_L2)), matches)
        if pycolmap is not None:
            matcher, features = _colmap_matcher(), _colmap_features(bytes_)
            case.add(COLMAP, lambda m=matcher, f=features: m.match(*f[0], *f[1]), matches)
        else:
            case.missing.append(COLMAP)
        yield case


def relpose_cases(library, pairs):
    """PoseLib's minimal solver, one call a sample; ours is timed by the native program."""
    del library, pairs
    samples = []
    for number in range(200):
        pixels0, pixels1, _, _ = robust500.problem(100, number, num=5)
        rays = []
        for pixels in (pixels0, pixels1):
            x = np.column_stack([(pixels - robust500.CENTRE) / robust500.FOCAL, np.ones(5)])
            rays.append(list(x / np.linalg.norm(x, axis=1, keepdims=True)))
        samples.append(rays)
    case = Case("relpose", "five-point", len(samples))
    case.add_if(poselib, POSELIB + " through Python, a call a sample",
                lambda: [poselib.essential_matrix_5pt(a, b) for a, b in samples],
                lambda found: {"solutions": np.mean([len(f) for f in found])})
    yield case


def _opencv_essential(method):
    def run(pixels0, pixels1):
        E, mask = cv2.findEssentialMat(pixels0, pixels1, robust500.K, method, 0.9999, 1.0, 10000)
        if E is None or E.shape != (3, 3):
            return None, None
        _, R, t, _, _ = cv2.recoverPose(E, pixels0, pixels1, robust500.K, distanceThresh=1e9,
                                        mask=mask)
        return R, t.ravel()
    return run


def robust_cases(library, pairs, batch=10):
    """Each repetition uses the next ten problems, so that the errors are taken over many
    problems."""
    del pairs
    context = twoview_ctypes.Context(library, max_width=64, max_height=64, max_matches=500)
    for share in robust500.SHARES:
        case = Case("robust", f"500 matches, {share} % true, through Python", batch)
        problems = {}

        def solve_all(run, poses, case=case, share=share, problems=problems):
            for number in range(batch * case.round, batch * (case.round + 1)):
                poses[number] = run(*problems[number][:2])
            return poses

        def errors(poses, problems=problems):
            found = [metrics.pose_error(*pose, *problems[number][2:])["pose_error_deg"]
                     for number, pose in poses.items()]
            return {"error_deg": float(np.median(found)), "problems": len(found),
                    "above_5deg": int(np.sum(np.array(found) > 5))}
        for number in range(15 * batch):
            problems[number] = robust500.problem(share, number)
        runners = {OURS: robust500._ours(context),
                   OPENCV + " USAC_ACCURATE": _opencv_essential(cv2.USAC_ACCURATE),
                   OPENCV + " USAC_MAGSAC": _opencv_essential(cv2.USAC_MAGSAC)}
        if poselib is not None:
            runners[POSELIB] = robust500._poselib()
            runners[POSELIB + ", min_iterations 50"] = robust500._poselib(min_iterations=50)
        else:
            case.missing.append(POSELIB)
        for name, run in runners.items():
            case.add(name, lambda r=run, s=solve_all, p={}: s(r, p), errors)
        yield case


# ---- whole pairs -------------------------------------------------------------------------------

def _opencv_pair(pair, extract):
    def work():
        (points0, d0), (points1, d1) = map(extract, pair.images)
        found = np.array(_opencv_match((d0, d1), cv2.BFMatcher(cv2.NORM_L2)), int).reshape(-1, 2)
        x0 = np.array([k.pt for k in points0])[found[:, 0]]
        x1 = np.array([k.pt for k in points1])[found[:, 1]]
        K0, K1 = pair.K
        moved = (x1 - K1[:2, 2]) / np.diag(K1)[:2] * np.diag(K0)[:2] + K0[:2, 2]
        E, mask = cv2.findEssentialMat(x0, moved, K0, cv2.USAC_MAGSAC, 0.9999, 1.0, 10000)
        _, R, t, _, _ = cv2.recoverPose(E, x0, moved, K0, distanceThresh=1e9, mask=mask)
        inliers = mask.ravel() > 0
        points = cv2.triangulatePoints(K0 @ np.eye(3, 4), K1 @ np.hstack([R, t]), x0[inliers].T,
                                       x1[inliers].T)
        return {"keypoints": len(points0), "matches": len(found), "inliers": int(inliers.sum()),
                "points": points.shape[1], "error_deg": pair.error_deg(R, t.ravel())}
    return work


def _fast_sift(size):
    def extract(image):
        keypoints = list(cv2.FastFeatureDetector_create(20, True).detect(image))
        keypoints = sorted(keypoints, key=lambda k: -k.response)[:MAX_KEYPOINTS]
        for k in keypoints:
            k.size, k.angle, k.octave = size, 0, 0
        return cv2.SIFT_create().compute(image, keypoints)
    return extract


def _colmap_extractor():
    if pycolmap is None:
        return None
    options = pycolmap.FeatureExtractionOptions()
    options.num_threads, options.use_gpu = 1, False
    options.sift.max_num_features = MAX_KEYPOINTS
    return pycolmap.FeatureExtractor.create(options, pycolmap.Device.cpu)


def _colmap_matcher():
    options = pycolmap.FeatureMatchingOptions()
    options.num_threads, options.use_gpu = 1, False
    return pycolmap.FeatureMatcher.create(options, pycolmap.Device.cpu)


def _colmap_features(descriptors):
    """Our descriptors in the form that COLMAP's matcher needs; it ignores the positions."""
    sides = []
    for d in descriptors:
        keypoints = [pycolmap.FeatureKeypoint(x=float(i % 640), y=float(i // 640))
                     for i in range(len(d))]
        sides.append((pycolmap.FeatureKeypoints(keypoints),
                      pycolmap.FeatureDescriptors(pycolmap.FeatureExtractorType.SIFT, d)))
    return sides


def _colmap_pair(pair):
    extractor, matcher = _colmap_extractor(), _colmap_matcher()
    height, width = pair.images[0].shape
    cameras = [pycolmap.Camera(model="PINHOLE", width=width, height=height,
                               params=[K[0, 0], K[1, 1], K[0, 2] + 0.5, K[1, 2] + 0.5])
               for K in pair.K]
    options = pycolmap.TwoViewGeometryOptions()
    options.compute_relative_pose = True

    def work():
        features = [extractor.extract_from_uint8_array(image) for image in pair.images]
        matches = np.asarray(matcher.match(*features[0], *features[1]), np.uint32).reshape(-1, 2)
        points = [np.array([(k.x, k.y) for k in keypoints], float) for keypoints, _ in features]
        geometry = pycolmap.estimate_calibrated_two_view_geometry(
            cameras[0], points[0], cameras[1], points[1], matches, options)
        pose = geometry.cam2_from_cam1
        R, t = pose.rotation.matrix(), np.array(pose.translation)
        inliers = np.asarray(geometry.inlier_matches, int)
        # COLMAP's own triangulation needs one Python call a point; OpenCV's is faster.
        found = cv2.triangulatePoints(pair.K[0] @ np.eye(3, 4),
                                      pair.K[1] @ np.hstack([R, t[:, None]]),
                                      (points[0][inliers[:, 0]] - 0.5).T,
                                      (points[1][inliers[:, 1]] - 0.5).T)
        return {"keypoints": len(points[0]), "matches": len(matches), "inliers": len(inliers),
                "points": found.shape[1], "error_deg": pair.error_deg(R, t)}
    return work


def pair_cases(library, pairs):
    for pair in pairs:
        case = Case("pair", f"{pair.name} same corners, size 7")
        options = {"arc": 9, "threshold": 20, "min_threshold": 0, "levels": 1, "cell_px": 0,
                   "orientation": "upright", "descriptor": "sift", "keypoint_size": 7}
        match_options = {"ratio": RATIO, "neighbourhood_px": 0}
        case.add(OURS, Ours(library, pair).reconstruct(options, match_options), dict)
        case.add(OPENCV + " FAST + SIFT", _opencv_pair(pair, _fast_sift(7)), dict)
        yield case

        case = Case("pair", f"{pair.name} defaults")
        case.add(OURS, Ours(library, pair).reconstruct(), dict)
        case.add(OPENCV + " FAST + SIFT", _opencv_pair(pair, _fast_sift(7)), dict)
        sift = cv2.SIFT_create(MAX_KEYPOINTS)
        case.add(OPENCV + " SIFT",
                 _opencv_pair(pair, lambda i, s=sift: s.detectAndCompute(i, None)), dict)
        if pycolmap is None:
            case.missing.append(COLMAP)
            yield case
            continue
        # COLMAP is measured once. Its row is reported in two cases: beside our default options, and
        # beside ours with COLMAP's number of keypoints and COLMAP's descriptor window.
        keypoints, _ = _colmap_extractor().extract_from_uint8_array(pair.images[0])
        # A descriptor bin is 3 scales wide in COLMAP and 1.5 keypoint sizes wide in twoview, so the
        # same window needs a keypoint size of 2 scales.
        size = 2 * np.median([k.compute_scale() for k in keypoints])
        options = {"max_keypoints": len(keypoints), "keypoint_size": float(np.clip(size, 1, 32))}
        equal = f"{pair.name} COLMAP's number and median window"
        case.add(OURS, Ours(library, pair, len(keypoints)).reconstruct(options, {"ratio": RATIO}),
                 dict, [equal])
        case.add(COLMAP, _colmap_pair(pair), dict, [case.case, equal])
        yield case


STAGES = {"fast": fast_cases, "describe": describe_cases, "extract": extract_cases,
          "match": match_cases, "relpose": relpose_cases, "robust": robust_cases,
          "pair": pair_cases}


def measure(library_path, folder, stages, quick):
    """Measures of the stages that have peers in Python. `folder` holds the output of
    bench_export_images."""
    from rows import UNITS, pyramid_apart
    library = twoview_ctypes.Library(library_path)
    pairs = [Pair(folder, name) for name in PAIRS]
    rounds, least_seconds = (3, 0.005) if quick else (15, 0.02)
    measures = []
    for stage in (s for s in stages if s in STAGES):
        print(f"bench: {stage} through Python", file=sys.stderr, flush=True)
        for case in STAGES[stage](library, pairs):
            measures += case.run(1e6 / UNITS[stage][1], rounds, least_seconds)
    return measures + pyramid_apart(measures)
