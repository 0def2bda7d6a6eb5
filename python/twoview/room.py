"""A room, fused from depth maps into a surface (room.h)."""

from __future__ import annotations

import threading
from ctypes import addressof, byref, c_int32, c_size_t, c_void_p
from dataclasses import dataclass
from typing import Any, Optional, Sequence

import numpy as np

from . import _abi
from .camera import Camera, camera_struct
from .options import (RoomInferOptions, RoomMeshOptions, RoomOptions, RoomPlaneOptions,
                      to_struct)

#: Memory in bytes that holds a furnished room of 8 x 6 x 3 m with the default options.
ROOM_DEFAULT_BYTES = 64 << 20


@dataclass(frozen=True)
class RoomState:
    """tv_room_state: what is in a room."""

    num_maps: int  #: that were added and not removed
    num_blocks: int  #: of 4 x 4 x 4 voxels
    cap_blocks: int  #: that there is memory for
    voxel: float  #: its side now, in the unit of the poses
    min: np.ndarray  #: (3,), the box of all blocks in the world; zeros where there are none
    max: np.ndarray  #: (3,)


@dataclass(frozen=True)
class RoomMesh:
    """What Room.mesh returns."""

    vertices: np.ndarray  #: (n,) of twoview.ROOM_VERTEX
    triangles: np.ndarray  #: (m, 3) int32, anticlockwise as seen from the free side


class Room:
    """tv_room in memory that Python owns: depth maps with their poses, fused into a surface.

    memory_bytes: how much the room may take. options: a RoomOptions, or its fields as keywords.
    Calls from several threads wait for each other. close() or a with statement frees the memory;
    later calls raise ValueError."""

    def __init__(self, memory_bytes: int = ROOM_DEFAULT_BYTES,
                 options: Optional[RoomOptions] = None, *, library: Optional[_abi.Library] = None,
                 **keywords: Any):
        self.library = library or _abi.default_library()
        wanted = to_struct(self.library, RoomOptions, options, keywords)
        if not 0 <= memory_bytes < 2**63:
            raise ValueError(f"memory_bytes: {memory_bytes} is out of range")
        self._memory: Optional[np.ndarray] = np.empty(memory_bytes + _abi.CONTEXT_ALIGNMENT,
                                                      np.uint8)
        start = -self._memory.ctypes.data % _abi.CONTEXT_ALIGNMENT
        self._pointer = c_void_p()
        self.library.call("tv_room_init", byref(self._pointer), byref(wanted),
                          c_void_p(self._memory.ctypes.data + start), c_size_t(memory_bytes))
        self._lock = threading.RLock()

    def __enter__(self) -> Room:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def close(self) -> None:
        with self._lock:
            self._memory = None
            self._pointer = c_void_p()

    def _call(self, function: str, *arguments: Any) -> None:
        with self._lock:
            if self._memory is None:
                raise ValueError(f"{function}: the room is closed")
            self.library.call(function, self._pointer, *arguments)

    def add(self, camera: Camera, R: Sequence[Sequence[float]], t: Sequence[float],
            distance: np.ndarray, sigma: Optional[np.ndarray] = None,
            witnesses: Optional[np.ndarray] = None, pixels: Optional[np.ndarray] = None, *,
            mask: Optional[np.ndarray] = None, inferred: bool = False) -> None:
        """tv_room_add: fuses a depth map.

        camera: of the map's width and height. R (3, 3), t (3,): world_from_cam. distance:
        (height, width) float32, along each pixel's ray; 0 or NaN where it is unknown. sigma: the
        same, its standard deviation; None: a hundredth of it. witnesses: (height, width) uint8,
        how many other images confirmed it; 0: unknown. pixels: (height, width) or (height, width,
        3) uint8, the image, grey or red, green, blue. mask: (height, width) uint8 or bool, 0
        where the image shows nothing of the scene, as DepthMap.grey is beyond the edge of a lens;
        None: all of it does. inferred: no view measured these distances.
        Raises TV_ERR_CAPACITY where the room has no memory left: it is then as it was;
        TV_ERR_CAMERA, TV_ERR_ARGUMENT, TV_ERR_NOT_FINITE, TV_ERR_LIMITS (too many maps)."""
        self._fuse("tv_room_add", camera, R, t, distance, sigma, witnesses, pixels, mask, inferred)

    def remove(self, camera: Camera, R: Sequence[Sequence[float]], t: Sequence[float],
               distance: np.ndarray, sigma: Optional[np.ndarray] = None,
               witnesses: Optional[np.ndarray] = None, pixels: Optional[np.ndarray] = None, *,
               mask: Optional[np.ndarray] = None, inferred: bool = False) -> None:
        """tv_room_remove: removes a map that was added with equal arguments, exactly. Raises
        TV_ERR_ARGUMENT where the room holds no such map."""
        self._fuse("tv_room_remove", camera, R, t, distance, sigma, witnesses, pixels, mask,
                   inferred)

    def _fuse(self, function: str, camera: Camera, R: Any, t: Any, *arrays: Any) -> None:
        depth, kept = depth_map(self.library, camera, R, t, *arrays)
        self._call(function, byref(depth))
        del kept

    def see_through(self, camera: Camera, R: Sequence[Sequence[float]], t: Sequence[float],
                    distance: np.ndarray, sigma: Optional[np.ndarray] = None,
                    witnesses: Optional[np.ndarray] = None,
                    pixels: Optional[np.ndarray] = None, *,
                    mask: Optional[np.ndarray] = None) -> None:
        """tv_room_see_through: adds a map that is in the room to the blocks that were made after
        it: it sees through them, and takes back what prune freed of its surface.
        Raises TV_ERR_ARGUMENT where the room holds no such map."""
        self._fuse("tv_room_see_through", camera, R, t, distance, sigma, witnesses, pixels, mask,
                   False)

    def find_planes(self, options: Optional[RoomPlaneOptions] = None, *, max_planes: int = 64,
                    **keywords: Any) -> np.ndarray:
        """tv_room_find_planes: the planes of the measured surface, the largest first, of dtype
        twoview.ROOM_PLANE; kind is a RoomPlaneKind. options: a RoomPlaneOptions, or its fields as
        keywords."""
        wanted = to_struct(self.library, RoomPlaneOptions, options, keywords)
        if not 0 <= max_planes <= 64:
            raise ValueError(f"max_planes: {max_planes} is out of range")
        planes, count = np.zeros(max_planes, _abi.ROOM_PLANE), c_int32()
        self._call("tv_room_find_planes", byref(wanted), _abi.pointer(planes),
                   c_int32(max_planes), byref(count))
        return planes[:count.value].copy()

    def infer(self, planes: np.ndarray, camera: Camera, R: Sequence[Sequence[float]],
              t: Sequence[float], distance: np.ndarray, sigma: Optional[np.ndarray] = None,
              witnesses: Optional[np.ndarray] = None, pixels: Optional[np.ndarray] = None, *,
              mask: Optional[np.ndarray] = None, options: Optional[RoomInferOptions] = None,
              **keywords: Any) -> tuple[np.ndarray, np.ndarray]:
        """tv_room_infer: distances and sigmas, (height, width) float32, of what a map lacks, along
        planes that find_planes returned; 0 where nothing was inferred. pixels: not None. mask: as
        for add; nothing is inferred where it is 0. They are for add(..., inferred=True), and then
        see_through with each measured map."""
        wanted = to_struct(self.library, RoomInferOptions, options, keywords)
        planes = _abi.check_array("planes", planes, _abi.ROOM_PLANE)
        wanted.planes, wanted.num_planes = planes.ctypes.data, len(planes)
        depth, kept = depth_map(self.library, camera, R, t, distance, sigma, witnesses, pixels,
                                mask, False)
        size, count = c_size_t(), c_int32()
        self.library.call("tv_room_infer_size", c_int32(depth.width), c_int32(depth.height),
                          byref(size))
        memory = np.empty(size.value + _abi.CONTEXT_ALIGNMENT, np.uint8)
        memory = memory[-memory.ctypes.data % _abi.CONTEXT_ALIGNMENT:]
        inferred = np.zeros((2, depth.height, depth.width), np.float32)
        self._call("tv_room_infer", _abi.pointer(memory), size, byref(depth), byref(wanted),
                   _abi.pointer(inferred[0]), _abi.pointer(inferred[1]), byref(count))
        del kept
        return inferred[0], inferred[1]

    def prune(self, min_maps: int = 2) -> int:
        """tv_room_prune: frees the memory of what fewer than min_maps maps measured; how many
        blocks that was."""
        freed = c_int32()
        self._call("tv_room_prune", c_int32(min_maps), byref(freed))
        return freed.value

    def coarsen(self) -> None:
        """tv_room_coarsen: doubles the voxel, which leaves about three quarters of the memory
        free. The maps that are in the room can no longer be removed."""
        self._call("tv_room_coarsen")

    @property
    def state(self) -> RoomState:
        """tv_room_get_state: what is in the room."""
        s = self.library.make(_abi.tv_room_state)
        self._call("tv_room_get_state", byref(s))
        return RoomState(s.num_maps, s.num_blocks, s.cap_blocks, s.voxel, np.array(s.min),
                         np.array(s.max))

    def mesh(self, options: Optional[RoomMeshOptions] = None, *,
             planes: Optional[np.ndarray] = None, **keywords: Any) -> RoomMesh:
        """tv_room_mesh: the surface. options: a RoomMeshOptions, or its fields as keywords.
        planes: of find_planes; surface that lies on one of them is drawn to it."""
        wanted = to_struct(self.library, RoomMeshOptions, options, keywords)
        if planes is not None:
            planes = _abi.check_array("planes", planes, _abi.ROOM_PLANE)
            wanted.planes, wanted.num_planes = planes.ctypes.data, len(planes)
        num_vertices, num_triangles = c_int32(), c_int32()
        vertices, triangles = np.zeros(0, _abi.ROOM_VERTEX), np.zeros((0, 3), np.int32)

        def call() -> None:
            self._call("tv_room_mesh", byref(wanted), _abi.pointer(vertices),
                       c_int32(len(vertices)), byref(num_vertices), _abi.pointer(triangles),
                       c_int32(len(triangles)), byref(num_triangles))

        with self._lock:
            try:
                call()
            except _abi.TV_ERR_CAPACITY:
                vertices = np.zeros(num_vertices.value, _abi.ROOM_VERTEX)
                triangles = np.zeros((num_triangles.value, 3), np.int32)
                call()
        return RoomMesh(vertices[:num_vertices.value].copy(),
                        triangles[:num_triangles.value].copy())


def depth_map(library: _abi.Library, camera: Camera, R: Any, t: Any, distance: np.ndarray,
              sigma: Optional[np.ndarray], witnesses: Optional[np.ndarray],
              pixels: Optional[np.ndarray], mask: Optional[np.ndarray],
              inferred: bool) -> tuple[Any, list[Any]]:
    """The tv_depth_map of a view, and what has to live as long."""
    lens = camera_struct("camera", camera)
    rotation, translation = _abi.small_array("R", R, 3, 3), _abi.small_array("t", t, 3)
    shape = np.shape(distance)
    if len(shape) != 2 or 0 in shape or max(shape) >= 2**31:
        raise ValueError(f"distance: shape (height, width) is expected, not {shape}")
    fields: dict[str, Any] = {"width": shape[1], "height": shape[0], "stride": shape[1],
                              "mask_stride_bytes": shape[1], "inferred": int(inferred),
                              "camera": addressof(lens), "world_from_cam_R": rotation.ravel(),
                              "world_from_cam_t": translation}
    kept: list[Any] = [lens]
    for name, array, dtype in (("distance", distance, np.float32), ("sigma", sigma, np.float32),
                               ("witnesses", witnesses, np.uint8),
                               ("mask", _abi.mask_bytes(mask), np.uint8)):
        if array is None:
            continue
        if np.shape(array) != shape:
            raise ValueError(f"{name}: shape {shape} is expected, not {np.shape(array)}")
        kept.append(_abi.check_array(name, array, dtype, shape[1]))
        fields[name] = kept[-1].ctypes.data
    if pixels is not None:
        if np.shape(pixels) not in (shape, (*shape, 3)):
            raise ValueError(f"pixels: shape {shape} or {(*shape, 3)} is expected, not "
                             f"{np.shape(pixels)}")
        kept.append(_abi.check_array("pixels", pixels, np.uint8, *np.shape(pixels)[1:]))
        fields.update(pixels=kept[-1].ctypes.data, channels=1 if kept[-1].ndim == 2 else 3,
                      pixel_stride_bytes=kept[-1].strides[0])
    return library.make(_abi.tv_depth_map, fields), kept
