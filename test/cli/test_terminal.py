#!/usr/bin/env python3
"""Tests of what the program shows on a terminal: colours, NO_COLOR, TERM=dumb and progress."""
import unittest

import cli_support as cli
from cli_support import HEIGHT, WIDTH, png
from test_evaluate import pair_line

ESCAPE = b"\033["


class Terminal(cli.CliTest):
    def evaluate(self, **environment):
        pairs = self.write("pairs.txt", pair_line())
        status, shown = self.on_terminal("evaluate", pairs, "--images", self.folder, "-o", self.out,
                                         **environment)
        self.assertEqual(status, 0, shown)
        return shown

    def test_a_terminal_gets_colours_and_progress_that_is_erased(self):
        shown = self.evaluate()
        self.assertIn(b"\033[1m", shown)
        self.assertIn(b"\r\033[K1 of 1: a.png b.png\r\033[K", shown)

    def test_progress_is_cut_to_the_width_of_the_terminal(self):
        pairs = self.write("pairs.txt", pair_line())
        for columns, shown in ((80, b"1 of 1: a.png b.png"), (19, b"1 of 1: a.png b.pn"),
                               (12, b"1 of 1: a.p")):
            _, text = self.on_terminal("evaluate", pairs, "--images", self.folder, "-o", self.out,
                                       columns=columns)
            self.assertIn(b"\r\033[K" + shown + b"\r\033[K", text)

    def test_no_color_is_obeyed_where_it_is_not_empty(self):
        self.assertNotIn(b"\033[1m", self.evaluate(NO_COLOR="1"))
        self.assertNotIn(b"\033[2m", self.evaluate(NO_COLOR="1"))
        self.assertIn(b"\033[1m", self.evaluate(NO_COLOR=""))

    def test_a_dumb_terminal_gets_no_escape_at_all(self):
        self.assertNotIn(ESCAPE, self.evaluate(TERM="dumb"))
        status, shown = self.on_terminal("reconstruct", self.a, self.b, "--camera", self.camera,
                                         "-o", self.out, TERM="dumb")
        self.assertEqual(status, 0)
        self.assertNotIn(ESCAPE, shown)

    def test_calibrate_says_which_picture_it_looks_at(self):
        images = [self.write(f"v{i}.png", png(WIDTH, HEIGHT, bytes([128]) * (WIDTH * HEIGHT)))
                  for i in range(3)]
        _, shown = self.on_terminal("calibrate", *images, "--board", "9x6", "-o", self.out)
        for i in range(3):
            self.assertIn(f"looking for the board: {i + 1} of 3, ".encode(), shown)
        _, shown = self.on_terminal("calibrate", *images, "--board", "9x6", "-o", self.out,
                                    "--quiet")
        self.assertNotIn(b"looking for the board", shown)

    def test_long_work_shows_its_seconds(self):
        rows = cli.texture(1200, 900)
        image = self.write("big.png", png(1200, 900, b"".join(rows)))
        _, shown = self.on_terminal("match", image, image, "--max-keypoints", "7000",
                                    "--threshold", "1", "--resize", "0", "--kernels", "c", "-o",
                                    self.out)
        self.assertIn(b"at most 7000 keypoints a view: ", shown)


if __name__ == "__main__":
    cli.main()
