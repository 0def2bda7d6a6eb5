"""sweep_depth: a wall of known depth, and what is refused."""

import numpy as np
import pytest
import twoview as tv
from conftest import needs

pytestmark = needs("tv_sweep_depth")

SHIFT = 8
CAMERA = tv.Camera(320, 240, 300.0, 300.0, 159.5, 119.5)


def sweep(image, **keywords):
    images = [np.ascontiguousarray(np.roll(image, shift, axis=1)) for shift in (0, -SHIFT, SHIFT)]
    arguments = {"cameras": [CAMERA] * 3, "R": [np.eye(3)] * 3,
                 "t": [[0.0, 0, 0], [1.0, 0, 0], [-1.0, 0, 0]], "near_depth": 15.0,
                 "far_depth": 150.0, **keywords}
    return tv.sweep_depth(images, **arguments)


def test_a_walls_depths_are_the_walls_within_their_sigma(image):
    found = sweep(image)
    assert found.camera == CAMERA
    inside = np.s_[4:-4, 4:-4]  # grey is the image, a little smoother
    assert np.corrcoef(found.grey[inside].ravel(), image[inside].ravel())[0, 1] > 0.9
    rows, columns = np.nonzero(found.distance)
    assert len(rows) > 0.8 * image.size
    rays, inside = tv.camera_unproject_points(found.camera, np.stack([columns, rows], 1) * 1.0)
    assert inside.all()
    depth = found.distance[rows, columns] * rays[:, 2]
    off = np.abs(depth - 300 / SHIFT)
    assert np.median(off) < 0.02 * 300 / SHIFT
    assert (off < 3 * found.sigma[rows, columns]).mean() > 0.95
    assert (found.witnesses[rows, columns] > 0).mean() > 0.9


def test_what_c_could_not_read_is_refused(image):
    with pytest.raises(ValueError):
        sweep(image, t=[[0.0, 0, 0]])
    with pytest.raises(TypeError):
        sweep(image, cameras=[CAMERA, CAMERA, None])
    with pytest.raises(tv.TV_ERR_ARGUMENT):
        sweep(image, near_depth=0.0)
    with pytest.raises(tv.TV_ERR_ARGUMENT):
        sweep(image, max_views=2)
    with pytest.raises(tv.TV_ERR_ARGUMENT):
        sweep(image, R=[2 * np.eye(3)] * 3)
