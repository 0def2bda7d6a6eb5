"""Fuses a vehicle's attitudes and velocities with the odometry: docs/fusion.md says what and why.
usage: 18_fusion.py FLIGHT, a folder with cameras.yaml, frames.txt, groundtruth.txt and imu.txt
(a sample a frame), such as `twoview_flights --seed 0 -o FLIGHT` makes"""
import pathlib
import sys

import imageio.v3 as imageio
import numpy as np
import twoview as tv
from fusion_filter import Filter, cross


def rows(path):
    with open(path, encoding="utf-8") as file:
        return [line.split() for line in file if not line.startswith("#")]


def matrix(w, x, y, z):
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


class Vehicle:
    """What imu.txt says. Velocities are along the world's axes, in m/s."""

    def __init__(self, path):
        (_, *body_from_cam), *samples = rows(path)
        samples = np.array(samples, float)
        world_from_body = np.array([matrix(*q) for q in samples[:, 1:5]])
        self.times, self.attitude_sigma = samples[:, 0], samples[0, 5]
        self.world_from_cam = world_from_body @ matrix(*map(float, body_from_cam))
        self.velocities = np.einsum("kij,kj->ki", world_from_body, samples[:, 8:11])
        self.velocity_sigma = samples[:, 11]

    def predict(self, kalman, k):
        """From sample k - 1 to sample k. Neighbouring steps share a velocity, so that their errors
        add up as if each step had one of its own."""
        kalman.predict((self.velocities[k - 1] + self.velocities[k]) / 2, self.velocity_sigma[k],
                       self.times[k] - self.times[k - 1])


def newest_pair(odometry, num_keyframes):
    """The two keyframes before the newest one, which only the next frame adjusts, and the
    covariance of their relative pose; None where they do not compare."""
    if num_keyframes < 3:
        return None
    k0, k1 = (odometry.keyframe(num_keyframes - back) for back in (3, 2))
    covariance = odometry.covariance(num_keyframes - 2)
    return None if covariance is None or k0.segment != k1.segment else (k0, k1, covariance)


def track(folder):
    """Yields, for each frame: the state, and at a keyframe its id and the newest pair. The odometry
    gets the pictures alone: what the filter fuses must not be in its map already."""
    with tv.Odometry(tv.read_camera(folder / "cameras.yaml")) as odometry:
        for time, name in rows(folder / "frames.txt"):
            image = np.ascontiguousarray(imageio.imread(folder / name, mode="L"))
            state, count = odometry.track(image, float(time)), 0
            if state.is_keyframe:
                count = state.num_keyframes
            yield (state, odometry.keyframe(count - 1).id if count else None,
                   newest_pair(odometry, count))


def fuse(kalman, vehicle, state, keyframe_id, pair):
    """After each frame. True: a pair was fused."""
    has_moved = state.loop_closed or state.relocated
    if has_moved:
        kalman.segment = None  # the map's unit may be another one here
    if state.is_keyframe:
        kalman.clone(keyframe_id)
    if not pair or has_moved or state.status != tv.OdometryStatus.TRACKING:
        return False
    k0, k1, covariance = pair
    t, R = k1.R.T @ (k0.t - k1.t), vehicle.world_from_cam[k1.frame]  # t: of cam1_from_cam0
    J = R @ np.hstack([-cross(t), np.eye(3)])  # of cam1_from_cam0, x_true = exp([w]x) x + v
    return kalman.fuse(k0.id, k1.id, k1.segment, -R @ t, J @ covariance @ J.T)


def main():
    folder = pathlib.Path(sys.argv[1]) if len(sys.argv) == 2 else sys.exit(__doc__)
    vehicle = Vehicle(folder / "imu.txt")
    kalman = Filter(vehicle.attitude_sigma)
    truth = np.loadtxt(folder / "groundtruth.txt")[:, 1:4]
    for k, (state, keyframe_id, pair) in enumerate(track(folder)):
        if k > 0:
            vehicle.predict(kalman, k)
        if fuse(kalman, vehicle, state, keyframe_id, pair):
            position, P = kalman.position()
            error = np.linalg.norm(position - (truth[k] - truth[0]))
            unit, sigma = np.exp(kalman.x[6]), np.sqrt(kalman.P[6, 6])
            print(f"{vehicle.times[k]:7.2f} s: {error:.3f} m off, sigma {np.sqrt(np.trace(P)):.3f}"
                  f", a unit is {unit:.3f} m +- {100 * sigma:.1f} %")


if __name__ == "__main__":
    main()
