"""The errors of an estimated trajectory: ATE, RPE, coverage, and where it was silently wrong.

ATE and RPE are those of J. Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems",
IROS 2012, after the similarity of alignment.umeyama; they equal evo's (evo_ape tum -as, evo_rpe tum
-as)."""

from dataclasses import dataclass

import numpy as np

from . import alignment

OFF_SHARE, OFF_DEG = 0.05, 5.0  # an error above this share of the path, or angle, is "off"
MIN_POSES = 10  # of a segment: with fewer poses the similarity fits nearly anything
TRACKING = "tracking"


def rms(values):
    values = np.asarray(values, float)
    return float(np.sqrt(np.mean(values ** 2))) if values.size else None


def longest_segment(poses):
    """The segment with the most poses, the lowest number on a tie; None without a pose."""
    if not len(poses):
        return None
    numbers, counts = np.unique(poses.segments, return_counts=True)
    return int(numbers[counts.argmax()])


def position_errors(estimate, truth, with_scale=True):
    """(distances, similarity) of associated trajectories."""
    similarity = alignment.umeyama(estimate.positions, truth.positions, with_scale)
    offsets = estimate.moved(similarity).positions - truth.positions
    return np.linalg.norm(offsets, axis=1), similarity


def relative_errors(estimate, truth):
    """(translations, degrees) of the error of the motion from each pose to the next, for associated
    trajectories in the same unit: the RPE's terms."""
    def motions(poses):
        R = poses.rotations[:-1].transpose(0, 2, 1)
        step = np.diff(poses.positions, axis=0)
        return R @ poses.rotations[1:], np.einsum("nij,nj->ni", R, step)
    (R, t), (R_true, t_true) = motions(estimate), motions(truth)
    return (np.linalg.norm(t - t_true, axis=1),
            alignment.angles_deg(R_true.transpose(0, 2, 1) @ R))


def ate(estimate, truth, num_frames=None, max_difference=alignment.MAX_DIFFERENCE):
    """The figures of one estimate: of its longest segment, as INTERFACES.md's `truth` names them.
    num_frames: how many frames the source has, for the coverage. None where fewer than 3 poses have
    a truth."""
    segment = longest_segment(estimate)
    best = estimate[estimate.segments == segment] if segment is not None else estimate
    matched, true = alignment.associate(best, truth, max_difference)
    coverage = len(best) / num_frames if num_frames else None
    if len(matched) < 3:
        return {"coverage": coverage, "num_compared": len(matched), "ate_rmse": None}
    errors, similarity = position_errors(matched, true)
    rigid_errors, _ = position_errors(matched, true, with_scale=False)
    aligned = matched.moved(similarity)
    moved, turned = relative_errors(aligned, true)
    path = true.path_length()
    step = path / (len(true) - 1)
    return {
        "coverage": coverage,
        "num_compared": len(matched),
        "segment": segment,
        "path_length": path,
        "ate_rmse": rms(errors),
        "ate_max": float(errors.max()),
        "ate_rmse_percent_of_path": 100 * rms(errors) / path if path else None,
        "ate_metric_rmse": rms(rigid_errors),
        "rpe_rotation_deg": rms(turned),
        "rpe_translation_rmse": rms(moved),
        "rpe_translation_percent": 100 * rms(moved) / step if step else None,
        "scale_ratio": 1 / similarity[0] if similarity[0] > 0 else None,
        "similarity": similarity,
        "loop_end_percent": loop_end_percent(aligned, true),
    }


def loop_end_percent(aligned, truth):
    """How far the motion from the first pose to the last is off, in per cent of the path: the error
    that an inner error of the path cannot hide where the path is closed."""
    path = truth.path_length()
    if len(aligned) < 2 or not path:
        return None
    moved = aligned.positions[-1] - aligned.positions[0]
    return float(100 * np.linalg.norm(moved - (truth.positions[-1] - truth.positions[0])) / path)


@dataclass
class FrameState:
    """What the program said of a frame."""

    status: str
    flags: str = ""  # why the pose may have jumped: reasons, a relocation, a closed loop


def silent_errors(estimate, truth, states, sigma=(0.0, 0.0), elsewhere=()):
    """Where the program said "tracking" and was off: by more than 5 % of the segment's true path or
    5 degrees, each plus three sigmas of the truth.

    states: {time: FrameState}. sigma: of the truth, (metres, degrees). elsewhere: time intervals in
    which the camera saw another place (a fault that was injected): every pose there that claims to
    be in a segment of the poses outside is wrong.

    Positions are compared after the similarity, and attitudes after the mean rotation, of the
    segment's tracked poses, so that neither depends on the other. A segment of fewer than
    MIN_POSES poses is not compared. Returns num_tracking, num_wrong, share, the worst errors, the
    times of wrong frames, and unflagged_jumps: steps from one tracked pose to the next in which the
    error changes by as much, without any flag; flagged_jumps: the same with a flag."""
    def is_elsewhere(time):
        return any(first <= time <= last for first, last in elsewhere)

    def is_tracking(time):
        state = states.get(round(float(time), 6))
        return state is not None and state.status == TRACKING

    def is_flagged(time):
        state = states.get(round(float(time), 6))
        return state is None or state.status != TRACKING or bool(state.flags)

    wrong, jumps, flagged = set(), [], []
    worst_share = worst_deg = 0.0
    num_compared = 0
    for segment in np.unique(estimate.segments):
        poses = estimate[estimate.segments == segment]
        away = np.array([is_elsewhere(time) for time in poses.times], bool)
        if away.any() and not away.all():
            wrong.update(float(time) for time in poses.times[away] if is_tracking(time))
        poses, true = alignment.associate(poses[~away], truth)
        tracked = np.array([is_tracking(time) for time in poses.times], bool)
        if tracked.sum() < MIN_POSES:
            continue
        num_compared += int(tracked.sum())
        _, similarity = position_errors(poses[tracked], true[tracked])
        path = true.path_length()
        offsets = poses.moved(similarity).positions - true.positions
        turns = true.rotations @ poses.rotations.transpose(0, 2, 1)
        turns = alignment.mean_rotation(turns[tracked]).T @ turns
        most, most_deg = OFF_SHARE * path + 3 * sigma[0], OFF_DEG + 3 * sigma[1]
        distances, degrees = np.linalg.norm(offsets, axis=1), alignment.angles_deg(turns)
        off = tracked & ((distances > most) | (degrees > most_deg))
        wrong.update(float(time) for time in poses.times[off])
        if path:
            worst_share = max(worst_share, float(distances[tracked].max() / path))
        worst_deg = max(worst_deg, float(degrees[tracked].max()))
        steps = np.linalg.norm(np.diff(offsets, axis=0), axis=1)
        swings = alignment.angles_deg(turns[:-1].transpose(0, 2, 1) @ turns[1:])
        for k in np.flatnonzero((steps > most) | (swings > most_deg)):
            if is_flagged(poses.times[k + 1]) or is_flagged(poses.times[k]):
                flagged.append(float(poses.times[k + 1]))
            else:
                jumps.append(float(poses.times[k + 1]))
    num_tracking = sum(state.status == TRACKING for state in states.values())
    return {"num_tracking": num_tracking, "num_compared": num_compared, "num_wrong": len(wrong),
            "share": len(wrong) / num_tracking if num_tracking else 0.0,
            "worst_percent_of_path": 100 * worst_share, "worst_deg": worst_deg,
            "times": sorted(wrong), "unflagged_jumps": len(jumps), "flagged_jumps": len(flagged)}
