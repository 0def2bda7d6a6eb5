"""Debian's `colmap` on one pair: features and matches by its commands, the database read."""

import os
import re
import shutil
import sqlite3
import subprocess
import tempfile

import numpy as np

PROGRAM = "colmap"
MAX_IMAGE_ID = 2147483647  # COLMAP's pair_id is smaller_id times this, plus the larger
HALF_PIXEL = 0.5  # COLMAP's origin is the corner of the top-left pixel


def version():
    """Of the program in the PATH; ImportError without it."""
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


def camera_arguments(K, distortion):
    """COLMAP's model and its parameters, its pixel origin."""
    fx, fy, cx, cy = K[0, 0], K[1, 1], K[0, 2] + HALF_PIXEL, K[1, 2] + HALF_PIXEL
    if not any(distortion):
        return "PINHOLE", [fx, fy, cx, cy]
    k1, k2, p1, p2, k3 = distortion
    return "FULL_OPENCV", [fx, fy, cx, cy, k1, k2, p1, p2, k3, 0, 0, 0]


def run(views, cap, max_error_px, seed, watch):
    """{"R", "t", "num_inliers", "num_keypoints", "pixels"} of the two views; R None without a
    pose."""
    import cv2
    with tempfile.TemporaryDirectory() as folder:
        database = os.path.join(folder, "database.db")
        images = os.path.join(folder, "images")
        os.mkdir(images)
        for name, gray in zip(("0.png", "1.png"), views.gray):
            cv2.imwrite(os.path.join(images, name), gray, [cv2.IMWRITE_PNG_COMPRESSION, 1])
        watch.lap()
        by_camera = {}
        for name, gray, (K, distortion) in zip(("0.png", "1.png"), views.gray, views.cameras):
            model, parameters = camera_arguments(K, distortion)
            camera = model, ",".join(map(repr, map(float, parameters))), gray.shape
            by_camera.setdefault(camera, []).append(name)
        for (model, parameters, _), names in by_camera.items():
            listed = os.path.join(folder, names[0] + ".txt")
            with open(listed, "w", encoding="utf-8") as f:
                f.writelines(name + "\n" for name in names)
            _run("feature_extractor", "--database_path", database, "--image_path", images,
                 "--image_list_path", listed, "--ImageReader.camera_model", model,
                 "--ImageReader.camera_params", parameters, "--ImageReader.single_camera", 1,
                 "--SiftExtraction.use_gpu", 0, "--SiftExtraction.num_threads", 1,
                 "--SiftExtraction.max_num_features", cap, "--random_seed", seed)
        watch.lap("extract")
        listed = os.path.join(folder, "pairs.txt")
        with open(listed, "w", encoding="utf-8") as f:
            f.write("0.png 1.png\n")
        _run("matches_importer", "--database_path", database, "--match_list_path", listed,
             "--SiftMatching.use_gpu", 0, "--SiftMatching.num_threads", 1,
             "--SiftMatching.max_error", max_error_px, "--SiftMatching.compute_relative_pose", 1,
             "--random_seed", seed)
        watch.lap("match + estimate")  # one command does both
        return _read(database)


def _read(database):
    with sqlite3.connect(database) as connection:
        ids = dict(connection.execute("SELECT name, image_id FROM images"))
        keypoints = {}
        for name in ("0.png", "1.png"):
            row = connection.execute("SELECT rows, cols, data FROM keypoints WHERE image_id = ?",
                                     (ids[name],)).fetchone()
            keypoints[name] = (np.zeros((0, 2)) if row is None or not row[0] else
                               np.frombuffer(row[2], np.float32).reshape(row[0], row[1])[:, :2]
                               - HALF_PIXEL)
        is_swapped = ids["0.png"] > ids["1.png"]
        pair_id = min(ids.values()) * MAX_IMAGE_ID + max(ids.values())
        matched = connection.execute("SELECT rows, data FROM matches WHERE pair_id = ?",
                                     (pair_id,)).fetchone()
        geometry = connection.execute("SELECT rows, qvec, tvec FROM two_view_geometries "
                                      "WHERE pair_id = ?", (pair_id,)).fetchone()
    connection.close()
    index = np.zeros((0, 2), int)
    if matched and matched[0]:
        index = np.frombuffer(matched[1], np.uint32).reshape(-1, 2).astype(int)
    if is_swapped:
        index = index[:, ::-1]
    R, t, inliers = _pose(geometry, is_swapped)
    return {"R": R, "t": t, "num_inliers": inliers,
            "num_keypoints": [len(keypoints[n]) for n in ("0.png", "1.png")],
            "pixels": (keypoints["0.png"][index[:, 0]], keypoints["1.png"][index[:, 1]])}


def _pose(geometry, is_swapped):
    if not geometry or not geometry[0] or geometry[1] is None:
        return None, None, 0
    w, x, y, z = np.frombuffer(geometry[1], np.float64)
    t = np.frombuffer(geometry[2], np.float64)
    if not np.linalg.norm(t) > 0:  # no pose, or rotation only
        return None, None, geometry[0]
    R = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                  [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                  [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])
    return (R.T, -R.T @ t, geometry[0]) if is_swapped else (R, t, geometry[0])
