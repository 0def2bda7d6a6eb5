"""Whether the estimates that an autopilot gets lead its filter astray: rendered flights whose
camera is covered, switched off, in another room or sees a person; the driver's own estimates
(tvm_estimator), fused by an error-state filter with the noises and gates that PX4 and ArduPilot
document.

The filter has position, velocity and the accelerometer's bias; the attitude is the vehicle's. Its
accelerometer is the flight's true acceleration with noise and a bias. A reset counter that changed
resets position and velocity, as both autopilots do.

For each run: frames after the first estimate; of these those with an estimate within the last
second ("fed"); of these those whose position is off by more than three of the filter's own standard
deviations along some axis ("astray"); the largest error in standard deviations, and in metres; the
longest silence; and the seconds from the end of the fault to the next frame that has an estimate
and whose position is within three standard deviations ("back"). The places of a later segment, to
which the filter is reset, are measured from where its first message puts it.

Of the estimates themselves, for each flight without a fault: the mean squared error of position and
of attitude a degree of freedom, in units of the covariance that is sent and of that of one message
(NEES). The errors of a flight's messages are nearly one error, so the 95 % band of a flight is that
of one draw with three degrees of freedom.

  scripts/python -m twoview_tools.odometry.autopilot --flights 20 --keep FOLDER --rows FILE

A run that was stopped goes on where it was: --keep has what the odometry said of each flight, which
does not depend on the driver, and --rows the rows that are done."""

import argparse
import ctypes
import json
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
NEES_BAND = (0.2158 / 3, 9.348 / 3)  # 2.5 and 97.5 % of chi square with three degrees, a degree
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
                ("reserved", ctypes.c_int32), ("heading_rad", ctypes.c_double),
                ("velocity_m_s", ctypes.c_double * 3), ("velocity_sigma_m_s", ctypes.c_double)]


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

    def __init__(self, library_path, body_from_camera, weak, memory_s=None):
        path = os.path.join(os.path.dirname(os.path.realpath(library_path)),
                            "libtwoview_mavlink.so")
        self._driver = ctypes.CDLL(path)
        options = _Options()
        self._driver.tvm_estimator_options_init_sized(ctypes.byref(options),
                                                      ctypes.c_size_t(ctypes.sizeof(options)))
        options.weak = weak
        if memory_s is not None:
            options.filter_memory_s = memory_s
        options.body_from_camera[:] = body_from_camera.ravel().tolist()
        self._estimator = ctypes.create_string_buffer(4096)  # more than sizeof(tvm_estimator)
        check(self._driver.tvm_estimator_init(self._estimator, ctypes.byref(options)),
              "tvm_estimator_init")

    def update(self, raw, time_s, previous, is_upright, velocity=None):
        """velocity: of the vehicle along its axes, and its sigma."""
        track, estimate = _Track(), _Estimate()
        track.struct_size, estimate.struct_size = ctypes.sizeof(track), ctypes.sizeof(estimate)
        track.state, track.host_ns = ctypes.pointer(raw), int(1e9 * time_s)
        track.time_us, track.is_upright = int(1e6 * time_s), is_upright
        if velocity is not None and np.isfinite(velocity).all():
            track.velocity_m_s[:], track.velocity_sigma_m_s = velocity[:3].tolist(), velocity[3]
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


def track(folder):
    """What the odometry says of a set's frames, as arrays with a row a frame: time; state (the
    bytes of tv_odometry_state); previous (R and t of the frame before in the map as it is now, or
    NaN); upright; velocity (the vehicle's, along its axes, and the sigma; or NaN); origin (the true
    place of the segment's origin, or NaN). And body (the mount), fault (the first and the last time
    of each fault)."""
    import cv2
    source = read_set(folder)
    truth = source.truth()
    with open(os.path.join(folder, "imu.txt"), encoding="ascii") as file:
        lines = [line.split() for line in file if line[0] != "#"]
    body_from_camera = rotation(*map(float, lines[0][1:]))
    samples = np.array(lines[1:], float)
    unknown = np.full(3, np.nan)
    rows, origins, last, metric = [], {None: unknown}, None, False
    with Tracker(tv.read_camera(os.path.join(folder, "cameras.yaml"))) as odometry:
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
            previous = np.full(12, np.nan)
            if last is not None and last.R is not None:
                try:
                    R, t, _ = odometry.pose_of(last)
                    previous = np.concatenate([R.ravel(), t])
                except (ValueError, tv.StatusError):
                    pass
            upright = state.R is not None and (state.R @ attitude.T)[2, 2] > np.cos(
                0.1 + 3 * sigma)
            # The unit of the map is not its last one before it is the metre.
            if state.segment not in origins or (state.segment is not None and not metric):
                metric = odometry.raw.scale_source != 0
                frames = [odometry.keyframe(i) for i in range(state.num_keyframes)]
                first = min((f for f in frames if f.segment == state.segment),
                            key=lambda f: f.frame)
                origins[state.segment] = truth.positions[
                    int(np.argmin(abs(truth.times - source.times[first.frame])))] - first.t
            rows.append((time, np.frombuffer(bytes(odometry.raw), np.uint8), previous, upright,
                         samples[k][8:12], origins[state.segment]))
            last = state
    columns = [np.array(column) for column in zip(*rows)]
    said = dict(zip(("time", "state", "previous", "upright", "velocity", "origin"), columns))
    said["body"], said["fault"] = body_from_camera, np.reshape(fault_of(folder), (-1, 2))
    return said


def fault_of(folder):
    """[[first, last] time of a fault] of a set's folder."""
    path = os.path.join(folder, "fault.json")
    if not os.path.isfile(path):
        return []
    with open(path, encoding="utf-8") as file:
        return json.load(file)["intervals"]


def estimates(said, weak=0, memory_s=None):
    """[(time, _Estimate, the true place of the segment's origin)] of each frame of track()."""
    estimator = Estimator(_abi.default_library().path, said["body"], weak, memory_s)
    found = []
    for k, time in enumerate(said["time"]):
        raw = _abi.tv_odometry_state.from_buffer_copy(said["state"][k].tobytes())
        previous = said["previous"][k]
        previous = (previous[:9], previous[9:]) if np.isfinite(previous[0]) else None
        upright = (1 if said["upright"][k] else -1) if raw.has_pose else 0
        found.append((float(time), estimator.update(raw, time, previous, upright,
                                                    said["velocity"][k]), said["origin"][k]))
    return found


def messages(said, truth, weak=0):
    """[(time, Message or None, the true place of the segment's origin)] of each frame. A later
    segment is another frame of coordinates, to which the filter is reset: its origin is where its
    first message puts it."""
    found, first, later = [], None, {}
    for k, (time, estimate, origin) in enumerate(estimates(said, weak)):
        if estimate.silence != 0:
            found.append((time, None, origin))
            continue
        message = Message(estimate)
        segment = _abi.tv_odometry_state.from_buffer_copy(said["state"][k].tobytes()).segment
        first = segment if first is None else first
        if segment > first:
            place = truth.positions[int(np.argmin(abs(truth.times - time)))]
            origin = later.setdefault(segment, place - message.position)
        found.append((time, message, origin))
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


def result(rows, fault):
    """A run's row: what the table has of it. fault: [[first, last] time]."""
    fed = [row for row in rows if row[3] < 1]
    if not fed:
        return {"frames": len(rows), "fed": 0}
    back = None
    if len(fault):
        end = max(last for _, last in fault)
        back = min((row[0] - end for row in rows if row[0] > end and row[3] == 0 and row[1] <= 3),
                   default=np.inf)
    return {"frames": len(rows), "fed": len(fed), "astray": int(sum(row[1] > 3 for row in fed)),
            "sigmas": max(row[1] for row in fed), "metres": max(row[2] for row in fed),
            "silent": max(row[3] for row in rows), "back": back}


def line(row):
    """A run's line of the table."""
    run = f"{row['flight']:10}{row['fault']:12}{row['autopilot']:11}"
    if not row["fed"]:
        return f"{run}   no message"
    back = "-" if row["back"] is None else f"{row['back']:.2f}"
    return (f"{run}{row['frames']:7d}{row['fed']:6d}{row['astray']:7d}{row['sigmas']:8.2f}"
            f"{row['metres']:8.3f}{row['silent']:9.2f}{back:>7}")


def summary(rows):
    """The lines of the table of faults: runs, those that are astray somewhere, the largest error in
    standard deviations, and how many are back within a second."""
    lines = [f"{'fault':12}{'autopilot':11}{'runs':>5}{'astray':>7}{'sigmas':>8}{'metres':>8}"
             f"{'back in 1 s':>13}"]
    for kind in dict.fromkeys(row["fault"] for row in rows):
        for autopilot in AUTOPILOTS:
            runs = [row for row in rows if (row["fault"], row["autopilot"]) == (kind, autopilot)
                    and row["fed"]]
            if not runs:
                continue
            timed = [row["back"] for row in runs if row["back"] is not None]
            back = f"{sum(value <= 1 for value in timed)} of {len(timed)}" if timed else "-"
            lines.append(f"{kind:12}{autopilot:11}{len(runs):5d}"
                         f"{sum(row['astray'] > 0 for row in runs):7d}"
                         f"{max(row['sigmas'] for row in runs):8.2f}"
                         f"{max(row['metres'] for row in runs):8.3f}{back:>13}")
    return lines


def euler(R):
    """Roll, pitch, yaw."""
    return np.array([np.arctan2(R[2, 1], R[2, 2]), -np.arcsin(R[2, 0]),
                     np.arctan2(R[1, 0], R[0, 0])])


def consistency(said, truth, memory_s=None):
    """[(squared error of position, of attitude)] a degree of freedom, in units of the covariances,
    of each estimate."""
    found = []
    for time, estimate, origin in estimates(said, memory_s=memory_s):
        if estimate.silence != 0 or not estimate.has_covariance:
            continue
        k = int(np.argmin(abs(truth.times - time)))
        place = np.array(estimate.position_m) - (truth.positions[k] - origin)
        turn = euler(rotation(*estimate.world_from_body)) - euler(
            truth.rotations[k] @ said["body"].T)
        turn = (turn + np.pi) % (2 * np.pi) - np.pi
        covariance = np.reshape(estimate.pose_covariance, (6, 6))
        found.append([error @ np.linalg.solve(block, error) / 3 for error, block in (
            (place, covariance[:3, :3]), (turn, covariance[3:, 3:]))])
    return np.array(found)


def kept(folder, name, make_set):
    """track() of a set, which is kept in a folder, if there is one."""
    path = os.path.join(folder, name + ".npz") if folder else None
    if path and os.path.isfile(path):
        with np.load(path) as file:
            return dict(file)
    said = track(make_set())
    if path:
        os.makedirs(folder, exist_ok=True)
        np.savez_compressed(path + ".unfinished.npz", **said)
        os.rename(path + ".unfinished.npz", path)
    return said


def read_rows(path):
    if not path or not os.path.isfile(path):
        return []
    with open(path, encoding="utf-8") as file:
        return [json.loads(text) for text in file]


def fault_rows(name, kind, said, truth, seeds, weak):
    """The rows of a flight with a fault."""
    found, rows = messages(said, truth, weak), []
    for autopilot in AUTOPILOTS:
        for seed in range(seeds):
            flown = fly(found, truth.times, truth.positions, autopilot, seed)
            rows.append({"flight": name, "fault": kind, "autopilot": autopilot, "seed": seed,
                         **result(flown, said["fault"])})
    if kind == "none":
        for memory_s in (None, 0):
            squares = consistency(said, truth, memory_s)
            rows.append({"flight": name, "fault": kind, "memory_s": memory_s,
                         "nees": squares.mean(axis=0).tolist() if len(squares) else None})
    return rows


def nees_lines(rows):
    """Of the flights' means of the NEES: quantiles, and how many are within the band."""
    lines = [f"{'NEES of':12}{'covariance':14}{'flights':>8}{'least':>7}{'10 %':>7}{'median':>7}"
             f"{'90 %':>7}{'most':>7}{'below':>7}{'in band':>8}{'above':>7}"]
    for memory_s, words in ((None, "sent"), (0, "one message")):
        of = [row["nees"] for row in rows if row.get("memory_s", "") == memory_s
              and row.get("nees")]
        for column, word in enumerate(("position", "attitude")):
            values = np.array([value[column] for value in of])
            if not len(values):
                continue
            low, high = values < NEES_BAND[0], values > NEES_BAND[1]
            numbers = "".join(f"{value:7.2f}"
                              for value in np.quantile(values, (0, 0.1, 0.5, 0.9, 1)))
            lines.append(f"{word:12}{words:14}{len(values):8d}{numbers}{low.sum():7d}"
                         f"{(~low & ~high).sum():8d}{high.sum():7d}")
    return lines


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    flights.add_arguments(parser)
    parser.add_argument("--kinds", default=",".join(KINDS), help="faults (%(default)s)")
    parser.add_argument("--seeds", type=int, default=3, help="of the accelerometer (%(default)s)")
    parser.add_argument("--weak", action="store_true", help="weak frames are sent, too")
    parser.add_argument("--keep", metavar="FOLDER", help="of what the odometry said")
    parser.add_argument("--rows", metavar="FILE", help="of the rows that are done")
    arguments = parser.parse_args(argv)
    folders, rows = flights.chosen(parser, arguments), read_rows(arguments.rows)
    done = {(row["flight"], row["fault"]) for row in rows}
    print(f"{'flight':10}{'fault':12}{'autopilot':11}{'frames':>7}{'fed':>6}{'astray':>7}"
          f"{'sigmas':>8}{'metres':>8}{'silent s':>9}{'back s':>7}")
    with tempfile.TemporaryDirectory() as scratch:
        for n, folder in enumerate(folders):
            name, truth = os.path.basename(os.path.normpath(folder)), read_set(folder).truth()
            for kind in arguments.kinds.split(","):
                if (name, kind) in done:
                    continue
                said = kept(arguments.keep, f"{name}_{kind}", lambda: make(
                    kind, folder, os.path.join(scratch, kind), folders[(n + 1) % len(folders)]))
                new = fault_rows(name, kind, said, truth, arguments.seeds, int(arguments.weak))
                rows += new
                for row in new:
                    if "autopilot" in row:
                        print(line(row), flush=True)
                if arguments.rows:
                    with open(arguments.rows, "a", encoding="utf-8") as file:
                        file.write("".join(json.dumps(row) + "\n" for row in new))
    flown = [row for row in rows if "autopilot" in row]
    print("", *summary(flown), "", *nees_lines(rows), sep="\n")


if __name__ == "__main__":
    main()
