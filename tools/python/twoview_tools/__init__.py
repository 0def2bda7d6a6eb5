"""The project's Python tools, one importable package.

- formats: the one reader of pairs files, camera files and a data set's cameras.yaml.
- accuracy: the accuracy tables (scripts/accuracy), the verdict and covariance against true poses
  (scripts/belief), and what measures them.
- compare: twoview beside COLMAP, OpenGV, OpenCV and PoseLib (tools/compare_colmap/compare_colmap).
- bags: bags of ROS 1, ROS 2 and MCAP, in and out (tools/compare_colmap/twoview_bags).
- colmap: COLMAP databases and models, in and out (tools/compare_colmap/twoview_colmap).
- paper: the paper's figures and tables (scripts/paper).
- to_rerun: results and recordings for Rerun's viewer (tools/compare_colmap/twoview_rerun).
- odometry: visual odometry over sequences, rendered flights and faults (scripts/odometry).
- docs: what builds and checks the documentation (scripts/docs, test/docs).

compare, bags, colmap and to_rerun are verbs of the program and are installed. accuracy, odometry,
room, paper and docs are the project's laboratory and are not, but for the modules that the verbs
take: modules_of_verbs in tools/twoview/CMakeLists.txt.

`scripts/python -m twoview_tools.accuracy.tune` runs a module of the source tree. The tests get the
same path from test/CMakeLists.txt, and the programs of tools/compare_colmap from their
launch.py.
"""

import os
import pathlib

# The folder that makes this package importable, and two folders above it the root of the source
# tree.
PARENT = pathlib.Path(__file__).resolve().parents[1]
ROOT = PARENT.parents[1]
# The folders of both packages. In the source tree the package twoview lies in python/; in an
# installation it lies beside this package.
FOLDERS = [str(folder) for folder in (PARENT, ROOT / "python")
           if folder == PARENT or (folder / "twoview" / "__init__.py").is_file()]
# The library of the release build; TWOVIEW_LIBRARY overrides it.
DEFAULT_LIBRARY = str(ROOT / "build" / "release" / "lib" / "libtwoview.so")
# Modules that compare, colmap, import and export need, and what installs them: a package of Debian,
# or None, and one of PyPI.
PACKAGES = {
    "cv2": ("python3-opencv", "opencv-python-headless"),
    "jinja2": ("python3-jinja2", "jinja2"),
    "lz4": ("python3-lz4", "lz4"),
    "mcap": (None, "mcap"),
    "numpy": ("python3-numpy", "numpy"),
    "plotly": ("python3-plotly", "plotly"),
    "scipy": ("python3-scipy", "scipy"),
    "pycolmap": (None, "pycolmap"),
    "rosbags": (None, "rosbags"),
    "tqdm": ("python3-tqdm", "tqdm"),
    "twoview": ("python3-twoview", "twoview"),
    "yaml": ("python3-yaml", "pyyaml"),
    "zstandard": ("python3-zstandard", "zstandard"),
}


def environment():
    """The environment for a child process that imports twoview_tools and twoview."""
    folders = [*FOLDERS, *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(folders),
            "PYTHONSAFEPATH": "1"}  # no import from the current folder


def advice(modules):
    """How to install modules that are missing, for the end of an error's line."""
    known = [PACKAGES[name] for name in modules if name in PACKAGES]
    if not known:
        return "scripts/bootstrap test installs what it needs"
    debian, pypi = (" ".join(filter(None, names)) for names in zip(*known))
    apt = f"apt install {debian}, or " if debian else ""
    return f"{apt}pip install {pypi}, or scripts/bootstrap test"
