"""A room's surface out of a flight: for each keyframe the views that show its scene from elsewhere,
its depth map, and the fusion of all."""

import math
import time
from dataclasses import dataclass, field

import cv2
import numpy as np
import twoview as tv

# A partner's distance from the keyframe that is aimed at, as a share of the median depth, and on
# which side of the first one it should lie.
WANTED = ((0.1, 1), (0.1, -1), (0.2, 1), (0.2, -1))
NEIGHBOURS = 120  # frames before and after a keyframe among which its partners are looked for
MOST_TURN = 0.35  # radians between the axes of a keyframe and a partner
LEAST_WITNESSES = 2  # of a depth that is measured
LEAST_SHARE = 8  # so much of the memory is freed at least, or voxels become coarser
TRUNCATION_VOXELS = 5  # three standard deviations of a depth, 1.8 % of it in the median
MOST_SIGMA_VOXELS = 1.5  # of surface that is kept, as in `twoview room`


@dataclass
class Settings:
    voxel: float = 0.03  # in the unit of the poses
    memory_mib: int = 64
    measured_only: bool = False  # no planes across plain walls
    min_maps: int = 2


@dataclass
class Model:
    vertices: np.ndarray  # of twoview.ROOM_VERTEX
    triangles: np.ndarray
    planes: np.ndarray
    voxel: float
    keyframes: list = field(default_factory=list)  # (index of the frame, DepthMap)
    ms_depth: float = 0.0  # CPU time a keyframe
    ms_fusion: float = 0.0
    ms_mesh: float = 0.0  # in all


def choose_partners(flight, index, median_depth):
    """The frames that show the keyframe's scene from a fitting distance, in different
    directions."""
    first = max(0, index - NEIGHBOURS)
    others = np.array([i for i in range(first, min(len(flight.names), index + NEIGHBOURS + 1))
                       if i != index])
    away = (flight.centres[others] - flight.centres[index]) @ flight.R[index]
    length = np.linalg.norm(away, axis=1)
    cosine = (np.einsum("kij,ij->k", flight.R[others], flight.R[index]) - 1) / 2
    turn = np.arccos(np.clip(cosine, -1, 1))
    usable = (length > 0.02 * median_depth) & (turn < MOST_TURN)
    others, away, length, turn = others[usable], away[usable], length[usable], turn[usable]
    chosen, direction = [], None
    unit = away / np.maximum(length, 1e-9)[:, None]
    for share, side in WANTED:
        if not len(others):
            break
        # A distance off by a factor e counts as much as a turn of half a radian or a step ahead.
        cost = (np.abs(np.log(length / (share * median_depth))) + 2 * turn +
                0.5 * np.abs(unit[:, 2]))
        if direction is not None:
            cost -= 0.6 * side * (unit @ direction)
        cost[np.isin(others, chosen)] = np.inf
        best = int(cost.argmin())
        if not np.isfinite(cost[best]):
            break
        chosen.append(int(others[best]))
        direction = unit[best] if direction is None else direction
    return chosen


def depth_of(flight, index, pictures):
    """The DepthMap of a keyframe; None where nothing shows its scene from elsewhere."""
    found = flight.depth_range(index)
    partners = choose_partners(flight, index, found[1]) if found else []
    if not partners:
        return None
    views = [index] + partners
    return tv.sweep_depth([pictures(i) for i in views], [flight.camera] * len(views),
                          flight.R[views], flight.centres[views], near_depth=found[0],
                          far_depth=found[2])


class Fusion:
    """A room and the keyframes in it, in memory given beforehand, as `twoview room` has it: where
    it is full, what one keyframe alone saw makes way; else all are fused again, coarser."""

    def __init__(self, settings):
        self.settings, self.keyframes = settings, []  # (index of the frame, pose, arrays)
        self.begin(settings.voxel)

    def begin(self, voxel):
        truncation = math.ceil(TRUNCATION_VOXELS * self.settings.voxel / voxel)
        self.room = tv.Room(self.settings.memory_mib << 20, voxel=voxel,
                            truncation_voxels=max(2, truncation))

    def add(self, pose, arrays, **keywords):
        """Whether there is memory for a map."""
        for is_last in (False, True):
            try:
                self.room.add(*pose, *arrays, **keywords)
                return True
            except tv.TV_ERR_CAPACITY:
                if is_last:
                    return False
                self.see_through()
                freed = self.room.prune(self.settings.min_maps)
                if freed < self.room.state.cap_blocks // LEAST_SHARE:
                    return False

    def add_keyframe(self, *keyframe):
        self.keyframes.append(keyframe)
        waiting = [keyframe]
        while not all(self.add(pose, arrays, mask=arrays[3]) for _, pose, arrays in waiting):
            voxel = 2 * self.room.state.voxel
            self.room.close()
            self.begin(voxel)
            waiting = self.keyframes

    def see_through(self):
        for _, pose, arrays in self.keyframes:
            try:
                self.room.see_through(*pose, *arrays, mask=arrays[3])
            except tv.TV_ERR_ARGUMENT:
                pass  # not added yet

    def infer(self, planes):
        for _, pose, arrays in self.keyframes:
            distance, sigma = self.room.infer(planes, *pose, *arrays, mask=arrays[3])
            if distance.any():
                self.add(pose, (distance, sigma), inferred=True)  # or is left out
        self.see_through()


def make(flight, settings=Settings(), depth_of=depth_of):
    """The Model of a Flight; depth_of: what makes the maps, a peer perhaps."""
    def pictures(i):
        return cv2.imread(f"{flight.folder}/{flight.names[i]}", cv2.IMREAD_GRAYSCALE)

    fusion = Fusion(settings)
    spent_depth, spent_fusion = 0.0, 0.0
    for index in flight.keyframes:
        begin = time.process_time()
        found = depth_of(flight, index, pictures)
        spent_depth += time.process_time() - begin
        if found is None:
            continue
        begin = time.process_time()
        measured = np.where(found.witnesses >= LEAST_WITNESSES, found.distance, 0)
        # grey is 0 where the lens shows nothing, which makes it the mask as well
        arrays = (measured, found.sigma, found.witnesses, found.grey)
        fusion.add_keyframe(index, (found.camera, flight.R[index], flight.centres[index]), arrays)
        spent_fusion += time.process_time() - begin
    begin = time.process_time()
    fusion.see_through()
    room = fusion.room
    planes = room.find_planes(min_maps_behind=settings.min_maps)
    if not settings.measured_only:
        fusion.infer(planes)
    mesh = room.mesh(measured_only=settings.measured_only, min_maps=settings.min_maps,
                     planes=planes, max_sigma=MOST_SIGMA_VOXELS * room.state.voxel)
    spent_mesh = time.process_time() - begin
    num = max(len(fusion.keyframes), 1)
    model = Model(mesh.vertices, mesh.triangles, planes, room.state.voxel, fusion.keyframes,
                  1e3 * spent_depth / num, 1e3 * spent_fusion / num, 1e3 * spent_mesh)
    room.close()
    return model
