#!/usr/bin/env python3
"""Tests of twoview undistort: images without the lens's distortion, and their camera."""
import json
import math
import os
import unittest

import cli_support as cli
from cli_support import camera_yaml, png

W, H, F = 96, 72, 70.0
CX, CY = 46.0, 37.0


def scene(x, y):
    """The grey level that a pinhole sees at a pixel: smooth, so that interpolation errors are
    small."""
    return 128 + 70 * math.sin(x / 9) * math.cos(y / 7)


def brown_conrady(k):
    """Distorted coordinates from straight ones, on the plane z = 1."""

    def distort(x, y):
        r2 = x * x + y * y
        radial = 1 + k[0] * r2 + k[1] * r2 * r2
        return (x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x),
                y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y)

    return distort


def kannala_brandt(k):
    def distort(x, y):
        r = math.hypot(x, y)
        if r == 0:
            return x, y
        t = math.atan(r)
        d = t * (1 + k[0] * t**2 + k[1] * t**4 + k[2] * t**6 + k[3] * t**8)
        return x * d / r, y * d / r

    return distort


def straightened(distort, x, y):
    """The inverse of the distortion, by Newton's method with finite differences; None where it does
    not converge."""
    sx, sy = x, y
    for _ in range(50):
        dx, dy = distort(sx, sy)
        h = 1e-6
        ax, ay = distort(sx + h, sy)
        bx, by = distort(sx, sy + h)
        a, b, c, d = (ax - dx) / h, (bx - dx) / h, (ay - dy) / h, (by - dy) / h
        det = a * d - b * c
        if abs(det) < 1e-9:
            return None
        ex, ey = x - dx, y - dy
        sx, sy = sx + (d * ex - b * ey) / det, sy + (a * ey - c * ex) / det
    return (sx, sy) if math.hypot(ex, ey) < 1e-9 else None


def distorted_image(distort):
    samples = []
    for v in range(H):
        for u in range(W):
            place = straightened(distort, (u - CX) / F, (v - CY) / F)
            samples.append(round(scene(F * place[0] + CX, F * place[1] + CY)) if place else 0)
    return samples


LENSES = {
    "brown_conrady": (
        brown_conrady((-0.25, 0.06, 0.002, -0.003)),
        (-0.25, 0.06, 0.002, -0.003, 0),
        "",
    ),
    "kannala_brandt": (
        kannala_brandt((0.02, -0.01, 0.003, 0)),
        (0.02, -0.01, 0.003, 0),
        "distortion_model: equidistant\n",
    ),
}


class Undistort(cli.CliTest):
    def lens_file(self, name):
        _, k, more = LENSES[name]
        return self.write("lens.yaml", camera_yaml(W, H, F, F, CX, CY, k) + more)

    def undistort(self, *more, images=("d.png",), camera="lens.yaml"):
        return self.run_program("undistort", *images, "--camera", camera, "-o", self.out, *more)

    def test_a_pinhole_would_have_seen_the_result(self):
        for name, (distort, _, _) in LENSES.items():
            with self.subTest(lens=name):
                self.lens_file(name)
                self.write("d.png", png(W, H, distorted_image(distort)))
                result = json.loads(self.succeed(self.undistort("--mask", "--json")).stdout)
                self.assertEqual(self.listing(), ["camera.yaml", "d.png", "mask.png"])
                mask = cli.png_samples((self.out / "mask.png").read_bytes())
                image = cli.png_samples((self.out / "d.png").read_bytes())
                worst, seen = 0, 0
                for v in range(H):
                    for u in range(W):
                        x, y = distort((u - CX) / F, (v - CY) / F)
                        x, y = F * x + CX, F * y + CY
                        inside = -0.5 < x < W - 0.5 and -0.5 < y < H - 0.5
                        self.assertEqual(mask[v * W + u], 255 if inside else 0)
                        seen += inside
                        if not inside:
                            self.assertEqual(image[v * W + u], 0)
                        elif 2 < x < W - 3 and 2 < y < H - 3:
                            worst = max(worst, abs(image[v * W + u] - scene(u, v)))
                self.assertLess(worst, 2.5)
                self.assertAlmostEqual(result["seen_share"], seen / (W * H))

    def test_the_camera_file_is_a_pinhole_that_can_be_read_back(self):
        self.lens_file("brown_conrady")
        self.write("d.png", png(W, H, bytes(range(W)) * H))
        self.succeed(self.undistort("--focal-scale", "0.5"))
        camera = (self.out / "camera.yaml").read_text()
        self.assertIn(f"[ {F / 2:g}, 0, {CX:g}, 0, {F / 2:g}, {CY:g}, 0, 0, 1 ]", camera)
        self.assertIn("data: [ 0, 0, 0, 0, 0 ]", camera)
        again = self.folder / "again"
        self.succeed(self.run_program("undistort", self.out / "d.png", "--camera",
                                      self.out / "camera.yaml", "-o", again))
        self.assertEqual(cli.png_samples((again / "d.png").read_bytes()),
                         cli.png_samples((self.out / "d.png").read_bytes()))
        self.assertEqual((again / "camera.yaml").read_text(), camera)

    def test_depth_and_channels_of_the_image_stay(self):
        self.write("lens.yaml", camera_yaml(W, H, F, F, CX, CY))
        rgba = [(7 * i + c) % 256 for i in range(W * H) for c in range(4)]
        grey16 = [(997 * i) % 65536 for i in range(W * H)]
        self.write("rgba.png", png(W, H, rgba, 4))
        self.write("grey16.png", png(W, H, grey16, 1, 16))
        self.succeed(self.undistort(images=("rgba.png", "grey16.png")))
        self.assertEqual(list(cli.png_samples((self.out / "rgba.png").read_bytes())), rgba)
        self.assertEqual(list(cli.png_samples((self.out / "grey16.png").read_bytes())), grey16)

    def test_what_the_lens_model_cannot_reach_is_black(self):
        # A lens like the AR.Drone's: its polynomial turns back at radius 0.8 on the plane z = 1,
        # which a wide pinhole's image exceeds.
        self.write("lens.yaml", camera_yaml(W, H, F, F, CX, CY, (-0.5, 0, 0, 0, 0)))
        self.write("d.png", png(W, H, [200] * (W * H)))
        self.succeed(self.undistort("--focal-scale", "0.2", "--mask"))
        image = cli.png_samples((self.out / "d.png").read_bytes())
        self.assertEqual(set(image), {0, 200})
        for v in range(H):
            for u in range(W):
                r = math.hypot(u - CX, v - CY) / (0.2 * F)
                self.assertTrue(r < 0.83 or image[v * W + u] == 0)

    def test_images_that_cannot_be_used_are_left_out_and_named(self):
        self.lens_file("brown_conrady")
        whole = png(W, H, [128] * (W * H))
        self.write("small.png", png(8, 8, [128] * 64))
        self.write("cut.png", whole[:len(whole) // 2])
        self.write("empty.png", b"")
        self.write("text.png", b"not a picture at all")
        for name in "a.png", "b.png":
            self.write(name, whole)
        images = ("small.png", "a.png", "cut.png", "empty.png", "b.png", "text.png")
        self.assert_refused(self.undistort(images=("cut.png", "text.png")), "cut.png")
        options = (("--camera", "lens.yaml"), ("--camera", "lens.yaml", "--scale-camera"),
                   ("--focal-35mm", "30"))
        for given in options:
            with self.subTest(options=given):
                done = self.run_program("undistort", *images, *given, "-o", self.out, "--json")
                result = json.loads(self.succeed(done).stdout)
                self.assertEqual(result["images"], ["a.png", "b.png"])
                self.assertEqual([row["image"] for row in result["left_out"]],
                                 ["small.png", "cut.png", "empty.png", "text.png"])
                self.assertIn("8x8", result["left_out"][0]["reason"])
                self.assertEqual(self.listing(), ["a.png", "b.png", "camera.yaml"])
        done = self.succeed(self.undistort(images=images))
        self.assertIn("4 images are left out: ", done.stdout.decode())
        self.assertIn("cut.png", done.stdout.decode())

    def test_bad_input_is_refused_and_nothing_written(self):
        self.lens_file("brown_conrady")
        self.write("d.png", png(W, H, [128] * (W * H)))
        self.write("small.png", png(8, 8, [128] * 64))
        (self.folder / "x").mkdir()
        self.write("x/d.png", png(W, H, [1] * (W * H)))
        self.assert_refused(self.undistort(images=("d.png", "none.png")), "none.png")
        self.assert_refused(self.undistort(images=("small.png",)), "small.png", "8x8", f"{W}x{H}")
        self.assert_refused(self.undistort(images=("d.png", "x/d.png")), "two results", "d.png")
        self.assert_refused(self.undistort("--mask", images=("mask.jpg",)), "mask.png")
        self.assert_refused(self.undistort(camera="none.yaml"), "none.yaml")
        for scale in ("0", "-1", "nan", "21", "x"):
            self.assert_refused(self.undistort("--focal-scale", scale), "--focal-scale")
        self.assert_refused(self.run_program("undistort", "d.png", "-o", self.out), "--camera")
        self.assert_refused(
            self.run_program("undistort", "--camera", "lens.yaml", "-o", self.out), "IMAGE"
        )

    def test_a_lens_that_sees_nothing_of_the_result_is_refused(self):
        self.write("lens.yaml", camera_yaml(W, H, F, F, 100 * W, CY, (-0.5, 0, 0, 0, 0)))
        self.write("d.png", png(W, H, [128] * (W * H)))
        self.assert_refused(self.undistort(), "lens.yaml", "principal point")

    def test_what_is_read_is_not_written_over(self):
        self.lens_file("brown_conrady")
        (self.folder / "lens.yaml").rename(self.folder / "camera.yaml")
        image = self.write("d.png", png(W, H, [128] * (W * H)))
        before = {name: (self.folder / name).read_bytes() for name in os.listdir(self.folder)}
        done = self.run_program("undistort", "d.png", "--camera", "camera.yaml", "-o", self.folder)
        self.assertEqual(done.returncode, 2)
        self.one_line(done, "d.png", "read by this run")
        # The image written would be e.png, but the camera file written would replace the one read.
        image.rename(self.folder / "e.jpg")
        done = self.run_program("undistort", "e.jpg", "--camera", "camera.yaml", "-o", ".")
        self.assertEqual(done.returncode, 2)
        self.one_line(done, "camera.yaml", "read by this run")
        (self.folder / "e.jpg").rename(image)
        after = {name: (self.folder / name).read_bytes() for name in os.listdir(self.folder)}
        self.assertEqual(before, after)


if __name__ == "__main__":
    cli.main()
