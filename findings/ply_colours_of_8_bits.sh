#!/bin/sh
# No spelling of an 8-bit colour in a binary PLY is read rightly by both COLMAP and meshio.
#
# Packages: pycolmap 4.2.1, meshio 5.3.5 (Python 3.11, Linux x86-64). Run on 2026-11-29.
# PLY's names uchar and uint8 are the same type. A cloud of one point with the colour 200 100 50
# is written binary, with both. Expected: 200 100 50, four times.
# Seen: pycolmap's import_PLY takes uchar and refuses uint8 (though it takes float32 for float);
# meshio reads uint8 rightly and uchar as signed, -56 100 50 (in an ASCII file it is right).
# A column of integers of 32 bits is refused by pycolmap, too.
# What helps: uchar, no other integers, and .view("uint8") behind meshio.
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check pycolmap==4.2.1 meshio==5.3.5
cd "$work"
cat > run.py <<'EOF'
import struct

import meshio
import pycolmap

for kind in ("uchar", "uint8"):
    lines = ["ply", "format binary_little_endian 1.0", "element vertex 1"]
    lines += [f"property float {name}" for name in "xyz"]
    lines += [f"property {kind} {name}" for name in ("red", "green", "blue")]
    with open("x.ply", "wb") as file:
        file.write(("\n".join(lines) + "\nend_header\n").encode())
        file.write(struct.pack("<3f3B", 1, 2, 3, 200, 100, 50))
    model = pycolmap.Reconstruction()
    try:
        model.import_PLY("x.ply")
        print(kind, "pycolmap", *model.points3D[1].color)
    except ValueError:
        print(kind, "pycolmap refuses it")
    point = meshio.read("x.ply").point_data
    print(kind, "meshio", *(int(point[name][0]) for name in ("red", "green", "blue")))
EOF
"$work/venv/bin/python" run.py > seen
cat > expected <<'EOF'
uchar pycolmap 200 100 50
uchar meshio -56 100 50
uint8 pycolmap refuses it
uint8 meshio 200 100 50
EOF
cat seen
diff expected seen
