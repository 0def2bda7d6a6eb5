"""Checks the reader and writer of camera files: on the cases that the program's reader runs, too
(test/formats), against OpenCV's FileStorage and COLMAP's own reader, and by reading back."""

import dataclasses
import json
import os
import random

import numpy as np
import pytest
import twoview as tv
from conftest import ROOT

pytest.importorskip("yaml")
CASES = json.loads((ROOT / "test" / "formats" / "camera_formats.json").read_text("utf-8"))["cases"]


def values_of(name, camera):
    k = list(camera.k)
    while k and k[-1] == 0:
        k.pop()
    return {"name": name, "width": camera.width, "height": camera.height, "fx": camera.fx,
            "fy": camera.fy, "cx": camera.cx, "cy": camera.cy, "model": camera.model.name.lower(),
            "k": k}


@pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
def test_the_cases_of_both_languages(case, tmp_path):
    path = tmp_path / "file"
    path.write_text("".join(line + "\n" for line in case["text"]), "utf-8")
    if "expect" in case:
        found = [values_of(name, camera) for name, camera in tv.read_cameras(path).items()]
        assert found == case["expect"]
        return
    with pytest.raises(tv.FormatError) as refusal:
        tv.read_cameras(path)
    message = str(refusal.value)
    assert message.startswith(str(path)) and "\n" not in message
    for word in case["refused"]:
        assert word in message


def cameras(count=40):
    """Random cameras of every lens, with numbers that need all their digits."""
    dice = random.Random(7)
    for i in range(count):
        lens = list(tv.CameraModel)[i % 3]
        num = {tv.CameraModel.PINHOLE: 0, tv.CameraModel.BROWN_CONRADY: dice.choice((1, 4, 5, 8)),
               tv.CameraModel.KANNALA_BRANDT: 4}[lens]
        width, height = dice.randint(64, 4000), dice.randint(64, 3000)
        yield tv.Camera(width, height, dice.uniform(0.1, 9) * width, dice.uniform(0.1, 9) * height,
                        dice.uniform(-0.9, 1.9) * width, dice.uniform(-0.9, 1.9) * height, lens,
                        tuple(dice.uniform(-0.1, 0.1) for _ in range(num)))


def fits(camera, format):
    return format != "kalibr" or not any(camera.k[4:])


@pytest.mark.parametrize("format", tv.camera_files.FORMATS)
def test_what_is_written_reads_back(tmp_path, format):
    path, count = tmp_path / "camera", 0
    for camera in cameras():
        if not fits(camera, format):
            with pytest.raises(ValueError, match="cam0: .*k1 k2 p1 p2"):
                tv.write_cameras(path, camera, format)
            assert os.listdir(tmp_path) == ([] if not count else ["camera"])
            continue
        count += 1
        tv.write_cameras(path, camera, format)
        again = tv.read_camera(path)
        if format == "colmap":  # + 0.5 and - 0.5 round
            assert abs(again.cx - camera.cx) < 1e-12 and abs(again.cy - camera.cy) < 1e-12
            again = dataclasses.replace(again, cx=camera.cx, cy=camera.cy)
        assert again == camera
    assert count >= 20 and os.listdir(tmp_path) == ["camera"]


@pytest.mark.parametrize("format", ["kalibr", "cameras.yaml", "colmap"])
def test_files_of_several_cameras(tmp_path, format):
    given = {"cam0": tv.Camera(64, 48, 50, 51, 31.5, 23.5),
             'a "b': tv.Camera(32, 24, 50, 51, 15.5, 11.5, tv.CameraModel.BROWN_CONRADY, (0.5,))}
    path = tmp_path / "cameras"
    tv.write_cameras(path, given, format)
    names = ["1", "2"] if format == "colmap" else list(given)
    assert tv.read_cameras(path) == dict(zip(names, given.values()))
    assert tv.read_camera(path, names[1]) == given['a "b']
    with pytest.raises(tv.FormatError, match="2 cameras .*name one"):
        tv.read_camera(path)
    with pytest.raises(tv.FormatError, match="no camera 'left' but " + names[0]):
        tv.read_camera(path, "left")
    for one in ("opencv", "ros"):
        with pytest.raises(ValueError, match="holds one"):
            tv.write_cameras(path, given, one)


@pytest.mark.parametrize("format", ["opencv", "opencv-xml", "ros"])
def test_sigmas(tmp_path, format):
    path, camera = tmp_path / "camera", tv.Camera(64, 48, 50, 51, 31.5, 23.5)
    tv.write_cameras(path, camera, format)
    assert tv.read_calibration(path) == tv.PLAIN_FILE == (0.01, 0.005, tv.Refine.FOCAL_LENGTH)
    tv.write_cameras(path, camera, format, tv.Calibration(0.0007, 0.0003))
    assert tv.read_calibration(path)[:2] == (0.0007, 0.0003) and tv.read_camera(path) == camera
    path.write_text(path.read_text().replace("0.0007", "0.7"))
    with pytest.raises(tv.FormatError, match=r"focal_sigma is not in \[0, 0.5\]"):
        tv.read_calibration(path)
    for other in ("kalibr", "cameras.yaml", "colmap"):
        with pytest.raises(ValueError, match=other):
            tv.write_cameras(path, camera, other, tv.PLAIN_FILE)


# ---- against other readers and writers -----------------------------------------------------------

@pytest.mark.parametrize("suffix", ["yaml", "xml"])
@pytest.mark.parametrize("count", [4, 5, 8, 12, 14])
def test_what_opencv_writes_is_read(tmp_path, suffix, count):
    cv2 = pytest.importorskip("cv2")
    k = np.zeros(count)
    k[:8] = np.array([0.1, -0.2, 1e-3, -3e-4, 0.05, 0.06, 0.07, 0.08])[:count]
    K = np.array([[500.25, 0, 320.1], [0, 510.75, 240.2], [0, 0, 1]])
    path = str(tmp_path / f"camera.{suffix}")
    file = cv2.FileStorage(path, cv2.FILE_STORAGE_WRITE)
    file.write("calibration_time", "Sun 22 Nov 2026 20:00:00 UTC")
    file.write("image_width", 640)
    file.write("image_height", 480)
    file.write("camera_matrix", K)
    file.write("distortion_coefficients", k.reshape(-1, 1))
    file.write("avg_reprojection_error", 0.25)
    file.release()
    camera = tv.read_camera(path)
    assert np.array_equal(camera.K, K) and (camera.width, camera.height) == (640, 480)
    assert camera == dataclasses.replace(camera, k=k[:8])
    points = np.array([[0.3, -0.2, 1.0], [-0.1, 0.25, 1.0]])
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, k)
    pixels, inside = tv.camera_project_points(camera, points)
    assert inside.all() and np.abs(pixels - expected[:, 0]).max() < 1e-9


@pytest.mark.parametrize("format", ["opencv", "opencv-xml"])
def test_opencv_reads_what_is_written(tmp_path, format):
    cv2 = pytest.importorskip("cv2")
    for camera in cameras(12):
        path = str(tmp_path / ("camera.xml" if format == "opencv-xml" else "camera.yaml"))
        tv.write_cameras(path, camera, format)
        file = cv2.FileStorage(path, cv2.FILE_STORAGE_READ)
        assert np.array_equal(file.getNode("camera_matrix").mat(), camera.K)
        assert file.getNode("image_width").real() == camera.width
        k = file.getNode("distortion_coefficients").mat().ravel()
        assert len(k) in (4, 5, 8) and np.array_equal(k[:len(camera.k)], camera.k[:len(k)])
        assert not any(camera.k[len(k):])


def test_colmap_reads_what_is_written(tmp_path):
    pycolmap = pytest.importorskip("pycolmap")
    given = {str(i): camera for i, camera in enumerate(cameras(12), 1)}
    tv.write_cameras(tmp_path / "cameras.txt", given, "colmap")
    for other in ("images.txt", "points3D.txt"):
        (tmp_path / other).write_text("")
    found = pycolmap.Reconstruction(str(tmp_path))
    points = np.array([[0.1, -0.05, 1.0], [-0.02, 0.07, 1.0]])
    for name, camera in given.items():
        pixels, inside = tv.camera_project_points(camera, points)
        theirs = found.cameras[int(name)].img_from_cam(points)
        assert inside.all() and np.abs(theirs - 0.5 - pixels).max() < 1e-6
    again = tv.read_cameras(tmp_path / "cameras.txt")
    assert list(again) == list(given)


def test_the_camera_of_the_same_picture_at_another_size(tmp_path):
    camera = tv.Camera(1280, 960, 1000, 1010, 639.5, 479.5, tv.CameraModel.BROWN_CONRADY, (0.1,))
    half = tv.Camera(640, 480, 500, 505, 319.5, 239.5, tv.CameraModel.BROWN_CONRADY, (0.1,))
    assert camera.scaled(640, 480) == half and half.scaled(1280, 960) == camera
    assert camera.scaled(1280, 960) == camera
    assert tv.Camera(1920, 1080, 900, 900, 960, 540).scaled(854, 480).width == 854  # 853.33
    tv.write_cameras(tmp_path / "camera", camera)
    assert tv.read_camera(tmp_path / "camera", scale_to=(640, 480)) == half
    for size in ((640, 360), (0, 0), (1280, 720)):
        with pytest.raises(ValueError, match=f"{size[0]}x{size[1]}"):
            camera.scaled(*size)


def test_what_is_left_out_is_named(tmp_path):
    (tmp_path / "c").write_text("image_width: 64\nimage_height: 48\nweather: fine\nrms: 0.2\n"
                                "K: [50, 0, 32, 0, 50, 24, 0, 0, 1]\n"
                                "P: [40, 0, 32, 0, 0, 40, 24, 0, 0, 0, 1, 0]\n")
    with pytest.warns(tv.CameraFileWarning) as warned:
        tv.read_camera(tmp_path / "c")
    assert [str(w.message).split(": ", 1)[1] for w in warned] == [
        "left out: P (of rectified pictures), weather"]


def test_four_coefficients_without_a_model_are_named(tmp_path):
    head = "image_width: 640\nimage_height: 480\nK: [500, 0, 320, 0, 510, 240, 0, 0, 1]\n"
    (tmp_path / "c").write_text(head + "D: [[0.1], [0.02], [-0.03], [0.01]]\n")
    with pytest.warns(tv.CameraFileWarning, match="D as a fisheye's k1 k2 k3 k4"):
        assert tv.read_camera(tmp_path / "c").model == tv.CameraModel.BROWN_CONRADY


# ---- bad input -----------------------------------------------------------------------------------

@pytest.mark.parametrize("text, words", [
    ("<opencv_storage><image_width>640</image_width></opencv_storage>", "camera_matrix is missing"),
    ("<camera/>", "opencv_storage"),
    ("<opencv_storage>", "no XML"),
    ('<!DOCTYPE x [<!ENTITY a "b">]><opencv_storage/>', "declarations"),
    ("<opencv_storage><a>1</a><a>2</a></opencv_storage>", "a is given twice"),
    ("a: &x 1\nb: *x\n", "aliases"),
    ("1 PINHOLE 8 8 5 5 4 4\n1 PINHOLE 8 8 5 5 4 4\n", "camera 1 is given twice"),
    ("\x00\x01", "a binary file"),
    ("x" * (1 << 20) + "x", "larger than"),
])
def test_files_that_are_refused(tmp_path, text, words):
    path = tmp_path / "file"
    path.write_text(text)
    with pytest.raises(tv.FormatError, match=words) as refusal:
        tv.read_cameras(path)
    assert str(path) in str(refusal.value) and "\n" not in str(refusal.value)
    assert isinstance(refusal.value, ValueError)


def test_other_mistakes(tmp_path):
    camera = tv.Camera(64, 48, 50, 51, 31.5, 23.5)
    with pytest.raises(OSError):
        tv.read_camera(tmp_path / "none.yaml")
    with pytest.raises(ValueError, match="format 'openCV' is not one of opencv, "):
        tv.write_cameras(tmp_path / "a", camera, "openCV")
    with pytest.raises(tv.TV_ERR_CAMERA):
        tv.write_cameras(tmp_path / "a", dataclasses.replace(camera, fx=float("nan")))
    with pytest.raises(ValueError, match="at least one"):
        tv.write_cameras(tmp_path / "a", {}, "kalibr")
    with pytest.raises(OSError):
        tv.write_cameras(tmp_path / "folder" / "a", camera)
    assert not os.listdir(tmp_path)


def test_without_pyyaml_one_line_names_it(tmp_path, monkeypatch):
    import sys
    monkeypatch.setitem(sys.modules, "yaml", None)
    (tmp_path / "a.yaml").write_text("image_width: 1")
    with pytest.raises(ImportError, match="PyYAML.*python3-yaml"):
        tv.read_camera(tmp_path / "a.yaml")
