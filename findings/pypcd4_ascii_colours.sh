#!/bin/sh
# pypcd4 loses every packed colour of a point cloud that it writes as ASCII.
#
# Package: pypcd4 1.5.1 with numpy 2.4.6 (Python 3.11, Linux x86-64). Run on 2026-11-29.
# PCD keeps a colour as the bits of a float, 0x00RRGGBB: a tiny number such as 1.84e-38. pypcd4's own
# encode_rgb makes them and from_xyzrgb_points takes them. Expected: the colours come back from each
# encoding of the file. Seen: binary and binary_compressed keep them; ASCII is written with ten
# decimals, "0.0000000000", and every point is black. (Programs that write ASCII PCD give the float
# its significant digits, or the field the type U.)
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check pypcd4==1.5.1 numpy==2.4.6
cd "$work"
cat > run.py <<'EOF'
import numpy as np
from pypcd4 import Encoding, PointCloud

colours = PointCloud.encode_rgb(np.array([[200, 100, 50], [255, 255, 255]], np.uint8))
cloud = PointCloud.from_xyzrgb_points(np.column_stack([np.eye(3, dtype=np.float32)[:2], colours]))
for encoding in (Encoding.BINARY, Encoding.BINARY_COMPRESSED, Encoding.ASCII):
    cloud.save("x.pcd", encoding=encoding)
    read = PointCloud.from_path("x.pcd")
    print(encoding.value, PointCloud.decode_rgb(read.pc_data["rgb"]).tolist())
EOF
"$work/venv/bin/python" run.py > seen
cat > expected <<'EOF'
binary [[200, 100, 50], [255, 255, 255]]
binary_compressed [[200, 100, 50], [255, 255, 255]]
ascii [[0, 0, 0], [0, 0, 0]]
EOF
cat seen
diff expected seen
