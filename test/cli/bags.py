"""Small bags for tests, written by rosbags and mcap."""

import contextlib

import numpy as np
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

FORMS = ("ros1", "ros1-lz4", "ros1-bz2", "sqlite3", "sqlite3-message", "sqlite3-file",
         "mcap-folder", "mcap", "mcap-ros1")
IDENTITY = (0.0, 0.0, 0.0, 1.0)


class Maker:
    """Messages of ROS 1 or ROS 2 by the same words."""

    def __init__(self, form):
        self.is_ros1 = "ros1" in form
        self.store = get_typestore(Stores.ROS1_NOETIC if self.is_ros1 else Stores.ROS2_HUMBLE)
        if self.is_ros1:  # rosbags' noetic has no tf2_msgs
            self.store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms",
                                                   "tf2_msgs/msg/TFMessage"))

    def of(self, name, *values, **fields):
        return self.store.types[name](*values, **fields)

    def time(self, ns):
        return self.of("builtin_interfaces/msg/Time", ns // 10**9, ns % 10**9)

    def header(self, ns, frame="camera"):
        return self.of("std_msgs/msg/Header", **({"seq": 0} if self.is_ros1 else {}),
                       stamp=self.time(ns), frame_id=frame)

    def vector(self, values=(0, 0, 0), kind="Vector3"):
        return self.of(f"geometry_msgs/msg/{kind}", *map(float, values))

    def quaternion(self, values=IDENTITY):
        return self.of("geometry_msgs/msg/Quaternion", *map(float, values))

    def image(self, ns, data, width, height, encoding="mono8", is_bigendian=False, **more):
        data = np.frombuffer(bytes(data), np.uint8)
        return self.of("sensor_msgs/msg/Image", self.header(ns, **more), height, width, encoding,
                       int(is_bigendian), len(data) // height, data)

    def compressed(self, ns, data, about="jpeg", **more):
        return self.of("sensor_msgs/msg/CompressedImage", self.header(ns, **more), about,
                       np.frombuffer(bytes(data), np.uint8))

    def camera_info(self, ns, width, height, K, D=(), model="plumb_bob", P=None, binning=0,
                    roi=(0, 0, 0, 0)):
        K, D = np.array(K, float), np.array(D, float)
        P = np.array(P if P is not None else [*K[:3], 0, *K[3:6], 0, *K[6:], 0], float)
        letters = "DKRP" if self.is_ros1 else "dkrp"
        return self.of(
            "sensor_msgs/msg/CameraInfo", header=self.header(ns), height=height, width=width,
            distortion_model=model, **dict(zip(letters, (D, K, np.eye(3).ravel(), P))),
            binning_x=binning, binning_y=binning, roi=self.of(
                "sensor_msgs/msg/RegionOfInterest", roi[0], roi[1], roi[3], roi[2], False))

    def imu(self, ns, q=IDENTITY, covariance=(0.0004, 0.0009), a=(0, 0, 9.81), frame="imu"):
        matrix = np.zeros(9)
        matrix[0], matrix[4] = covariance
        return self.of("sensor_msgs/msg/Imu", self.header(ns, frame), self.quaternion(q), matrix,
                       self.vector(), np.zeros(9), self.vector(a), np.zeros(9))

    def pose(self, position, q=IDENTITY):
        return self.of("geometry_msgs/msg/Pose", self.vector(position, "Point"), self.quaternion(q))

    def pose_stamped(self, ns, position, q=IDENTITY):
        return self.of("geometry_msgs/msg/PoseStamped", self.header(ns, "world"),
                       self.pose(position, q))

    def pose_with_covariance(self, ns, position, q=IDENTITY):
        return self.of("geometry_msgs/msg/PoseWithCovarianceStamped", self.header(ns, "world"),
                       self.of("geometry_msgs/msg/PoseWithCovariance", self.pose(position, q),
                               np.zeros(36)))

    def odometry(self, ns, position, q=IDENTITY, child="base"):
        twist = self.of("geometry_msgs/msg/Twist", self.vector(), self.vector())
        return self.of("nav_msgs/msg/Odometry", self.header(ns, "odom"), child, self.of(
            "geometry_msgs/msg/PoseWithCovariance", self.pose(position, q), np.zeros(36)), self.of(
                "geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36)))

    def transform(self, ns, parent, child, t=(0, 0, 0), q=IDENTITY):
        pose = self.of("geometry_msgs/msg/Transform", self.vector(t), self.quaternion(q))
        return self.of("geometry_msgs/msg/TransformStamped", self.header(ns, parent), child, pose)

    def frames(self, *transforms):
        return self.of("tf2_msgs/msg/TFMessage", list(transforms))

    def string(self, text):
        return self.of("std_msgs/msg/String", text)


def write_bag(folder, form, messages):
    """messages(maker) gives (topic, receive time in ns, message). Returns the bag's path."""
    make = Maker(form)
    known = {}

    def serialized(message):
        kind = message.__msgtype__
        return bytes(make.store.serialize_ros1(message, kind) if make.is_ros1
                     else make.store.serialize_cdr(message, kind))

    if form in ("mcap", "mcap-ros1"):
        path = folder / f"{form}.mcap"
        with open(path, "wb") as file:
            writer = McapWriter(file, chunk_size=1 << 16)
            writer.start(profile="ros1" if make.is_ros1 else "ros2")
            for topic, ns, message in messages(make):
                kind = message.__msgtype__
                if topic not in known:
                    text, _ = make.store.generate_msgdef(kind, ros_version=1 if make.is_ros1 else 2)
                    schema = writer.register_schema(
                        kind.replace("/msg/", "/") if make.is_ros1 else kind,
                        "ros1msg" if make.is_ros1 else "ros2msg", text.encode())
                    known[topic] = writer.register_channel(
                        topic, "ros1" if make.is_ros1 else "cdr", schema)
                writer.add_message(known[topic], ns, serialized(message), ns)
            writer.finish()
        return path
    with contextlib.ExitStack() as stack:
        if make.is_ros1:
            path = folder / f"{form}.bag"
            writer = Ros1Writer(path)
            writer.chunk_threshold = 1 << 16
            if "-" in form:
                writer.set_compression(Ros1Writer.CompressionFormat[form[5:].upper()])
        else:
            path = folder / form
            writer = Ros2Writer(path, version=9, storage_plugin=(
                StoragePlugin.MCAP if form == "mcap-folder" else StoragePlugin.SQLITE3))
            if form.startswith("sqlite3-"):
                writer.set_compression(CompressionMode[form[8:].upper()], CompressionFormat.ZSTD)
        stack.enter_context(writer)
        for topic, ns, message in messages(make):
            if topic not in known:
                known[topic] = writer.add_connection(topic, message.__msgtype__,
                                                     typestore=make.store)
            writer.write(known[topic], ns, serialized(message))
    return path
