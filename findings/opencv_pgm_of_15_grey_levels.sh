#!/bin/sh
# OpenCV scales a PGM or PPM whose largest sample is below 255 where it is ASCII, not where binary.
#
# Packages: opencv-python-headless 5.0.0.93; 4.6.0.66 does the same (Python 3.11, Linux x86-64).
# Run on 2026-11-29.
# The header of a PNM file says the sample of white. The same four pixels, 0 5 10 15 of 15, are read
# from an ASCII (P2) and a binary (P5) file, and 0 1365 2730 4095 of 4095 from both.
# Expected: the same pixels from both forms. Seen: of 15 grey levels the ASCII file gives 0 85 170
# 255 and the binary one 0 5 10 15, a nearly black picture; of 4095 neither is scaled. Raw cameras
# and data sets of 10 and 12 bits come so.
# What helps: read the header's largest sample oneself.
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check opencv-python-headless==5.0.0.93
cd "$work"
cat > run.py <<'EOF'
import cv2
import numpy as np

for white, samples, kind in ((15, [0, 5, 10, 15], "u1"), (4095, [0, 1365, 2730, 4095], ">u2")):
    ascii_form = f"P2\n4 1\n{white}\n{' '.join(map(str, samples))}\n".encode()
    binary_form = f"P5\n4 1\n{white}\n".encode() + np.array(samples, kind).tobytes()
    for name, data in (("ASCII", ascii_form), ("binary", binary_form)):
        read = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        print(f"of {white}, {name}:", *read.reshape(-1).tolist())
EOF
"$work/venv/bin/python" run.py > seen
cat > expected <<'EOF'
of 15, ASCII: 0 85 170 255
of 15, binary: 0 5 10 15
of 4095, ASCII: 0 1365 2730 4095
of 4095, binary: 0 1365 2730 4095
EOF
cat seen
diff expected seen
