"""Computes what a person reads of the library's results on the rendered pair (scene.c): counts,
verdicts, poses. test/golden/results.txt holds them. The test golden/results compares words and
whole numbers exactly and other numbers to 1e-9, so that, where golden/stages says that bytes have
changed, this says whether more than rounding has. After an intended change, run
  cmake --build build/release --target golden_results_update
and read the difference."""
import argparse
import subprocess
import sys
from pathlib import Path

COMMITTED = Path(__file__).with_name("results.txt")
TOLERANCE = 1e-9  # of a number, relative where it is above 1
SKIP_CODE = 77  # ctest reports this exit status (TWOVIEW_SKIP_CODE) as skipped

try:
    import numpy as np
    import twoview as tv
except ImportError as error:
    print(f"skipped: {error} (scripts/bootstrap test)")
    sys.exit(SKIP_CODE)


def read_scene(path):
    """Both images and cameras of a file of scene.c (the form is that of digest.c)."""
    head, lens0, lens1, pixels = path.read_bytes().split(b"\n", 3)
    width, height = map(int, head.split())
    images = np.frombuffer(pixels, np.uint8).reshape(2, height, width)
    cameras = [tv.Camera(width, height, *map(float, lens.split()[:4])) for lens in (lens0, lens1)]
    return images, cameras


def words_of_pose(found):
    """Of a TwoView or an AbsolutePose: how many agree, the verdict, R, t, the deviations."""
    words = [found.num_inliers, found.verdict.name, *(reason.name for reason in tv.Reason
                                                      if reason & found.reasons)]
    for array in (found.R, found.t):
        words += ["none"] if array is None else list(np.ravel(array))
    if found.covariance is not None:
        words += list(np.sqrt(np.diag(found.covariance)))
    return words


def pair_results(context, images, cameras):
    """Yields (name, words) for what a pair gives, stage by stage."""
    keypoints, descriptors = zip(*(tv.extract(context, image) for image in images))
    yield "keypoints", [len(k) for k in keypoints]
    yield "keypoints_by_level", list(np.bincount(keypoints[0]["level"]))
    matches = tv.match(context, *descriptors, keypoints0=keypoints[0], keypoints1=keypoints[1])
    yield "matches", [len(matches), int(matches["dist_sq"].sum())]
    pixels = [np.column_stack([k["x"], k["y"]])[matches[idx]].astype(float)
              for k, idx in zip(keypoints, ("idx0", "idx1"))]
    for solver in (tv.Solver.FIVE_POINT, tv.Solver.EIGHT_POINT, tv.Solver.SEVEN_POINT):
        found = tv.estimate_two_view(context, *cameras, *pixels, matches["ratio"].copy(),
                                     method=solver)[0]
        yield f"estimate_{solver.name.lower()}", [found.kind.name, *words_of_pose(found)]
    pose, inliers = tv.estimate_two_view(context, *cameras, *pixels, matches["ratio"].copy())
    guided = tv.match_guided(context, *cameras, pose.E, keypoints[0], descriptors[0],
                             keypoints[1], descriptors[1])
    yield "guided", [len(guided)]
    agreeing = [p[inliers] for p in pixels]
    for method in tv.Triangulation:
        points = tv.triangulate(*cameras, pose.R, pose.t, *agreeing, method=method)
        good = points[points["status"] == tv.PointStatus.OK]
        yield f"triangulate_{method.name.lower()}", [
            len(good), float(np.median(good["position"][:, 2])),
            float(np.median(good["error_px"].astype(float)))]
    adjusted = tv.adjust_two_view(context, *cameras, *agreeing, pose.R, pose.t, points)
    yield "bundle", [adjusted.num_points, adjusted.rms_px, *np.ravel(adjusted.R), *adjusted.t]
    good = points["status"] == tv.PointStatus.OK
    absolute = tv.estimate_absolute_pose(context, cameras[1], agreeing[1][good],
                                         points["position"][good])[0]
    yield "absolute_pose", words_of_pose(absolute)
    dense = tv.densify(*(x for pair in zip(images, cameras) for x in pair), pose.R, pose.t, points)
    yield "dense", [len(dense), float(np.median(dense["position"][:, 2]))]
    yield from room_results(images, cameras, pose, points[good])


def room_results(images, cameras, pose, points):
    """Yields the depth map of the first image, and the surface that a room makes of it."""
    depths = points["position"][:, 2]
    place = -(pose.R * pose.t[:, None]).sum(axis=0)  # no matrix product, whose bits the CPU chooses
    depth = tv.sweep_depth(images, cameras, [np.eye(3), pose.R.T],
                           [np.zeros(3), place],
                           near_depth=0.7 * depths.min(), far_depth=1.5 * depths.max())
    known = depth.distance[depth.distance > 0].astype(float)
    yield "depth", [len(known), float(np.median(known))]
    with tv.Room(voxel=0.02 * float(np.median(depths)), memory_bytes=1 << 24) as room:
        room.add(depth.camera, np.eye(3), np.zeros(3), depth.distance, depth.sigma)
        mesh = room.mesh()
        planes = room.find_planes()
    yield "room", [len(mesh.vertices), len(mesh.triangles), len(planes),
                   *np.ravel(planes["normal"][:1].astype(float))]


def flight_results(image, camera):
    """Yields the last state of a flight made of one picture: the upper half passes slowly and the
    lower half faster, as walls at two distances do."""
    half = len(image) // 2
    with tv.Odometry(camera, max_keypoints=300, max_keyframes=12, max_points=2000) as odometry:
        for k in range(16):
            frame = np.vstack([np.roll(image[:half], -3 * k, 1), np.roll(image[half:], -8 * k, 1)])
            state = odometry.track(frame, time_s=float(k))
    yield "odometry", [state.status.name, state.num_inliers, state.num_keyframes,
                       state.num_points, *np.ravel(state.R), *state.t]


def results(scene):
    images, cameras = read_scene(scene)
    height, width = images[0].shape
    with tv.Context(max_width=width, max_height=height, max_keypoints=600, max_effort=3) as context:
        yield from pair_results(context, images, cameras)
        for effort in (0, 2):
            pose, cloud = tv.reconstruct(context, images[0], cameras[0], images[1], cameras[1],
                                         effort=effort)
            yield f"reconstruct_effort_{effort}", [cloud.effort, len(cloud.points),
                                                   *words_of_pose(pose)]
    yield from flight_results(images[0], cameras[0])


def written(word):
    return f"{word:.12e}" if isinstance(word, (float, np.floating)) else str(word)


def differs(word, committed):
    if "e" not in committed or not committed[-1].isdigit():
        return word != committed
    a, b = float(word), float(committed)
    return not abs(a - b) <= TOLERANCE * max(1, abs(b))


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path, help="the program made from scene.c")
    parser.add_argument("folder", type=Path, help="where the rendered pair goes")
    parser.add_argument("--update", action="store_true", help="rewrite results.txt")
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    subprocess.run([args.scene, args.folder / "results_scene"], check=True)
    now = {name: list(map(written, words)) for name, words in
           results(args.folder / "results_scene")}
    if args.update:
        COMMITTED.write_text("".join(" ".join([name, *words]) + "\n"
                                     for name, words in now.items()))
        return 0
    before = {name: words for name, *words in map(str.split, COMMITTED.read_text().splitlines())}
    wrong = [name for name in [*now, *(name for name in before if name not in now)]
             if len(now.get(name, [])) != len(before.get(name, [])) or
             any(map(differs, now[name], before[name]))]
    for name in wrong:
        print(f"{name}\n  is        {' '.join(now.get(name, ['-']))}\n"
              f"  committed {' '.join(before.get(name, ['-']))}")
    print(f"{len(wrong)} of {len(now)} results differ from results.txt by more than rounding")
    return 1 if wrong else 0


sys.exit(main())
