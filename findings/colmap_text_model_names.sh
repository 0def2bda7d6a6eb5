#!/bin/sh
# COLMAP writes the whole name of a picture into images.txt and reads it up to the first blank.
#
# Package: pycolmap 4.2.1 (Python 3.11, Linux x86-64). Run on 2026-11-29.
# A reconstruction with the pictures "left 1.png" and "left 2.png" is written as text and as binary
# and read again. Expected: the same names. Seen: the binary model keeps them; of the text model
# both pictures are called "left", without an error. Whoever keys by the name loses all but one.
# What helps: binary models, or names without blanks.
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check pycolmap==4.2.1
cd "$work"
cat > run.py <<'EOF'
import os

import pycolmap

model = pycolmap.Reconstruction()
model.add_camera_with_trivial_rig(pycolmap.Camera(
    model="PINHOLE", width=640, height=480, camera_id=1, params=[500, 500, 320, 240]))
for number in (1, 2):
    image = pycolmap.Image(name=f"left {number}.png", camera_id=1, image_id=number)
    model.add_image_with_trivial_frame(image, pycolmap.Rigid3d())
for folder, write in (("text", model.write_text), ("binary", model.write_binary)):
    os.mkdir(folder)
    write(folder)
    print(folder, sorted(image.name for image in pycolmap.Reconstruction(folder).images.values()))
EOF
"$work/venv/bin/python" run.py > seen
cat > expected <<'EOF'
text ['left', 'left']
binary ['left 1.png', 'left 2.png']
EOF
cat seen
diff expected seen
