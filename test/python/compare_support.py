"""Functions that several tests of compare_colmap use."""

import importlib.util
import os
import subprocess
import sys
import unittest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
TOOL = os.path.join(ROOT, "tools", "compare_colmap")
PROGRAM = os.path.join(TOOL, "compare_colmap")
MOTORCYCLE = os.path.join(ROOT, ".cache", "motorcycle")
DATA = os.environ.get("TWOVIEW_DATA") or os.path.join(os.path.dirname(ROOT), "shared", "data")

# The Middlebury pair of scripts/demo: it is rectified, and the second camera is to the right of the
# first.
K0 = "994.978 0 311.193 0 994.978 254.877 0 0 1"
K1 = "994.978 0 342.279 0 994.978 254.877 0 0 1"
TRUTH = "1 0 0 -1 0 1 0 0 0 0 1 0 0 0 0 1"
IMAGES = "motorcycle_left.png", "motorcycle_right.png"
LINE = f"{IMAGES[0]} {IMAGES[1]} 0 0 {K0} {K1}"
PEERS = ("cv2", "poselib", "pycolmap")


def skip_without(*packages):
    missing = [p for p in ("numpy", "cv2", "yaml", "jinja2", "plotly", "tqdm", *packages)
               if importlib.util.find_spec(p) is None]
    if missing:
        raise unittest.SkipTest(f"no {', '.join(missing)}: run scripts/bootstrap test")
    if not os.path.isdir(MOTORCYCLE):
        raise unittest.SkipTest("no Motorcycle pair: run scripts/bootstrap test")


def run(*words, environment=None, program=(sys.executable, PROGRAM)):
    return subprocess.run([*program, *map(str, words)], capture_output=True, text=True, check=False,
                          timeout=500, env={**os.environ, **(environment or {})})


def write(folder, name, text, mode=0o644):
    path = os.path.join(folder, name)
    with open(path, "w", encoding="utf-8") as f:
        f.write(text)
    os.chmod(path, mode)
    return path
