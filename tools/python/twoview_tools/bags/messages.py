"""The types of messages that are read, and their decoding by rosbags."""

import struct

from rosbags.serde import SerdeError
from rosbags.typesys import (Stores, get_types_from_idl, get_types_from_msg, get_typestore)
from rosbags.typesys.base import TypesysError

from . import BadInput

TF_TYPE = "tf2_msgs/msg/TFMessage"
# {type: what it is used for}
ROLES = {
    "sensor_msgs/msg/Image": "picture",
    "sensor_msgs/msg/CompressedImage": "picture",
    "sensor_msgs/msg/CameraInfo": "camera",
    "sensor_msgs/msg/Imu": "imu",
    "nav_msgs/msg/Odometry": "truth",
    "geometry_msgs/msg/PoseStamped": "truth",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "truth",
    "geometry_msgs/msg/TransformStamped": "truth",
    TF_TYPE: "frames",
    "tf/msg/tfMessage": "frames",
}
# Each used type's own definition, for bags that bring none, by the encoding.
STANDARD = {"ros1": Stores.ROS1_NOETIC, "cdr": Stores.ROS2_HUMBLE}
FORMATS = ("ros1msg", "ros2msg", "ros2idl")


def role_of(topic):
    """What the messages of a topic are used for; "" for nothing."""
    is_read = topic.encoding in STANDARD and topic.definition_format in ("", *FORMATS)
    return ROLES.get(topic.type, "") if is_read else ""


def standard_store(encoding):
    """rosbags' definitions of ROS 1 or ROS 2, and tf2_msgs, which its noetic lacks (0.11.9)."""
    store = get_typestore(STANDARD[encoding])
    if TF_TYPE not in store.fielddefs:
        store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TF_TYPE))
    return store


class Damaged(Exception):
    """A message that cannot be used, in words that continue the topic's name."""


def _registered(topic):
    """The typestore of a topic's type, by the bag's own definition where it brings one."""
    if not topic.definition_format:
        return standard_store(topic.encoding)
    store = get_typestore(Stores.EMPTY)
    if topic.definition_format == "ros2idl":
        types = {}
        for part in topic.definition.split("=" * 80 + "\n"):
            if part.strip():
                types.update(get_types_from_idl(
                    part.split("\n", 1)[1] if part.startswith("IDL: ") else part))
    else:
        types = get_types_from_msg(topic.definition, topic.type)
    store.register({name: fields for name, fields in types.items()
                    if name not in store.fielddefs})
    return store


class Decoder:
    """Raw messages to objects with the fields of their type."""

    def __init__(self):
        # {id of a Topic: (it, its type's function)}; a Topic's own hash is slow.
        self._by_topic = {}

    def __call__(self, topic, data):
        known = self._by_topic.get(id(topic))
        if known is None:
            try:
                store = _registered(topic)
            except (TypesysError, ValueError, KeyError, IndexError) as error:
                raise BadInput(f"{topic.name}: the definition of {topic.type} that the bag brings "
                               f"is not understood: {error}") from None
            known = self._by_topic[id(topic)] = topic, (
                store.deserialize_ros1 if topic.encoding == "ros1" else store.deserialize_cdr)
        try:
            return known[1](data, topic.type)
        except (SerdeError, struct.error, ValueError, IndexError, AssertionError, KeyError,
                UnicodeDecodeError, OverflowError, MemoryError) as error:
            raise Damaged(f"is no {topic.type}: {error or type(error).__name__}") from None


def stamp_ns(stamp):
    """Nanoseconds of a builtin_interfaces/Time."""
    return stamp.sec * 10**9 + stamp.nanosec
