#!/bin/sh
# A camera whose parameters are given to pycolmap is stored as one whose focal length was guessed.
#
# Package: pycolmap 4.2.1 (Python 3.11, Linux x86-64). Run on 2026-11-29.
# The column prior_focal_length of a database tells the focal lengths that EXIF data or the user
# gave (1) from those that COLMAP guessed as 1.2 times the longer side (0).
# Expected: a Camera made of a calibration counts as given, as ImageReader's camera_params does.
# Seen: 0, the same as for Camera.create_from_model_name with a guess. The two cannot be told apart.
# What helps: camera.has_prior_focal_length = True before write_camera.
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check pycolmap==4.2.1
cd "$work"
cat > run.py <<'EOF'
import sqlite3

import pycolmap

given = pycolmap.Camera(model="PINHOLE", width=640, height=480, params=[512.3, 512.9, 317.2, 242.5])
guess = pycolmap.Camera.create_from_model_name(2, "PINHOLE", 1.2 * 640, 640, 480)
told = pycolmap.Camera(model="PINHOLE", width=640, height=480, params=[512.3, 512.9, 317.2, 242.5])
told.has_prior_focal_length = True
with pycolmap.Database.open("x.db") as database:
    for camera in (given, guess, told):
        database.write_camera(camera)
flags = sqlite3.connect("x.db").execute("SELECT prior_focal_length FROM cameras").fetchall()
print(*(flag for flag, in flags))
EOF
"$work/venv/bin/python" run.py > seen
cat seen
echo "0 0 1" | diff - seen
