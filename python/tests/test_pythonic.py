"""Checks what a Python programmer expects of the package: None cameras as in C, __version__,
results that print and compare, documented functions, and types that mypy --strict accepts."""

import copy
import dataclasses
import inspect
import re
import subprocess
import sys

import numpy as np
import pytest
import twoview as tv
from conftest import ROOT, needs

FUNCTIONS = {name: value for name, value in vars(tv).items()
             if inspect.isfunction(value) and name in tv.__all__}
CLASSES = {name: value for name, value in vars(tv).items()
           if inspect.isclass(value) and name in tv.__all__}


@pytest.fixture
def pose(context, scene):
    return tv.estimate_two_view(context, scene.camera, scene.camera, scene.pixels0,
                                scene.pixels1)[0]


def shifted(image):
    """Two views of `image`: itself, and it moved by three pixels."""
    return image, np.ascontiguousarray(np.roll(image, 3, axis=1))


# ---- None cameras --------------------------------------------------------------------------------

def test_reconstruct_without_cameras_is_the_uncalibrated_estimate(context, image):
    left, right = shifted(image)
    found, cloud = tv.reconstruct(context, left, None, right, None)
    pixels = [np.column_stack([points["x"], points["y"]])[cloud.matches[idx]].astype(float)
              for points, idx in zip(cloud.keypoints, ("idx0", "idx1"))]
    sigmas = [tv.keypoint_sigmas(points, 1.0)[cloud.matches[idx]]
              for points, idx in zip(cloud.keypoints, ("idx0", "idx1"))]
    expected, inliers = tv.estimate_two_view(
        context, None, None, *pixels, cloud.matches["ratio"].copy(), sigmas0=sigmas[0],
        sigmas1=sigmas[1])
    assert found.kind == expected.kind and found.kind in (tv.Kind.UNCALIBRATED,
                                                          tv.Kind.PLANAR_OR_PANORAMIC)
    assert found.R is None and found.t is None and found.E is None
    assert np.array_equal(cloud.inlier_mask, inliers) and inliers.sum() > 20
    assert cloud.num_points == 0


def test_one_camera_alone_is_refused(context, image, scene):
    left, right = shifted(image)
    for cameras in ((scene.camera, None), (None, scene.camera)):
        missing = "camera0" if cameras[0] is None else "camera1"
        words = missing + " is None.*None for both"
        with pytest.raises(TypeError, match=words):
            tv.reconstruct(context, left, cameras[0], right, cameras[1])
        with pytest.raises(TypeError, match=words):
            tv.estimate_two_view(context, *cameras, scene.pixels0, scene.pixels1)
        with pytest.raises(TypeError, match=words):
            tv.triangulate(*cameras, scene.R, scene.t, scene.pixels0, scene.pixels1)


# ---- names ---------------------------------------------------------------------------------------

def test_the_version_is_the_headers():
    header = (ROOT / "lib" / "include" / "twoview" / "version.h").read_text()
    assert tv.__version__ == re.search(r'TV_VERSION_STRING "([^"]+)"', header)[1]
    assert tv.__version__ == tv.version_string()
    with pytest.raises(AttributeError, match="reconstrukt"):
        tv.reconstrukt  # noqa: B018


def test_every_public_name_is_listed_once():
    public = {name for name, value in vars(tv).items()
              if not name.startswith("_") and not inspect.ismodule(value)}
    assert sorted(tv.__all__) == sorted(public)


# ---- printing and comparing ----------------------------------------------------------------------

def test_a_pose_prints_readably(pose, scene):
    text = str(pose)
    assert text.startswith("calibrated, ok: 200 of 200 matches agree\n")
    degrees = np.degrees(np.arccos((np.trace(scene.R) - 1) / 2))
    assert f"rotation     {degrees:.3f} deg about (+0.000, +1.000, +0.000)" in text
    x, y, z = scene.t
    assert f"t            ({x:+.3f}, {y:+.3f}, {z:+.3f}), x1 = R x0 + t" in text
    assert len(text.split("\n")) <= 7 and max(map(len, text.split("\n"))) <= 100
    assert repr(pose) == "<TwoView: calibrated, ok: 200 of 200 matches agree>"


def test_ok_without_a_full_pose_is_printed_as_what_is_ok(context, scene, pose):
    found, _ = tv.estimate_two_view(context, None, None, scene.pixels0, scene.pixels1,
                                    method=tv.Solver.EIGHT_POINT)
    assert found.verdict == tv.Verdict.OK and found.R is None
    assert str(found).startswith("uncalibrated, matches ok, no pose: ")
    turned = dataclasses.replace(pose, kind=tv.Kind.PANORAMIC, t=None)
    assert str(turned).startswith("panoramic, rotation ok, no full pose: ")


def test_a_refused_pair_prints_its_reasons(context, image, scene):
    found, cloud = tv.reconstruct(context, image, scene.camera, image, scene.camera)
    assert str(found).startswith("no_motion, refused (no_motion")
    assert "t  " not in str(found) and "keypoints" in str(cloud)
    blank = np.zeros_like(image)
    nothing, _ = tv.reconstruct(context, blank, scene.camera, blank, scene.camera)
    assert str(nothing).startswith("degenerate, refused (") and "\n" not in str(nothing)


@needs("tv_estimate_absolute_pose")
def test_every_result_prints_in_a_few_lines(context, scene, pose):
    points = tv.triangulate(scene.camera, scene.camera, pose.R, pose.t, scene.pixels0,
                            scene.pixels1)
    adjusted = tv.adjust_two_view(context, scene.camera, scene.camera, scene.pixels0, scene.pixels1,
                                  pose.R, pose.t, points)
    absolute, _ = tv.estimate_absolute_pose(context, scene.camera, scene.pixels0, scene.points)
    nowhere, _ = tv.estimate_absolute_pose(context, scene.camera, scene.pixels0[:3],
                                           scene.points[:3])
    assert "200 points" in str(adjusted) and "px rms" in str(adjusted)
    assert str(absolute).startswith("pose, ok: 200 of 200") and "x = R X + t" in str(absolute)
    assert str(nowhere).startswith("no pose, refused")
    for result in (adjusted, absolute, nowhere):
        assert repr(result).startswith(f"<{type(result).__name__}: ")


def test_results_compare(context, scene, pose):
    again, inliers = tv.estimate_two_view(context, scene.camera, scene.camera, scene.pixels0,
                                          scene.pixels1)
    assert pose == again and not pose != again and pose == copy.deepcopy(pose)
    other = dataclasses.replace(pose, R=pose.R + 1e-12)
    assert (pose == other) is False and pose != other
    assert pose != dataclasses.replace(pose, R=None) and dataclasses.replace(pose, R=None) != pose
    nan = dataclasses.replace(pose, noise_px=float("nan"), t=np.full(3, np.nan))
    assert nan == copy.deepcopy(nan)
    assert pose != "a pose" and pose not in [None, 3] and pose in [other, pose]
    with pytest.raises(TypeError, match="unhashable"):
        hash(pose)


def test_clouds_compare(context, image, scene):
    left, right = shifted(image)
    first, second = (tv.reconstruct(context, left, scene.camera, right, scene.camera)[1]
                     for _ in range(2))
    assert first == second
    moved = first.points.copy()
    moved["position"][0] += 1
    assert first != dataclasses.replace(first, points=moved)


def test_cameras_and_options_compare_whatever_holds_their_numbers():
    plain = tv.Camera(64, 48, 50, 50, 31.5, 23.5)
    lens = tv.Camera(64, 48, 50, 50, 31.5, 23.5, tv.CameraModel.BROWN_CONRADY, (0.1, 0.2))
    for k in ([0.1, 0.2], np.array([0.1, 0.2]), (0.1, 0.2, 0, 0)):
        same = dataclasses.replace(lens, k=k)
        assert same == lens and hash(same) == hash(lens)
    assert lens != plain and plain != 3 and tv.camera_scale(lens, 1.0) == lens
    options = [tv.EstimateOptions(gravity0=g) for g in ((0, 1, 0), [0, 1, 0], np.array([0, 1, 0]))]
    assert options[0] == options[1] == options[2] and len(set(options)) == 1
    assert tv.EstimateOptions(gravity0=np.zeros(3)) != options[0]


# ---- documentation -------------------------------------------------------------------------------

@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_every_function_documents_its_arguments_result_and_errors(name):
    function, text = FUNCTIONS[name], inspect.getdoc(FUNCTIONS[name]) or ""
    missing = [p for p in inspect.signature(function).parameters
               if p != "keywords" and not re.search(rf"\b{p}\b", text)]
    assert not missing, f"{name} does not say what {missing} are"
    assert re.search(r"\bRaises\s", text), f"{name} does not say what it raises"
    assert re.search(r"\b[Rr]eturns\b|^\w+: \S", text), f"{name} does not say what it returns"


@pytest.mark.parametrize("name", sorted(CLASSES))
def test_every_class_and_field_is_documented(name):
    kind = CLASSES[name]
    if issubclass(kind, tv.StatusError) and kind is not tv.StatusError:
        return  # named and documented by its status in C
    assert inspect.getdoc(kind), name
    if dataclasses.is_dataclass(kind):
        lines = inspect.getsource(kind).split("\n")
        for field in dataclasses.fields(kind):
            number, = (i for i, line in enumerate(lines)
                       if re.match(rf"    {field.name}: ", line))
            if not re.search("#:", lines[number] + lines[number - 1]):
                # cy follows cx, and so on: one comment serves neighbours of one meaning
                assert re.search("#:", lines[number - 1] + lines[number - 2]), field.name


# ---- types ---------------------------------------------------------------------------------------

PROGRAM = '''
import numpy as np
import numpy.typing as npt
import twoview as tv


def direction(left: npt.NDArray[np.uint8], right: npt.NDArray[np.uint8],
              camera: tv.Camera | None) -> npt.NDArray[np.float64] | None:
    with tv.Context(max_width=left.shape[1], max_height=left.shape[0]) as context:
        options = tv.EstimateOptions(gravity0=[0.0, 1.0, 0.0], seed=3)
        pose, cloud = tv.reconstruct(context, left, camera, right, camera, estimate=options)
        keypoints = tv.detect(context, left, arc=9)
        near: int = len(keypoints) + cloud.num_points
        if pose.verdict is tv.Verdict.OK and pose != None and near:
            print(pose, tv.__version__, pose.reasons & tv.Reason.LOW_PARALLAX)
            return pose.t
    return None


try:
    tv.camera_check(tv.Camera(8, 8, 5.0, 5.0, 3.5, 3.5))
except tv.TV_ERR_CAMERA as error:
    print(error.status.name)
'''
MISTAKES = {
    "tv.reconstrukt": "attr-defined",
    "tv.Camera(8, 8, '5', 5.0, 3.5, 3.5)": "call-overload",
    "tv.camera_scale(None, 0.5)": "arg-type",
    "tv.FeatureOptions(arcs=9)": "call-arg",
    "tv.version_string().Foo": "attr-defined",
}


def mypy(folder, *files):
    pytest.importorskip("mypy")
    return subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(folder / "cache"), *files],
        capture_output=True, text=True, check=False, cwd=folder,
        env={"MYPYPATH": str(ROOT / "python"), "PATH": "/usr/bin:/bin"})


def test_the_types_are_strict(tmp_path):
    assert (ROOT / "python" / "twoview" / "py.typed").is_file()
    (tmp_path / "user.py").write_text(PROGRAM)
    run = mypy(tmp_path, str(ROOT / "python" / "twoview"), "user.py")
    assert run.returncode == 0, run.stdout + run.stderr
    (tmp_path / "mistakes.py").write_text(
        "import twoview as tv\n" + "\n".join(MISTAKES) + "\n")
    run = mypy(tmp_path, "mistakes.py")
    for line, (text, code) in enumerate(MISTAKES.items(), 2):
        found = re.search(rf"mistakes.py:{line}: error: .*\[{code}\]", run.stdout)
        assert found, (text, run.stdout)
