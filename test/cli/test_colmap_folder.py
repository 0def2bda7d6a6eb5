#!/usr/bin/env python3
"""Tests of colmap/ of `twoview odometry`: the keyframes' pictures with the models of these, for
OpenMVS, Gaussian splatting and nerfstudio. test/colmap reads them with pycolmap."""
import json
import shutil
import struct

import test_odometry
from cli_support import CliTest, camera_yaml, main, png
from films import mov
from test_odometry import COUNT, FOCAL, FPS, HEIGHT, PICTURES, TIMES, WIDTH

MODEL = ["cameras.txt", "images.txt", "points3D.txt"]


def rows(path):
    """The lines of a model's file as words, without comments; those of pixels may be empty."""
    text = path.read_text().split("\n")
    return [line.split() for line in text if not line.startswith("#")][:-1]


class ColmapFolder(CliTest):
    set_folder = test_odometry.OdometryTest.set_folder
    odometry = test_odometry.OdometryTest.odometry
    trajectory = test_odometry.OdometryTest.trajectory

    def setUp(self):
        super().setUp()
        self.colmap = self.out / "colmap"

    def model(self, folder="sparse"):
        """The camera, {name: (id, points)} and {id of a point: row}."""
        camera, = rows(self.colmap / folder / "cameras.txt")
        images = rows(self.colmap / folder / "images.txt")
        return (camera, {head[9]: (head[0], pixels[2::3])
                         for head, pixels in zip(images[::2], images[1::2])},
                {row[0]: row for row in rows(self.colmap / folder / "points3D.txt")})

    def pictures(self):
        return self.listing(self.colmap / "images")

    def test_pictures_of_a_centred_pinhole_are_those_of_the_source(self):
        done = self.succeed(self.odometry(self.set_folder()))
        self.assertEqual(self.listing(self.colmap), [*MODEL[:1], "images", "images.txt",
                                                     "points3D.txt", "sparse", "transforms.json"])
        self.assertEqual(self.listing(self.colmap / "sparse"), ["0", *MODEL])
        self.assertEqual(self.listing(self.colmap / "sparse/0"),
                         ["cameras.txt", "images.txt", "points3D.ply", "points3D.txt"])
        for name in MODEL:
            self.assertEqual((self.colmap / "sparse" / name).read_bytes(),
                             (self.colmap / "sparse/0" / name).read_bytes())
        camera, images, points = self.model()
        self.assertEqual(camera[1:4], ["PINHOLE", str(WIDTH), str(HEIGHT)])
        self.assertEqual(sorted(images), self.pictures())
        for name in images:
            self.assertEqual((self.colmap / "images" / name).read_bytes(), PICTURES[int(name[:-4])])
        # The text model of the source's own frames has the same poses, under the source's names,
        # which lead to these pictures, too.
        frames = rows(self.colmap / "images.txt")
        self.assertEqual([head[:9] for head in rows(self.colmap / "sparse/images.txt")[::2]],
                         [head[:9] for head in frames[::2]])
        for head in frames[::2]:
            self.assertTrue((self.colmap / head[9]).is_file())
        for row in points.values():  # each end of a track is there
            for k in range(8, len(row), 2):
                name = next(n for n, (number, _) in images.items() if number == row[k])
                self.assertEqual(images[name][1][int(row[k + 1])], row[0])
        pictures = self.result()["colmap_pictures"]
        self.assertEqual((pictures["num"], pictures["size"]), (len(images), [WIDTH, HEIGHT]))
        size = sum((self.colmap / "images" / name).stat().st_size for name in images)
        self.assertEqual(pictures["bytes"], size)
        self.assertIn(f"colmap/ ({len(images)} pictures, {size / 2**20:.1f} MiB)",
                      done.stdout.decode())

    def test_the_cloud_and_the_transforms_say_the_same_as_the_model(self):
        self.succeed(self.odometry(self.set_folder()))
        camera, images, points = self.model("sparse/0")
        data = (self.colmap / "sparse/0/points3D.ply").read_bytes()
        head, body = data.split(b"end_header\n", 1)
        self.assertIn(f"element vertex {len(points)}\n".encode(), head)
        self.assertEqual(len(body), len(points) * 27)
        cloud = sorted(struct.unpack_from("<3f", body, 27 * k) for k in range(len(points)))
        true = sorted(tuple(map(float, row[1:4])) for row in points.values())
        for place, expected in zip(cloud, true):
            for a, b in zip(place, expected):
                self.assertAlmostEqual(a, b, 5)
        transforms = json.loads((self.colmap / "transforms.json").read_text())
        numbers = [transforms[key] for key in ("w", "h", "fl_x", "fl_y", "cx", "cy")]
        self.assertEqual(numbers, list(map(float, camera[2:])))
        self.assertTrue((self.colmap / transforms["ply_file_path"]).is_file())
        self.assertEqual(sorted(f["file_path"] for f in transforms["frames"]),
                         sorted("images/" + name for name in images))
        # Each camera looks at the walls along its -z, with y up: the flight is level.
        for frame in transforms["frames"]:
            matrix = frame["transform_matrix"]
            self.assertAlmostEqual(-matrix[2][2], 1, 3)
            self.assertAlmostEqual(-matrix[1][1], 1, 3)
            self.assertEqual(matrix[3], [0, 0, 0, 1])
        # The program reads its camera.
        again = self.folder / "again"
        self.succeed(self.odometry(self.folder / "set", "--camera", self.colmap / "transforms.json",
                                   out=again))
        self.assertEqual((again / "trajectory.txt").read_bytes(), self.trajectory())

    def test_a_principal_point_that_is_off_the_middle_is_moved_there(self):
        # Splatting programs take it to be in the middle.
        wide = self.write("wide.yaml", camera_yaml(WIDTH, HEIGHT, FOCAL, FOCAL,
                                                   (WIDTH - 1) / 2 - 10, (HEIGHT - 1) / 2))
        self.succeed(self.odometry(self.set_folder(), "--camera", wide, "--keep-camera"))
        camera, images, _ = self.model()
        width, height = WIDTH - 22, HEIGHT - 16  # of about the same shape
        self.assertEqual(camera[1:4], ["PINHOLE", str(width), str(height)])
        self.assertEqual(list(map(float, camera[4:])), [FOCAL, FOCAL, width / 2, height / 2])
        self.assertEqual(sorted(images), self.pictures())
        for name in images:
            self.assertTrue(name.endswith("_undistorted.jpg"), name)

    def test_a_film_is_read_again_and_a_resized_flight_has_whole_pictures(self):
        film = self.write("film.mov", mov(PICTURES, TIMES))
        camera = self.write("film.yaml", camera_yaml(WIDTH, HEIGHT, FOCAL, FOCAL,
                                                     (WIDTH - 1) / 2, (HEIGHT - 1) / 2))
        self.succeed(self.odometry(film, "--camera", camera, "--resize", 240))
        camera, images, points = self.model()
        self.assertEqual(list(map(float, camera[2:])),
                         [WIDTH, HEIGHT, FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2])
        self.assertEqual(sorted(images), self.pictures())
        self.assertRegex(self.pictures()[0], r"^frame_\d{6}\.jpg$")
        # Pixels are those of the whole pictures: some lie beyond the resized ones.
        pixels = rows(self.colmap / "sparse/images.txt")[1::2]
        self.assertGreater(max(float(x) for row in pixels for x in row[::3]), 250)

    def test_names_become_flat_and_without_blanks(self):
        source = self.set_folder()
        for k in range(COUNT):
            name = f"one/a b{k // 2}.png" if k % 2 else f"two/a b{k // 2}.png"
            (source / name).parent.mkdir(exist_ok=True)
            shutil.move(source / f"images/{k:05}.png", source / name)
        names = [f"{'one' if k % 2 else 'two'}/a b{k // 2}.png" for k in range(COUNT)]
        # A list of names has no blanks: a folder of images in the order of their names.
        flat = self.folder / "flat"
        flat.mkdir()
        for k, name in enumerate(names):
            shutil.move(source / name, flat / f"pic {k:02}.png")
        self.succeed(self.odometry(flat, "--fps", FPS, "--camera", self.write(
            "flat.yaml", camera_yaml(WIDTH, HEIGHT, FOCAL, FOCAL, (WIDTH - 1) / 2,
                                     (HEIGHT - 1) / 2))))
        _, images, _ = self.model()
        self.assertEqual(sorted(images), self.pictures())
        self.assertRegex(self.pictures()[0], r"^pic_\d\d\.png$")
        # Two of one name, from two folders.
        source = self.folder / "two"
        for k in range(COUNT):
            self.write(f"two/{k:02}/p.png", PICTURES[k])
        self.write("two/frames.txt", "".join(f"{t:.9f} {k:02}/p.png\n"
                                             for k, t in enumerate(TIMES)))
        shutil.copy(self.folder / "set/cameras.yaml", source)
        self.succeed(self.odometry(source))
        _, images, _ = self.model()
        self.assertGreater(len(images), 1)
        self.assertEqual(sorted(images), self.pictures())

    def test_pictures_can_be_left_out_and_go_with_the_next_run(self):
        self.succeed(self.odometry(self.set_folder()))
        (self.colmap / "images" / "mine.png").write_bytes(b"kept")
        self.succeed(self.odometry(self.folder / "set", "--no-pictures"))
        self.assertEqual(self.listing(self.colmap), [*MODEL[:1], "images", "images.txt",
                                                     "points3D.txt"])
        self.assertEqual(self.pictures(), ["mine.png"])
        self.assertIsNone(self.result()["colmap_pictures"])
        # Another run's pictures replace those of the earlier one.
        self.succeed(self.odometry(self.folder / "set"))
        self.succeed(self.odometry(self.folder / "set", "--every", 2, "--max-frames", 8))
        _, images, _ = self.model()
        self.assertEqual([*sorted(images), "mine.png"], self.pictures())
        self.assert_refused(self.odometry(self.colmap / "images", "--fps", 5, "--camera",
                                          self.colmap / "cameras.txt"),
                            "is read by this run", out=self.folder / "none")

    def test_a_picture_that_has_gone_is_named(self):
        # The second reading of a pipe's end fails as a file that was removed meanwhile does.
        source = self.set_folder()
        self.succeed(self.odometry(source))
        _, before, _ = self.model()
        gone = sorted(before)[-1]
        (source / "images" / gone).write_bytes(png(10, 10, bytes(100)))
        # As if it had changed after it was tracked: the list still has it.
        done = self.succeed(self.odometry(source))
        _, images, _ = self.model()
        self.assertEqual(sorted(images), self.pictures())
        self.assertNotIn(gone, images)
        self.assertIn("could not be used", done.stdout.decode())


if __name__ == "__main__":
    main()
