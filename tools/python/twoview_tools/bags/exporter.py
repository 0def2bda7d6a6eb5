"""What `twoview odometry` wrote, as a bag: /twoview/odometry (nav_msgs/Odometry), /twoview/cloud
(sensor_msgs/PointCloud2) and /tf_static.

The frames are those of trajectory.txt, with its axes: `twoview_map` of the longest segment,
`twoview_map_K` of segment K otherwise, `camera` with x right, y down, z forward. /tf_static places
twoview_map in `map`, whose z axis points up, as ROS has it."""

import contextlib
import json
import os
import shutil
import struct

import numpy as np
from mcap.writer import Writer as McapWriter
from rosbags.interfaces import (Qos, QosDurability, QosHistory, QosLiveliness, QosReliability,
                                QosTime)
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.rosbag2.metadata import dump_qos_v9

from .. import ply
from ..odometry import poses
from . import BadInput
from .messages import standard_store

ODOMETRY, CLOUD, STATIC = "/twoview/odometry", "/twoview/cloud", "/tf_static"
TOPICS = ((STATIC, "tf2_msgs/msg/TFMessage"), (ODOMETRY, "nav_msgs/msg/Odometry"),
          (CLOUD, "sensor_msgs/msg/PointCloud2"))
# map from twoview_map: z down to z up where gravity is known, else by the first camera's axes.
FROM_DOWN = np.diag([1.0, -1.0, -1.0])
FROM_CAMERA = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
UPRIGHT_OFFSET = 172  # in map.twm (docs/formats.md, the bytes of a map)
UNKNOWN = np.array([-1.0] + [0.0] * 35)  # a covariance, as sensor_msgs has it
PACKAGES = ("builtin_interfaces/", "geometry_msgs/", "nav_msgs/", "sensor_msgs/", "tf2_msgs/",
            "std_msgs/msg/Header")
FLOAT32, UINT32 = 7, 6  # PointField's numbers for these types
FOREVER = QosTime(0, 0)
# A player must repeat tf_static to those who come later.
LATCHED = Qos(QosHistory.KEEP_LAST, 1, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL,
              FOREVER, FOREVER, QosLiveliness.AUTOMATIC, FOREVER, False)


class _Messages:
    """Makes the messages of one version of ROS."""

    def __init__(self, store, is_ros1):
        self.store, self.is_ros1 = store, is_ros1
        self.of = {name.rpartition("/")[2]: kind for name, kind in store.types.items()
                   if name.startswith(PACKAGES)}

    def header(self, ns, frame):
        stamp = self.of["Time"](sec=ns // 10**9, nanosec=ns % 10**9)
        seq = {"seq": 0} if self.is_ros1 else {}
        return self.of["Header"](**seq, stamp=stamp, frame_id=frame)

    def _quaternion(self, q):
        return self.of["Quaternion"](*map(float, q))

    def odometry(self, ns, frame, position, q):
        vector = self.of["Vector3"](0.0, 0.0, 0.0)
        pose = self.of["Pose"](self.of["Point"](*map(float, position)), self._quaternion(q))
        return self.of["Odometry"](
            self.header(ns, frame), "camera", self.of["PoseWithCovariance"](pose, UNKNOWN),
            self.of["TwistWithCovariance"](self.of["Twist"](vector, vector), UNKNOWN))

    def cloud(self, ns, frame, points):
        """points: a structured array. The bits of rgb are a whole number in the place of a float,
        as PCL and RViz have it."""
        fields = [self.of["PointField"](name, points.dtype.fields[name][1],
                                        UINT32 if name == "num_observations" else FLOAT32, 1)
                  for name in points.dtype.names]
        return self.of["PointCloud2"](
            self.header(ns, frame), 1, len(points), fields, False, points.itemsize,
            points.nbytes, np.frombuffer(points.tobytes(), np.uint8), True)

    def static(self, ns, R):
        transform = self.of["Transform"](self.of["Vector3"](0.0, 0.0, 0.0),
                                         self._quaternion(poses.quaternions_of(R)[0]))
        return self.of["TFMessage"]([self.of["TransformStamped"](
            self.header(ns, "map"), "twoview_map", transform)])


def _write_ros1(path, messages):
    store = standard_store("ros1")
    make = _Messages(store, True)
    with Ros1Writer(path) as writer:
        known = {name: (writer.add_connection(name, kind, typestore=store,
                                              latching=int(name == STATIC)), kind)
                 for name, kind in TOPICS}
        for name, ns, message in messages(make):
            writer.write(known[name][0], ns, store.serialize_ros1(message, known[name][1]))


def _write_ros2(path, messages, storage):
    store = standard_store("cdr")
    make = _Messages(store, False)
    with Ros2Writer(path, version=9, storage_plugin=StoragePlugin[storage.upper()]) as writer:
        known = {name: (writer.add_connection(name, kind, typestore=store, offered_qos_profiles=(
            [LATCHED] if name == STATIC else [])), kind) for name, kind in TOPICS}
        for name, ns, message in messages(make):
            writer.write(known[name][0], ns, store.serialize_cdr(message, known[name][1]))


def _qos_text(name):
    """As rosbag2 puts it beside a channel: YAML, of which JSON is a part."""
    return json.dumps(dump_qos_v9([LATCHED])) if name == STATIC else ""


def _write_mcap(path, messages):
    store = standard_store("cdr")
    make = _Messages(store, False)
    with open(path, "wb") as file:
        writer = McapWriter(file)
        writer.start(profile="ros2", library="twoview")
        known = {}
        for name, kind in TOPICS:
            schema = writer.register_schema(
                kind, "ros2msg", store.generate_msgdef(kind, ros_version=2)[0].encode())
            known[name] = writer.register_channel(
                name, "cdr", schema, {"offered_qos_profiles": _qos_text(name)}), kind
        for name, ns, message in messages(make):
            data = bytes(store.serialize_cdr(message, known[name][1]))
            writer.add_message(known[name][0], ns, data, ns)
        writer.finish()


def _is_upright(folder):
    """Whether the z axis of the map points along gravity."""
    try:
        with open(folder / "map.twm", "rb") as file:
            head = file.read(UPRIGHT_OFFSET + 4)
        return struct.unpack_from("<i", head, UPRIGHT_OFFSET)[0] == 1
    except (OSError, struct.error):
        return False


def _cloud(folder):
    """(points with x y z rgb sigma num_observations, their segments) of cloud.ply; None without."""
    path = folder / "cloud.ply"
    if not path.is_file():
        return None
    try:
        read = ply.read_ply(path)
    except ValueError as error:
        raise BadInput(str(error)) from None
    if not {"x", "y", "z", "red", "green", "blue", "sigma", "num_observations",
            "segment"} <= set(read.dtype.names):
        raise BadInput(f"{path}: no cloud of twoview odometry")
    points = np.zeros(len(read), [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<u4"),
                                  ("sigma", "<f4"), ("num_observations", "<u4")])
    for name in ("x", "y", "z", "sigma", "num_observations"):
        points[name] = read[name]
    red, green, blue = (read[name].astype(np.uint32) for name in ("red", "green", "blue"))
    points["rgb"] = red << 16 | green << 8 | blue
    return points, read["segment"].astype(int)


def export(arguments):
    """Writes the bag; returns the summary."""
    folder, path = arguments.folder, arguments.output
    if not folder.is_dir():
        raise BadInput(f"{folder}: no folder")
    source = folder / f"{arguments.poses}.txt"
    if not source.is_file():
        raise BadInput(f"{folder}: no {source.name} in it: name what twoview odometry wrote")
    try:
        way = poses.read_tum(source)
    except (poses.PoseError, UnicodeDecodeError) as error:
        raise BadInput(str(error)) from None
    if not len(way):
        raise BadInput(f"{source}: no pose in it")
    times = [int(round(time * 1e9)) for time in way.times]
    if times[0] < 0 or times[-1] >= 2**32 * 10**9:
        raise BadInput(f"{source}: a time below 0, or above what a stamp of ROS can hold")
    if os.path.lexists(path):
        raise BadInput(f"{path} is there already: give another -o")
    if not path.absolute().parent.is_dir():
        raise BadInput(f"cannot write {path}: there is no folder {path.parent}")
    numbers, counts = np.unique(way.segments, return_counts=True)
    longest = numbers[counts.argmax()]
    cloud = _cloud(folder)

    def frame(segment):
        return "twoview_map" if segment == longest else f"twoview_map_{segment}"

    def messages(make):
        yield STATIC, times[0], make.static(times[0],
                                            FROM_DOWN if _is_upright(folder) else FROM_CAMERA)
        for time, segment, position, q in zip(times, way.segments, way.positions,
                                              poses.quaternions_of(way.rotations)):
            yield ODOMETRY, time, make.odometry(time, frame(segment), position, q)
        if cloud is not None:
            for segment in np.unique(cloud[1]):
                yield CLOUD, times[-1], make.cloud(times[-1], frame(segment),
                                                   cloud[0][cloud[1] == segment])

    temporary = path.with_name(f".{path.name}.{os.getpid()}{path.suffix}")
    try:
        if path.suffix == ".bag":
            _write_ros1(temporary, messages)
        elif path.suffix == ".mcap":
            _write_mcap(temporary, messages)
        else:
            temporary.mkdir()
            _write_ros2(temporary / path.name, messages, arguments.storage)
        os.rename(temporary / path.name if temporary.is_dir() else temporary, path)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
        with contextlib.suppress(OSError):
            temporary.unlink()
    return {"source": str(folder), "num_poses": len(way), "num_segments": len(numbers),
            "num_points": 0 if cloud is None else len(cloud[0]),
            "topics": {"odometry": ODOMETRY, "cloud": None if cloud is None else CLOUD,
                       "tf_static": STATIC}}
