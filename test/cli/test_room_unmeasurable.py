#!/usr/bin/env python3
"""Tests of `twoview room` before what cannot be measured: a mirror, a window, a lamp, a person who
walks through, a plain wall, a flight that is one rotation. What is not there must not be made, and
the walls around must stay. The flight is the one past five walls of test_odometry, with its true
poses."""
import math
import unittest

import numpy as np

from cli_support import CliTest, main, png
from test_odometry import CAMERAS, COUNT, FOCAL, HEIGHT, LUMA, SHIFTS, TIMES, TUM_TRUTH, WIDTH
from test_room_model import DEPTHS, WALLS, away_from_walls, read_ply

FRAMES = [np.frombuffer(luma, np.uint8).reshape(HEIGHT, WIDTH) for luma in LUMA]
STRIP = HEIGHT // len(SHIFTS)
# Another texture than the walls', as large as the flight sees of it: the mean of 5 x 5 random
# pixels, with four times the contrast.
NOISE = np.random.default_rng(7).integers(
    0, 256, (HEIGHT + 4, WIDTH + COUNT * max(SHIFTS) + 4))
OTHER = np.clip(4 * sum(NOISE[y:y + HEIGHT, x:x - 4 or None] for y in range(5) for x in range(5)) //
                25 - 381, 0, 255).astype(np.uint8)
# The opening of a mirror or a window: a part of the wall in the second strip, in its pixels as the
# first frame shows them.
WALL, LEFT, RIGHT = 1, 130, 250


def through_opening(shift):
    """The frames with that part of the wall showing what moves by `shift` pixels a frame."""
    rows = slice(WALL * STRIP, (WALL + 1) * STRIP)
    for i, frame in enumerate(FRAMES):
        shown = frame.copy()
        left, right = (max(0, edge - SHIFTS[WALL] * i) for edge in (LEFT, RIGHT))
        shown[rows, left:right] = OTHER[rows, left + shift * i:right + shift * i]
        yield shown


def blended(one, other):
    return ((a.astype(int) + b) // 2 for a, b in zip(one, other))


class UnmeasurableTest(CliTest):
    def set_of(self, frames):
        """A set folder of these pictures, with the true path."""
        for i, frame in enumerate(frames):
            self.write(f"set/images/{i:05}.png",
                       png(WIDTH, HEIGHT, np.asarray(frame, np.uint8).tobytes()))
        self.write("set/frames.txt", "".join(f"{t:.9f} images/{i:05}.png\n"
                                             for i, t in enumerate(TIMES)))
        self.write("set/cameras.yaml", CAMERAS)
        self.write("set/groundtruth.txt", TUM_TRUTH)
        return self.folder / "set"

    def vertices_of(self, frames):
        """The positions of the room's vertices, in the truth's frame and unit."""
        source = self.set_of(frames)
        self.succeed(self.run_program("room", source, "--poses", source / "groundtruth.txt", "-o",
                                      self.out))
        _, vertices, _ = read_ply(self.out / "room.ply")
        return np.array([(v["x"], v["y"], v["z"]) for v in vertices])

    def in_strip(self, points, wall):
        """Which points the camera sees in the middle of that wall's strip."""
        row = points[:, 1] / points[:, 2] * FOCAL + HEIGHT / 2
        return (row > wall * STRIP + 10) & (row < (wall + 1) * STRIP - 10)

    def assert_walls_stay(self, points, hidden=()):
        """Each wall that nothing hid is there without a hole, and where it is; its ends are in few
        pictures."""
        for k, wall in enumerate(WALLS):
            if k in hidden:
                continue
            strip = points[self.in_strip(points, k)]
            right = np.abs(strip[:, 2] / wall["z"] - 1) < 0.03
            self.assertGreater(right.mean(), 0.85, f"wall {k}")
            cells = np.linspace(*wall["x"], 12)
            found, _ = np.histogram(strip[right, 0], cells)
            self.assertTrue((found[2:-3] > 0).all(), f"wall {k} has holes: {found}")

    def assert_nothing_before_the_walls(self, points, most=0.01):
        """No more than that share of the strips' middles lies before its wall."""
        before = total = 0
        for k, wall in enumerate(WALLS):
            strip = points[self.in_strip(points, k)]
            before += (strip[:, 2] < 0.93 * wall["z"]).sum()
            total += len(strip)
        self.assertLessEqual(before / total, most)

    def opening(self, points):
        """The points in the middle of the opening, seen from the middle of the flight."""
        across = (points[:, 0] - 0.05 * COUNT) / points[:, 2] * FOCAL + WIDTH / 2
        middle = SHIFTS[WALL] * COUNT // 2
        return points[self.in_strip(points, WALL) & (across > LEFT - middle + 20) &
                      (across < RIGHT - middle - 20)]

    def test_what_a_mirror_shows_lies_behind_it_and_the_walls_stay(self):
        shift = 2  # of what is mirrored: at twice the wall's depth
        points = self.vertices_of(through_opening(shift))
        self.assert_walls_stay(points, hidden=[WALL])
        self.assert_nothing_before_the_walls(points)
        seen = self.opening(points)
        self.assertGreater(len(seen), 10)
        self.assertGreater((np.abs(seen[:, 2] / (FOCAL * 0.1 / shift) - 1) < 0.06).mean(), 0.8)

    def test_a_window_that_reflects_makes_nothing_before_it(self):
        # Half of what lies behind the glass, half of what it reflects.
        points = self.vertices_of(blended(through_opening(3), through_opening(2)))
        self.assert_walls_stay(points, hidden=[WALL])
        self.assert_nothing_before_the_walls(points)

    def test_a_lamp_leaves_a_hole_or_a_part_of_its_wall(self):
        frames = []
        for i, frame in enumerate(FRAMES):
            shown = frame.copy()
            y, x = np.mgrid[:HEIGHT, :WIDTH]
            lit = np.hypot(x - (180 - SHIFTS[2] * i), y - HEIGHT / 2) < 30
            shown[lit] = 255
            frames.append(shown)
        points = self.vertices_of(frames)
        self.assert_walls_stay(points, hidden=[1, 2, 3])
        self.assert_nothing_before_the_walls(points)

    def test_a_person_who_walks_through_leaves_no_ghost(self):
        for step in (8, -1):  # pixels a frame, to the right; the walls move 3 to 9 to the left
            with self.subTest(step=step):
                frames = []
                for i, frame in enumerate(FRAMES):
                    shown, x = frame.copy(), 100 + step * i
                    shown[60:, x:x + 60] = OTHER[60:, 200:260]
                    frames.append(shown)
                points = self.vertices_of(frames)
                self.assert_nothing_before_the_walls(points)
                away = away_from_walls(points)
                self.assertLess((away > 0.3).mean(), 0.03)

    def test_a_plain_part_of_a_wall_is_inferred_in_its_own_colour(self):
        """One wall, 5 units away, whose middle is plain but for the sensor's noise."""
        grey, noise, frames = 210, np.random.default_rng(1), []
        y, x = np.mgrid[:HEIGHT, :WIDTH]
        for i in range(COUNT):
            shown = OTHER[:, 6 * i:6 * i + WIDTH].astype(float)
            shown[(np.abs(x - (210 - 6 * i)) < 100) & (np.abs(y - HEIGHT / 2) < 75)] = grey
            frames.append(np.clip(shown + noise.normal(0, 1, shown.shape), 0, 255))
        source = self.set_of(frames)
        poses = ("--poses", source / "groundtruth.txt", "-o", self.out)
        self.succeed(self.run_program("room", source, *poses))
        _, vertices, _ = read_ply(self.out / "room.ply")
        inferred = [v for v in vertices if v["inferred"]]
        self.assertGreater(len(inferred), 10)
        for v in inferred:
            self.assertAlmostEqual(v["z"], 5, delta=0.1)
            for channel in ("red", "green", "blue"):
                self.assertAlmostEqual(v[channel], grey, delta=10)
        # Where the memory is full, all is fused again with larger voxels, and the wall is carried
        # there, too.
        done = self.succeed(self.run_program("room", source, *poses, "--voxel", "0.05",
                                             "--max-memory", "1"))
        self.assertIn("voxels became 0.1 instead of 0.05", done.stdout.decode())
        self.assertGreater(self.result()["room"]["share_inferred"], 0)

    def test_a_flight_that_is_one_rotation_makes_no_room(self):
        """A camera that turns by 0.8 degrees a frame before a wall without end."""
        y, x = np.mgrid[:HEIGHT, :WIDTH]
        right, down = (x - (WIDTH - 1) / 2) / FOCAL, (y - (HEIGHT - 1) / 2) / FOCAL
        yaw = np.arctan(right)
        rows = np.clip(down * np.cos(yaw) * FOCAL + HEIGHT / 2, 0, HEIGHT - 1).astype(int)
        turns = [math.radians(0.8 * i) for i in range(COUNT)]
        texture = np.tile(OTHER, (1, 2))
        source = self.set_of(texture[rows, ((yaw + turn + 0.6) * FOCAL).astype(int)]
                             for turn in turns)
        # With its poses, whose centres are one and whose rotations are many.
        path = self.write("turning.txt", "".join(
            f"{t:.9f} 0 0 0 0 {math.sin(turn / 2):.9f} 0 {math.cos(turn / 2):.9f}\n"
            for t, turn in zip(TIMES, turns)))
        done = self.run_program("room", source, "--poses", path, "-o", self.out)
        self.assertEqual(done.returncode, 3)
        self.one_line(done, "no surface")
        self.assertGreater(self.result()["room"]["pixels"]["seen_from_one_place"], 0.5)
        self.assertEqual(self.listing(), ["report.html", "result.json"])
        # Without them no map begins.
        flight = self.folder / "flight"
        done = self.run_program("odometry", source, "-o", flight, "--room")
        self.assertEqual(done.returncode, 3, done.stderr)
        self.one_line(done, "")
        self.assertNotIn("room.ply", self.listing(flight))


if __name__ == "__main__":
    main()
