"""Writes a result of twoview as a recording for Rerun's viewer (rerun-sdk, optional).

  twoview rerun out/mine mine.rrd --images left.jpg right.jpg
  twoview rerun flight flight.rrd

DIR is one of
- the folder of `reconstruct -o`: both cameras with their pictures, the cloud, the alternative pose
  of a plane, and the summary. The cameras' lens comes from --intrinsics, else from the camera files
  or the focal length that result.json names;
- the folder of `odometry -o`: the camera's way, a line for each segment, and the cloud;
- the folder of `drone record`: the attitude and the height over time, and the pictures that
  `--frames` wrote, in the drone's own frames (x forward, y right, z down).

Distances are in the unit of the result: the distance between the cameras, or metres.
Exit status: 0; 2 for bad input, or without rerun-sdk (one line on stderr, and no file)."""

import argparse
import json
import math
import os
import pathlib
import sys

import numpy as np
import twoview as tv
from twoview_tools import ply
from twoview_tools.odometry import poses
from twoview_tools.parser import Parser

PROGRAM, SPEAKER = "twoview rerun", "twoview: rerun"
MISSING = "needs the package rerun-sdk (pip install rerun-sdk)"
PLANE_SHARE = 0.5  # distance of the drawn picture from its camera, in units of the result
FILM_DIAGONAL_MM = math.hypot(36, 24)


class BadInput(Exception):
    """Input that is refused, in one line."""


def read_json(path):
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise BadInput(f"{path}: no JSON: {error}") from None


def read_cloud(path):
    """Positions (n, 3) and colours (n, 3) of a pair's or a map's cloud.ply (docs/formats.md)."""
    try:
        cloud = ply.read_ply(path)
    except ValueError as error:
        raise BadInput(str(error)) from None
    if not {"x", "y", "z", "red", "green", "blue"} <= set(cloud.dtype.names):
        raise BadInput(f"{path}: no cloud of twoview")
    return [np.column_stack([cloud[name] for name in names])
            for names in (("x", "y", "z"), ("red", "green", "blue"))]


def read_table(path, columns):
    """The numbers of a text file with a fixed number of columns, (n, columns); comments begin with
    #."""
    try:
        table = np.loadtxt(path, ndmin=2)
    except ValueError as error:
        raise BadInput(f"{path}: {error}") from None
    if table.size and table.shape[1] != columns:
        raise BadInput(f"{path}: {table.shape[1]} columns, not {columns}")
    return table.reshape(-1, columns)


# ---- cameras -------------------------------------------------------------------------------------

def camera_file(given):
    """The camera of a file, or of PATH:NAME."""
    path, colon, name = given.rpartition(":")
    if colon and not os.path.exists(given) and os.path.exists(path):
        return tv.read_camera(path, name)
    return tv.read_camera(given)


def intrinsics_of(result, view, given):
    """(fx, fy, cx, cy) of a view in pixels of the result's image, or None if nothing says so."""
    if given:
        return given[4 * view:4 * view + 4]
    width, height = result[f"image_size{view}"]
    options = result.get("options", {})
    known = (result.get("cameras") or [{}, {}])[view] or {}  # not in results of older versions
    file = known.get("file") or options.get(f"camera{view}")
    focal_35mm = known.get("focal_35mm") or options.get("focal_35mm")
    if file:
        try:
            camera = camera_file(file)
        except (OSError, tv.FormatError) as error:
            print(f"twoview: rerun: camera {view} is drawn without its lens: {error}",
                  file=sys.stderr)
            return None
        sx, sy = width / camera.width, height / camera.height
        found = [camera.fx * sx, camera.fy * sy, (camera.cx + 0.5) * sx - 0.5,
                 (camera.cy + 0.5) * sy - 0.5]
    elif focal_35mm:
        f = focal_35mm * math.hypot(width, height) / FILM_DIAGONAL_MM
        found = [f, f, (width - 1) / 2, (height - 1) / 2]
    else:
        return None
    scale = (result.get("focal_length") or {}).get("scale") or 1.0
    shift = result.get("principal_point_shift_px") or (0.0, 0.0)
    return [found[0] * scale, found[1] * scale, found[2] + shift[0], found[3] + shift[1]]


def picture(path, size):
    """The pixels (height, width, 3) of an image file, brought to `size`, as they are stored."""
    from PIL import Image  # rerun-sdk depends on it
    with Image.open(path) as image:
        colour = image.convert("RGB")
        if size is not None and colour.size != tuple(size):
            colour = colour.resize(tuple(size), Image.Resampling.BOX)
        return np.asarray(colour)


def log_camera(rr, recording, entity, pose, size, intrinsics, image):
    """pose: world_from_cam as (R, t). An entity with its picture plane below it."""
    R, t = pose
    recording.log(entity, rr.Transform3D(translation=t, mat3x3=R), static=True)
    if intrinsics is not None:
        fx, fy, cx, cy = intrinsics
        # Rerun's pixel (0, 0) begins at the corner of the first pixel, as COLMAP's does.
        recording.log(f"{entity}/image", rr.Pinhole(
            image_from_camera=[[fx, 0, cx + 0.5], [0, fy, cy + 0.5], [0, 0, 1]],
            resolution=size, camera_xyz=rr.ViewCoordinates.RDF,
            image_plane_distance=PLANE_SHARE * (np.linalg.norm(t) or 1.0)), static=True)
    if image is not None:
        recording.log(f"{entity}/image", rr.Image(image).compress(jpeg_quality=90), static=True)


# ---- the three kinds of folders ------------------------------------------------------------------

def summary_of(result):
    known = {key: result.get(key) for key in (
        "image0", "image1", "config", "verdict", "reasons", "probability_wrong", "num_matches",
        "num_inliers", "num_points", "median_parallax_deg", "scale", "num_frames", "num_tracked",
        "version") if result.get(key) is not None}
    rows = [f"| {key} | {', '.join(value) if isinstance(value, list) else value} |"
            for key, value in known.items()]
    return "\n".join(["| | |", "| --- | --- |", *rows, *(f"\n{line}" for line in
                                                       result.get("advice", []))])


def log_cloud(rr, recording, folder):
    path = folder / "cloud.ply"
    if path.is_file():
        positions, colours = read_cloud(path)
        recording.log("world/points", rr.Points3D(
            positions, colors=colours, radii=rr.Radius.ui_points(2.0)), static=True)


def log_pair(rr, recording, folder, arguments):
    result = read_json(folder / "result.json")
    recording.log("world", rr.ViewCoordinates.RDF, static=True)
    recording.log("summary", rr.TextDocument(summary_of(result), media_type="text/markdown"),
                  static=True)
    views = [("world/camera0", (np.eye(3), np.zeros(3)), 0)]
    alternative = result.get("alternative") or {}
    for entity, found in (("world/camera1", result), ("world/alternative_camera1", alternative)):
        if found.get("R") is not None:
            R = np.array(found["R"], float).reshape(3, 3)
            t = np.array(found.get("t") or (0, 0, 0), float)  # a rotation only: at the same place
            views.append((entity, (R.T, -R.T @ t), 1))
    for entity, pose, view in views:
        size = result[f"image_size{view}"]
        path = arguments.images[view] if arguments.images else None
        log_camera(rr, recording, entity, pose, size,
                   intrinsics_of(result, view, arguments.intrinsics),
                   None if path is None else picture(path, size))
    log_cloud(rr, recording, folder)


def log_way(rr, recording, entity, table, segments):
    """Poses of a TUM file (n, 8) over time, and a line through those of each segment, whose number
    `segments` (n,) has. Returns the first time."""
    seconds = table[:, 0] - table[0, 0]
    recording.send_columns(
        entity, indexes=[rr.TimeColumn("time", duration=seconds)],
        columns=rr.Transform3D.columns(translation=table[:, 1:4], quaternion=table[:, 4:8]))
    recording.log(f"{entity}_path", rr.LineStrips3D(
        [table[segments == segment, 1:4] for segment in np.unique(segments)]), static=True)
    return table[0, 0]


def log_odometry(rr, recording, folder, arguments):
    recording.log("world", rr.ViewCoordinates.RDF, static=True)
    try:
        way = poses.read_tum(folder / "trajectory.txt")
    except (poses.PoseError, UnicodeDecodeError) as error:
        raise BadInput(str(error)) from None
    if len(way):
        table = np.column_stack([way.times, way.positions, poses.quaternions_of(way.rotations)])
        log_way(rr, recording, "world/camera", table, way.segments)
    log_cloud(rr, recording, folder)
    if (folder / "result.json").is_file():
        recording.log("summary", rr.TextDocument(summary_of(read_json(folder / "result.json")),
                                                 media_type="text/markdown"), static=True)


def angles_deg(quaternions):
    """Roll, pitch and yaw (n, 3) in degrees of quaternions (n, 4), x y z w, world_from_body."""
    x, y, z, w = quaternions.T
    return np.degrees(np.column_stack([
        np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
        np.arcsin(np.clip(2 * (w * y - z * x), -1, 1)),
        np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))]))


def log_flight(rr, recording, folder, arguments):
    recording.log("world", rr.ViewCoordinates.FRD, static=True)
    table = read_table(folder / "attitude.tum", 8)
    frames = read_table(folder / "frames.txt", 4) if (folder / "frames.txt").is_file() else []
    if not len(table):
        raise BadInput(f"{folder / 'attitude.tum'}: no attitude in it")
    start = log_way(rr, recording, "world/body", table, np.zeros(len(table)))
    index = [rr.TimeColumn("time", duration=table[:, 0] - start)]
    for name, values in (("height_m", -table[:, 3]),
                         *zip(("roll_deg", "pitch_deg", "yaw_deg"), angles_deg(table[:, 4:8]).T)):
        recording.send_columns(name, indexes=index, columns=rr.Scalars.columns(scalars=values))
    for host_ns, _, number, _ in frames:
        path = folder / "frames" / f"{int(number):06d}.png"
        if path.is_file():
            recording.set_time("time", duration=host_ns * 1e-9 - start)
            recording.log("picture", rr.EncodedImage(path=path))
    if (folder / "summary.json").is_file():
        text = json.dumps(read_json(folder / "summary.json"), indent=2)
        recording.log("summary", rr.TextDocument(text), static=True)


KINDS = (("attitude.tum", log_flight), ("trajectory.txt", log_odometry), ("result.json", log_pair))


def package():
    """The package rerun. BadInput where it is missing."""
    try:
        import rerun
    except ImportError:
        raise BadInput(MISSING) from None
    return rerun


def check_output(file):
    """BadInput where the file cannot be written, or is named as an input might be."""
    if file.suffix != ".rrd":
        raise BadInput(f"{file}: the name does not end in .rrd")
    if file.is_dir():
        raise BadInput(f"cannot write {file}: it is a folder")
    if not file.parent.is_dir():
        raise BadInput(f"cannot write {file}: there is no folder {file.parent}")
    if not os.access(file.parent, os.W_OK):
        raise BadInput(f"cannot write {file}: the folder does not allow it")


def write(folder, file, arguments):
    rr = package()
    check_output(file)
    kind = next((log for name, log in KINDS if (folder / name).is_file()), None)
    if kind is None:
        raise BadInput(f"{folder}: none of " + ", ".join(name for name, _ in KINDS) + " is in it")
    temporary = file.with_name(f"{file.name}.{os.getpid()}")
    try:
        recording = rr.RecordingStream("twoview")
        recording.save(temporary)
        kind(rr, recording, folder, arguments)
        recording.flush()
        recording.disconnect()
        os.replace(temporary, file)
    except RuntimeError as error:  # of rerun-sdk
        raise BadInput(f"cannot write {file}: {error}") from None
    finally:
        temporary.unlink(missing_ok=True)


def main(argv=None):
    parser = Parser(speaker=SPEAKER, prog=PROGRAM, description=__doc__,
                    formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", metavar="DIR", type=pathlib.Path, nargs="?",
                        help="what twoview wrote")
    parser.add_argument("file", metavar="FILE.rrd", type=pathlib.Path, nargs="?",
                        help="an existing file is replaced")
    parser.add_argument("--check", metavar="FILE.rrd", type=pathlib.Path,
                        help="only say whether rerun-sdk is there and FILE.rrd can be written")
    parser.add_argument("--quiet", action="store_true", help="print nothing but errors")
    parser.add_argument("--images", nargs=2, metavar=("A", "B"), help="the pictures of a pair")
    parser.add_argument("--intrinsics", nargs=8, type=float, metavar="N",
                        help="fx fy cx cy of image 0 and of image 1, in pixels of the result")
    arguments = parser.parse_args(argv)
    try:
        if arguments.check:
            package()
            check_output(arguments.check)
            return 0
        if arguments.file is None:
            parser.error("DIR and FILE.rrd are required")
        if not arguments.folder.is_dir():
            raise BadInput(f"{arguments.folder}: no folder")
        write(arguments.folder, arguments.file, arguments)
        if not arguments.quiet:
            print(f"files        {arguments.file}")
    except (BadInput, OSError, tv.FormatError) as error:
        print(f"{SPEAKER}: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
