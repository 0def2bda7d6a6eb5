"""Tests of twoview_tools.accuracy.effort: the counts, and the threshold that is chosen on the other
sets."""

import unittest

try:
    import numpy as np
except ImportError:
    np = None

if np is not None:
    from twoview_tools.accuracy import effort


def setUpModule():
    if np is None:
        raise unittest.SkipTest("no numpy: run scripts/bootstrap test")


def row(name, way, error, verdict="ok", probability=0.01, number=0, **more):
    return {"set": name, "name0": f"{number}", "name1": "x", "way": way, "error_deg": error,
            "pose_error_deg": error, "verdict": verdict, "probability_wrong": probability,
            "effort": 0, "num_rungs": 1, "inside": error < 1, "cpu_ms": 2.0, **more}


def pair(name, number, first, again):
    """The rows of a pair: (error, probability_wrong) of rung 0, which is "ok", and of the climb."""
    return [row(name, "auto", first[0], probability=first[1], number=number),
            row(name, effort.AGAIN, again[0], probability=again[1], number=number, effort=2)]


class TestSummary(unittest.TestCase):
    def test_right_and_wrong_poses_are_counted_by_their_verdict(self):
        rows = [row("a", "auto", 0.5), row("a", "auto", 7.0, effort=2),
                row("a", "auto", 1.0, "doubtful"), row("a", "auto", np.inf, "refused", 1.0)]
        found = effort.summarise(rows)
        self.assertEqual([found[k] for k in ("pairs", "ok", "wrong_ok", "right", "right_ok",
                                             "above")], [4, 2, 1, 2, 1, 1])
        self.assertAlmostEqual(found["stated"], 0.02)
        self.assertAlmostEqual(found["inside"], 0.5)
        self.assertLess(found["auc"][0], found["auc"][2])

    def test_the_mean_of_sets_weighs_each_set_alike(self):
        one, two = ([row(name, "auto", error)] for name, error in (("a", 0.0), ("b", np.inf)))
        mean = effort.mean_of([effort.summarise(one), effort.summarise(two * 9)])
        self.assertEqual(mean["pairs"], 10)
        np.testing.assert_allclose(mean["auc"], 50)


class TestThreshold(unittest.TestCase):
    def test_a_pair_climbs_where_its_ok_is_weak_and_an_ok_above_is_taken(self):
        [weak] = effort.by_pair(pair("a", 0, (3.0, 0.1), (1.0, 0.02)))
        self.assertEqual(effort.with_threshold(weak, 0.05)["error_deg"], 1.0)
        self.assertEqual(effort.with_threshold(weak, 0.15)["error_deg"], 3.0)
        weak[effort.AGAIN]["verdict"] = "doubtful"
        self.assertEqual(effort.with_threshold(weak, 0.05)["error_deg"], 3.0)

    def test_a_pair_that_climbed_anyway_stays(self):
        [climbed] = effort.by_pair(pair("a", 0, (3.0, 0.1), (1.0, 0.02)))
        climbed["auto"].update(num_rungs=2)
        self.assertEqual(effort.with_threshold(climbed, 0.0)["error_deg"], 3.0)

    def test_a_set_has_no_part_in_its_own_threshold(self):
        helped = pair("a", 0, (4.0, 0.1), (0.5, 0.02)) + pair("b", 0, (4.0, 0.1), (0.5, 0.02))
        harmed = pair("c", 0, (0.5, 0.1), (40.0, 0.02))
        chosen = {name: threshold for name, threshold, *_ in
                  effort.left_out(effort.by_pair(helped + harmed))}
        self.assertEqual(chosen["a"], effort.NEVER)  # c loses more than b gains
        self.assertLess(chosen["c"], 0.1)
        [only] = effort.left_out(effort.by_pair(helped[:2]))
        self.assertEqual(only[1], effort.NEVER)


if __name__ == "__main__":
    unittest.main()
