"""Runs Debian's `colmap` on one pair: features and matches by its commands, then reads the
database."""

import os
import re
import shutil
import subprocess
import tempfile

import numpy as np
import twoview

from ..colmap import conventions
from ..colmap import database as colmap_database
from .masked import write_masks

PROGRAM = "colmap"
NAMES = "0.png", "1.png"


def version():
    """The version of the program in the PATH. Raises ImportError if it is not installed."""
    if shutil.which(PROGRAM) is None:
        raise ImportError(f"no program {PROGRAM} in the PATH (Debian's package colmap)")
    told = _run("help").stdout
    found = re.search(r"COLMAP (\S+)", told)
    return found.group(1) if found else "unknown"


def _run(*arguments):
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
    done = subprocess.run([PROGRAM, *map(str, arguments)], env=environment, capture_output=True,
                          text=True, errors="replace", check=False)
    if done.returncode != 0:
        last = (done.stderr.strip() or done.stdout.strip() or "no message").splitlines()[-1]
        how = (f"signal {-done.returncode}" if done.returncode < 0
               else f"exit status {done.returncode}")
        raise RuntimeError(f"{PROGRAM} {arguments[0]}: {how}: {last}")
    return done


def camera_arguments(size, K, distortion):
    """(the name of COLMAP's camera model, the text of its parameters, separated by commas)."""
    camera = conventions.camera_to_colmap(twoview.Camera(
        *map(int, size), K[0, 0], K[1, 1], K[0, 2], K[1, 2], twoview.CameraModel.BROWN_CONRADY,
        distortion))
    return camera.model, ",".join(map(repr, map(float, camera.params)))


def run(views, cap, max_error_px, seed, watch):
    """{"R", "t", "num_inliers", "num_keypoints", "pixels"} of the two views; R is None without a
    pose."""
    import cv2
    with tempfile.TemporaryDirectory() as folder:
        database = os.path.join(folder, "database.db")
        images = os.path.join(folder, "images")
        os.mkdir(images)
        for name, gray in zip(NAMES, views.gray):
            cv2.imwrite(os.path.join(images, name), gray, [cv2.IMWRITE_PNG_COMPRESSION, 1])
        masks = write_masks(os.path.join(folder, "masks"), dict(zip(NAMES, views.used)))
        watch.lap()
        by_camera = {}
        for name, size, camera in zip(NAMES, views.sizes, views.cameras):
            by_camera.setdefault((*camera_arguments(size, *camera), size), []).append(name)
        for (model, parameters, _), names in by_camera.items():
            listed = os.path.join(folder, names[0] + ".txt")
            with open(listed, "w", encoding="utf-8") as f:
                f.writelines(name + "\n" for name in names)
            _run("feature_extractor", "--database_path", database, "--image_path", images,
                 "--image_list_path", listed, "--ImageReader.camera_model", model,
                 "--ImageReader.camera_params", parameters, "--ImageReader.single_camera", 1,
                 *(("--ImageReader.mask_path", masks) if masks else ()),
                 "--SiftExtraction.use_gpu", 0, "--SiftExtraction.num_threads", 1,
                 "--SiftExtraction.max_num_features", cap, "--random_seed", seed)
        watch.lap("extract")
        listed = os.path.join(folder, "pairs.txt")
        with open(listed, "w", encoding="utf-8") as f:
            f.write(" ".join(NAMES) + "\n")
        _run("matches_importer", "--database_path", database, "--match_list_path", listed,
             "--SiftMatching.use_gpu", 0, "--SiftMatching.num_threads", 1,
             "--SiftMatching.max_error", max_error_px, "--SiftMatching.compute_relative_pose", 1,
             "--random_seed", seed)
        watch.lap("match + estimate")  # matches_importer matches and estimates
        return _read(database)


def _read(path):
    with colmap_database.reading(path) as tables:
        ids = [colmap_database.read_images(tables)[name][0] for name in NAMES]
        pixels = [conventions.pixels_from_colmap(colmap_database.read_keypoints(tables, path, i))
                  for i in ids]
        index = np.zeros((0, 2), np.uint32)
        for _, _, index in colmap_database.read_matches(tables, path):
            break
        geometry = tables.execute("SELECT rows, qvec, tvec FROM two_view_geometries").fetchone()
    is_swapped = ids[0] > ids[1]
    index = index[:, ::-1] if is_swapped else index
    R, t, inliers = _pose(geometry, is_swapped)
    return {"R": R, "t": t, "num_inliers": inliers, "num_keypoints": [len(p) for p in pixels],
            "pixels": (pixels[0][index[:, 0]], pixels[1][index[:, 1]])}


def _pose(geometry, is_swapped):
    if not geometry or not geometry[0] or geometry[1] is None:
        return None, None, 0
    t = np.frombuffer(geometry[2], np.float64)
    if not np.linalg.norm(t) > 0:  # t = 0: no pose was found, or a pure rotation
        return None, None, geometry[0]
    R = conventions.rotation(np.frombuffer(geometry[1], np.float64))
    return (R.T, -R.T @ t, geometry[0]) if is_swapped else (R, t, geometry[0])
