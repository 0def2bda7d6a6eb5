"""Runs estimators in the system's Python (Debian's python3-opencv and python3-opengv) in a
subprocess, because these packages are built only for that Python.

The same file is also the program of that subprocess: `-m twoview_tools.accuracy.system_python
JOB.npz OUT.npz`.
"""

import json
import os
import subprocess
import sys
import tempfile
import time

import numpy as np

from .. import environment
from . import estimators

INTERPRETER = "/usr/bin/python3"


def versions():
    """{module: version} of the estimators' modules that are installed for the system's Python."""
    program = ("import json\n"
               "from twoview_tools.accuracy import estimators\n"
               "have = {}\n"
               "for module in ('cv2', 'pyopengv'):\n"
               "    try: have[module] = estimators.module_version(module)\n"
               "    except Exception: pass\n"
               "print(json.dumps(have))")
    try:
        done = subprocess.run([INTERPRETER, "-c", program], env=environment(),
                              capture_output=True, text=True, check=True, timeout=120)
        return json.loads(done.stdout.splitlines()[-1])
    except (OSError, subprocess.SubprocessError, ValueError, IndexError):
        return {}


def run(kind, list_of_matches, threshold_px, num_seeds):
    """For each of the Matches a list, seed by seed, of (R, t, inliers, ms); R is None for a
    failure."""
    job = {"kind": np.array(kind), "threshold_px": np.array(threshold_px),
           "num_seeds": np.array(num_seeds), "count": np.array(len(list_of_matches))}
    for i, m in enumerate(list_of_matches):
        job[f"{i}_pixels0"], job[f"{i}_pixels1"] = m.pixels0, m.pixels1
        job[f"{i}_K"] = np.array([K for K, _ in m.cameras])
        job[f"{i}_distortion"] = np.array([d for _, d in m.cameras], float)
        job[f"{i}_sizes"] = np.array(m.sizes)
    with tempfile.TemporaryDirectory() as folder:
        there, back = os.path.join(folder, "job.npz"), os.path.join(folder, "out.npz")
        np.savez(there, **job)
        subprocess.run([INTERPRETER, "-m", __name__, there, back], env=environment(),
                       check=True)
        with np.load(back) as found:
            table = found["table"]
    return [[(row[:9].reshape(3, 3), row[9:12], int(row[12]), row[13])
             if np.isfinite(row[0]) else (None, None, 0, row[13]) for row in rows]
            for rows in table]


def _serve(there, back):
    with np.load(there) as job:
        kind, threshold_px = str(job["kind"]), float(job["threshold_px"])
        num_seeds = int(job["num_seeds"])
        table = np.full((int(job["count"]), num_seeds, 14), np.nan)
        for i in range(len(table)):
            cameras = list(zip(job[f"{i}_K"], (list(d) for d in job[f"{i}_distortion"])))
            sizes = [tuple(int(x) for x in s) for s in job[f"{i}_sizes"]]
            matches = estimators.Matches(job[f"{i}_pixels0"], job[f"{i}_pixels1"], cameras, sizes)
            for seed in range(num_seeds):
                start = time.perf_counter()
                found = estimators.run_peer(kind, matches, threshold_px, seed)
                table[i, seed, 13] = 1e3 * (time.perf_counter() - start)
                if found is not None:
                    table[i, seed, :9] = np.ravel(found[0])
                    table[i, seed, 9:12] = found[1]
                    table[i, seed, 12] = found[2]
    np.savez(back, table=table)


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    try:
        import cv2
        cv2.setNumThreads(1)
    except ImportError:
        pass
    _serve(*sys.argv[1:])
