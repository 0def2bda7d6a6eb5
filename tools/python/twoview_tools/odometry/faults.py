"""Faults put into a set folder: each makes a folder of its own beside links to the unharmed images,
with the truth of the source, and fault.json: {kind, source, intervals, elsewhere}.

| kind | what happens |
| --- | --- |
| black | 1 s of black frames |
| covered | 1.5 s of a covered lens: dark, blurred, uneven, noisy |
| other_room | 1.5 s of another place's frames, then the first place again |
| slow | 5 frames a second |
| dropped | 20 % of the frames are missing, at random |
| person | a textured figure walks through 40 % of the picture for 4 s |

Half a turn on the spot is rendered (`twoview_flights --half-turn`)."""

import numpy as np

from .set_writer import SetWriter, read_grey, with_noise
from .sets import DESCRIPTIONS, read_set

KINDS = ("black", "covered", "other_room", "slow", "dropped", "person")
PERSON_SHARE = 0.4  # of the picture's area that the figure covers when it is in the middle


def _span(source, start_share, seconds):
    """(indices, [first, last] time) of the frames from a share of the flight on."""
    times = np.array(source.times)
    start = times[0] + start_share * (times[-1] - times[0])
    inside = np.flatnonzero((times >= start) & (times < start + seconds))
    if not len(inside):
        inside = np.array([len(times) // 2])
    return set(inside.tolist()), [float(times[inside[0]]), float(times[inside[-1]])]


def black(source, writer, random, other):
    inside, interval = _span(source, 0.5, 1.0)
    shape = read_grey(source, 0).shape
    for k in range(len(source.times)):
        if k in inside:
            writer.make(k, with_noise(np.full(shape, 2.0), 1.0, random))
        else:
            writer.keep(k)
    return [interval], []


def covered(source, writer, random, other):
    import cv2
    inside, interval = _span(source, 0.4, 1.5)
    shape = read_grey(source, 0).shape
    uneven = cv2.resize(random.uniform(10, 60, (3, 4)).astype(np.float32), shape[::-1],
                        interpolation=cv2.INTER_CUBIC)
    for k in range(len(source.times)):
        if k in inside:
            hand = cv2.warpAffine(uneven, np.float32([[1, 0, random.normal(0, 6)],
                                                      [0, 1, random.normal(0, 6)]]),
                                  shape[::-1], borderMode=cv2.BORDER_REPLICATE)
            writer.make(k, with_noise(hand, 2.5, random))
        else:
            writer.keep(k)
    return [interval], []


def other_room(source, writer, random, other):
    """The other place's frames have the size of the source's."""
    import cv2
    if other is None:
        raise ValueError("other_room needs another set")
    inside, interval = _span(source, 0.5, 1.5)
    shape = read_grey(source, 0).shape
    start = len(other.names) // 3
    for k in range(len(source.times)):
        if k in inside:
            shown = min(start + k - min(inside), len(other.names) - 1)
            picture = read_grey(other, shown)
            writer.make(k, cv2.resize(picture, shape[::-1], interpolation=cv2.INTER_AREA))
        else:
            writer.keep(k)
    return [interval], [interval]


def slow(source, writer, random, other):
    last = -np.inf
    for k, time in enumerate(source.times):
        if time - last >= 0.2 - 1e-6:
            writer.keep(k)
            last = time
    return [], []


def dropped(source, writer, random, other):
    for k in range(len(source.times)):
        if k == 0 or random.uniform() >= 0.2:
            writer.keep(k)
    return [], []


def person_of(shape, random):
    """(grey, mask) of a figure that covers PERSON_SHARE of a picture of this shape: a head, a body
    and legs in clothes with a pattern."""
    import cv2
    height, width = shape
    tall = int(1.05 * height)
    wide = int(PERSON_SHARE * height * width / (0.74 * tall))
    mask = np.zeros((tall, wide), np.uint8)
    head = int(0.17 * tall)
    cv2.ellipse(mask, (wide // 2, head // 2 + 4), (int(0.2 * wide), head // 2), 0, 0, 360, 255, -1)
    cv2.ellipse(mask, (wide // 2, int(0.5 * tall)), (wide // 2, int(0.36 * tall)), 0, 0, 360, 255,
                -1)
    mask[int(0.5 * tall):, int(0.12 * wide):int(0.88 * wide)] = 255
    grey = np.zeros((tall, wide), np.float32)
    for cells, amplitude in ((3, 60), (8, 40), (30, 30), (90, 20)):
        grey += cv2.resize(random.uniform(-amplitude, amplitude, (cells, cells)).astype(np.float32),
                           (wide, tall), interpolation=cv2.INTER_CUBIC)
    for y in range(0, tall, max(tall // 18, 1)):  # a striped shirt with spots
        cv2.line(grey, (0, y), (wide, y + int(random.uniform(-8, 8))),
                 float(random.uniform(-90, 90)), 3)
    for _ in range(160):
        spot = (int(random.uniform(0, wide)), int(random.uniform(0, tall)))
        cv2.circle(grey, spot, int(random.uniform(2, 8)), float(random.uniform(-110, 110)), -1)
    return np.clip(115 + grey, 0, 255), mask


def person(source, writer, random, other):
    """The figure walks through the picture once, from the left edge to the right one, and sways."""
    inside, interval = _span(source, 0.4, 4.0)
    order = sorted(inside)
    shape = read_grey(source, 0).shape
    figure, mask = person_of(shape, random)
    tall, wide = mask.shape
    for k in range(len(source.times)):
        if k not in inside:
            writer.keep(k)
            continue
        picture = read_grey(source, k).astype(float)
        share = order.index(k) / max(len(order) - 1, 1)
        left = int(-wide + share * (shape[1] + wide))
        top = shape[0] - tall + int(0.02 * shape[0] * (1 + np.sin(40 * share)))
        y0, y1 = max(top, 0), min(top + tall, shape[0])
        x0, x1 = max(left, 0), min(left + wide, shape[1])
        if x1 > x0 and y1 > y0:
            seen = mask[y0 - top:y1 - top, x0 - left:x1 - left] > 0
            patch = figure[y0 - top:y1 - top, x0 - left:x1 - left]
            picture[y0:y1, x0:x1][seen] = patch[seen] + random.normal(0, 2, int(seen.sum()))
        writer.make(k, np.clip(picture, 0, 255).astype(np.uint8))
    return [interval], []


def inject(kind, source_path, folder, other_path=None, seed=1):
    """Writes the folder of a fault. other_path: the set whose frames other_room shows. Returns the
    folder."""
    if kind not in KINDS:
        raise ValueError(f"no fault '{kind}'; there are {', '.join(KINDS)}")
    source = read_set(source_path)
    other = read_set(other_path) if other_path else None
    writer = SetWriter(source, folder, DESCRIPTIONS)
    random = np.random.default_rng([seed, KINDS.index(kind)])
    intervals, elsewhere = globals()[kind](source, writer, random, other)
    return writer.finish(kind, intervals, elsewhere)
