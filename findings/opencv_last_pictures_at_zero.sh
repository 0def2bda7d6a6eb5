#!/bin/sh
# OpenCV 4.6 gives the last pictures of an H.264 film the time 0.
#
# Packages: opencv-python-headless 4.6.0.66 with numpy 1.26.4, and 5.0.0.93; av 18.1.0 makes the
# film (Python 3.11, Linux x86-64). Run on 2026-11-29.
# A film of 30 pictures at 15 a second is read with grab(), and CAP_PROP_POS_MSEC after each.
# Expected: 0 to 1933.3 ms, rising. Seen with 4.6.0.66: the pictures that the decoder still holds at
# the end of the file have 0: as many as it has threads, here 2 of a machine with 2 processors. A
# reader that takes times that do not rise for an error loses the end of each film. 5.0.0.93 is
# right.
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
with av.open("x.mp4", "w") as film:
    stream = film.add_stream("libx264", rate=15)
    stream.width, stream.height, stream.pix_fmt = 320, 240, "yuv420p"
    for i in range(30):
        picture = np.ascontiguousarray(base[:, i:i + 320])
        film.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
    film.mux(stream.encode())
EOF
"$work/5.0/bin/python" film.py
cat > run.py <<'EOF'
import cv2

film, times = cv2.VideoCapture("x.mp4"), []
while film.grab():
    times.append(film.get(cv2.CAP_PROP_POS_MSEC))
print(cv2.__version__, len(times), "pictures, the last at", round(times[-1], 1), "ms,",
      "some" if 0 in times[1:] else "none", "after the first at 0")
EOF
"$work/4.6/bin/python" run.py > seen
"$work/5.0/bin/python" run.py >> seen
printf '%s\n' "4.6.0 30 pictures, the last at 0.0 ms, some after the first at 0" \
  "5.0.0 30 pictures, the last at 1933.3 ms, none after the first at 0" > expected
cat seen
diff expected seen
