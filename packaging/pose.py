"""A pose of two PGM images with the installed package twoview; needs numpy only.

usage: pose.py LEFT.pgm RIGHT.pgm      (the Motorcycle pair, whose true t is (-1, 0, 0))
"""

import sys

import numpy as np
import twoview as tv


def pgm(path):
    with open(path, "rb") as file:
        data = file.read()
    magic, width, height, _, pixels = data.split(None, 4)
    assert magic == b"P5"
    size = int(width) * int(height)
    return np.frombuffer(data[-size:], np.uint8).reshape(int(height), int(width)).copy()


left, right = map(pgm, sys.argv[1:])
height, width = left.shape
cameras = [tv.Camera(width, height, fx=994.978, fy=994.978, cx=cx, cy=254.877)
           for cx in (311.193, 342.279)]
with tv.Context(max_width=width, max_height=height) as context:
    pose, cloud = tv.reconstruct(context, left, cameras[0], right, cameras[1])
print(tv.__file__, tv.version_string(), pose.verdict.name, pose.t.round(3).tolist(),
      f"{cloud.num_points} points")
assert pose.verdict.name == "OK" and pose.t[0] < -0.99, pose
