#!/bin/sh
# OpenCV 5.0 says 25 pictures a second for every raw H.264 stream.
#
# Packages: opencv-python-headless 5.0.0.93, and 4.6.0.66 with numpy 1.26.4; av 18.1.0 makes the
# stream (Python 3.11, Linux x86-64). Run on 2026-11-29.
# Drones and cameras give raw streams (Annex B), whose rate is in the stream's own timing
# information. Three are made, of 10, 15 and 30 pictures a second. Expected: CAP_PROP_FPS says so,
# as with 4.6.0.66 (to 2 %). Seen with 5.0.0.93: 25 each time. As CAP_PROP_POS_MSEC is 0 for every
# picture of such a stream (with both), the rate is all that is left to tell the time by.
# What helps: read the timing information (VUI) of the stream, or ask the user.
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
import av
import numpy as np

base = np.random.default_rng(0).integers(0, 255, (240, 400, 3), dtype=np.uint8)
for rate in (10, 15, 30):
    with av.open(f"{rate}.h264", "w", format="h264") as film:
        stream = film.add_stream("libx264", rate=rate)
        stream.width, stream.height, stream.pix_fmt = 320, 240, "yuv420p"
        for i in range(20):
            picture = np.ascontiguousarray(base[:, i:i + 320])
            film.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        film.mux(stream.encode())
EOF
"$work/5.0/bin/python" film.py
cat > run.py <<'EOF'
import cv2

films = [cv2.VideoCapture(f"{rate}.h264") for rate in (10, 15, 30)]
print(cv2.__version__, *(round(film.get(cv2.CAP_PROP_FPS)) for film in films))
EOF
"$work/4.6/bin/python" run.py > seen
"$work/5.0/bin/python" run.py >> seen
printf '%s\n' "4.6.0 10 15 30" "5.0.0 25 25 25" > expected
cat seen
diff expected seen
