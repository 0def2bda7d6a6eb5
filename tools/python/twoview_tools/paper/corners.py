"""Figures 5 and 6: the segment test, and how many corners it finds.

E. Rosten, T. Drummond, "Machine learning for high-speed corner detection", ECCV 2006. The test is
computed here from its definition, with one array for each circle pixel, and the library is compared
with the result."""

import numpy as np

from . import drawing
from .experiment import Experiment, Missing, Result, Table, available
from .inputs import grey, library, read_colour

# The Bresenham circle of radius 3, clockwise from the top.
CIRCLE = np.array([(0, -3), (1, -3), (2, -2), (3, -1), (3, 0), (3, 1), (2, 2), (1, 3), (0, 3),
                   (-1, 3), (-2, 2), (-3, 1), (-3, 0), (-3, -1), (-2, -2), (-1, -3)])
ARC, THRESHOLD = 12, 20  # 12 of 16 circle pixels, as in the paper; grey levels


def differences(image):
    """(16, height, width): circle pixel minus centre pixel; 0 in a border of 3 pixels."""
    height, width = image.shape
    centre = image[3:-3, 3:-3].astype(np.int16)
    found = np.zeros((16, height, width), np.int16)
    for i, (dx, dy) in enumerate(CIRCLE):
        found[i, 3:-3, 3:-3] = image[3 + dy:height - 3 + dy, 3 + dx:width - 3 + dx] - centre
    return found


def scores(image, arc):
    """For each pixel, the largest threshold at which it is a corner; 0 or less if it never is
    one."""
    d = differences(image)
    around = np.concatenate([d, d])  # an arc may continue from the 16th pixel to the first
    contrast = np.full(image.shape, -255, np.int16)
    for start in range(16):
        on_arc = around[start:start + arc]
        contrast = np.maximum(contrast, np.maximum(on_arc.min(axis=0), -on_arc.max(axis=0)))
    return contrast - 1


def suppressed(score, threshold):
    """A (height, width) bool array: true where a corner has a higher score than its eight
    neighbours."""
    score = np.where(score >= threshold, score, 0)
    padded = np.pad(score, 1)
    height, width = score.shape
    around = [padded[1 + dy:1 + dy + height, 1 + dx:1 + dx + width]
              for dy in (-1, 0, 1) for dx in (-1, 0, 1) if dy or dx]
    return (score > 0) & (score > np.max(around, axis=0))


def longest_arc(values, threshold):
    """(first circle pixel, length, sign) of the longest run of circle pixels that are all brighter
    or all darker."""
    best = (0, 0, 0)
    for sign in (1, -1):
        passes = sign * np.asarray(values) > threshold
        for start in range(16):
            turned = np.roll(passes, -start)
            length = 16 if turned.all() else int(np.argmin(turned))
            if length > best[1]:
                best = (start, length, sign)
    return best


def detect(image, arc, threshold):
    """The library's corners in whole pixels, at most 65535 of them."""
    tv = library()
    with tv.Context(max_width=image.shape[1], max_height=image.shape[0],
                    max_keypoints=65535) as context:
        return tv.detect(context, image, arc=arc, threshold=threshold, min_threshold=0,
                         max_keypoints=65535, levels=1, cell_px=0, subpixel=0)


def example_corner(image):
    """A corner with an arc of 12 or 13 pixels, more than 40 pixels from the border, in which a
    reader can count the pixels: the strongest such corner."""
    found = detect(image, ARC, THRESHOLD)
    around = differences(image)
    for k in found:  # keypoints, strongest first
        x, y = int(k["x"]), int(k["y"])
        start, length, sign = longest_arc(around[:, y, x], THRESHOLD)
        if 12 <= length <= 13 and 40 < x < image.shape[1] - 40 and 40 < y < image.shape[0] - 40:
            return {"x": x, "y": y, "library_score": int(k["score"]), "first": start,
                    "arc_length": length, "sign": sign,
                    "centre": int(image[y, x]),
                    "circle": [int(image[y + dy, x + dx]) for dx, dy in CIRCLE],
                    "score": int(scores(image[y - 6:y + 7, x - 6:x + 7], ARC)[6, 6])}
    raise Missing("a corner with an arc of 12 or 13")


def states(corner, threshold):
    """The state of each circle pixel: +1 brighter, -1 darker, 0 similar."""
    d = np.array(corner["circle"]) - corner["centre"]
    return np.where(d > threshold, 1, np.where(d < -threshold, -1, 0))


COLOURS = {1: drawing.ORANGE, -1: drawing.BLUE, 0: drawing.GREY}


def draw_circle(axis, image, corner):
    x, y = corner["x"], corner["y"]
    reach = 7
    drawing.show(axis, image[y - reach:y + reach + 1, x - reach:x + reach + 1],
                 "The corner and its circle of 16 pixels")
    on_arc = {(corner["first"] + k) % 16 for k in range(corner["arc_length"])}
    for i, ((dx, dy), state) in enumerate(zip(CIRCLE, states(corner, THRESHOLD))):
        centre = reach + dx, reach + dy
        axis.add_patch(
            drawing.pyplot.Rectangle(
                (centre[0] - 0.5, centre[1] - 0.5),
                1,
                1,
                fill=False,
                color=COLOURS[int(state)],
                linewidth=3 if i in on_arc else 1.5,
            )
        )
        axis.text(*centre, str(i + 1), color=COLOURS[int(state)], ha="center", va="center",
                  fontsize=8, fontweight="bold")
    axis.plot(reach, reach, "+", color=drawing.BAD, markersize=11, markeredgewidth=2)


def draw_levels(axis, corner):
    state = states(corner, THRESHOLD)
    axis.bar(range(1, 17), corner["circle"], color=[COLOURS[int(s)] for s in state])
    axis.axhline(corner["centre"], color=drawing.BAD, label=f"centre p = {corner['centre']}")
    for sign in (1, -1):
        axis.axhline(corner["centre"] + sign * THRESHOLD, color=drawing.BAD, linestyle=":",
                     label="p ± t" if sign > 0 else None)
    axis.set_xticks(range(1, 17))
    axis.set_xlabel("circle pixel")
    axis.set_ylabel("grey level")
    axis.set_title(f"{corner['arc_length']} contiguous pixels are "
                   f"{'brighter' if corner['sign'] > 0 else 'darker'} by more than t = {THRESHOLD}")
    axis.legend(loc="best")


def figure5(inputs):
    image = inputs.motorcycle.grey[0]
    corner = example_corner(image)
    sheet, axes = drawing.sheet(11, 3.5, 1, 3, width_ratios=(1.5, 1, 1.5))
    drawing.show(axes[0], image, "Motorcycle, left image")
    axes[0].add_patch(drawing.pyplot.Rectangle((corner["x"] - 12, corner["y"] - 12), 24, 24,
                                               fill=False, color=drawing.BAD, linewidth=2))
    draw_circle(axes[1], image, corner)
    draw_levels(axes[2], corner)
    found = (
        f"At ({corner['x']}, {corner['y']}) the longest arc has {corner['arc_length']} pixels of "
        f"the 12 that are wanted. The largest threshold at which it is still a corner, its score, "
        f"is {corner['score']} by the definition and {corner['library_score']} by the library."
    )
    picture = drawing.finish(sheet, "A corner, the 16 pixels of its circle and their grey levels")
    return Result(corner, found, [picture])


def images(inputs):
    """Returns ({name: grey image}, a list of sentences about missing images)."""
    def of_set(folder, number):
        return grey(read_colour(sorted(inputs.of_data(folder, "images").iterdir())[number]))

    def of_the_drone():
        return grey(read_colour(inputs.of_fixtures("chessboard_ardrone1", "image_000003.png")))
    named = {"Motorcycle": lambda: inputs.motorcycle.grey[0],
             "TUM office": lambda: of_set("tum_fr3_office", 0),
             "HoloLens rooms": lambda: of_set("hololens_room_seq", 100),
             "KITTI street": lambda: of_set("kitti00_turn", 0), "AR.Drone's view": of_the_drone}
    found, missing = available(*(lambda n=n, read=read: (n, read()) for n, read in named.items()))
    return dict(found), missing


def count(image):
    """The numbers of corners for each arc, before and after suppression, and the library's
    number."""
    entry = {"width": image.shape[1], "height": image.shape[0], "threshold": THRESHOLD, "arcs": {}}
    for arc in (9, 10, 11, 12):
        score = scores(image, arc)
        keep = suppressed(score, THRESHOLD)
        ours = detect(image, arc, THRESHOLD)
        same = {tuple(p) for p in np.argwhere(keep)[:, ::-1].tolist()} == {
            (int(k["x"]), int(k["y"])) for k in ours}
        entry["arcs"][str(arc)] = {"segment_test": int((score >= THRESHOLD).sum()),
                                   "suppressed": int(keep.sum()), "library": len(ours),
                                   "library_equals_definition": same}
    return entry


def counts_by_threshold(image, thresholds):
    return {arc: [len(detect(image, arc, t)) for t in thresholds] for arc in (9, 12)}


def draw_corners(name, image, thresholds, curves):
    sheet, axes = drawing.sheet(11, 4, 1, 2, width_ratios=(1.7, 1))
    found = detect(image, ARC, THRESHOLD)
    drawing.show(axes[0], image, f"{name}: {len(found)} corners by 12-FAST, t = {THRESHOLD}")
    axes[0].plot(found["x"], found["y"], ".", color="#34d17f", markersize=3.5)
    for arc, style, colour in ((9, "o--", drawing.ORANGE), (12, "o-", drawing.BLUE)):
        axes[1].plot(
            thresholds, curves[arc], style, markersize=4, label=f"{arc} of 16", color=colour
        )
    axes[1].set_yscale("log")
    axes[1].set_xlabel("threshold t [grey levels]")
    axes[1].set_title("Corners left after suppression")
    axes[1].legend()
    return drawing.finish(sheet, "Corners drawn, and their number by threshold")


def counts_table(numbers):
    rows = [[name, f"{e['width']} x {e['height']}",
             *(str(e["arcs"][a][key]) for a in ("9", "12") for key in ("segment_test", "library")),
             "yes" if all(a["library_equals_definition"] for a in e["arcs"].values()) else "NO"]
            for name, e in numbers.items()]
    return Table(
        f"Corners at t = {THRESHOLD}: pixels that pass the test, and those left after non-maximum "
        "suppression",
        [
            "image",
            "size",
            "9 of 16, all",
            "suppressed",
            "12 of 16, all",
            "suppressed",
            "equal to the definition",
        ],
        rows,
    )


def figure6(inputs):
    read, missing = images(inputs)
    numbers = {name: count(image) for name, image in read.items()}
    name, image = next(iter(read.items()))
    thresholds = [5, 10, 15, 20, 30, 40, 60, 80]
    curves = counts_by_threshold(image, thresholds)
    arcs = numbers[name]["arcs"]
    equal = all(
        a["library_equals_definition"] for e in numbers.values() for a in e["arcs"].values()
    )
    found = (
        f"12-FAST leaves {arcs['12']['library']} corners on {name} at t = {THRESHOLD}, 9-FAST "
        f"{arcs['9']['library']}. On {'every' if equal else 'NOT EVERY'} image and for every arc "
        f"the "
        "library's corners are, pixel for pixel, those of the definition."
    )
    by_threshold = {"image": name, "thresholds": thresholds, "arc9": curves[9], "arc12": curves[12]}
    return Result({"images": numbers, "by_threshold": by_threshold}, found,
                  [draw_corners(name, image, thresholds, curves)], [counts_table(numbers)], missing)


EXPERIMENTS = [
    Experiment(
        "figure5",
        "FAST corners",
        "Figure 5: the segment test",
        "The circle of 16 pixels around a candidate p: p is a corner when 12 contiguous ones are "
        "all brighter than p + t, or all darker than p - t.",
        "The test is the paper's, for arcs of 9 to 12. The score, the largest t that a corner "
        "survives, is exact rather than searched for.",
        figure5,
    ),
    Experiment(
        "figure6",
        "FAST corners",
        "Figure 6: corners found by 12-FAST",
        "A picture with the corners that 12-FAST finds in it, and their number.",
        "The paper uses 12 of 16. Our default is 9 of 16 with a threshold that falls from 10 until "
        "2048 corners are found: a tenth more matches, and on the hardest of the larger sets 3.6 "
        "points "
        "of AUC@10 more; elsewhere the two tie (docs/decisions/0001-features.md). --arc 12 is the "
        "paper's.",
        figure6,
    ),
]
