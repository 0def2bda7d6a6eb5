"""The filter of 18_fusion.py, an error-state Kalman filter: docs/fusion.md says why it is so."""
import numpy as np

MOST_CHI2 = 16.27  # of three degrees of freedom at 99.9 per cent: what is beyond it is not fused
UNIT_DRIFT = 0.005  # of the map's scale from one keyframe to the next; 0.003 to 0.02 do as well
VELOCITY_SCALE_SIGMA = 0.01  # of a factor that all velocities share: of your vehicle's sensor


def cross(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


class Filter:
    """State: position in metres (3); the rotation vector (3) that corrects the vehicle's attitude,
    along the world's axes; the logarithm of the map's unit in metres; and the position (3) at each
    of the last keyframes."""

    def __init__(self, attitude_sigma):
        self.x, self.P = np.zeros(7), np.diag([0] * 3 + [attitude_sigma ** 2] * 3 + [0])
        self.attitude_drift = attitude_sigma ** 2 / 60  # a second: it is another one in a minute
        self.ids = []  # of the keyframes whose positions are in the state
        self.segment = None  # the one that the unit is of; None: the unit is open

    def predict(self, velocity, sigma, seconds):
        """velocity: along the world's axes by the vehicle, of this sigma for each axis, in m/s."""
        way = (velocity + np.cross(self.x[3:6], velocity)) * seconds
        F = np.eye(len(self.x))
        F[:3, 3:6] = -cross(way)
        self.x[:3] += way
        noise = [(sigma * seconds) ** 2] * 3 + [self.attitude_drift * seconds] * 3
        self.P = F @ self.P @ F.T + np.diag(noise + [0] * (len(self.x) - 6))

    def clone(self, keyframe_id):
        """The vehicle is at this keyframe: its position there has the same error. The two keyframes
        before stay in the state, so that no way is fused twice."""
        first = max(0, len(self.ids) - 2)
        rows = [*range(7), *range(7 + 3 * first, len(self.x)), 0, 1, 2]
        self.x, self.P, self.ids = self.x[rows], self.P[np.ix_(rows, rows)], self.ids[first:]
        self.ids.append(keyframe_id)
        self.P[6, 6] += UNIT_DRIFT ** 2

    def fuse(self, id0, id1, segment, way, covariance):
        """way: from keyframe id0 to id1 along the world's axes by the vehicle, in the unit of the
        segment, of this covariance. True: it was fused."""
        if id0 not in self.ids or id1 not in self.ids:
            return False
        at0, at1 = (7 + 3 * self.ids.index(k) for k in (id0, id1))
        H = np.zeros((3, len(self.x)))
        H[:, at1:at1 + 3], H[:, at0:at0 + 3] = np.eye(3), -np.eye(3)
        way_m = self.x[at1:at1 + 3] - self.x[at0:at0 + 3]
        if self.segment != segment:  # another unit: so far the velocities alone say how long it is
            length_m = np.linalg.norm(way_m)
            if np.sqrt(np.trace(H @ self.P @ H.T) / 3) > 0.2 * length_m:
                return False
            self.x[6], self.segment = np.log(length_m / np.linalg.norm(way)), segment
            self.P[6], self.P[:, 6] = 0, 0
            self.P[6, 6] = 1
        turned = np.exp(self.x[6]) * (way + np.cross(self.x[3:6], way))
        H[:, 3:6], H[:, 6] = cross(turned), -turned
        r = turned - way_m
        S = H @ self.P @ H.T + np.exp(2 * self.x[6]) * covariance
        if r @ np.linalg.solve(S, r) > MOST_CHI2:
            return False
        K = np.linalg.solve(S, H @ self.P).T
        self.x, self.P = self.x + K @ r, self.P - K @ S @ K.T
        return True

    def position(self):
        """Position and covariance, with what no state has: a factor of all velocities scales all
        ways and the unit alike, so nothing here tells it."""
        p = self.x[:3]
        return p, self.P[:3, :3] + VELOCITY_SCALE_SIGMA ** 2 * np.outer(p, p)
