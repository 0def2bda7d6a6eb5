#!/usr/bin/env python3
"""Draws docs/images/conventions.svg. usage: draw_conventions.py FILE"""

import math
import sys

RED, GREEN, BLUE, GREY, INK, TEAL = "#c62828", "#2e7d32", "#1565c0", "#9aa0a6", "#202124", "#00838f"
WIDTH, HEIGHT = 960, 640
out = []


def text(x, y, words, size=15, colour=INK, anchor="start", style=""):
    out.append(
        f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" fill="{colour}" '
        f'text-anchor="{anchor}"{style}>{words}</text>'
    )


def line(a, b, colour=INK, width=1.5, dash="", arrow=False):
    end = f' marker-end="url(#{colour[1:]})"' if arrow else ""
    out.append(
        f'<line x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}" stroke="{colour}" '
        f'stroke-width="{width}"'
        f'{f" stroke-dasharray={chr(34)}{dash}{chr(34)}" if dash else ""}{end}/>'
    )


def dot(p, radius=4, colour=INK, fill=None):
    out.append(
        f'<circle cx="{p[0]:.1f}" cy="{p[1]:.1f}" r="{radius}" fill="{fill or colour}" '
        f'stroke="{colour}" stroke-width="1.5"/>'
    )


def polygon(points, fill, stroke=INK, opacity=1.0):
    out.append(f'<polygon points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in points)}" fill="{fill}" '
               f'fill-opacity="{opacity}" stroke="{stroke}" stroke-width="1.2"/>')


def title(x, y, words):
    text(x, y, words, 17, style=' font-weight="bold"')


class Camera:
    """A camera in a world with x right, y down, z forward, drawn from above, behind and left of the
    camera."""

    def __init__(self, centre, yaw, name):
        self.centre, self.yaw, self.name = centre, yaw, name

    def world(self, p):
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        x, y, z = p
        return (self.centre[0] + c * x + s * z, self.centre[1] + y, self.centre[2] - s * x + c * z)


def project(p):
    """An oblique projection: x to the right, y down, z up and to the right."""
    x, y, z = p
    return (60 + 105 * x + 46 * z, 330 + 95 * y - 62 * z)


def camera(c, offsets):
    origin = project(c.centre)
    corners = [
        project(c.world((x, y, 0.8)))
        for x, y in ((-0.42, -0.3), (0.42, -0.3), (0.42, 0.3), (-0.42, 0.3))
    ]
    for corner in corners:
        line(origin, corner, GREY, 1)
    polygon(corners, "#e8f0fe", GREY, 0.7)
    for axis, colour, name in (
        ((0.9, 0, 0), RED, "x"),
        ((0, 0.8, 0), GREEN, "y"),
        ((0, 0, 1.5), BLUE, "z"),
    ):
        tip = project(c.world(axis))
        line(origin, tip, colour, 2.5, arrow=True)
        dx, dy = offsets[name]
        text(tip[0] + dx, tip[1] + dy, name, 16, colour, style=' font-style="italic"')
    dot(origin, 4)


def geometry():
    c0, c1 = Camera((0.35, 0, 0), 0.0, "0"), Camera((3.6, 0, 0.1), -0.42, "1")
    point = (2.35, -0.25, 4.0)
    p, o0, o1 = project(point), project(c0.centre), project(c1.centre)
    line(o0, o1, TEAL, 1.5, "6 4")
    line(o0, p, INK, 1.2, "2 4")
    line(o1, p, INK, 1.2, "2 4")
    camera(c0, {"x": (8, 5), "y": (8, 10), "z": (-16, 0)})
    camera(c1, {"x": (8, 5), "y": (8, 10), "z": (-16, 6)})
    dot(p, 5, "#6a1b9a")
    text(p[0] + 10, p[1] - 4, "X", 18, "#6a1b9a")
    title(20, 32, "Two cameras: x right, y down, z forward")
    text(o0[0] - 40, o0[1] + 112, "camera 0, the first image", 15)
    text(o1[0] - 20, o1[1] + 112, "camera 1", 15)
    line((o1[0] - 14, o1[1] + 14), (o0[0] + 130, o0[1] + 17), TEAL, 2, arrow=True)
    text((o0[0] + o1[0]) / 2 + 40, o0[1] + 38, "t: camera 0's centre,", 15, TEAL, "middle")
    text((o0[0] + o1[0]) / 2 + 40, o0[1] + 57, "in camera 1's axes; |t| = 1", 15, TEAL, "middle")
    text(20, 62, "x1 = R x0 + t", 20, style=' font-family="monospace" font-weight="bold"')
    text(20, 86, "x0, x1: the point X in camera 0's and in camera 1's frame", 14)
    text(20, 106, "R turns from camera 0's axes to camera 1's", 14)
    text(20, 126, "camera 1 stands at -Rᵀ t in camera 0's axes", 14)
    text(p[0] + 30, p[1] + 26, "rays d0, d1:", 14)
    text(p[0] + 30, p[1] + 44, "unit vectors", 14)


def pixels():
    left, top, side = 640, 76, 62
    title(640, 32, "Pixel zero is a pixel's centre")
    for row in range(3):
        for column in range(4):
            shade = ["#f1f3f4", "#e8eaed", "#dfe1e5"][(row + column) % 3]
            x, y = left + 12 + column * side, top + row * side
            polygon([(x, y), (x + side, y), (x + side, y + side), (x, y + side)], shade, GREY)
            dot((x + side / 2, y + side / 2), 2.5, GREY)
    zero = (left + 12 + side / 2, top + side / 2)
    line(zero, (zero[0] + 3.2 * side, zero[1]), RED, 2.5, arrow=True)
    line(zero, (zero[0], zero[1] + 2.3 * side), GREEN, 2.5, arrow=True)
    text(zero[0] + 3.2 * side + 4, zero[1] - 8, "x", 16, RED, style=' font-style="italic"')
    text(zero[0] - 16, zero[1] + 2.3 * side + 4, "y", 16, GREEN, style=' font-style="italic"')
    dot(zero, 4.5)
    text(zero[0] + 8, zero[1] + 18, "(0, 0)", 14)
    text(zero[0] + 8 + side, zero[1] + 18, "(1, 0)", 14)
    dot((left + 12, top), 4.5, "#ef6c00", "#fff")
    text(left + 8, top - 8, "COLMAP's (0, 0): ours + 0.5 is theirs", 14, "#ef6c00")
    text(left + 12, top + 3 * side + 24, "u = fx x/z + cx,  v = fy y/z + cy, through the lens", 14)


def body():
    cx, cy = 150, 560
    title(20, 482, "A drone's body, from above")
    for dx, dy in ((-34, -28), (34, -28), (-34, 28), (34, 28)):
        line((cx, cy), (cx + dx, cy + dy), GREY, 5)
        out.append(f'<circle cx="{cx + dx}" cy="{cy + dy}" r="16" fill="#f1f3f4" stroke="{GREY}"/>')
    out.append(
        f'<rect x="{cx - 12}" y="{cy - 20}" width="24" height="40" rx="8" fill="#fff" '
        f'stroke="{INK}"/>'
    )
    line((cx, cy), (cx, cy - 58), RED, 2.5, arrow=True)
    line((cx, cy), (cx + 92, cy), GREEN, 2.5, arrow=True)
    dot((cx, cy), 7, BLUE, "#fff")
    line((cx - 4.5, cy - 4.5), (cx + 4.5, cy + 4.5), BLUE, 1.6)
    line((cx - 4.5, cy + 4.5), (cx + 4.5, cy - 4.5), BLUE, 1.6)
    text(cx + 10, cy - 46, "x forward", 14, RED)
    text(cx + 72, cy + 22, "y right", 14, GREEN)
    text(cx - 76, cy + 5, "z down", 14, BLUE)
    for k, words in enumerate(
        (
            "world: z down, x along the body's x at start",
            "quaternions: w x y z, world_from_body",
            "roll right, pitch up, yaw clockwise: positive",
        )
    ):
        text(300, 520 + 24 * k, words, 14)
    text(300, 600, "a camera that looks forward:", 14)
    text(
        500,
        600,
        "x_cam = y_body   y_cam = z_body   z_cam = x_body",
        14,
        style=' font-family="monospace"',
    )


def main():
    geometry()
    pixels()
    line((20, 452), (WIDTH - 20, 452), GREY, 1)
    line((615, 20), (615, 436), GREY, 1)
    body()
    markers = "".join(
        f'<marker id="{colour[1:]}" viewBox="0 0 10 10" refX="8" refY="5" markerWidth="6" '
        f'markerHeight="6" '
        f'orient="auto"><path d="M0,0 L10,5 L0,10 z" fill="{colour}"/></marker>'
        for colour in (RED, GREEN, BLUE, TEAL)
    )
    with open(sys.argv[1], "w") as file:
        file.write(
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
            'font-family="Helvetica, Arial, sans-serif" role="img">'
            "<title>Frames, R, t, pixel zero, rays and the body frame of twoview</title>"
            f'<defs>{markers}</defs><rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>\n'
            + "\n".join(out)
            + "\n</svg>\n"
        )


main()
