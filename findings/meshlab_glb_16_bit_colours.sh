#!/bin/sh
# Of the 16-bit colours of a glTF file MeshLab takes the low byte.
#
# Package: pymeshlab 2025.7.post1 (Python 3.11, Linux x86-64). Run on 2026-11-30.
# glTF 2.0 allows COLOR_0 as floats, as normalised bytes and as normalised unsigned shorts. One
# triangle, whose corners are greys of 0.3, 0.15 and 0.1, is written as each.
# Expected: these three times, to a hundredth.
# Seen: floats and bytes are right; of the shorts (0x4ccc, 0x2666, 0x199a) come 0xcc, 0x66 and
# 0x9a over 255: a picture becomes noise.
# What helps: floats (bytes lose the dark tones of linear light), or a PLY.
set -eu
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check pymeshlab==2025.7.post1
cd "$work"
cat > run.py <<'EOF'
import json
import struct

import pymeshlab

SHARES = (0.3, 0.15, 0.1)


def chunk(kind, data, filler):
    data += filler * (-len(data) % 4)
    return struct.pack("<II", len(data), kind) + data


def glb(component, colours, normalized):
    parts = (struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0), colours, struct.pack("<3I", 0, 1, 2))
    views, start = [], 0
    for part, target in zip(parts, (34962, 34962, 34963)):
        views.append({"buffer": 0, "byteOffset": start, "byteLength": len(part), "target": target})
        start += len(part)
    colour = {"bufferView": 1, "componentType": component, "type": "VEC4", "count": 3}
    if normalized:
        colour["normalized"] = True
    text = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}], "buffers": [{"byteLength": start}], "bufferViews": views,
            "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3,
                           "min": [0, 0, 0], "max": [1, 1, 0]}, colour,
                          {"bufferView": 2, "componentType": 5125, "type": "SCALAR", "count": 3}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 1},
                                        "indices": 2}]}]}
    body = chunk(0x4E4F534A, json.dumps(text).encode(), b" ") + chunk(0x004E4942, b"".join(parts),
                                                                      b"\0")
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


for name, component, code, full in (("float", 5126, "f", 1.0), ("byte", 5121, "B", 255),
                                    ("short", 5123, "H", 65535)):
    values = []
    for share in SHARES:
        grey = share * full if code == "f" else round(share * full)
        values += [grey, grey, grey, full]
    with open("x.glb", "wb") as file:
        file.write(glb(component, struct.pack("<12" + code, *values), code != "f"))
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh("x.glb")
    colours = meshes.current_mesh().vertex_color_matrix()
    print(name, *(" ".join(f"{v:.2f}" for v in row[:3]) for row in colours), sep=" | ")
EOF
"$work/venv/bin/python" run.py 2> /dev/null | grep -E "^(float|byte|short)" > seen
cat > expected <<'EOF'
float | 0.30 0.30 0.30 | 0.15 0.15 0.15 | 0.10 0.10 0.10
byte | 0.30 0.30 0.30 | 0.15 0.15 0.15 | 0.10 0.10 0.10
short | 0.80 0.80 0.80 | 0.40 0.40 0.40 | 0.60 0.60 0.60
EOF
cat seen
diff expected seen
