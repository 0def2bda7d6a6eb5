"""Helpers of the command line's tests: they run the program and make images and cameras. Only
Python's standard library is used. The program is the one that TWOVIEW_PROGRAM names, or the first
argument.
"""
import fcntl
import functools
import json
import os
import pty
import random
import select
import shutil
import struct
import subprocess
import sys
import tempfile
import termios
import time
import unittest
import zlib
from pathlib import Path

SKIP_CODE = 77
RESULT_FILES = [
    "cloud.ply",
    "epipolar.png",
    "matches.png",
    "report.html",
    "result.json",
    "views.png",
]


def program():
    path = os.environ.get("TWOVIEW_PROGRAM", "")
    if not path or not os.path.exists(path):
        print(f"skipped: TWOVIEW_PROGRAM names no program: '{path}'")
        sys.exit(SKIP_CODE)
    return path


def main():
    """Runs the tests of the calling file; argument 1 may be the path of the twoview program."""
    if len(sys.argv) > 1 and os.path.isfile(sys.argv[1]):
        os.environ["TWOVIEW_PROGRAM"] = os.path.abspath(sys.argv.pop(1))
    program()
    unittest.main(verbosity=2)


def png(width, height, samples, channels=1, depth=8):
    """A PNG file's bytes; samples is a flat sequence, row by row, or bytes already (8 bits)."""
    colour_type = {1: 0, 2: 4, 3: 2, 4: 6}[channels]
    if depth == 16:
        data = struct.pack(f">{len(samples)}H", *samples)
    else:
        data = bytes(samples)
    row = width * channels * depth // 8
    raw = b"".join(b"\0" + data[y * row : (y + 1) * row] for y in range(height))
    header = struct.pack(">IIBBBBB", width, height, depth, colour_type, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + png_chunk(b"IHDR", header)
        + png_chunk(b"IDAT", zlib.compress(raw, 1))
        + png_chunk(b"IEND", b"")
    )


def png_chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png_size(data):
    """The width and height of a PNG file; fails if the file is incomplete."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n" and data[-8:-4] == b"IEND", "no whole PNG"
    return struct.unpack(">II", data[16:24])


def png_samples(data):
    """The flat samples of a PNG file without palette and interlacing, 8 or 16 bits."""
    width, height = png_size(data)
    depth, colour_type = data[24], data[25]
    channels = {0: 1, 4: 2, 2: 3, 6: 4}[colour_type]
    packed, at = b"", 8
    while at < len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        if data[at + 4 : at + 8] == b"IDAT":
            packed += data[at + 8 : at + 8 + length]
        at += 12 + length
    raw, step, row_bytes = (
        zlib.decompress(packed),
        channels * depth // 8,
        width * channels * depth // 8,
    )
    above, out = bytearray(row_bytes), bytearray()
    for y in range(height):
        kind, row = raw[y * (row_bytes + 1)], bytearray(raw[y * (row_bytes + 1) + 1 :][:row_bytes])
        for i in range(row_bytes):
            a, b, c = (row[i - step], above[i], above[i - step]) if i >= step else (0, above[i], 0)
            nearest = min((abs(b - c), 0, a), (abs(a - c), 1, b), (abs(a + b - 2 * c), 2, c))[2]
            row[i] = (row[i] + (0, a, b, (a + b) // 2, nearest)[kind]) & 255
        out += row
        above = row
    return bytes(out) if depth == 8 else list(struct.unpack(f">{len(out) // 2}H", out))


def texture(width, height, seed=7):
    """Small patches of random grey on grey: there are corners everywhere, and no two places look
    alike."""
    rng = random.Random(seed)
    rows = [bytearray([128]) * width for _ in range(height)]
    for _ in range(width * height // 40):
        x, y = rng.randrange(width), rng.randrange(height)
        w, h = rng.randrange(1, 8), rng.randrange(1, 8)
        value = rng.randrange(20, 236)
        for row in rows[y : y + h]:
            row[x : x + w] = bytes([value]) * len(row[x : x + w])
    return rows


# The scene is a sideways flight past five walls, which stand one above the other in the image. A
# pixel at distance Z (in baselines) moves left by FOCAL / Z.
WIDTH, HEIGHT, FOCAL = 320, 240, 300.0
SHIFTS = (24, 6, 15, 10, 20)


@functools.lru_cache
def stereo_pair(seed=7):
    """A pair of textured images, left and right, each as bytes row by row."""
    wide = texture(WIDTH + max(SHIFTS), HEIGHT, seed)
    left, right = bytearray(), bytearray()
    for y, row in enumerate(wide):
        shift = SHIFTS[y * len(SHIFTS) // HEIGHT]
        left += row[:WIDTH]
        right += row[shift : shift + WIDTH]
    return bytes(left), bytes(right)


def true_depth(x, y):
    return FOCAL / SHIFTS[int(y) * len(SHIFTS) // HEIGHT]


def pfm(width, height, value_at):
    rows = []
    for y in reversed(range(height)):
        rows.append(struct.pack(f"<{width}f", *(value_at(x, y) for x in range(width))))
    return f"Pf\n{width} {height}\n-1.0\n".encode() + b"".join(rows)


def camera_yaml(
    width=WIDTH, height=HEIGHT, fx=FOCAL, fy=FOCAL, cx=None, cy=None, k=(0, 0, 0, 0, 0)
):
    """A camera file in OpenCV's YAML format."""
    cx = (WIDTH - 1) / 2 if cx is None else cx
    cy = (HEIGHT - 1) / 2 if cy is None else cy
    return f"""%YAML:1.0
---
image_width: {width}
image_height: {height}
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ {fx}, 0., {cx}, 0., {fy}, {cy}, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: {len(k)}
   dt: d
   data: [ {", ".join(str(v) for v in k)} ]
"""


class CliTest(unittest.TestCase):
    """Each test has a folder of its own with a.png, b.png and cam.yaml in it."""

    def setUp(self):
        self.folder = Path(tempfile.mkdtemp(prefix="twoview_cli_"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        left, right = stereo_pair()
        self.a = self.write("a.png", png(WIDTH, HEIGHT, left))
        self.b = self.write("b.png", png(WIDTH, HEIGHT, right))
        self.camera = self.write("cam.yaml", camera_yaml())
        self.out = self.folder / "out"

    def write(self, name, data):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data.encode() if isinstance(data, str) else data)
        return path

    def run_program(self, *arguments, before=(), **options):
        """Runs twoview. before: the words of a command, such as setpriv, that starts twoview."""
        options.setdefault("timeout", 300)
        return subprocess.run(
            [*before, program(), *map(str, arguments)],
            capture_output=True,
            cwd=self.folder,
            **options,
        )

    def reconstruct(self, *more, a=None, b=None, camera=True, out=None, **options):
        arguments = ["reconstruct", a or self.a, b or self.b, "-o", out or self.out]
        if camera:
            arguments += ["--camera", self.camera]
        return self.run_program(*arguments, *more, **options)

    def succeed(self, done, status=0):
        self.assertEqual(done.returncode, status, done.stderr.decode())
        return done

    def on_terminal(self, *arguments, columns=0, **environment):
        """(exit status, what stdout and stderr showed) of the program on a terminal, which has no
        known width unless `columns` is given."""
        master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("4H", 24, columns, 0, 0))
        kept = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "TERM")}
        process = subprocess.Popen([program(), *map(str, arguments)], stdin=subprocess.DEVNULL,
                                   stdout=slave, stderr=slave, cwd=self.folder,
                                   env={**kept, "TERM": "xterm", **environment})
        os.close(slave)
        shown, deadline = b"", time.monotonic() + 120
        while time.monotonic() < deadline:
            if not select.select([master], [], [], 1)[0]:
                continue
            try:
                block = os.read(master, 1 << 16)
            except OSError:  # the program has ended
                break
            if not block:
                break
            shown += block
        os.close(master)
        return process.wait(60), shown

    def one_line(self, done, *words):
        """Requires exactly one line on stderr, and that it contains the words."""
        text = done.stderr.decode()
        self.assertEqual(text.count("\n"), 1, text)
        self.assertTrue(text.startswith("twoview: ") and text.endswith("\n"), text)
        for word in words:
            self.assertIn(word, text)

    def assert_refused(self, done, *words, out=None):
        """Requires exit status 2, one line on stderr with the words, and no output file."""
        self.assertEqual(done.returncode, 2, done.stdout.decode() + done.stderr.decode())
        self.one_line(done, *words)
        self.assertEqual(done.stdout, b"")
        self.assertFalse((out or self.out).exists(), "something was written")

    def assert_no_pose(self, done, *words):
        """Requires exit status 3, one line on stderr, and a result.json with the reason."""
        self.assertEqual(done.returncode, 3, done.stderr.decode())
        self.one_line(done, "no full pose", *words)
        result = self.result()
        self.assertIsNone(result["t"])
        self.assertNotIn("cloud.ply", self.listing())
        return result

    def result(self, out=None):
        return json.loads(((out or self.out) / "result.json").read_text())

    def listing(self, folder=None):
        """The names of all entries of the folder, hidden files included."""
        return sorted(os.listdir(folder or self.out))
