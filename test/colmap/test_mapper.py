"""The mappers of COLMAP 4 and 3.8 work on an export without running their own verification."""

import shutil

import numpy as np
import pytest
from twoview_tools.colmap import mapping, truth
from twoview_tools.colmap.model import read_model
from conftest import NAMES, camera_pose

pytest.importorskip("pycolmap")


@pytest.mark.parametrize("schema", ["4", "3.8"])
def test_every_image_is_registered_where_it_was(exported, photographs, tmp_path, schema):
    if schema == "3.8" and not shutil.which("colmap"):
        pytest.skip("no colmap: scripts/bootstrap test installs it")
    database = shutil.copy(exported[schema], tmp_path / "x.db")
    [folder] = mapping.MAPPERS[schema](
        str(database), str(photographs / "images"), str(tmp_path / "model"), True
    )
    model = read_model(folder)
    assert set(model.images) == set(NAMES) and model.num_points > 300 and model.mean_error_px < 0.6
    true = {
        name: (camera_pose(i)[0], -camera_pose(i)[0].T @ camera_pose(i)[1])
        for i, name in enumerate(NAMES)
    }
    _, positions, angles = truth.pose_errors(model.poses(), true)
    # Neighbouring cameras are 0.8 length units and 8 degrees apart; 1.25 per cent is allowed.
    assert positions.max() < 0.01 and angles.max() < 0.1


def test_alignment_undoes_a_similarity():
    random = np.random.default_rng(4)
    source = random.normal(size=(6, 3))
    R, _ = camera_pose(3)
    scale, rotation, t = truth.align(source, 2.5 * source @ R.T + [1, 2, 3])
    assert scale == pytest.approx(2.5)
    np.testing.assert_allclose(rotation, R, atol=1e-12)
    np.testing.assert_allclose(t, [1, 2, 3], atol=1e-12)
    poses = {i: (camera_pose(i)[0], centre) for i, centre in enumerate(source)}
    moved = {i: (pose @ R.T, 2.5 * R @ centre + [1, 2, 3]) for i, (pose, centre) in poses.items()}
    names, positions, angles = truth.pose_errors(poses, moved)
    assert len(names) == 6 and positions.max() < 1e-12 and angles.max() < 1e-5


@pytest.mark.parametrize("schema", ["4", "3.8"])
def test_an_image_without_keypoints_is_left_out(photographs, tmp_path, schema, call):
    """The mappers read the keypoints of every image, and refuse an empty table whose number of
    columns is not 2, 4 or 6."""
    if schema == "3.8" and not shutil.which("colmap"):
        pytest.skip("no colmap: scripts/bootstrap test installs it")
    import cv2
    shutil.copytree(photographs / "images", tmp_path / "images")
    cv2.imwrite(str(tmp_path / "images" / "blank.png"), np.full((480, 640), 90, np.uint8))
    shutil.copy(photographs / "cameras.yaml", tmp_path)
    assert (
        call(
            "export",
            "--database",
            tmp_path / "x.db",
            "--images",
            tmp_path / "images",
            "--schema",
            schema,
        )[0]
        == 0
    )
    [folder] = mapping.MAPPERS[schema](
        str(tmp_path / "x.db"), str(tmp_path / "images"), str(tmp_path / "model"), True
    )
    assert set(read_model(folder).images) == set(NAMES)
