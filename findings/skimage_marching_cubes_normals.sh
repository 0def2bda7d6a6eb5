#!/bin/sh
# The normals of skimage's marching_cubes oppose its own faces.
#
# Package: scikit-image 0.26.0 with numpy 2.4.6 (Python 3.11, Linux x86-64). Run on 2026-11-29.
# A ball as a signed distance, negative inside as of every fused depth map. Expected: the faces'
# winding and the vertex normals that come with them point to the same side. Seen: with the default
# gradient_direction="descent" all faces point out of the ball and all normals into it. "ascent"
# turns the faces and leaves the normals, so that both point in. A mesh written with the two of the
# default is lit from the wrong side.
# What helps: normals computed from the faces, or -normals.
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check \
  scikit-image==0.26.0 numpy==2.4.6
cd "$work"
cat > run.py <<'EOF'
import numpy as np
from skimage.measure import marching_cubes

x, y, z = np.meshgrid(*[np.linspace(-1, 1, 33)] * 3, indexing="ij")
ball = np.sqrt(x * x + y * y + z * z) - 0.61
for direction in ("descent", "ascent"):
    vertices, faces, normals, _ = marching_cubes(ball, 0.0, gradient_direction=direction)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    wound_out = (np.cross(b - a, c - a) * (a - 16)).sum(axis=1) > 0
    normal_out = (normals * (vertices - 16)).sum(axis=1) > 0
    print(f"{direction}: {wound_out.mean():.0%} of the faces and {normal_out.mean():.0%} of the "
          "normals point out")
EOF
"$work/venv/bin/python" run.py > seen
cat > expected <<'EOF'
descent: 100% of the faces and 0% of the normals point out
ascent: 0% of the faces and 0% of the normals point out
EOF
cat seen
diff expected seen
