#!/bin/sh
# OpenCV 4.6 turns a film that is to be shown turned by 90 degrees the wrong way: upside down.
#
# Packages: opencv-python-headless 4.6.0.66 with numpy 1.26.4, and 5.0.0.93; av 18.1.0 makes the
# film (Python 3.11, Linux x86-64). Run on 2026-11-29.
# The matrix of an MP4's track header (tkhd) says how a player turns the pictures. With
# a b c d = 0 -1 1 0 the stored left side comes to the bottom: 90 degrees counter-clockwise. The film
# is white in its left half. Expected, with CAP_PROP_ORIENTATION_AUTO (the default): white below.
# Seen with 4.6.0.66: CAP_PROP_ORIENTATION_META 90, and white above. 5.0.0.93: 270, white below.
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
for name in 4.6 5.0; do python3 -m venv "$work/$name"; done
"$work/4.6/bin/pip" install --quiet --disable-pip-version-check \
  opencv-python-headless==4.6.0.66 numpy==1.26.4
"$work/5.0/bin/pip" install --quiet --disable-pip-version-check \
  opencv-python-headless==5.0.0.93 av==18.1.0 numpy==2.4.6
cd "$work"
cat > film.py <<'EOF'
import struct

import av
import numpy as np

picture = np.zeros((240, 320, 3), np.uint8)
picture[:, :160] = 255
with av.open("x.mp4", "w") as film:
    stream = film.add_stream("libx264", rate=15)
    stream.width, stream.height, stream.pix_fmt = 320, 240, "yuv420p"
    for _ in range(10):
        film.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
    film.mux(stream.encode())
data = bytearray(open("x.mp4", "rb").read())
at = data.index(b"tkhd") + 4 + 40  # the matrix of a header of version 0: a b u, c d v, x y w
assert data[at:at + 4] == struct.pack(">i", 1 << 16)
data[at:at + 20] = struct.pack(">5i", 0, -1 << 16, 0, 1 << 16, 0)
open("x.mp4", "wb").write(data)
print("av", "rotation", next(av.open("x.mp4").decode(video=0)).rotation)
EOF
cat > run.py <<'EOF'
import cv2

film = cv2.VideoCapture("x.mp4")
meta, picture = film.get(cv2.CAP_PROP_ORIENTATION_META), film.read()[1]
above = picture[:picture.shape[0] // 2].mean() > picture[picture.shape[0] // 2:].mean()
print(cv2.__version__, meta, picture.shape[:2], "white above" if above else "white below")
EOF
"$work/5.0/bin/python" film.py > seen
"$work/4.6/bin/python" run.py >> seen
"$work/5.0/bin/python" run.py >> seen
printf '%s\n' "av rotation 90" "4.6.0 90.0 (320, 240) white above" \
  "5.0.0 270.0 (320, 240) white below" > expected
cat seen
diff expected seen
