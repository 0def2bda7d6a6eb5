#!/usr/bin/env python3
"""Writes the known truth of the Motorcycle pair: both cameras, the motion and the depth of image 0.

usage: demo_truth.py motorcycle_disp.npz DIR
DIR gets camera0.yaml, camera1.yaml (OpenCV's format), truth.yaml and depth0.pfm.

Middlebury 2014 (D. Scharstein et al., GCPR 2014): the pair is rectified, so the motion is sideways
and a pixel's depth is focal * baseline / (disparity + cx1 - cx0). The values are those of the pair
as scikit-image ships it, 741x500. Python's own library is enough for a file this small.
"""
import array
import ast
import struct
import sys
import zipfile
from pathlib import Path

WIDTH, HEIGHT = 741, 500
FOCAL_PX, CY = 994.978, 254.877
CX = (311.193, 342.279)
BASELINE_M = 0.193001

CAMERA = """%YAML:1.0
---
image_width: {width}
image_height: {height}
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ {f}, 0., {cx}, 0., {f}, {cy}, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ 0., 0., 0., 0., 0. ]
# Middlebury's rig is calibrated to about 0.2 pixels (D. Scharstein et al., GCPR 2014), which is
# 0.0002 focal lengths.
focal_sigma: 0.0002
center_sigma: 0.0002
"""

TRUTH = """# x1 = R x0 + t, |t| = 1; baseline in metres; depth0 holds metres, 0 where unknown
R: [1, 0, 0, 0, 1, 0, 0, 0, 1]
t: [-1, 0, 0]
baseline: {baseline}
depth0: depth0.pfm
"""


def read_disparity(path):
    """Reads the only array of the .npz: float32, row-major, HEIGHT x WIDTH, infinite where
    unknown."""
    with zipfile.ZipFile(path) as archive:
        data = archive.read(archive.namelist()[0])
    # .npy: magic, version 1.0, u16 length of a header that is a Python dictionary, the array
    (header_size,) = struct.unpack_from("<H", data, 8)
    header = ast.literal_eval(data[10 : 10 + header_size].decode("latin1"))
    expected = {"descr": "<f4", "fortran_order": False, "shape": (HEIGHT, WIDTH)}
    if data[:8] != b"\x93NUMPY\x01\x00" or header != expected:
        sys.exit(f"{path}: not the expected array: {header}")
    disparity = array.array("f", data[10 + header_size :])
    if sys.byteorder == "big":
        disparity.byteswap()
    return disparity


def write_pfm(path, pixels):
    """Writes a portable float map: little-endian (which a negative scale indicates), bottom row
    first."""
    if sys.byteorder == "big":
        pixels.byteswap()
    with open(path, "wb") as file:
        file.write(f"Pf\n{WIDTH} {HEIGHT}\n-1.0\n".encode())
        for y in reversed(range(HEIGHT)):
            file.write(pixels[y * WIDTH : (y + 1) * WIDTH].tobytes())


def main():
    disparity = read_disparity(sys.argv[1])
    folder = Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    for index, cx in enumerate(CX):
        text = CAMERA.format(width=WIDTH, height=HEIGHT, f=FOCAL_PX, cx=cx, cy=CY)
        (folder / f"camera{index}.yaml").write_text(text)
    scale = FOCAL_PX * BASELINE_M
    offset = CX[1] - CX[0]
    # An infinite disparity gives depth 0, which means unknown.
    write_pfm(folder / "depth0.pfm", array.array("f", (scale / (d + offset) for d in disparity)))
    (folder / "truth.yaml").write_text(TRUTH.format(baseline=BASELINE_M))


main()
