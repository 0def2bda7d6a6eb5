"""Rendered scenes that mislead two-view geometry: repeated structure, copies, screens, mirrors,
moving people, rooms that are twins.

Each function of SCENES takes a seed and returns a pictures.Pair: two pictures of 480x360 pixels
with a noise of 2 grey levels, and the true pose of the camera, or none where the two pictures are
of different places. The textures are drawn from the seed. `before_person` puts a moving person
before the pair of a data set.
"""

from dataclasses import replace

import cv2
import numpy as np

from . import pictures
from .pictures import rotation

NOISE = 2.0  # grey levels, of each picture
FACING = np.eye(3)
LYING = rotation(-90, 0, 0)  # a board that lies, its lower edge nearer


def plaster(random, width=1600, height=1200, grey=150.0, depth=9.0):
    """A rough wall of low contrast: noise, blurred by 1 and by 6 texels."""
    noise = random.normal(0, 1, (height, width)).astype(np.float32)
    fine, coarse = (cv2.GaussianBlur(noise, (0, 0), s) for s in (1.0, 6.0))
    wall = grey + depth * (fine / fine.std() + coarse / coarse.std()) / 2
    return np.clip(np.rint(wall), 0, 255).astype(np.uint8)


def spots(random, width, height):
    return pictures.spots(int(random.integers(1, 2**31)), width, height)


def motion(random):
    """A rotation of up to 6 degrees about each axis, and a step of 0.25 to 0.6 metres."""
    t = random.uniform(-1, 1, 3) * (0.45, 0.25, 0.3)
    t[0] += np.copysign(0.2, t[0])
    return rotation(*random.uniform(-6, 6, 3)), t


def noisy(view, random):
    luma = view.luma + random.normal(0, NOISE, view.luma.shape)
    return replace(view, luma=np.clip(np.rint(luma), 0, 255).astype(np.uint8))


def pair_of(boards0, boards1, R, t, random):
    """The Pair of boards seen from the origin and boards seen from R, t; t None: another place."""
    step = np.zeros(3) if t is None else np.asarray(t, float)
    views = pictures.render(boards0, np.eye(3), np.zeros(3)), pictures.render(boards1, R, step)
    views = tuple(noisy(view, random) for view in views)
    return pictures.Pair(views, R, None if t is None else step / np.linalg.norm(step))


def still(boards, random):
    return pair_of(boards, boards, *motion(random), random)


def tilt(random):
    return rotation(*random.uniform(-20, 20, 2), random.uniform(-3, 3))


def furniture(random, num=3):
    """Boards of their own before a wall, at 1.6 to 2.6 metres, from far to near."""
    places = sorted(random.uniform(1.6, 2.6, num), reverse=True)
    return [(spots(random, *random.integers(60, 140, 2)),
             (random.uniform(-0.8, 0.8), random.uniform(-0.6, 0.6), z), tilt(random))
            for z in places]


# ---- repeated structure --------------------------------------------------------------------------

def windows(random):
    """A plastered wall with rows of equal windows, each of four panes in a frame."""
    wall = plaster(random)
    for y in range(40, 1200 - 150, 230):
        for x in range(40, 1600 - 110, 190):
            wall[y:y + 150, x:x + 110] = 225
            for j in (8, 80):
                for i in (8, 59):
                    wall[y + j:y + j + 62, x + i:x + i + 43] = 55
            wall[y + 154:y + 166, x - 8:x + 118] = 90
    return wall


def facade(seed):
    random = np.random.default_rng(seed)
    return still([(windows(random), (0, 0, 3.2), tilt(random))], random)


def facade_with_street(seed):
    """The same with a lamp, a tree and a sign before it, and pavement."""
    random = np.random.default_rng(seed)
    boards = [(windows(random), (0, -1.2, 3.4), rotation(0, random.uniform(-15, 15), 0)),
              (spots(random, 1600, 500), (0, 1.0, 2.6), LYING), *furniture(random)]
    return still(boards, random)


def brick(seed):
    """A brick wall each brick of which has a grey of its own, and grain."""
    random = np.random.default_rng(seed)
    wall = pictures.bricks(90).astype(float)
    greys = random.normal(0, 14, (1 + 1200 // 45, 2 + 1600 // 90))
    y, x = np.mgrid[:1200, :1600]
    row = y // 45
    wall += np.where(wall < 150, greys[row, (x + row % 2 * 45) // 90], 0)
    wall += plaster(random, grey=0.0 + 128) - 128.0
    wall = np.clip(np.rint(wall), 0, 255).astype(np.uint8)
    return still([(wall, (0, 0, 2.2), tilt(random))], random)


def paper(random):
    tile = spots(random, 130, 130)
    return np.clip(np.tile(tile, (10, 13)) + random.normal(0, 2, (1300, 1690)), 0, 255).astype(
        np.uint8)


def wallpaper(seed):
    random = np.random.default_rng(seed)
    return still([(paper(random), (0, 0, 2.2), tilt(random))], random)


def wallpaper_with_furniture(seed):
    random = np.random.default_rng(seed)
    return still([(paper(random), (0, 0, 3.0), tilt(random)), *furniture(random, 4)], random)


def stairs(seed):
    """Twelve steps of one wood, before a plastered wall."""
    random = np.random.default_rng(seed)
    riser, tread = spots(random, 500, 43), spots(random, 500, 70)
    boards = [(plaster(random), (0, 0, 5.5), FACING)]
    for i in range(11, -1, -1):
        top, z = 0.75 - 0.172 * i, 1.7 + 0.28 * i
        boards += [(tread, (0, top, z + 0.14), LYING), (riser, (0, top + 0.086, z), FACING)]
    return still(boards, random)


def blinds(seed):
    """A window with blinds in a plastered wall, and two things before it."""
    random = np.random.default_rng(seed)
    slats = pictures.blinds(24, 620, 440)
    boards = [(plaster(random), (0, 0, 3.0), FACING), (slats, (0, 0, 2.95), FACING),
              *furniture(random, 2)]
    return still(boards, random)


# ---- copies --------------------------------------------------------------------------------------

def posters(random, distance):
    one = spots(random, 220, 300)
    return [(plaster(random), (0, 0, distance), FACING),
            *((one, (x, 0, distance - 0.01), FACING) for x in (-0.75, 0.75))]


def two_posters(seed):
    """A poster beside the same poster; both are seen in both pictures."""
    random = np.random.default_rng(seed)
    return still(posters(random, 3.0), random)


def one_poster_each(seed):
    """The same wall from near: picture 0 shows the left poster, picture 1 the right one."""
    random = np.random.default_rng(seed)
    boards = posters(random, 1.5)
    R0, R1 = (rotation(*random.uniform(-3, 3, 3)) for _ in range(2))
    c0, c1 = (np.array([x, 0, 0]) + random.uniform(-0.1, 0.1, 3) for x in (-0.75, 0.75))
    views = [noisy(pictures.render(boards, R, -R @ c), random) for R, c in ((R0, c0), (R1, c1))]
    t = R1 @ (c0 - c1)
    return pictures.Pair(tuple(views), R1 @ R0.T, t / np.linalg.norm(t))


def twin_rooms(seed):
    """Two rooms of one hotel: the same furniture in the same places, other pictures on the wall.
    The camera is never in one place, so that there is no true pose."""
    random = np.random.default_rng(seed)
    same = furniture(random, 5)
    rooms = []
    for _ in range(2):
        hung = [(spots(random, *random.integers(70, 150, 2)), (x, random.uniform(-0.6, 0), 3.15),
                 FACING) for x in (-0.8, 0.6)]
        rooms.append([(plaster(random), (0, 0, 3.2), FACING), *hung, *same])
    R, t = motion(random)
    pair = pair_of(rooms[0], rooms[1], R, t, random)
    return replace(pair, t=None)


# ---- screens, mirrors, people --------------------------------------------------------------------

def film(random):
    """The two pictures of a camera that moves through another scene."""
    boards = [(spots(random, 1600, 1200), (0.2, 0, 4.0), tilt(random)), *furniture(random, 4)]
    return [view.luma for view in pictures.rendered(boards, *motion(random)).views]


def before_screen(random, content):
    wall = plaster(random), (0, 0, 2.6), FACING
    return [wall, (content, (0, -0.1, 2.5), FACING), *furniture(np.random.default_rng(7), 2)]


def screen_still(seed):
    """A screen of 1.9 x 1.4 m that shows one picture, and two things before it."""
    random = np.random.default_rng(seed)
    return still(before_screen(random, film(random)[0]), random)


def screen_film(seed):
    """The same screen, whose film moves on between the two pictures."""
    random = np.random.default_rng(seed)
    shown = film(random)
    wall = int(random.integers(1, 2**31))
    boards = [before_screen(np.random.default_rng(wall), luma) for luma in shown]
    return pair_of(*boards, *motion(random), random)


def mirror(seed):
    """A mirror of 2.2 x 1.6 m: behind it lies the room's mirror image, in which the photographer
    moves as the camera does."""
    random = np.random.default_rng(seed)
    R, t = motion(random)
    depth = 2.4
    behind = [(spots(random, 2200, 1600), (0, 0, depth + 4.0), tilt(random)),
              *((texture, (x, y, depth + z), turn) for texture, (x, y, z), turn
                in furniture(random, 4))]
    photographer = spots(random, 110, 260)
    frame = [(spots(random, *size), (x, y, depth), FACING) for size, x, y in
             (((700, 50), 0, -0.9), ((700, 50), 0, 0.9), ((60, 400), -1.2, 0), ((60, 400), 1.2, 0))]
    boards = []
    for centre in (np.zeros(3), -R.T @ t):
        image = centre * (1, 1, -1) + (0, 0.25, 2 * depth)
        at = sum(board[1][2] > image[2] for board in behind)
        ordered = sorted(behind, key=lambda board: -board[1][2])
        boards.append([*ordered[:at], (photographer, image, FACING), *ordered[at:], *frame])
    return pair_of(*boards, R, t, random)


def person(random):
    """The boards of a person near the camera, who fills half of the view, at two times."""
    at = np.array([random.uniform(-0.25, 0.25), 0.15, 1.15])
    step = random.uniform(-1, 1, 3) * (0.2, 0.03, 0.12)
    parts = [(spots(random, 110, 200), (0, 0.15, 0.0)), (spots(random, 45, 60), (0, -0.4, 0.0)),
             (spots(random, 30, 150), (-0.28, 0.15, -0.02)),
             (spots(random, 30, 150), (0.28, 0.15, -0.02))]
    times = []
    for time in range(2):
        boards = []
        for texture, place in parts:
            sway = random.uniform(-1, 1, 3) * (0.04, 0.04, 0.02) if time else np.zeros(3)
            turn = rotation(*random.uniform(-12, 12, 3)) if time else FACING
            boards.append((texture, at + np.array(place) + time * step + sway, turn))
        times.append(boards)
    return times


def person_in_room(seed):
    """A room, and a person before half of the view who takes a step and moves the arms."""
    random = np.random.default_rng(seed)
    room = [(spots(random, 1600, 1200), (0, 0, 3.6), tilt(random)), *furniture(random)]
    before, after = person(random)
    return pair_of(room + before, room + after, *motion(random), random)


def before_person(pair, seed):
    """A pair of a data set with a person cut out of texture, of half the picture's width and its
    full height, who walks on and turns by some degrees."""
    random = np.random.default_rng(seed)
    coat = spots(random, 300, 600)
    x, y = np.meshgrid(np.arange(300.0), np.arange(600.0))
    shape = (np.hypot((x - 150) / 75, (y - 90) / 90) < 1) | (
        (y > 160) & (np.abs(x - 150) < np.minimum(148, 60 + (y - 160))))
    views, place = [], random.uniform(0.35, 0.65)
    for time, view in enumerate(pair.views):
        height, width = view.luma.shape
        scale = np.array([width / 2 / 300, height / 600]) * (1 + time * random.uniform(-0.1, 0.15))
        angle = np.radians(time * random.uniform(-5, 5))
        place += time * random.uniform(-0.12, 0.12)
        A = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) * scale
        b = np.array([place * width, height - 1]) - A @ (150, 599)
        M, size = np.column_stack([A, b]), (width, height)
        inside = cv2.warpAffine(shape.astype(np.uint8), M, size, flags=cv2.INTER_NEAREST) > 0
        luma = np.where(inside, cv2.warpAffine(coat, M, size, flags=cv2.INTER_AREA), view.luma)
        views.append(replace(view, luma=np.ascontiguousarray(luma)))
    return replace(pair, views=tuple(views))


SCENES = {
    "facade": facade,
    "facade, things before it": facade_with_street,
    "brick wall": brick,
    "wallpaper": wallpaper,
    "wallpaper, furniture before it": wallpaper_with_furniture,
    "stairs": stairs,
    "window with blinds": blinds,
    "a poster beside the same poster": two_posters,
    "one of the two posters in each picture": one_poster_each,
    "twin rooms": twin_rooms,
    "screen with a still picture": screen_still,
    "screen with a film": screen_film,
    "mirror": mirror,
    "moving person before half of the view": person_in_room,
}
