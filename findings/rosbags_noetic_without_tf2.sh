#!/bin/sh
# rosbags has no tf2_msgs/TFMessage for ROS 1: /tf cannot be written into a ROS 1 bag.
#
# Package: rosbags 0.11.9 with numpy 2.4.6 (Python 3.11, Linux x86-64). Run on 2026-11-29.
# tf2_msgs is in every ROS installation, and /tf in nearly every bag. Expected: the store of ROS 1
# Noetic has the type, as all stores of ROS 2 do. Seen: it has not, and a program that writes a ROS 1
# bag with /tf gets an error for one of the commonest topics. (A bag that is read brings the
# definition with it.) What helps: register the type (one field, geometry_msgs/TransformStamped[] transforms).
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check rosbags==0.11.9 numpy==2.4.6
cd "$work"
cat > run.py <<'EOF'
from pathlib import Path

from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

NAME = "tf2_msgs/msg/TFMessage"
for store in (Stores.ROS1_NOETIC, Stores.ROS2_FOXY, Stores.ROS2_HUMBLE, Stores.ROS2_JAZZY):
    print(store.value, NAME in get_typestore(store).fielddefs)

store = get_typestore(Stores.ROS1_NOETIC)
for attempt in ("as it comes", "registered"):
    with Writer(Path(attempt + ".bag")) as writer:
        try:
            writer.add_connection("/tf", NAME, typestore=store)
            print(attempt + ": written")
        except Exception as error:
            print(f"{attempt}: {type(error).__name__}")
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", NAME))
EOF
"$work/venv/bin/python" run.py > seen
cat > expected <<'EOF'
ros1_noetic False
ros2_foxy True
ros2_humble True
ros2_jazzy True
as it comes: TypesysError
registered: written
EOF
cat seen
diff expected seen
