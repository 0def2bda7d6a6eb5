#!/usr/bin/env python3
"""Bad and changed pictures through the program, under the sanitizers, too: `twoview evaluate` on
rendered pairs gives each a kind and a verdict, and "ok" only where the pose is right.
test/python/test_bad_input.py has the reasons, real pictures and the bounds of the work."""
import json
import sys
import unittest
from pathlib import Path

import cli_support as cli

try:
    import cv2
    import numpy as np
except ImportError:
    cv2 = None

if cv2 is not None:
    root = Path(__file__).resolve().parents[2]
    sys.path[:0] = [str(root / "tools" / "python"), str(root / "python")]
    from twoview_tools.accuracy import pictures

RIGHT_DEG = 5.0


def setUpModule():
    if cv2 is None:
        raise unittest.SkipTest("no numpy and OpenCV: run scripts/bootstrap test")


def pairs_without_pose():
    """{name: Pair}, of which none may be "ok"."""
    room = pictures.room()
    same = pictures.with_itself(room.views[0])
    pairs = {"blank": pictures.blank(128, 128), "black_and_white": pictures.blank(0, 255),
             "saturated": pictures.changed(room, pictures.exposed, 300.0),
             "noise": pictures.without_truth(*pictures.noise(40, 1)),
             "corner": pictures.corner_in_noise(2, 1)}
    for name, pair in (("same", same), ("pair", room)):
        for axis in (0, 1):
            pairs[f"{name}_mirrored_{axis}"] = pictures.changed(pair, pictures.mirrored, axis)
    for name, change in (("as_it_is", (pictures.turned, 0)), ("turned", (pictures.turned, 1)),
                         ("smaller", (pictures.resized, 0.5)), ("inverted", (pictures.inverted,)),
                         ("blurred", (pictures.blurred, 9)), ("dark", (pictures.exposed, 0.5))):
        pairs[f"same_{name}"] = pictures.changed(same, *change)
    return pairs


def pairs_with_pose():
    """{name: Pair} of a scene; most must be "ok"."""
    changes = {"as_it_is": (pictures.turned, 0), "turned_90": (pictures.turned, 1),
               "turned_180": (pictures.turned, 2), "smaller_71": (pictures.resized, 0.71),
               "smaller_50": (pictures.resized, 0.5), "smaller_35": (pictures.resized, 0.35),
               "blurred": (pictures.blurred, 5), "dark": (pictures.exposed, 0.5),
               "bright": (pictures.exposed, 1.5)}
    return {name: pictures.changed(pictures.room(), *change) for name, change in changes.items()}


class BadPictures(cli.CliTest):
    def evaluate(self, pairs):
        """{name: row of report.json} of {name: Pair}."""
        lines = []
        for name, pair in pairs.items():
            files = [f"{name}_{v}.png" for v in (0, 1)]
            for file, view in zip(files, pair.views):
                self.assertTrue(cv2.imwrite(str(self.folder / file), view.luma))
            T = np.eye(4)
            T[:3, :3], T[:3, 3] = pair.R, (1, 0, 0) if pair.t is None else pair.t
            numbers = np.concatenate([pair.views[0].K, pair.views[1].K, T], axis=None)
            lines.append(" ".join([*files, "0 0", *(f"{n:.17g}" for n in numbers)]))
        list_of_pairs = self.write("pairs.txt", "\n".join(lines) + "\n")
        report = self.folder / "report.json"
        done = self.run_program("evaluate", list_of_pairs, "--images", self.folder, "-o", report,
                                "--quiet")
        self.succeed(done)
        self.assertEqual(done.stderr, b"")
        rows = json.loads(report.read_text())["pairs"]
        self.assertEqual(len(rows), len(pairs))
        for row in rows:
            self.assertNotIn("error", row)
            self.assertIn(row["verdict"], ("ok", "doubtful", "refused"))
            self.assertLessEqual(row["num_matches"], 2048)
        return dict(zip(pairs, rows))

    def assert_right(self, name, row):
        if row["verdict"] == "ok":
            with self.subTest(pair=name):
                self.assertLess(row["rotation_error_deg"], RIGHT_DEG)
                self.assertLess(row["translation_error_signed_deg"], RIGHT_DEG)

    def test_pictures_without_a_pose_are_never_ok(self):
        rows = self.evaluate(pairs_without_pose())
        verdicts = {name: row["verdict"] for name, row in rows.items()}
        self.assertNotIn("ok", verdicts.values(), verdicts)
        for name in ("blank", "black_and_white", "saturated", "noise", "corner"):
            self.assertEqual((name, rows[name]["config"]), (name, "degenerate"))
        self.assertEqual(rows["same_as_it_is"]["config"], "no_motion")

    def test_a_changed_picture_of_a_pair_keeps_the_pose(self):
        rows = self.evaluate(pairs_with_pose())
        for name, row in rows.items():
            self.assert_right(name, row)
        good = sum(row["verdict"] == "ok" for row in rows.values())
        self.assertGreaterEqual(good, len(rows) - 2)

    def test_patterns_get_a_verdict(self):
        pairs = {f"{name}_{period}": pictures.patterned(name, period, 1)
                 for name in pictures.PATTERNS for period in (16, 64)}
        verdicts = [row["verdict"] for row in self.evaluate(pairs).values()]
        self.assertEqual(verdicts.count("ok"), 0)


if __name__ == "__main__":
    cli.main()
