"""Tests of twoview_tools.accuracy.verdicts: the choice of unrelated pairs, and what is counted."""

import os
import tempfile
import unittest

try:
    import numpy as np
except ImportError:
    np = None

if np is not None:
    from twoview_tools.accuracy import verdicts


def setUpModule():
    if np is None:
        raise unittest.SkipTest("no numpy: run scripts/bootstrap test")


class TestChoice(unittest.TestCase):
    images = {"a": [f"a{i}" for i in range(30)], "b": ["b0", "b1"],
              "c": [f"c{i}" for i in range(40)]}

    def test_never_pairs_a_set_with_itself_and_never_repeats(self):
        pairs = verdicts.choose_unrelated(self.images, 1000)
        self.assertEqual(len(pairs), 1000)
        self.assertTrue(all(a[0] != b[0] for a, b in pairs))
        self.assertEqual(len({frozenset(pair) for pair in pairs}), 1000)

    def test_takes_from_every_pair_of_sets_in_turn(self):
        counts = {}
        for a, b in verdicts.choose_unrelated(self.images, 300):
            key = tuple(sorted((a[0], b[0])))
            counts[key] = counts.get(key, 0) + 1
        # Of a and b there are only 60 pairs; the other two share the rest.
        self.assertEqual(counts, {("a", "b"): 60, ("b", "c"): 80, ("a", "c"): 160})

    def test_is_the_same_each_time_and_has_both_orders(self):
        pairs = verdicts.choose_unrelated(self.images, 200)
        self.assertEqual(pairs, verdicts.choose_unrelated(self.images, 200))
        firsts = [a[0] < b[0] for a, b in pairs]
        self.assertTrue(60 < sum(firsts) < 140)

    def test_sets_of_the_same_place_are_not_combined(self):
        pairs = verdicts.choose_unrelated(self.images, 1000, same_place=(frozenset("ca"),))
        self.assertEqual({frozenset((a[0], b[0])) for a, b in pairs},
                         {frozenset("ab"), frozenset("bc")})
        self.assertEqual(len(pairs), 60 + 80)

    def test_all_there_are_is_the_most(self):
        self.assertEqual(len(verdicts.choose_unrelated({"a": ["x"], "b": ["y", "z"]}, 10)), 2)


class TestRows(unittest.TestCase):
    def test_an_interrupted_run_goes_on_with_the_pairs_that_its_file_lacks(self):
        pairs = [(("a", f"{i}.png"), ("b", "x.png")) for i in range(5)]
        seen = []

        def run(work):
            seen.extend(work)
            return [{"image0": "/".join(a), "image1": "/".join(b), "verdict": "refused"}
                    for a, b in work]

        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "rows.jsonl")
            self.assertEqual(verdicts.kept_rows(path, pairs), ([], pairs))
            verdicts.gather(run, [[pairs[2]], [pairs[0]]], 1, "a test", path)
            kept, missing = verdicts.kept_rows(path, pairs)
            self.assertEqual([row["image0"] for row in kept], ["a/0.png", "a/2.png"])
            self.assertEqual(missing, [pairs[1], pairs[3], pairs[4]])
            verdicts.gather(run, [missing], 1, "a test", path)
            kept, missing = verdicts.kept_rows(path, pairs)
            self.assertEqual(([row["image0"] for row in kept], missing),
                             ([f"a/{i}.png" for i in range(5)], []))
        self.assertEqual(sorted(seen), pairs)


def rows(verdict, errors):
    return [{"verdict": verdict, "error_deg": e} for e in errors]


class TestCounts(unittest.TestCase):
    def test_three_ok_in_ten_thousand_is_the_limit(self):
        bad = [{"verdict": "refused"}] * 9997
        for extra, reached in ((3, True), (4, False)):
            found = verdicts.summarise_unrelated(bad + [{"verdict": "ok"}] * extra)
            self.assertEqual((found[0], found[1]["ok"]), (reached, extra))

    def test_the_table_counts_each_error_once(self):
        _, table, _, _ = verdicts.summarise_related(
            rows("ok", [0.5, 1.0, 1.9, 9.99, 10.0]) + rows("refused", [np.inf])
            + rows("doubtful", [170.0]))
        self.assertEqual(list(table["ok"].values()), [1, 2, 0, 1, 1, 0])
        self.assertEqual(table["refused"]["no pose"], 1)
        self.assertEqual(table["doubtful"][">= 10"], 1)

    def test_one_wrong_ok_in_a_hundred_is_the_limit(self):
        for wrong, reached in ((1, True), (2, False)):
            found = verdicts.summarise_related(
                rows("ok", [1.0] * (100 - wrong) + [11.0] * wrong) + rows("doubtful", [90.0] * 50))
            self.assertEqual((found[0], len(found[2])), (reached, wrong))

    def test_an_ok_without_a_pose_is_wrong(self):
        self.assertEqual(len(verdicts.summarise_related(rows("ok", [np.inf]))[2]), 1)


if __name__ == "__main__":
    unittest.main()
