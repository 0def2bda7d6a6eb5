"""densify: a wall of known depth, and what is refused."""

import numpy as np
import pytest
import twoview as tv
from conftest import needs

pytestmark = needs("tv_densify")

SHIFT = 8


@pytest.fixture
def pair(image):
    """Two images of a wall at 300 / SHIFT baselines, and their camera."""
    return image, np.ascontiguousarray(np.roll(image, -SHIFT, axis=1)), tv.Camera(
        320, 240, 300.0, 300.0, 159.5, 119.5)


def densify(pair, **keywords):
    first, second, camera = pair
    if "options" not in keywords:
        keywords.setdefault("max_parallax_rad", 20 / 300)
    return tv.densify(first, camera, second, camera, np.eye(3), [-1.0, 0.0, 0.0], **keywords)


def test_a_walls_points_are_on_the_wall_within_their_sigma(pair):
    points = densify(pair)
    assert points.dtype == tv.DENSE_POINT and len(points) > 20000
    off = np.abs(points["position"][:, 2] - 300 / SHIFT)
    assert np.median(off) < 0.02 * 300 / SHIFT
    assert (off < 3 * points["sigma"]).mean() > 0.97
    x, y = np.rint(points["pixel0"]).astype(int).T
    assert (points["grey"] == pair[0][y, x]).all()
    shift = points["pixel0"] - points["pixel1"]
    assert np.abs(np.median(shift, axis=0) - [SHIFT, 0]).max() < 0.1
    assert (points["similarity"] > 0.7).all()


def test_the_range_comes_from_sparse_points_and_the_number_is_bounded(pair):
    sparse = np.zeros(20, tv.POINT)
    sparse["angle_rad"] = SHIFT / 300
    points = densify(pair, sparse=sparse, max_points=700, max_parallax_rad=0.0)
    assert len(points) == 700
    assert abs(np.median(points["position"][:, 2]) * SHIFT / 300 - 1) < 0.02
    assert len(densify(pair, max_points=0)) == 0
    same = densify(pair, options=tv.DenseOptions(max_parallax_rad=20 / 300))
    assert (same == densify(pair)).all()


def test_what_c_could_not_read_is_refused(pair):
    first, second, camera = pair
    with pytest.raises(TypeError):
        densify((first.astype(float), second, camera))
    with pytest.raises(TypeError):
        densify((first, second, None))
    with pytest.raises(TypeError):
        densify(pair, sparse=np.zeros((4, 3)))
    with pytest.raises(ValueError):
        densify(pair, max_points=-1)
    with pytest.raises(TypeError):
        densify(pair, max_step=3)
    with pytest.raises(tv.TV_ERR_CAMERA):
        densify((first[:-1], second, camera))
    with pytest.raises(tv.TV_ERR_ARGUMENT):
        densify(pair, max_steps=8)
    with pytest.raises(tv.TV_ERR_NOT_FINITE):
        tv.densify(first, camera, second, camera, np.eye(3), [np.nan, 0, 0])
    with pytest.raises(tv.TV_ERR_ARGUMENT):
        tv.densify(first, camera, second, camera, 2 * np.eye(3), [1, 0, 0])
