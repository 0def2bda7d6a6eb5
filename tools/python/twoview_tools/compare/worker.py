"""The child process, which runs one system on one pair at a time. A crash of a system ends only
this process.

`PYTHON -m twoview_tools.compare.worker FD`: requests and answers are JSON on that connection,
because numpy's pickles differ between the two Pythons.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):  # one thread; set before importing numpy
    os.environ.setdefault(_name, "1")

import functools
import hashlib
import json
import resource
import sys
import time
from multiprocessing.connection import Connection

import numpy as np

from .. import formats
from ..accuracy import datasets, estimators
from . import systems
from .masked import kept_by_mask, used_pixels


GRAVITY_SIGMA_RAD = np.radians(0.5)  # error of the gravity taken from a reference pose


class Failed(Exception):
    """A system reports that it found nothing; the text describes the reason."""


class Stopwatch:
    """Measures the wall-clock time of each stage in milliseconds."""

    def __init__(self):
        self.ms, self.last = {}, time.perf_counter()

    def lap(self, stage=None):
        """Adds the time since the last lap to `stage`; with None it is not counted."""
        now = time.perf_counter()
        if stage:
            self.ms[stage] = self.ms.get(stage, 0) + 1e3 * (now - self.last)
        self.last = now


@functools.lru_cache(maxsize=4)
def luma(path, resize):
    return datasets.resized_luma(path, resize)


class Views:
    """The two images of a task, their cameras at the scale of the images, and which pixels of each
    are used."""

    def __init__(self, task):
        self.gray, self.cameras, self.file_sizes, self.used = [], [], [], []
        for view in task["views"]:
            image, scale_x, scale_y = luma(view["path"], task["resize"])
            self.gray.append(image)
            self.used.append(used_pixels(view["mask"], image.shape))
            self.file_sizes.append((round(image.shape[1] / scale_x),
                                    round(image.shape[0] / scale_y)))
            if not view["has_entry"]:
                formats.check_K(None, view["name"], view["K"], *self.file_sizes[-1])
            K = datasets.scale_K(np.array(view["K"]), scale_x, scale_y)
            self.cameras.append((K, view["distortion"]))
        self.sizes = [image.shape[::-1] for image in self.gray]

    def matches(self, pixels0, pixels1, ratios=None, relative_sizes=None):
        return estimators.Matches(pixels0, pixels1, self.cameras, self.sizes, ratios,
                                  relative_sizes)


@functools.lru_cache(maxsize=2)
def twoview_context(width, height, max_matches):
    from ..accuracy import twoview_ctypes
    library = twoview_ctypes.Library(os.environ["TWOVIEW_LIBRARY"])
    return twoview_ctypes.Context(library, max_width=width, max_height=height,
                                  max_matches=max_matches)


# ---- whole pipelines ---------------------------------------------------------------------------

def run_twoview(views, options, task):
    del options
    width, height = np.max(views.sizes, axis=0)
    context = twoview_context(int(width), int(height), 0)
    watch = Stopwatch()
    features = [context.extract(gray, mask=used) for gray, used in zip(views.gray, views.used)]
    watch.lap("extract")
    links = context.match(features[0][1], features[1][1], None, features[0][0], features[1][0])
    watch.lap("match")
    chosen = [k[links[side]] for (k, _), side in zip(features, ("idx0", "idx1"))]
    size_of_one = context.library.feature_options().keypoint_size
    matches = views.matches(*(np.column_stack([k["x"], k["y"]]) for k in chosen),
                            links["ratio"].copy(),
                            [(k["size"] / size_of_one).astype(float) for k in chosen])
    watch.lap()
    from ..accuracy import twoview_ctypes
    R, t, inliers, found = estimators.run_twoview(context, matches, None, task["seed"])
    watch.lap("estimate")
    return {"num_keypoints": [len(k) for k, _ in features], **pose_answer(R, t, inliers, found),
            "config": twoview_ctypes.enum_name("kind", found.kind),
            "verdict": twoview_ctypes.enum_name("verdict", found.verdict),
            "probability_wrong": found.probability_wrong,
            **matches_answer(matches)}, watch.ms


@functools.lru_cache(maxsize=48)
def peer_features(path, mask, resize, front):
    """(points, descriptors, milliseconds), without those on pixels that the mask leaves out. The
    features of the latest 48 images are kept; the time
    of their extraction counts in each pair that uses them."""
    from ..accuracy import peers
    gray = luma(path, resize)[0]
    start = time.perf_counter()
    points, descriptors = peers.extract(gray, dict(front))
    used = used_pixels(mask, gray.shape)
    if used is not None:
        points, descriptors = peers.masked(points, descriptors, used)
    return points, descriptors, 1e3 * (time.perf_counter() - start)


@functools.lru_cache(maxsize=4)
def peer_matches(path0, path1, mask0, mask1, resize, front):
    """(pixels0, pixels1, ratios or None, numbers of keypoints, ms). Systems that differ only in
    their estimator share these matches."""
    from ..accuracy import peers
    (points0, d0, ms0), (points1, d1, ms1) = (
        peer_features(path, mask, resize, front) for path, mask in ((path0, mask0), (path1, mask1)))
    watch = Stopwatch()
    find = peers.match_pycolmap if dict(front)["front"] == "pycolmap" else peers.match
    index0, index1, ratios = find(d0, d1)
    watch.lap("match")
    return (points0[index0], points1[index1], ratios, [len(points0), len(points1)],
            {"extract": ms0 + ms1, **watch.ms})


def run_peer_pipeline(views, options, task):
    front = tuple((k, v) for k, v in options.items() if k not in ("estimator", "max_error_px"))
    *found, num_keypoints, ms = peer_matches(
        *(view[key] for key in ("path", "mask") for view in task["views"]), task["resize"], front)
    matches = views.matches(*found)
    watch = Stopwatch()
    pose = estimators.run_peer(options["estimator"], matches,
                               options.get("max_error_px", task["max_error_px"]), task["seed"])
    watch.lap("estimate")
    return {"num_keypoints": num_keypoints, **pose_answer(*pose or (None, None, 0)),
            **matches_answer(matches)}, {**ms, **watch.ms}


def run_colmap_program(views, options, task):
    from . import colmap_program
    watch = Stopwatch()
    found = colmap_program.run(views, options["cap"], task["max_error_px"], task["seed"], watch)
    matches = views.matches(*found.pop("pixels"))
    return {**found, **pose_answer(found["R"], found["t"], found["num_inliers"]),
            **matches_answer(matches)}, watch.ms


def run_own(views, options, task):
    """Matches of the user's, and twoview's estimate from them."""
    from .. import own_matches
    from ..accuracy import twoview_ctypes
    if options["file"] is None:
        raise Failed(f"no file of this pair in {options['matches']}")
    given = own_matches.read_matches(options["file"])
    pixels = [given.pixels0, given.pixels1]
    if options["exchanged"]:
        pixels.reverse()
    whole = own_matches.Matches(*pixels, given.ratios)
    resize = options["matches_resize"]
    matched = [datasets.resized_shape(*size, resize or 0) for size in views.file_sizes]
    own_matches.require_pixels(whole, matched, options["file"], may_be_smaller=resize is None)
    scaled = [(p + 0.5) * (np.array(size) / was) - 0.5
              for p, size, was in zip(pixels, views.sizes, matched)]
    own_matches.require_order(*scaled, views.gray, options["file"])
    kept = np.logical_and(*(kept_by_mask(p, used) for p, used in zip(scaled, views.used)))
    matches = views.matches(*(p[kept] for p in scaled),
                            None if given.ratios is None else given.ratios[kept])
    context = twoview_context(64, 64, max(8192, 1 << (len(given) - 1).bit_length()))
    watch = Stopwatch()
    R, t, inliers, found = estimators.run_twoview(context, matches, None, task["seed"])
    watch.lap("estimate")
    return {**pose_answer(R, t, inliers, found),
            "config": twoview_ctypes.enum_name("kind", found.kind),
            "verdict": twoview_ctypes.enum_name("verdict", found.verdict),
            "probability_wrong": found.probability_wrong,
            "note": "not used: " + ", ".join(given.left_out) if given.left_out else "",
            **matches_answer(matches)}, watch.ms


def pose_answer(R, t, inliers, found=None):
    """The answer with a pose. `found` is our library's tv_two_view, whose pose may refer to cameras
    with a shifted principal point."""
    if R is None or t is None:
        return {"R": None, "t": None, "num_inliers": int(inliers or 0)}
    answer = {"R": np.asarray(R).tolist(), "t": np.ravel(t).tolist(), "num_inliers": int(inliers)}
    if found is not None:
        answer["principal_point_shift_px"] = list(found.principal_point_shift)
    return answer


def matches_answer(matches):
    ratios = None if matches.ratios is None else np.asarray(matches.ratios, float).tolist()
    return {"pixels0": matches.pixels0.tolist(), "pixels1": matches.pixels1.tolist(),
            "ratios": ratios}


def pipeline(system, task, _):
    views = Views(task)
    run = {"twoview": run_twoview, "colmap": run_colmap_program,
           "own": run_own}.get(system.module, run_peer_pipeline)
    answer, ms = run(views, system.options, task)
    return {**answer, "ms": ms, "cameras": [[K.tolist(), list(d)] for K, d in views.cameras],
            "sizes": [list(map(int, size)) for size in views.sizes]}


# ---- solvers on identical matches --------------------------------------------------------------

def given_matches(given):
    """Converts the matches in a pipeline's answer to estimators.Matches."""
    cameras = [(np.array(K), d) for K, d in given["cameras"]]
    ratios = None if given["ratios"] is None else np.array(given["ratios"], np.float32)
    return estimators.Matches(given["pixels0"], given["pixels1"], cameras,
                              [tuple(s) for s in given["sizes"]], ratios)


def solver(system, task, matches):
    if system.module != "twoview":
        watch = Stopwatch()
        found = estimators.run_peer(system.options["estimator"], matches, task["max_error_px"],
                                    task["seed"])
        watch.lap("estimate")
        return {**pose_answer(*found or (None, None, 0)), "ms": watch.ms}
    options = {**system.options, **task.get("options", {})}
    if options["method"] == "upright":
        if task["reference"] is None:
            raise Failed("no reference pose to take gravity from")
        options["gravity0"] = np.array([0.0, 1.0, 0.0])
        options["gravity1"] = np.array(task["reference"]["R"]) @ options["gravity0"]
        options["gravity_sigma_rad"] = GRAVITY_SIGMA_RAD
    context = twoview_context(64, 64, 8192)
    watch = Stopwatch()
    R, t, inliers, found = estimators.run_twoview(context, matches, options, task["seed"])
    watch.lap("estimate")
    return {**pose_answer(R, t, inliers, found), "ms": watch.ms}


# ---- triangulations on an identical pose -------------------------------------------------------

def triangulation(system, task, matches):
    """Points in the first camera's frame; NaN where the system reports no point."""
    R, t = np.array(task["pose"]["R"]), np.array(task["pose"]["t"])
    run = {"twoview": triangulate_twoview, "cv2": triangulate_opencv,
           "pycolmap": triangulate_pycolmap, "pyopengv": triangulate_opengv}[system.module]
    points, seconds = run(matches, R, t, system.options)
    return {"points": points.tolist(), "ms": {"triangulate": 1e3 * seconds}}


def timed(work):
    """(result, shortest of three times in seconds); a single run of a few microseconds is not
    reliable."""
    seconds = []
    for _ in range(3):
        start = time.perf_counter()
        result = work()
        seconds.append(time.perf_counter() - start)
    return result, min(seconds)


def triangulate_twoview(matches, R, t, options):
    from ..accuracy import twoview_ctypes
    twoview = twoview_ctypes.twoview
    cameras = [twoview.Camera(*size, K[0, 0], K[1, 1], K[0, 2], K[1, 2],
                              twoview.CameraModel.BROWN_CONRADY, distortion)
               if any(distortion) else twoview.Camera(*size, K[0, 0], K[1, 1], K[0, 2], K[1, 2])
               for (K, distortion), size in zip(matches.cameras, matches.sizes)]
    method = twoview.Triangulation[options["method"].upper().replace("-", "_")]
    found, seconds = timed(lambda: twoview.triangulate(*cameras, R, t, matches.pixels0,
                                                       matches.pixels1, method))
    points = found["position"].copy()
    points[found["status"] == twoview.PointStatus.INVALID] = np.nan
    return points, seconds


def triangulate_opencv(matches, R, t, options):
    import cv2
    tx, ty, tz = t
    E = np.array([[0, -tz, ty], [tz, 0, -tx], [-ty, tx, 0]]) @ R
    P1 = np.column_stack([R, t])

    def work():
        rays0, rays1 = matches.rays0, matches.rays1
        if options.get("correct"):
            rays0, rays1 = (r[0] for r in cv2.correctMatches(E, rays0[None], rays1[None]))
        found = cv2.triangulatePoints(np.eye(3, 4), P1, rays0.T, rays1.T)
        with np.errstate(divide="ignore", invalid="ignore"):
            return (found[:3] / found[3]).T
    return timed(work)


def triangulate_pycolmap(matches, R, t, options):
    del options
    pycolmap = estimators.pycolmap_module()
    P0, P1 = np.eye(3, 4), np.column_stack([R, t])

    def work():
        found = [pycolmap.triangulate_point(P0, P1, a, b)
                 for a, b in zip(matches.rays0, matches.rays1)]
        return np.array([[np.nan] * 3 if point is None else np.ravel(point) for point in found])
    return timed(work)


def triangulate_opengv(matches, R, t, options):
    import pyopengv
    unit0, unit1 = (estimators.unit_rays(rays) for rays in (matches.rays0, matches.rays1))
    function = getattr(pyopengv, options["function"])
    # OpenGV's pose is that of camera 1 in camera 0.
    position, rotation = -R.T @ t, np.ascontiguousarray(R.T)
    found, seconds = timed(lambda: function(unit0, unit1, position, rotation))
    return np.asarray(found, float).reshape(-1, 3), seconds


# ---- the versions of the modules ---------------------------------------------------------------

def versions(modules):
    """{module: its version, or a message about what is missing}."""
    return {module: _version(module) for module in modules}


def _version(module):
    try:
        if module == "twoview":
            library = twoview_context(64, 64, 8192).library
            # The version includes a hash: a development version has many builds.
            with open(library.path, "rb") as f:
                return {"version": library.version(),
                        "sha256": hashlib.sha256(f.read()).hexdigest()}
        if module == "colmap":
            from . import colmap_program
            return {"version": colmap_program.version()}
        return {"version": estimators.module_version(module)}
    except (ImportError, OSError) as error:
        return {"missing": str(error) or type(error).__name__}


def answer(request, matches):
    call, task = request["call"], request["task"]
    if "library" in task:
        os.environ["TWOVIEW_LIBRARY"] = task["library"]
    if call == "versions":
        return versions(task["modules"])
    if call == "images":  # reads the images before the timed calls
        return len(Views(task).gray)
    if call == "reference":
        from . import reference
        return reference.reconstruct(task)
    system = next(s for s in (*systems.SYSTEMS, *systems.own_of(task.get("own", ())))
                  if s.id == request["system"] and s.kind == request["call"])
    run = {"pipeline": pipeline, "solver": solver, "triangulation": triangulation}[call]
    return run(system, task, matches)


def cpu_seconds():
    """The CPU time of this process and of the programs that it ran."""
    programs = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + programs.ru_utime + programs.ru_stime


def serve(connection):
    """Answers requests until the connection closes. Matches may follow a request; later requests
    then share them."""
    matches = None
    while True:
        try:
            request = json.loads(connection.recv_bytes())
            if request["has_matches"]:
                matches = given_matches(json.loads(connection.recv_bytes()))
        except EOFError:
            return
        start = cpu_seconds()
        try:
            reply = {"ok": answer(request, matches)}
        # pylint: disable=broad-except  (any error goes to the reply, and the worker continues)
        except Exception as error:
            reply = {"error": f"{type(error).__name__}: {error}" if not isinstance(error, Failed)
                     else str(error)}
        reply["cpu_seconds"] = cpu_seconds() - start
        connection.send_bytes(json.dumps(reply).encode())


if __name__ == "__main__":
    try:
        import cv2
        cv2.setNumThreads(1)
    except ImportError:
        pass
    serve(Connection(int(sys.argv[1])))
