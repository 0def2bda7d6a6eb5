"""What the matches of a pair say about its pose, besides the numbers of tv_two_view: from
keypoints, matches and the inlier mask. A rule of the verdict that uses such a number can be fitted
on the rows of twoview_tools.accuracy.belief."""

import numpy as np

from . import estimators

PLACE_PX = 32.0  # the side of a cell that counts as one place


def _cells(pixels, side):
    return {tuple(cell) for cell in np.floor(pixels / side).astype(int)}


def _median(values):
    return float(np.median(values)) if len(values) else None


def _share_near(pixels, radius):
    """The largest share of the pixels within `radius` of one of them."""
    if not len(pixels):
        return None
    distances = np.linalg.norm(pixels[:, None] - pixels[None], axis=2)
    return float((distances < radius).mean(axis=1).max())


def of_matches(matches, links, inliers):
    """Numbers that need no pose. links: the array of tv_correspondence of the matches."""
    found = {}
    for name, chosen in (("inliers", inliers), ("others", ~inliers)):
        found[f"median_ratio_{name}"] = _median(links["ratio"][chosen])
        found[f"median_dist_sq_{name}"] = _median(links["dist_sq"][chosen])
    pixels = [p[inliers] for p in (matches.pixels0, matches.pixels1)]
    # "places": cells that hold an inlier, in the image that has fewer of them
    found["inlier_places"] = min(len(_cells(p, PLACE_PX)) for p in pixels)
    found["match_places"] = min(len(_cells(p, PLACE_PX))
                                for p in (matches.pixels0, matches.pixels1))
    diagonals = [np.hypot(*size) for size in matches.sizes]
    shares = [_share_near(p[:400], 0.1 * d) for p, d in zip(pixels, diagonals)]
    found["cluster_share"] = None if None in shares else max(shares)
    return found


def _wrapped(angles):
    return (angles + np.pi) % (2 * np.pi) - np.pi


def of_keypoints(keypoints0, keypoints1, inliers):
    """How the inliers agree on a turn in the picture and on a change of scale: the length of the
    mean of their unit vectors (1: all turn alike), and the spread of log2 of the sizes' ratio."""
    turns = _wrapped(keypoints1["angle_rad"].astype(float) - keypoints0["angle_rad"])
    octaves = np.log2(keypoints1["size"].astype(float) / keypoints0["size"])
    found = {"turn_agreement": None, "octave_median": None, "octave_spread": None}
    if inliers.any():
        found["turn_agreement"] = float(abs(np.exp(1j * turns[inliers]).mean()))
        found["octave_median"] = _median(octaves[inliers])
        found["octave_spread"] = float(np.median(np.abs(
            octaves[inliers] - np.median(octaves[inliers]))))
    return found


def of_pose(matches, keypoints0, keypoints1, inliers, R, t):
    """Numbers that compare the matches with the pose, over the inliers: quantiles of the parallax
    and of the residual; how many more matches there would be at twice and thrice the threshold; the
    share of keypoints whose size changes as the depths say, to half an octave, and of those whose
    orientation turns as the epipolar lines do, to 30 degrees."""
    rays = [np.column_stack([r, np.ones(len(r))]) for r in (matches.rays0, matches.rays1)]
    good = inliers & np.isfinite(rays[0]).all(axis=1) & np.isfinite(rays[1]).all(axis=1)
    focal = np.mean([K[i, i] for K, _ in matches.cameras for i in (0, 1)])
    residual = focal * np.sqrt(estimators.sampson_squared(matches.rays0, matches.rays1, R, t))
    with np.errstate(invalid="ignore"):
        found = {"within_1px": int((residual < 1).sum()), "within_2px": int((residual < 2).sum()),
                 "within_3px": int((residual < 3).sum())}
    if not good.any():
        return found
    turned, other = rays[0][good] @ R.T, rays[1][good]
    cross = np.linalg.norm(np.cross(turned, other), axis=1)
    parallax = np.degrees(np.arctan2(cross, np.sum(turned * other, axis=1)))
    for percent in (10, 50, 90):
        found[f"parallax_{percent}_deg"] = float(np.percentile(parallax, percent))
        found[f"residual_{percent}_px"] = float(np.percentile(residual[good], percent))
    # depth0 turned + t = depth1 other: both depths up to the length of t, by least squares
    a, b = turned, -other
    aa, bb, ab = (np.sum(x * y, axis=1) for x, y in ((a, a), (b, b), (a, b)))
    at, bt = a @ t, b @ t
    with np.errstate(divide="ignore", invalid="ignore"):
        determinant = aa * bb - ab * ab
        depth0 = (ab * bt - bb * at) / determinant
        depth1 = (ab * at - aa * bt) / determinant
        expected = np.log2(depth0 / depth1)  # a point that comes nearer looks larger
    focals = [np.mean([K[0, 0], K[1, 1]]) for K, _ in matches.cameras]
    octaves = np.log2(keypoints1["size"][good].astype(float) / keypoints0["size"][good])
    difference = octaves - (expected + np.log2(focals[1] / focals[0]))
    known = np.isfinite(difference)
    found["in_front_share"] = float(np.mean((depth0 > 0) & (depth1 > 0)))
    if known.any():
        found["scale_agreement"] = float(np.mean(np.abs(difference[known]) < 0.5))
        found["scale_offset"] = float(np.median(difference[known]))
        found["depth_ratio_octaves"] = float(np.median(np.abs(expected[known])))
    epipole0, epipole1 = -R.T @ t, t  # the other camera's centre as each camera sees it
    lines = []
    for ray, epipole, depth in ((rays[0][good], epipole0, depth0), (other, epipole1, depth1)):
        # the direction in the image in which the point moves as its ray turns to the epipole
        toward = epipole[None, :2] - ray[:, :2] * epipole[2]
        lines.append(np.arctan2(toward[:, 1], toward[:, 0]))
    turn_of_lines = _wrapped(lines[1] + np.pi - lines[0])
    turn_of_keypoints = _wrapped(keypoints1["angle_rad"][good].astype(float)
                                 - keypoints0["angle_rad"][good])
    apart = np.abs(_wrapped(turn_of_keypoints - turn_of_lines))
    found["orientation_agreement"] = float(np.mean(apart < np.radians(30)))
    found["orientation_apart_deg"] = float(np.degrees(np.median(apart)))
    return found
