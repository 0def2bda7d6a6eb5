"""A simulated MAVLink vehicle and the film of its camera, for test_mavlink.py. The vehicle speaks
through pymavlink, which packs and parses independently of the program's C headers.

The room is a box. World: x along the camera's direction at the start, y right, z down; NED is that
turned by HEADING about z. The vehicle flies sideways at a constant velocity and turns slowly."""
import math
import select
import socket
import threading
import time

import cv2
import numpy as np

WIDTH, HEIGHT, FOCAL, FPS, FRAMES = 480, 360, 400.0, 20, 70
HEADING = 0.9  # yaw at the start, NED
ROLL, PITCH, TURN = 0.05, -0.08, 0.04  # rad, rad, rad/s
VELOCITY = np.array([0.1, 1.0, -0.05])  # m/s, in the world
FLOOR = 1.6  # m below the start
BOOT_MS = 4_000_000
LOW, HIGH = np.array([-4.0, -6.0, -2.0]), np.array([7.0, 8.0, FLOOR])
BODY_FROM_CAMERA = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]], float)


def rotation(roll, pitch, yaw):
    """world_from_body of yaw, then pitch, then roll, written out from the definition."""
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    return about_z @ about_y @ about_x


def position(t):
    return VELOCITY * t


def world_from_camera(t):
    return rotation(ROLL, PITCH, TURN * t) @ BODY_FROM_CAMERA


def render(t, texture):
    x, y = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    rays = np.stack([(x - (WIDTH - 1) / 2) / FOCAL, (y - (HEIGHT - 1) / 2) / FOCAL,
                     np.ones_like(x, float)], -1) @ world_from_camera(t).T
    with np.errstate(divide="ignore"):
        distance = (np.where(rays > 0, HIGH, LOW) - position(t)) / rays
    wall = distance.argmin(-1)
    hit = position(t) + rays * distance.min(-1)[..., None]
    # Each wall shows its own part of the texture, 90 pixels a metre.
    offset = 700.0 * wall + 350.0 * (np.take_along_axis(rays, wall[..., None], -1)[..., 0] > 0)
    u = np.where(wall == 0, hit[..., 1], hit[..., 0])
    v = np.where(wall == 2, hit[..., 1], hit[..., 2])
    size = texture.shape[0]
    return cv2.remap(texture, ((u * 90 + offset) % size).astype(np.float32),
                     ((v * 90 + offset) % size).astype(np.float32), cv2.INTER_LINEAR,
                     borderMode=cv2.BORDER_WRAP)


def write_film(path):
    random = np.random.default_rng(5)
    texture = np.full((2048, 2048), 128, np.uint8)
    for low, high, count in ((20, 60, 2500), (6, 20, 14000)):
        for _ in range(count):
            a, b = random.integers(0, 2048, 2)
            w, h = random.integers(low, high, 2)
            texture[a:a + h, b:b + w] = random.integers(20, 236)
    texture = cv2.GaussianBlur(texture, (0, 0), 0.8)
    writer = cv2.VideoWriter(str(path), cv2.CAP_OPENCV_MJPEG,
                             cv2.VideoWriter_fourcc(*"MJPG"), FPS, (WIDTH, HEIGHT))
    writer.set(cv2.VIDEOWRITER_PROP_QUALITY, 95)
    for k in range(FRAMES):
        writer.write(cv2.cvtColor(render(k / FPS, texture), cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


class Vehicle(threading.Thread):
    """Sends HEARTBEAT to a port of this computer; from the first packet of the companion on it
    flies and sends what was requested. `faults`: of every 25 packets one each is lost, repeated,
    corrupted, and sent after the next one; `num_faults` counts them. A second vehicle with other
    attitudes sends to the same port, and so does something that is no vehicle (`num_garbage`). A
    second port may get the packets of both sides, as a router passes them on (`routed_to`)."""

    FAULTS = {5: "lost", 10: "repeated", 15: "corrupted", 20: "late"}

    def __init__(self, mavlink, port, autopilot="px4", faults=False, version=2, system=7,
                 attitudes=True, lives=60.0, routed_to=None):
        super().__init__(daemon=True)
        self.mavlink, self.port, self.faults, self.attitudes = mavlink, port, faults, attitudes
        self.routed_to = routed_to
        self.autopilot = (mavlink.MAV_AUTOPILOT_PX4 if autopilot == "px4"
                          else mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
        self.link = mavlink.MAVLink(None, srcSystem=system, srcComponent=1)
        self.link.robust_parsing = True
        self.version1 = version == 1
        self.other = mavlink.MAVLink(None, srcSystem=system + 1, srcComponent=1)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.requested, self.heard, self.wrong = {}, [], []
        self.random = np.random.default_rng(3)
        self.stop_event, self.lives, self.held, self.num_sent = threading.Event(), lives, None, 0
        self.num_faults, self.num_garbage = dict.fromkeys(self.FAULTS.values(), 0), 0

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *_):
        self.stop_event.set()
        self.join()
        self.socket.close()

    def send(self, message, link=None):
        link = link or self.link
        data = message.pack(link, force_mavlink1=self.version1)
        link.seq = (link.seq + 1) % 256
        packets = [data]
        if self.faults and link is self.link and message.get_type() != "HEARTBEAT":
            self.num_sent += 1
            fault = self.FAULTS.get(self.num_sent % 25)
            if fault:
                self.num_faults[fault] += 1
            if fault == "lost":
                packets = []
            elif fault == "repeated":
                packets = [data, data]
            elif fault == "corrupted":
                at = self.random.integers(10, len(data))
                packets = [data[:at] + bytes([data[at] ^ 0x55]) + data[at + 1:]]
            elif fault == "late":
                self.held, packets = data, []
            elif self.held is not None:
                packets, self.held = [data, self.held], None
        for packet in packets:
            self.socket.sendto(packet, ("127.0.0.1", self.port))
            self.route(packet)

    def route(self, packet):
        if self.routed_to:
            self.socket.sendto(packet, ("127.0.0.1", self.routed_to))

    def listen(self):
        while select.select([self.socket], [], [], 0)[0]:
            try:
                data = self.socket.recv(2048)
            except ConnectionRefusedError:
                continue
            self.route(data)
            for m in self.link.parse_buffer(data) or []:
                self.heard.append(m)
                if m.get_type() == "BAD_DATA":
                    self.wrong.append(m)
                elif m.get_type() == "COMMAND_LONG" and m.command == 511:
                    self.requested[int(m.param1)] = m.param2 * 1e-6
                elif m.get_type() == "TIMESYNC" and m.tc1 == 0:
                    self.send(self.mavlink.MAVLink_timesync_message(self.now_ns(), m.ts1))

    def now_ns(self):
        return int((time.monotonic() - self.born) * 1e9) + BOOT_MS * 1_000_000

    def run(self):
        mav = self.mavlink
        self.born = time.monotonic()
        start, next_heartbeat, due = None, 0.0, {30: 0.0, 32: 0.0, 141: 0.0}
        while not self.stop_event.is_set() and time.monotonic() - self.born < self.lives:
            now = time.monotonic()
            if now >= next_heartbeat:
                next_heartbeat = now + (1.0 if start else 0.05)
                self.send(mav.MAVLink_heartbeat_message(2, self.autopilot, 0, 0, 4, 3))
            self.listen()
            if start is None and self.heard:
                start = time.monotonic()
            if start is not None:
                self.fly(now, time.monotonic() - start, due)
            time.sleep(0.002)

    def fly(self, now, t, due):
        mav, boot = self.mavlink, self.now_ns() // 1_000_000
        yaw = HEADING + TURN * t
        yaw = math.atan2(math.sin(yaw), math.cos(yaw))
        north = rotation(0, 0, HEADING)
        p, v = north @ position(t), north @ VELOCITY
        messages = {
            30: mav.MAVLink_attitude_message(boot, ROLL, PITCH, yaw, 0, 0, TURN),
            32: mav.MAVLink_local_position_ned_message(boot, *p, *v),
            141: mav.MAVLink_altitude_message(boot * 1000, 0, 0, -p[2], -p[2], 0, FLOOR - p[2]),
        }
        for key, message in messages.items():
            if key == 30 and not self.attitudes or now < due[key]:
                continue
            due[key] = max(due[key] + self.requested.get(key, 0.25), now - 0.1)
            self.send(message)
        if self.faults and self.random.random() < 0.1:
            self.send(mav.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3), self.other)
            self.send(mav.MAVLink_attitude_message(5, 1.5, 1.0, -2.0, 0, 0, 0), self.other)
        if self.faults and self.random.random() < 0.02:
            self.num_garbage += 1
            self.socket.sendto(b"\xfd\x09garbage" + self.random.bytes(40),
                               ("127.0.0.1", self.port))
