#!/bin/sh
# A database of COLMAP 3 that COLMAP 4 brought over cannot be added to by its own classes.
#
# Packages: pycolmap 3.11.1, then 4.2.1 (Python 3.11, Linux x86-64). Run on 2026-11-29.
# 3.11.1 makes a database with two images. 4.2.1 opens it, which adds the new tables, and adds an
# image with its rig and frame, as it does in a database of its own. Expected: the mapper reads all
# three. Seen: the migration makes no rigs and frames for the two that were there. The mapper makes
# them itself where no image has one (without the third image it gets as far as "no images with
# matches"), but where some have it raises "Check failed: image.HasFrameId()".
# What helps: write a frame for each image that has none, before the first one is added.
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for version in 3.11.1 4.2.1; do
  python3 -m venv "$work/$version"
  "$work/$version/bin/pip" install --quiet --disable-pip-version-check pycolmap==$version
done
cd "$work"
mkdir models
"$work/3.11.1/bin/python" -c '
import pycolmap
database = pycolmap.Database("x.db")
camera = pycolmap.Camera(model="PINHOLE", width=640, height=480, params=[500, 500, 320, 240])
number = database.write_camera(camera)
for name in ("1.png", "2.png"):
    database.write_image(pycolmap.Image(name=name, camera_id=number))
database.close()'
cat > run.py <<'EOF'
import pycolmap

pycolmap.logging.minloglevel = pycolmap.logging.FATAL.value
for adds in (False, True):
    with pycolmap.Database.open("x.db") as database:
        if adds:
            rig = pycolmap.Rig()
            rig.add_ref_sensor(database.read_camera(1).sensor_id)
            image = pycolmap.Image(name="3.png", camera_id=1)
            image.image_id = database.write_image(image)
            frame = pycolmap.Frame()
            frame.rig_id = database.write_rig(rig)
            frame.add_data_id(image.data_id)
            database.write_frame(frame)
        print(len(database.read_all_images()), "images,", len(database.read_all_frames()), "frames")
    try:
        print(len(pycolmap.incremental_mapping("x.db", ".", "models")), "models")
    except ValueError as error:
        print("raised:", str(error).split("] ")[-1])
EOF
"$work/4.2.1/bin/python" run.py > seen
printf '%s\n' "2 images, 0 frames" "0 models" "3 images, 1 frames" \
  "raised: Check failed: image.HasFrameId() " > expected
cat seen
diff expected seen
