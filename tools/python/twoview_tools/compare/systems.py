"""The systems that are compared: the name of each, the code that runs it, and its options."""

import dataclasses
import sys

from ..accuracy import estimators, peers

# COLMAP's defaults: the most keypoints of an image, and the inlier threshold in pixels.
COLMAP_CAP, COLMAP_ERROR_PX = 8192, 4.0


@dataclasses.dataclass(frozen=True)
class System:
    id: str  # the name of the system for --systems and in the output files
    name: str  # the name of the system on the page
    kind: str    # pipeline, solver or triangulation
    # The module whose version is reported: twoview, cv2, pycolmap, colmap, poselib, pyopengv.
    module: str
    options: dict
    note: str = ""

    @property
    def python(self):
        """The interpreter that has the module: Debian's OpenGV is built for Debian's Python."""
        return "/usr/bin/python3" if self.module == "pyopengv" else sys.executable


def _pipelines():
    fast, sift = ({**front, "estimator": "magsac"} for front in (peers.FAST, peers.SIFT))
    colmap = {"front": "pycolmap", "cap": COLMAP_CAP, "estimator": "pycolmap_tvg"}
    capped = f"at most {peers.CAP} features, the common threshold"
    colmaps = f"at most {COLMAP_CAP} features"
    yield System("twoview", "twoview", "pipeline", "twoview", {}, "its defaults")
    yield System("pycolmap", "COLMAP (pycolmap)", "pipeline", "pycolmap", colmap,
                 f"{colmaps}, the common threshold")
    yield System("pycolmap_defaults", "COLMAP (pycolmap), as it comes", "pipeline", "pycolmap",
                 {**colmap, "max_error_px": COLMAP_ERROR_PX},
                 f"{colmaps}, {COLMAP_ERROR_PX:g} px")
    yield System("colmap", "COLMAP (Debian's program)", "pipeline", "colmap", {"cap": COLMAP_CAP},
                 f"{colmaps}, the common threshold")
    yield System("opencv_fast", "OpenCV FAST + SIFT + USAC_MAGSAC", "pipeline", "cv2", fast, capped)
    yield System("opencv_sift", "OpenCV RootSIFT + USAC_MAGSAC", "pipeline", "cv2",
                 {**sift, "cap": peers.CAP}, capped)


def _solvers():
    five_point = ("its default; from the pixels of the matches alone, as the peers: the row "
                  "twoview of the pipelines also knows how precise each keypoint is, from its "
                  "size")
    for method, note in (("five-point", five_point), ("eight-point", "the paper's method"),
                         ("upright", "gravity is the reference pose's: two of the three angles "
                                     "are given")):
        yield System("twoview_" + method.replace("-", "_"), f"twoview {method}", "solver",
                     "twoview", {"method": method}, note)
    for kind, (name, module, _) in estimators.PEERS.items():
        if module != "pyopengv":
            yield System(kind + "_solver", name, "solver", module, {"estimator": kind})
    for kind, (name, module, _) in estimators.OPENGV.items():
        yield System(kind, name, "solver", module, {"estimator": kind},
                     f"at most {estimators.OPENGV_MAX_ITERATIONS} iterations")


def _triangulations():
    for method in ("poly", "poly-abs", "linear-eigen", "linear-ls", "iterative-eigen",
                   "iterative-ls", "midpoint"):
        yield System("twoview_" + method.replace("-", "_"), f"twoview {method}", "triangulation",
                     "twoview", {"method": method})
    yield System("opencv_triangulate", "OpenCV triangulatePoints", "triangulation", "cv2", {})
    yield System("opencv_correct", "OpenCV correctMatches + triangulatePoints", "triangulation",
                 "cv2", {"correct": True})
    yield System("pycolmap_triangulate", "COLMAP triangulate_point", "triangulation", "pycolmap",
                 {}, "a call a point from Python")
    for name in ("triangulate", "triangulate2"):
        yield System("opengv_" + name, f"OpenGV {name}", "triangulation", "pyopengv",
                     {"function": "triangulation_" + name})


SYSTEMS = (*_pipelines(), *_solvers(), *_triangulations())
KINDS = ("pipeline", "solver", "triangulation")


def own_of(entries):
    """The user's own systems of these entries: {"id", "note", "options"}; all are pipelines."""
    return [System(e["id"], e["id"], "pipeline", "own", e["options"], e["note"]) for e in entries]


def of_kind(kind, ids=None):
    return [s for s in SYSTEMS if s.kind == kind and (ids is None or s.id in ids)]


def chosen(text):
    """The ids that a --systems list selects. A word selects an id, a kind (pipelines, solvers,
    triangulations), or all ids that begin with the word and "_" (opencv, opengv)."""
    if not text:
        return [s.id for s in SYSTEMS]
    found = []
    for word in text.split(","):
        ids = [s.id for s in SYSTEMS
               if word in (s.id, s.kind + "s") or s.id.startswith(word + "_")]
        if not ids:
            raise ValueError(f"no system {word!r}; there are {', '.join(s.id for s in SYSTEMS)}, "
                             "and pipelines, solvers, triangulations")
        found += ids
    return [s.id for s in SYSTEMS if s.id in found]
