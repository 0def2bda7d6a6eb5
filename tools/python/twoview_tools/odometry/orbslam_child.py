"""Runs ORB-SLAM3 (orbslam3-python, PyPI) over a set folder and writes trajectory.txt, frames.csv
and peer.json as scripts/odometry reads them. Each pose is the one that was given when its frame was
tracked; each unbroken piece is a segment. It runs in the virtual environment of its own that
orbslam.py makes, so it imports nothing of the project.

usage: python orbslam_child.py SET OUT VOCABULARY SETTINGS INTERVAL_MS"""

import json
import os
import sys
import time

import cv2
import numpy as np
import orbslam3


def quaternion(R):
    """x y z w of a rotation matrix."""
    vector, _ = cv2.Rodrigues(R)
    angle = float(np.linalg.norm(vector))
    axis = vector.ravel() / angle if angle > 0 else np.zeros(3)
    return [*(np.sin(angle / 2) * axis), np.cos(angle / 2)]


def main(folder, out, vocabulary, settings, interval_ms):
    frames = [line.split(maxsplit=1) for line in open(os.path.join(folder, "frames.txt"))
              if line.strip() and not line.startswith("#")]
    system = orbslam3.System(vocabulary, settings, orbslam3.Sensor.MONOCULAR)
    system.set_use_viewer(False)
    system.initialize()
    begin_cpu = time.process_time()
    reading = 0.0
    poses, rows, segment, was_tracked = [], [], -1, False
    next_time = time.monotonic()
    for stamp, name in frames:
        before = time.process_time()
        picture = cv2.imread(os.path.join(folder, name.strip()), cv2.IMREAD_GRAYSCALE)
        reading += time.process_time() - before
        time.sleep(max(0.0, next_time - time.monotonic()))
        next_time = max(next_time, time.monotonic() - 0.001) + interval_ms / 1000
        before = time.thread_time()
        system.process_image_mono(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR), float(stamp))
        took = 1000 * (time.thread_time() - before)
        state = str(system.get_tracking_state())
        pose = system.get_frame_pose() if state.endswith("OK") else None
        pose = None if pose is None else np.array(pose, float)
        is_tracked = pose is not None and pose.shape == (4, 4) and np.isfinite(pose).all()
        if is_tracked:
            if not was_tracked:
                segment += 1
                poses.append(f"# segment {segment}")
            R, t = pose[:3, :3].T, -pose[:3, :3].T @ pose[:3, 3]
            poses.append(" ".join([stamp, *(f"{v:.12g}" for v in (*t, *quaternion(R)))]))
        was_tracked = is_tracked
        status = "tracking" if is_tracked else "starting" if segment < 0 else "lost"
        rows.append(f"{stamp},{name.strip()},{status},,{segment if is_tracked else -1},0,0,"
                    f"{took:.3f}")
    cpu = time.process_time() - begin_cpu - reading
    os.makedirs(out, exist_ok=True)
    with open(os.path.join(out, "trajectory.txt"), "w") as file:
        file.write("\n".join(["# timestamp tx ty tz qx qy qz qw, world_from_cam", *poses, ""]))
    with open(os.path.join(out, "frames.csv"), "w") as file:
        file.write("\n".join(["timestamp,name,status,reasons,segment,num_tracked,is_keyframe,"
                              "time_ms", *rows, ""]))
    with open(os.path.join(out, "peer.json"), "w") as file:
        json.dump({"cpu_ms_per_frame": 1000 * cpu / len(frames),
                   "version": getattr(orbslam3, "__version__", "")}, file)
    sys.stdout.flush()
    os._exit(0)  # the library's threads and destructors may hang or crash; everything is written


if __name__ == "__main__":
    main(*sys.argv[1:5], float(sys.argv[5]))
