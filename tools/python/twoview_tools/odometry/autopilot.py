"""Whether the estimates that an autopilot gets lead its filter astray: rendered flights whose
camera is covered, switched off, in another room or sees a person; the driver's own estimates
(tvm_estimator), fused by an error-state filter with the noises and gates that PX4 and ArduPilot
document.

The filter has position, velocity and the accelerometer's bias; the attitude is the vehicle's. Its
accelerometer is the flight's true acceleration with noise and a bias. A reset counter that changed
resets position and velocity, as both autopilots do.

For each run: frames after the first estimate; of these those with an estimate within the last
second ("fed"); of these those whose position is off by more than three of the filter's own standard
deviations along some axis ("astray"); the largest error in standard deviations, and in metres; and
the longest silence.

  scripts/python -m twoview_tools.odometry.autopilot --flights 20"""

import argparse
import ctypes
import os
import tempfile

import numpy as np
import twoview as tv
from twoview import _abi

from . import faults, flights
from .poses import rotations_of
from .set_writer import SetWriter
from .sets import DESCRIPTIONS, read_set

KINDS = ("none", "black", "covered", "other_room", "person", "off", "dropped")
OFF_S = 1.5

# Floors of the standard deviations of position and velocity, gates in standard deviations, noise of
# the accelerometer and of its bias a second (m/s^2): EKF2_EVP_NOISE, EKF2_EVV_NOISE, EKF2_EVP_GATE,
# EKF2_EVV_GATE, EKF2_ACC_NOISE, EKF2_ACC_B_NOISE; VISO_POS_M_NSE, VISO_VEL_M_NSE, EK3_POS_I_GATE,
# EK3_VEL_I_GATE, EK3_ACC_P_NSE, EK3_ABIAS_P_NSE.
AUTOPILOTS = {"PX4": (0.1, 0.1, 5.0, 3.0, 0.35, 0.003),
              "ArduPilot": (0.2, 0.1, 5.0, 5.0, 0.35, 0.02)}
TIMEOUT_S = 5.0  # of refused estimates, after which the filter starts anew from the next one
# Of the simulated accelerometer, in m/s^2: the standard deviations of each sample's noise (25
# samples a second), and of the constant bias, which is drawn once a run for each axis.
ACCELEROMETER = (0.1, 0.05)


class _Options(ctypes.Structure):
    _fields_ = [("struct_size", ctypes.c_uint32), ("messages", ctypes.c_int32),
                ("weak", ctypes.c_int32), ("world", ctypes.c_int32),
                ("weak_factor", ctypes.c_double), ("body_from_camera", ctypes.c_double * 9),
                ("camera_in_body", ctypes.c_double * 3), ("drift_share", ctypes.c_double),
                ("drift_turn_rad", ctypes.c_double), ("filter_memory_s", ctypes.c_double)]


class _Track(ctypes.Structure):
    _fields_ = [("struct_size", ctypes.c_uint32), ("has_previous", ctypes.c_int32),
                ("state", ctypes.POINTER(_abi.tv_odometry_state)), ("host_ns", ctypes.c_int64),
                ("previous_R", ctypes.c_double * 9), ("previous_t", ctypes.c_double * 3),
                ("time_us", ctypes.c_uint64), ("is_upright", ctypes.c_int32),
                ("reserved", ctypes.c_int32), ("heading_rad", ctypes.c_double)]


class _Estimate(ctypes.Structure):
    _fields_ = [("struct_size", ctypes.c_uint32), ("silence", ctypes.c_int32),
                ("time_us", ctypes.c_uint64), ("world", ctypes.c_int32),
                ("reset_counter", ctypes.c_int32), ("quality", ctypes.c_int32),
                ("has_covariance", ctypes.c_int32), ("position_m", ctypes.c_double * 3),
                ("world_from_body", ctypes.c_double * 4), ("velocity_m_s", ctypes.c_double * 3),
                ("rate_rad_s", ctypes.c_double * 3), ("pose_covariance", ctypes.c_double * 36),
                ("velocity_covariance", ctypes.c_double * 36)]


def rotation(w, x, y, z):
    return rotations_of([x, y, z, w])[0]


def check(status, call):
    if status != 0:
        raise RuntimeError(f"{call} returned {status}")


class Tracker(tv.Odometry):
    """Keeps the struct that the last frame filled."""

    raw = None

    def _call(self, name, *arguments):
        super()._call(name, *arguments)
        if name == "tv_odometry_track":
            self.raw = arguments[1]._obj  # pylint: disable=protected-access


class Estimator:
    """tvm_estimator of the driver beside the library."""

    def __init__(self, library_path, body_from_camera, weak):
        path = os.path.join(os.path.dirname(os.path.realpath(library_path)),
                            "libtwoview_mavlink.so")
        self._driver = ctypes.CDLL(path)
        options = _Options()
        self._driver.tvm_estimator_options_init_sized(ctypes.byref(options),
                                                      ctypes.c_size_t(ctypes.sizeof(options)))
        options.weak = weak
        options.body_from_camera[:] = body_from_camera.ravel().tolist()
        self._estimator = ctypes.create_string_buffer(4096)  # more than sizeof(tvm_estimator)
        check(self._driver.tvm_estimator_init(self._estimator, ctypes.byref(options)),
              "tvm_estimator_init")

    def update(self, raw, time_s, previous, is_upright):
        track, estimate = _Track(), _Estimate()
        track.struct_size, estimate.struct_size = ctypes.sizeof(track), ctypes.sizeof(estimate)
        track.state, track.host_ns = ctypes.pointer(raw), int(1e9 * time_s)
        track.time_us, track.is_upright = int(1e6 * time_s), int(is_upright)
        if previous is not None:
            track.has_previous = 1
            track.previous_R[:] = previous[0].ravel().tolist()
            track.previous_t[:] = previous[1].tolist()
        check(self._driver.tvm_estimator_update(self._estimator, ctypes.byref(track),
                                                ctypes.byref(estimate)), "tvm_estimator_update")
        return estimate


class Message:
    """What an estimate says of a frame: position and velocity along the world's axes."""

    def __init__(self, estimate):
        turn = rotation(*estimate.world_from_body)
        self.reset = estimate.reset_counter
        self.position, self.velocity = np.array(estimate.position_m), turn @ estimate.velocity_m_s
        self.position_covariance = np.reshape(estimate.pose_covariance, (6, 6))[:3, :3]
        body = np.reshape(estimate.velocity_covariance, (6, 6))[:3, :3]
        self.velocity_covariance = turn @ body @ turn.T


def messages(folder, weak=0):
    """[(time, Message or None, the true place of the segment's origin or None)] of each frame."""
    import cv2
    source = read_set(folder)
    truth = source.truth()
    with open(os.path.join(folder, "imu.txt"), encoding="ascii") as file:
        lines = [line.split() for line in file if line[0] != "#"]
    body_from_camera = rotation(*map(float, lines[0][1:]))
    samples = np.array(lines[1:], float)
    origins, found, last = {}, [], None
    with Tracker(tv.read_camera(os.path.join(folder, "cameras.yaml"))) as odometry:
        estimator = Estimator(odometry.library.path, body_from_camera, weak)
        for time, name in zip(source.times, source.names):
            k = int(np.argmin(abs(samples[:, 0] - time)))
            _, *q, sigma, height, height_sigma, vx, vy, vz, v_sigma = samples[k]
            attitude = rotation(*q) @ body_from_camera
            image = cv2.imread(os.path.join(folder, name), cv2.IMREAD_GRAYSCALE)
            state = odometry.track(
                image, time, world_from_cam=attitude, attitude_sigma_rad=sigma,
                height_m=height if np.isfinite(height) else 0,
                height_sigma_m=height_sigma if np.isfinite(height) else 0,
                velocity_m_s=(body_from_camera.T @ (vx, vy, vz)).tolist() if np.isfinite(vx)
                else (0, 0, 0),
                velocity_sigma_m_s=v_sigma if np.isfinite(vx) else 0)
            previous = None
            if last is not None and last.R is not None:
                try:
                    previous = odometry.pose_of(last)
                except (ValueError, tv.StatusError):
                    previous = None
            upright = state.R is not None and (state.R @ attitude.T)[2, 2] > np.cos(
                0.1 + 3 * sigma)
            estimate = estimator.update(odometry.raw, time, previous, upright)
            if state.segment is not None and state.segment not in origins:
                frames = [odometry.keyframe(i) for i in range(state.num_keyframes)]
                first = min((f for f in frames if f.segment == state.segment),
                            key=lambda f: f.frame)
                origins[state.segment] = truth.positions[
                    int(np.argmin(abs(truth.times - source.times[first.frame])))]
            found.append((time, Message(estimate) if estimate.silence == 0 else None,
                          origins.get(state.segment)))
            last = state
    return found


class Filter:
    """Position, velocity and the accelerometer's bias, along the world's axes."""

    def __init__(self, autopilot):
        (self.position_floor, self.velocity_floor, self.position_gate, self.velocity_gate,
         self.noise, self.bias_noise) = AUTOPILOTS[autopilot]
        self.x, self.P = np.zeros(9), np.diag([1e-4] * 6 + [0.1 ** 2] * 3)
        self.reset, self.is_set, self.refused_since = None, False, None

    def predict(self, acceleration, next_acceleration, dt):
        F = np.eye(9)
        F[:3, 3:6], F[3:6, 6:] = dt * np.eye(3), -dt * np.eye(3)
        F[:3, 6:] = -0.5 * dt * dt * np.eye(3)
        mean = 0.5 * (acceleration + next_acceleration)
        self.x = F @ self.x
        self.x[:3] += 0.5 * dt * dt * acceleration
        self.x[3:6] += dt * mean
        G = np.vstack([0.5 * dt * dt * np.eye(3), dt * np.eye(3), np.zeros((3, 3))])
        self.P = F @ self.P @ F.T + self.noise ** 2 * G @ G.T
        self.P[6:, 6:] += self.bias_noise ** 2 * dt * np.eye(3)

    def start(self, message):
        self.x[:3], self.x[3:6] = message.position, message.velocity
        self.P[:6, :], self.P[:, :6] = 0, 0
        self.P[:3, :3] = self._floored(message.position_covariance, self.position_floor)
        self.P[3:6, 3:6] = self._floored(message.velocity_covariance, self.velocity_floor)
        self.reset, self.is_set, self.refused_since = message.reset, True, None

    @staticmethod
    def _floored(covariance, floor):
        return np.diag(np.maximum(np.diag(covariance), floor ** 2))

    def _axis(self, k, value, variance, gate):
        S = self.P[k, k] + variance
        innovation = value - self.x[k]
        if innovation ** 2 > gate ** 2 * S:
            return False
        gain = self.P[:, k] / S
        self.x += gain * innovation
        self.P -= np.outer(gain, self.P[k])
        self.P = 0.5 * (self.P + self.P.T)
        return True

    def fuse(self, time, message):
        if not self.is_set or message.reset != self.reset:
            return self.start(message)
        R = np.diag(self._floored(message.position_covariance, self.position_floor))
        V = np.diag(self._floored(message.velocity_covariance, self.velocity_floor))
        taken = [self._axis(k, message.position[k], R[k], self.position_gate) for k in range(3)]
        for k in range(3):
            self._axis(3 + k, message.velocity[k], V[k], self.velocity_gate)
        if all(taken):
            self.refused_since = None
        elif self.refused_since is None:
            self.refused_since = time
        elif time - self.refused_since > TIMEOUT_S:
            self.start(message)
        return None


def fly(found, truth_times, truth_places, autopilot, seed):
    """A row for each frame after the first message: (time, largest error of an axis in the filter's
    standard deviations, error in metres, seconds since a message)."""
    random = np.random.default_rng(seed)
    dt = np.diff(truth_times)
    acceleration = np.zeros_like(truth_places)
    velocity = np.diff(truth_places, axis=0) / dt[:, None]
    acceleration[1:-1] = np.diff(velocity, axis=0) / (0.5 * (dt[1:] + dt[:-1]))[:, None]
    bias = ACCELEROMETER[1] * random.normal(size=3)
    measured = acceleration + bias + ACCELEROMETER[0] * random.normal(size=acceleration.shape)
    said = {round(time, 6): (message, origin) for time, message, origin in found}
    kalman, origin, heard = Filter(autopilot), None, -np.inf
    rows = []
    for k, time in enumerate(truth_times):
        if k > 0:
            kalman.predict(measured[k - 1], measured[k], dt[k - 1])
        message, place = said.get(round(float(time), 6), (None, None))
        if message is not None:
            kalman.fuse(time, message)
            origin, heard = place, time
        if kalman.is_set:
            error = kalman.x[:3] - (truth_places[k] - origin)
            rows.append((time, np.abs(error / np.sqrt(np.diag(kalman.P)[:3])).max(),
                         np.linalg.norm(error), time - heard))
    return rows


def make(kind, source, folder, other):
    """The folder of a flight with a fault. off: the pictures of OFF_S seconds are missing."""
    if kind == "none":
        return source
    if kind == "off":
        read = read_set(source)
        writer = SetWriter(read, folder, DESCRIPTIONS)
        middle = 0.5 * (read.times[0] + read.times[-1])
        for k, time in enumerate(read.times):
            if not middle <= time < middle + OFF_S:
                writer.keep(k)
        return writer.finish(kind, [[middle, middle + OFF_S]])
    return faults.inject(kind, source, folder, other)


def line(run, rows):
    """A run's line of the table."""
    fed = [row for row in rows if row[3] < 1]
    if not fed:
        return f"{run}   no message"
    sigmas = [row[1] for row in fed]
    return (f"{run}{len(rows):7d}{len(fed):6d}{sum(value > 3 for value in sigmas):7d}"
            f"{max(sigmas):8.2f}{max(row[2] for row in fed):8.3f}"
            f"{max(row[3] for row in rows):9.2f}")


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    flights.add_arguments(parser)
    parser.add_argument("--kinds", default=",".join(KINDS), help="faults (%(default)s)")
    parser.add_argument("--seeds", type=int, default=3, help="of the accelerometer (%(default)s)")
    parser.add_argument("--weak", action="store_true", help="weak frames are sent, too")
    arguments = parser.parse_args(argv)
    folders = flights.chosen(parser, arguments)
    print(f"{'flight':10}{'fault':12}{'autopilot':11}{'frames':>7}{'fed':>6}{'astray':>7}"
          f"{'sigmas':>8}{'metres':>8}{'silent s':>9}")
    with tempfile.TemporaryDirectory() as scratch:
        for n, folder in enumerate(folders):
            name, truth = os.path.basename(os.path.normpath(folder)), read_set(folder).truth()
            for kind in arguments.kinds.split(","):
                made = make(kind, folder, os.path.join(scratch, kind),
                            folders[(n + 1) % len(folders)])
                found = messages(made, int(arguments.weak))
                for autopilot in AUTOPILOTS:
                    for seed in range(arguments.seeds):
                        rows = fly(found, truth.times, truth.positions, autopilot, seed)
                        print(line(f"{name:10}{kind:12}{autopilot:11}", rows), flush=True)


if __name__ == "__main__":
    main()
