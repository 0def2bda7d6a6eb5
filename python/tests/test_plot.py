"""The figures of twoview.plot: what they draw lies where it should, and they can be saved."""

import io
import sys

import numpy as np
import pytest
import twoview as tv

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")

GREY = np.full((240, 320), 128, np.uint8)


@pytest.fixture
def found(context, scene):
    """(a pose, its inliers)"""
    return tv.estimate_two_view(context, scene.camera, scene.camera, scene.pixels0, scene.pixels1)


@pytest.fixture(autouse=True)
def close_figures():
    yield
    matplotlib.pyplot.close("all")


def saved(figure, kind):
    data = io.BytesIO()
    figure.savefig(data, format=kind)
    return data.getvalue()


def test_matches_are_lines_between_both_images(scene, found):
    inliers = found[1].copy()
    inliers[:30] = False
    figure = tv.plot.matches(GREY, GREY, scene.pixels0, scene.pixels1, inliers, most=50)
    lines = [line for line in figure.axes[0].lines if line.get_linestyle() == "-"]
    assert {line.get_color() for line in lines} == {tv.plot.GOOD, tv.plot.POOR}
    assert len(lines) == 50 + 30
    first = lines[0].get_xydata()
    assert np.allclose(first[0], scene.pixels0[0])
    assert np.allclose(first[1] - scene.pixels1[0], [320 * 1.02, 0])
    assert saved(figure, "pdf").startswith(b"%PDF") and b"<svg" in saved(figure, "svg")
    axes = figure.axes[0]
    assert tv.plot.matches(GREY, np.dstack([GREY] * 3), scene.pixels0.tolist(), scene.pixels1,
                           axes=axes) is figure


@pytest.mark.parametrize("lens", [(), (-0.2, 0.05, 0.001, 0.001)])
def test_epipolar_curves_run_through_the_matched_pixels(scene, found, lens):
    """Also through a lens that bends them."""
    camera = tv.Camera(scene.camera.K, distortion=lens)
    pixels = [tv.camera_project_points(camera, points)[0]
              for points in (scene.points, scene.points @ scene.R.T + scene.t)]
    pose = tv.TwoView.__new__(tv.TwoView)
    for name, value in (("R", scene.R), ("t", scene.t), ("F", found[0].F)):
        object.__setattr__(pose, name, value)
    figure = tv.plot.epipolar_lines(GREY, GREY, pose, *pixels, camera, camera, most=8)
    lines = figure.axes[0].lines
    curves, marks = lines[0::2], lines[1::2]
    assert len(curves) == len(marks) == 16
    for curve, mark in zip(curves, marks):
        x, y = curve.get_xydata().T
        order = np.argsort(x)
        known = np.isfinite(x[order])
        at, height = mark.get_xydata()[0]
        assert abs(np.interp(at, x[order][known], y[order][known]) - height) < 0.1


def test_straight_lines_by_f_run_through_the_matched_pixels(scene, found):
    figure = tv.plot.epipolar_lines(GREY, GREY, found[0], scene.pixels0, scene.pixels1, most=8)
    lines = figure.axes[0].lines
    for line, mark in zip(lines[0::2], lines[1::2]):
        (x0, y0), (x1, y1) = line.get_xydata()
        at, height = mark.get_xydata()[0]
        away = (x1 - x0) * (height - y0) - (y1 - y0) * (at - x0)
        assert abs(away) / np.hypot(x1 - x0, y1 - y0) < 0.5
    assert saved(figure, "png")


def test_a_cloud_shows_points_and_cameras(scene, found):
    pose, inliers = found
    points = tv.triangulate(scene.camera, scene.camera, pose.R, pose.t, scene.pixels0[inliers],
                            scene.pixels1[inliers])
    figure = tv.plot.cloud(points, pose)
    assert {text.get_text().strip() for text in figure.axes[0].texts} == {"camera 0", "camera 1"}
    assert saved(figure, "png")
    tv.plot.cloud(points["position"].astype(np.float32), colours="red", share=1.0)
    with pytest.raises(ValueError, match="no point"):
        tv.plot.cloud(np.empty((0, 3)))


def test_a_reconstruction_is_enough(context, image):
    moved = np.ascontiguousarray(np.roll(image, 3, axis=1))
    pose, cloud = tv.reconstruct(context, image, None, moved, None)
    tv.plot.matches(image, moved, cloud)
    if pose.F is not None:
        tv.plot.epipolar_lines(image, moved, pose, cloud)
    with pytest.raises(ValueError, match="no point"):
        tv.plot.cloud(cloud)


def test_what_cannot_be_drawn_is_named(scene, found):
    with pytest.raises(ValueError, match="pixels1"):
        tv.plot.matches(GREY, GREY, scene.pixels0, scene.pixels1[:3])
    with pytest.raises(ValueError, match="inliers: shape"):
        tv.plot.matches(GREY, GREY, scene.pixels0, scene.pixels1, [True])
    with pytest.raises(ValueError, match="image1"):
        tv.plot.matches(GREY, [1, 2], scene.pixels0, scene.pixels1)
    with pytest.raises(ValueError, match="both cameras"):
        tv.plot.epipolar_lines(GREY, GREY, found[0], scene.pixels0, scene.pixels1, scene.camera)


def test_without_matplotlib_the_message_says_what_to_install(monkeypatch, scene):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ImportError, match="pip install matplotlib"):
        tv.plot.matches(GREY, GREY, scene.pixels0, scene.pixels1)
