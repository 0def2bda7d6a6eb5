#!/usr/bin/env python3
"""Tests of twoview reconstruct with a direction of gravity in both views."""
import math

import cli_support as cli

GRAVITY = ("--gravity0", "0.1,9.8,-0.3", "--gravity1", "0.1,9.8,-0.3", "--gravity-sigma-deg", "0.5")


class Gravity(cli.CliTest):
    def test_without_gravity_the_options_say_so(self):
        self.succeed(self.reconstruct())
        options = self.result()["options"]
        self.assertIsNone(options["gravity0"])
        self.assertIsNone(options["gravity1"])
        self.assertEqual(options["gravity_sigma_deg"], 0)

    def test_gravity_is_a_prior_of_the_default_method(self):
        self.succeed(self.reconstruct())
        without = self.result()["R"]
        self.succeed(self.reconstruct(*GRAVITY))
        result = self.result()
        self.assertEqual(result["options"]["gravity0"], [0.1, 9.8, -0.3])
        self.assertEqual(result["options"]["gravity_sigma_deg"], 0.5)
        self.assertNotEqual(result["R"], without)
        for a, b in zip(result["R"], without):
            self.assertAlmostEqual(a, b, delta=1e-3)

    def test_the_upright_method_finds_the_flight(self):
        self.succeed(self.reconstruct("--method", "upright", *GRAVITY))
        result = self.result()
        self.assertEqual(result["options"]["method"], "upright")
        self.assertEqual(result["config"], "calibrated")
        self.assertAlmostEqual(result["t"][0], -1, delta=1e-3)
        self.assertAlmostEqual(math.hypot(*result["t"]), 1, delta=1e-12)

    def test_a_direction_that_begins_with_a_minus_sign_is_read(self):
        self.succeed(self.reconstruct("--gravity0", "-0.1,-9.8,0.3", "--gravity1", "-0.1,-9.8,0.3",
                                      "--gravity-sigma-deg", "0.5"))
        self.assertEqual(self.result()["options"]["gravity1"], [-0.1, -9.8, 0.3])

    def test_what_is_no_direction_is_refused(self):
        for text in ("0,0,0", "1,2", "1,2,3,4", "nan,0,1", "1,inf,0", "1,,2", "down", "1 2 3"):
            with self.subTest(text=text):
                self.assert_refused(
                    self.reconstruct(*GRAVITY[2:], "--gravity0", text), "--gravity0"
                )

    def test_a_deviation_out_of_range_is_refused(self):
        for text in ("-1", "181", "nan", "wide"):
            with self.subTest(text=text):
                self.assert_refused(self.reconstruct(*GRAVITY[:4], "--gravity-sigma-deg", text),
                                    "--gravity-sigma-deg")

    def test_half_of_what_gravity_needs_is_refused(self):
        for start, end in ((0, 2), (0, 4), (2, 6), (4, 6)):
            with self.subTest(flags=GRAVITY[start:end]):
                self.assert_refused(self.reconstruct(*GRAVITY[start:end]), "go together")

    def test_the_upright_method_without_gravity_is_refused(self):
        self.assert_refused(self.reconstruct("--method", "upright"), "--gravity0")


if __name__ == "__main__":
    cli.main()
