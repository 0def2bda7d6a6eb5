"""Room: a wall of known distance, a map that is removed, memory that ends, and what is refused."""

import numpy as np
import pytest
import twoview as tv
from conftest import needs

pytestmark = needs("tv_room_add")

CAMERA = tv.Camera(96, 72, 80.0, 80.0, 47.5, 35.5)


def wall(z=1.5):
    """The distances of a wall at z in front of the camera, along the rays."""
    y, x = np.mgrid[:72, :96].astype(float)
    x, y = (x - CAMERA.cx) / CAMERA.fx, (y - CAMERA.cy) / CAMERA.fy
    return (z * np.sqrt(x * x + y * y + 1)).astype(np.float32)


def add(room, z=1.5, **keywords):
    room.add(CAMERA, np.eye(3), [0.0, 0.0, 0.0], wall(z), np.full((72, 96), 0.01, np.float32),
             **keywords)


def test_a_wall_is_where_it_is_and_has_its_colour():
    pixels = np.zeros((72, 96, 3), np.uint8)
    pixels[:] = [10, 100, 200]
    with tv.Room(4 << 20) as room:
        add(room, 1.507, pixels=pixels)
        mesh = room.mesh()
        assert mesh.vertices.dtype == tv.ROOM_VERTEX and len(mesh.vertices) > 2000
        assert np.abs(mesh.vertices["position"][:, 2] - 1.507).max() < 0.004
        assert (mesh.vertices["normal"][:, 2] < -0.9).all()
        assert (mesh.vertices["rgb"] == [10, 100, 200]).all()
        assert (mesh.vertices["sigma"] > 0).all() and not mesh.vertices["inferred"].any()
        assert 0 <= mesh.triangles.min() and mesh.triangles.max() < len(mesh.vertices)
        a, b, c = (mesh.vertices["position"][mesh.triangles[:, k]] for k in range(3))
        assert np.cross(b - a, c - a)[:, 2].sum() < -2.0
        half = room.mesh(min=(0, -9, -9), max=(9, 9, 9))
        assert 0.4 * len(mesh.vertices) < len(half.vertices) < 0.7 * len(mesh.vertices)


def test_a_mesh_is_drawn_to_planes_and_left_out_by_sigma():
    wave = 0.015 * (np.indices((72, 96)) // 12 % 2).sum(0).astype(np.float32)
    with tv.Room(4 << 20) as room:
        room.add(CAMERA, np.eye(3), [0.0, 0.0, 0.0], wall() + wave,
                 np.full((72, 96), 0.03, np.float32))
        planes = room.find_planes()
        away = [np.std(mesh.vertices["position"][:, 2]) for mesh in
                (room.mesh(), room.mesh(planes=planes[:1]), room.mesh(planes=planes[:0]))]
        assert away[1] < 0.5 * away[0] and away[2] == away[0]
        assert np.median(room.mesh(planes=planes[:1]).vertices["sigma"]) <= 0.03 / 3
        assert len(room.mesh(max_sigma=0.01).vertices) == 0
        with pytest.raises(TypeError):
            room.mesh(planes=[1.0])


def test_a_map_is_removed_as_exactly_as_it_was_added():
    with tv.Room(4 << 20, tv.RoomOptions(voxel=0.05)) as room:
        add(room)
        before = room.mesh()
        add(room, 1.53)
        assert room.state.num_maps == 2
        room.remove(CAMERA, np.eye(3), [0.0, 0.0, 0.0], wall(1.53),
                    np.full((72, 96), 0.01, np.float32))
        after = room.mesh()
        assert (before.vertices == after.vertices).all()
        assert (before.triangles == after.triangles).all()
        with pytest.raises(tv.TV_ERR_ARGUMENT):
            room.remove(CAMERA, np.eye(3), [0.0, 0.0, 0.1], wall())


def test_a_room_that_is_full_says_so_and_goes_on_coarser():
    with tv.Room(1 << 20) as room:
        with pytest.raises(tv.TV_ERR_CAPACITY):
            for k in range(20):
                add(room, 1.0 + 0.3 * k)
        state = room.state
        assert state.num_maps > 0
        before = len(room.mesh().vertices)
        assert before > 1000
        room.coarsen()
        assert room.state.voxel == 2 * state.voxel and room.state.num_blocks < state.num_blocks
        add(room, 1.0 + 0.3 * state.num_maps)
        assert len(room.mesh().vertices) > before / 4
        assert room.prune() > 0 and not len(room.mesh().vertices)  # none was seen twice


def test_a_plain_wall_is_inferred_from_its_edges():
    y, x = np.mgrid[:72, :96]
    middle = (x >= 16) & (x < 80) & (y >= 16) & (y < 56)
    edge = (x < 12) | (x >= 84) | (y < 12) | (y >= 60)
    pixels = np.where(edge, (x ^ y) % 4 * 60, 150).astype(np.uint8)
    distance = np.where(middle, np.float32(0), wall())
    sigma = np.full((72, 96), 0.01, np.float32)
    seen = (CAMERA, np.eye(3), [0.0, 0.0, 0.0], distance, sigma, None, pixels)
    with tv.Room(4 << 20) as room:
        room.add(*seen)
        planes = room.find_planes(gravity=(0, 1, 0))
        assert planes.dtype == tv.ROOM_PLANE and len(planes) == 1
        assert planes["kind"][0] == tv.RoomPlaneKind.UPRIGHT
        assert abs(planes["offset"][0] + 1.5) < 0.002
        inferred, its_sigma = room.infer(planes, *seen)
        known = inferred > 0
        assert known.sum() > 0.8 * middle.sum() and not (known & ~middle).any()
        assert np.abs(inferred - wall())[known].max() < 0.005 and (its_sigma[known] > 0).all()
        assert not room.infer(planes[:0], *seen)[0].any()
        mask = x < 48
        shown, _ = room.infer(planes, *seen, mask=mask)
        assert (shown[:, :48] == inferred[:, :48]).all() and not shown[:, 48:].any()
        with pytest.raises(ValueError):
            room.infer(planes, *seen, mask=mask[:, :50])
        for x in (0.0, 0.01):  # two maps have to agree
            room.add(CAMERA, np.eye(3), [x, 0.0, 0.0], inferred, its_sigma, pixels=pixels,
                     inferred=True)
        room.see_through(*seen)
        vertices = room.mesh().vertices
        assert 0.3 < vertices["inferred"].mean() < 0.7
        assert not room.mesh(measured_only=True).vertices["inferred"].any()
        with pytest.raises(tv.TV_ERR_ARGUMENT):
            room.infer(planes, *seen[:6])  # without pixels


def test_what_c_could_not_read_is_refused():
    with tv.Room(1 << 20) as room:
        def give(distance, **keywords):
            room.add(CAMERA, np.eye(3), [0.0, 0.0, 0.0], distance, **keywords)

        with pytest.raises(TypeError):
            give(wall().astype(complex))
        with pytest.raises(TypeError):
            room.add(None, np.eye(3), [0.0, 0.0, 0.0], wall())
        with pytest.raises(ValueError):
            give(wall()[:, ::2])
        with pytest.raises(ValueError):
            give(wall(), sigma=wall()[:50])
        with pytest.raises(ValueError):
            give(wall(), pixels=np.zeros((72, 96, 4), np.uint8))
        with pytest.raises(TypeError):
            give(wall(), mask=np.full((72, 96), 0.5))
        with pytest.raises(tv.TV_ERR_CAMERA):
            give(np.ascontiguousarray(wall()[:50]))
        with pytest.raises(tv.TV_ERR_ARGUMENT):
            room.add(CAMERA, 2 * np.eye(3), [0.0, 0.0, 0.0], wall())
        with pytest.raises(tv.TV_ERR_NOT_FINITE):
            room.add(CAMERA, np.eye(3), [0.0, 0.0, np.nan], wall())
        with pytest.raises(tv.TV_ERR_ARGUMENT):
            room.mesh(min_maps=0)
        assert room.state.num_maps == 0 and len(room.mesh().vertices) == 0
    with pytest.raises(ValueError):
        room.mesh()
    with pytest.raises(tv.TV_ERR_MEMORY):
        tv.Room(1000)
    with pytest.raises(tv.TV_ERR_ARGUMENT):
        tv.Room(voxel=0.0)
