"""Tests of --mavlink over real sockets: a simulated vehicle (mavlink_vehicle.py) that speaks
through pymavlink, and a film of a flight through a room whose poses are known."""
import csv
import json
import math
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

from cli_support import SKIP_CODE, camera_yaml

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / ".cache/mavlink"))
try:
    import numpy as np
    from pymavlink.dialects.v20 import common as mavlink

    import mavlink_vehicle as world
except ImportError as error:
    print(f"skipped: {error} (scripts/bootstrap test)")
    sys.exit(SKIP_CODE)

try:
    import mavsdk
    from mavsdk.plugins.mavlink_direct import MavlinkDirect
    from mavsdk.plugins.telemetry import Telemetry
except ImportError:
    mavsdk = None

PROGRAM = os.environ["TWOVIEW_PROGRAM"]


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def run(*arguments, timeout=60):
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True,
                          timeout=timeout)


def has_mavlink():
    answer = run("drone", "info", "--mavlink", "nonsense")
    if "--mavlink nonsense" in answer.stderr:
        return True
    # What a program without the driver says is one line that names the remedy.
    assert answer.returncode == 2 and answer.stderr.count("\n") == 1, answer.stderr
    assert "drone" in answer.stderr or "scripts/bootstrap mavlink" in answer.stderr, answer.stderr
    return False


def has_room():
    return "--room" in run("odometry", "--help").stdout


NEEDS_ODOMETRY = unittest.skipUnless("\n  odometry " in run("--help").stdout,
                                     "the program was built without TWOVIEW_ODOMETRY")


def angle_deg(a, b):
    return math.degrees(math.acos(max(-1.0, min(1.0, (np.trace(a @ b.T) - 1) / 2))))


def matrix(x, y, z, w):
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def trajectory(path):
    lines = [line.split() for line in Path(path).read_text().splitlines() if line[0] != "#"]
    return [(float(n[0]), np.array([float(v) for v in n[1:4]]),
             matrix(*(float(v) for v in n[4:]))) for n in lines]


@unittest.skipUnless(has_mavlink(), "this build has no MAVLink (scripts/bootstrap mavlink)")
class Mavlink(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.film = world.write_film(cls.folder / "film.avi")
        cls.camera = cls.folder / "camera.yaml"
        cls.camera.write_text(camera_yaml(world.WIDTH, world.HEIGHT, world.FOCAL, world.FOCAL,
                                          (world.WIDTH - 1) / 2, (world.HEIGHT - 1) / 2))
        cls.recording = cls.folder / "recording"
        cls.port = free_port()
        cls.address = f"udp://127.0.0.1:{cls.port}"
        # The flight that most tests use: recorded over a bad link.
        with world.Vehicle(mavlink, cls.port, faults=True) as cls.vehicle:
            cls.recorded = run("drone", "record", "--mavlink", cls.address, "--camera-source",
                               cls.film, "--camera-delay", 0, "-o", cls.recording)

    def assert_refused(self, result, *words):
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        for word in words:
            self.assertIn(word, result.stderr)

    def assert_flown(self, output):
        """The poses of an odometry are those of the flight, in metres and upright."""
        result = json.loads((output / "result.json").read_text())
        self.assertEqual(result["scale"], "metric")
        poses = trajectory(output / "trajectory.txt")
        self.assertGreater(len(poses), 0.8 * world.FRAMES)
        start = poses[0][0]
        # The first frame of the path may be a later one of the film; it flies at one velocity.
        travelled = poses[-1][1] - poses[0][1]
        expected = world.VELOCITY * (poses[-1][0] - start)
        self.assertLess(np.linalg.norm(travelled - expected),
                        0.1 * np.linalg.norm(expected), (travelled, expected))
        for _, _, rotation in (poses[0], poses[len(poses) // 2], poses[-1]):
            # Of the attitude, what does not depend on the heading: where down is in the camera.
            down = rotation.T @ [0, 0, 1]
            true_down = world.world_from_camera(0).T @ [0, 0, 1]
            self.assertLess(math.degrees(math.acos(min(1, down @ true_down))), 1.0)
        turned = world.rotation(0, 0, world.TURN * (poses[-1][0] - start))
        self.assertLess(angle_deg(poses[-1][2] @ poses[0][2].T, turned), 1.0)

    def test_a_recording_over_a_bad_link_is_whole(self):
        self.assertEqual(self.recorded.returncode, 0, self.recorded.stderr)
        self.assertEqual(self.recorded.stderr, "")
        summary = json.loads((self.recording / "summary.json").read_text())
        self.assertEqual(summary["vehicle"], "PX4, system 7")
        self.assertGreaterEqual(summary["frames_decoded"], 0.8 * world.FRAMES)
        self.assertEqual(summary["frames_received"], world.FRAMES)
        # The faults are counted, but for those after the film's end. A corrupted packet is lost,
        # too, and what is no packet looks like a corrupted one and may hide the packet after it.
        made, garbage = dict(self.vehicle.num_faults), self.vehicle.num_garbage
        made["lost"] += made["corrupted"]
        for kind, number in made.items():
            most = number + (garbage if kind in ("lost", "corrupted") else 0)
            self.assertGreater(number, 0)
            self.assertLessEqual(summary[f"packets_{kind}"], most, summary)
            self.assertGreaterEqual(summary[f"packets_{kind}"], 0.5 * number, (summary, made))
        self.assertGreater(summary["packets_of_others"], 0)
        self.assertGreater(summary["timesyncs"], 0)
        self.assertEqual((summary["silences"], summary["reboots"]), (0, 0))
        self.assertGreater(summary["attitudes"], 0.75 * 50 * world.FRAMES / world.FPS)

    def test_the_companion_asks_for_messages_and_never_steers(self):
        self.assertEqual(self.vehicle.wrong, [])
        self.assertEqual({m.get_type() for m in self.vehicle.heard},
                         {"HEARTBEAT", "COMMAND_LONG", "TIMESYNC"})
        for m in self.vehicle.heard:
            self.assertEqual((m.get_srcSystem(), m.get_srcComponent()), (7, 191))
            if m.get_type() == "COMMAND_LONG":
                self.assertEqual(m.command, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL)
                self.assertEqual((m.target_system, m.target_component), (7, 1))
            if m.get_type() == "HEARTBEAT":  # not a ground station, whose absence is a failure
                self.assertEqual(m.type, mavlink.MAV_TYPE_ONBOARD_CONTROLLER)
        self.assertAlmostEqual(self.vehicle.requested[mavlink.MAVLINK_MSG_ID_ATTITUDE], 0.02, 6)
        self.assertIn(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, self.vehicle.requested)

    def test_the_log_is_read_by_pymavlink(self):
        data = (self.recording / "vehicle.tlog").read_bytes()
        parser, kinds, at = mavlink.MAVLink(None), {}, 0
        while at < len(data):
            size = 12 + data[at + 9]
            message = parser.decode(bytearray(data[at + 8:at + 8 + size]))
            # MAVLink's tools (pymavlink's mavutil) read the number of the link there.
            self.assertEqual(data[at + 7] & 3, 0)
            kinds[message.get_type()] = kinds.get(message.get_type(), 0) + 1
            at += 8 + size
        self.assertGreater(kinds["ATTITUDE"], 100)
        self.assertIn("TIMESYNC", kinds)

    def test_the_log_is_read_by_mavutil(self):
        # It looks for the dialect as it is imported.
        os.environ.update(MAVLINK20="1", MAVLINK_DIALECT="common")
        try:
            from pymavlink import mavutil
        except ImportError as missing:
            self.skipTest(f"{missing} (scripts/bootstrap test)")
        log = mavutil.mavlink_connection(str(self.recording / "vehicle.tlog"))
        kinds, times = {}, []
        while (message := log.recv_msg()) is not None:
            kinds[message.get_type()] = kinds.get(message.get_type(), 0) + 1
            times.append(message._timestamp)
            self.assertNotEqual(message.get_type(), "BAD_DATA")
        self.assertGreater(kinds["ATTITUDE"], 100)
        self.assertEqual(times, sorted(times))
        data, own, at = (self.recording / "vehicle.tlog").read_bytes(), [], 0
        while at < len(data):  # the packets and their times are those of the file
            own.append(int.from_bytes(data[at:at + 8], "big") * 1e-6)
            at += 20 + data[at + 9]
        self.assertEqual(sum(kinds.values()), len(own))
        np.testing.assert_allclose(times, own, atol=1e-5)

    def test_two_frames_of_the_recording_have_metres_and_gravity(self):
        output = self.folder / "pair"
        result = run("reconstruct", "--recording", self.recording, "--camera", self.camera,
                     "--frames", 8, 24, "-o", output)
        self.assertEqual(result.returncode, 0, result.stderr)
        result = json.loads((output / "result.json").read_text())
        self.assertEqual((result["scale"], result["imu"]["scale_source"]), ("metric", "velocity"))
        self.assertIn(b"forward; unit: metres\n", (output / "cloud.ply").read_bytes())
        self.assertTrue(result["imu"]["gravity_used"])
        self.assertLess(result["imu"]["rotation_difference_deg"], 0.3)
        baseline = np.linalg.norm(result["t"])
        true = np.linalg.norm(world.VELOCITY) * result["recording"]["seconds_apart"]
        self.assertLess(abs(baseline / true - 1), 0.02)
        # The pose of the second frame in the first one's axes, from the true flight.
        seconds = result["recording"]["seconds_apart"]
        turned = world.rotation(0, 0, world.TURN * seconds)
        a = world.world_from_camera(8 / world.FPS)
        b = turned @ a
        self.assertLess(angle_deg(np.array(result["R"]).reshape(3, 3), b.T @ a), 0.3)
        t = -b.T @ (world.VELOCITY * seconds)
        self.assertLess(np.linalg.norm(np.array(result["t"]) - t), 0.03 * true)

    def test_the_pair_is_chosen_with_the_calibration_that_it_is_estimated_with(self):
        # A focal length that is off by a third and refined: with the camera taken as exact other
        # frames, and other inliers of theirs, are the best.
        output = self.folder / "chosen"
        result = run("reconstruct", "--recording", self.recording, "--focal-35mm", "20", "-o",
                     output)
        self.assertEqual(result.returncode, 0, result.stderr)
        result = json.loads((output / "result.json").read_text())
        self.assertNotEqual(result["focal_length"]["scale"], 1)
        self.assertRegex(result["recording"]["chosen"],
                         f": {result['num_inliers']} matches agree, "
                         f"{result['median_parallax_deg']:.1f} deg of parallax")

    def test_the_first_seconds_alone_are_replayed(self):
        # A film takes its time to open, on a busy computer more than the seconds asked for: they
        # are counted from the first frame on, whose time the recording states.
        log = (self.recording / "vehicle.tlog").read_bytes()
        begin = int.from_bytes(log[:8], "big") * 1e-6
        lines = (self.recording / "frames.txt").read_text().splitlines()
        times = [float(line.split()[0]) * 1e-9 - begin for line in lines if line[0] != "#"]
        decoded = [0]
        for seconds in (1, 2):
            duration = times[0] + seconds
            done = run("drone", "replay", self.recording, "--json", "--duration", duration)
            self.assertEqual(done.returncode, 0, done.stderr)
            played = json.loads(done.stdout)
            self.assertTrue(0.8 * duration < played["seconds"] <= duration, (played, times))
            self.assertLessEqual(played["frames_decoded"],
                                 sum(time <= duration for time in times), (played, times))
            decoded.append(played["frames_decoded"])
        self.assertTrue(decoded[0] < decoded[1] < decoded[2] < len(times), decoded)

    @NEEDS_ODOMETRY
    def test_odometry_of_the_recording_is_metric_and_upright(self):
        output = self.folder / "flown"
        result = run("odometry", self.recording, "--camera", self.camera, "-o", output)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assert_flown(output)
        again = run("drone", "replay", self.recording, "--json")
        self.assertEqual(again.returncode, 0, again.stderr)
        summary = json.loads((self.recording / "summary.json").read_text())
        replayed = json.loads(again.stdout)
        for name in ("frames_decoded", "attitudes", "timesyncs"):
            self.assertAlmostEqual(replayed[name], summary[name], delta=1, msg=name)

    @NEEDS_ODOMETRY
    def test_odometry_of_the_vehicle_itself_is_metric_and_upright(self):
        output = self.folder / "live"
        with world.Vehicle(mavlink, self.port, autopilot="ardupilot"):
            result = run("odometry", "--mavlink", self.address, "--camera-source", self.film,
                         "--camera", self.camera, "-o", output, *["--room"] * has_room())
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assert_flown(output)
        if has_room():  # of pictures that were kept: the vehicle does not give them again
            room = json.loads((output / "result.json").read_text())["room"]
            self.assertGreater(room["keyframes_used"], 0, room)
            self.assertGreater(room["num_vertices"], 1000, room)
            self.assertTrue(list((output / "colmap" / "images").iterdir()))
            self.assertEqual([p for p in output.iterdir() if p.name[0] == "."], [])

    def told(self, output, *options):
        """What the vehicle hears of an odometry: {type: messages}."""
        with world.Vehicle(mavlink, self.port) as vehicle:
            result = run("odometry", "--mavlink", self.address, "--camera-source", self.film,
                         "--camera", self.camera, "-o", output, *options)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(vehicle.wrong, [])
        heard = {}
        for message in vehicle.heard:
            heard.setdefault(message.get_type(), []).append(message)
        # Nothing of this steers.
        self.assertLessEqual(set(heard), {"HEARTBEAT", "TIMESYNC", "COMMAND_LONG", "ODOMETRY",
                                          "VISION_POSITION_ESTIMATE", "STATUSTEXT"})
        self.assertEqual({m.command for m in heard["COMMAND_LONG"]},
                         {mavlink.MAV_CMD_SET_MESSAGE_INTERVAL})
        return heard, result

    def assert_packed_as_pymavlink_does(self, message):
        """Byte for byte: pymavlink packs the fields that it has read into the same packet."""
        link = mavlink.MAVLink(None, srcSystem=message.get_srcSystem(),
                               srcComponent=message.get_srcComponent())
        link.seq = message.get_seq()
        fields = [getattr(message, name) for name in message.fieldnames]
        self.assertEqual(type(message)(*fields).pack(link), bytes(message.get_msgbuf()))

    @NEEDS_ODOMETRY
    def test_the_vehicle_is_told_where_it_is(self):
        output = self.folder / "told"
        heard, result = self.told(output, "--send-odometry", "--send-vision-position")
        with open(output / "frames.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        known = [row for row in rows if row["status"] == "tracking" and row["scale"] == "metric"]
        odometry, positions = heard["ODOMETRY"], heard["VISION_POSITION_ESTIMATE"]
        # Each tracked frame in metres but the first of a stretch, which has no velocity yet.
        self.assertGreater(len(known), 20)
        self.assertLessEqual(len(odometry), len(known))
        self.assertGreater(len(odometry), 0.8 * len(known))
        self.assertIn(f"{len(odometry)} frames were sent to the vehicle", result.stdout)
        self.assertRegex(result.stdout, r"to message [\d.]+ ms \(mean\), [\d.]+ ms \(max\)")
        self.assertEqual(len(positions), len(odometry))
        numbers = [m.get_seq() for messages in heard.values() for m in messages]
        self.assertEqual(len(set(numbers)), min(256, len(numbers)))
        for m, p in zip(odometry, positions):
            for message in (m, p):
                self.assertEqual((message.get_srcSystem(), message.get_srcComponent()), (7, 197))
                self.assert_packed_as_pymavlink_does(message)
            self.assertEqual((m.frame_id, m.child_frame_id), (mavlink.MAV_FRAME_LOCAL_FRD,
                                                              mavlink.MAV_FRAME_BODY_FRD))
            self.assertEqual(m.estimator_type, mavlink.MAV_ESTIMATOR_TYPE_VIO)
            self.assertTrue(1 <= m.quality <= 100, m.quality)
            self.assertEqual((p.usec, p.x, p.y, p.z, p.reset_counter),
                             (m.time_usec, m.x, m.y, m.z, m.reset_counter))
            self.assertEqual(list(p.covariance), list(m.pose_covariance))
            w, x, y, z = m.q
            R = matrix(x, y, z, w)
            self.assertLess(angle_deg(R, world.rotation(p.roll, p.pitch, p.yaw)), 0.01)
            # Level attitudes of the flight, whatever the heading is.
            self.assertLess(abs(math.degrees(p.roll - world.ROLL)), 1.0)
            self.assertLess(abs(math.degrees(p.pitch - world.PITCH)), 1.0)
            for upper in (m.pose_covariance, m.velocity_covariance):
                full = np.zeros((6, 6))
                full[np.triu_indices(6)] = upper
                full += np.triu(full, 1).T
                self.assertTrue((np.linalg.eigvalsh(full) > 0).all(), full)
        # The exposures, in the vehicle's clock, which began at BOOT_MS.
        times = np.array([m.time_usec for m in odometry]) * 1e-6 - world.BOOT_MS * 1e-3
        self.assertTrue((np.diff(times) > 0).all())
        self.assertTrue(0 < times[0] and times[-1] < 60, times)
        seconds = [float(row["timestamp"]) for row in known]
        self.assertAlmostEqual(times[-1] - times[0], seconds[-1] - seconds[len(known) - len(times)],
                               delta=0.15)
        # Where and how fast the vehicle is, in metres; the path's own scale is good to 10 %.
        places = np.array([(m.x, m.y, m.z) for m in odometry])
        travelled, expected = places[-1] - places[0], world.VELOCITY * (times[-1] - times[0])
        self.assertLess(abs(np.linalg.norm(travelled) / np.linalg.norm(expected) - 1), 0.15)
        speeds = np.array([(m.vx, m.vy, m.vz) for m in odometry])
        self.assertLess(abs(np.linalg.norm(np.median(speeds, 0)) /
                            np.linalg.norm(world.VELOCITY) - 1), 0.15)
        self.assertAlmostEqual(np.median([m.yawspeed for m in odometry]), world.TURN, delta=0.02)
        texts = [m.text for m in heard["STATUSTEXT"]]
        self.assertTrue(texts[0].startswith("twoview: ") and "no position" in texts[0], texts)
        self.assertIn("twoview: position", texts)

    # Not in the bootstrap, since it brings 19 MB: scripts/python -m pip install mavsdk
    if mavsdk:
        @NEEDS_ODOMETRY
        def test_mavsdk_reads_what_the_vehicle_is_told(self):
            port, read, others = free_port(), [], []
            ground = mavsdk.Mavsdk(mavsdk.Configuration.create_with_component_type(
                mavsdk.ComponentType.GROUND_STATION))
            ground.add_any_connection(f"udpin://127.0.0.1:{port}")
            with world.Vehicle(mavlink, self.port, routed_to=port) as vehicle:
                command = [PROGRAM, "odometry", "--mavlink", self.address, "--camera-source",
                           self.film, "--camera", self.camera, "-o", self.folder / "mavsdk",
                           "--send-odometry", "--quiet"]
                with subprocess.Popen(command) as process:
                    system = ground.first_autopilot(10)
                    telemetry, direct = Telemetry(system), MavlinkDirect(system)
                    telemetry.subscribe_odometry(lambda message, _: read.append(message))
                    direct.subscribe_message("ODOMETRY", lambda message, _: others.append(message))
                    process.wait(60)
                deadline = time.monotonic() + 5
                sent = [m for m in vehicle.heard if m.get_type() == "ODOMETRY"]
                while min(len(read), len(others)) < len(sent) and time.monotonic() < deadline:
                    time.sleep(0.05)
            ground.destroy()
            self.assertGreater(len(sent), 20)
            self.assertEqual([m.time_usec for m in sent], [m.time_usec for m in read])
            for m, by_plugin, by_name in zip(sent, read, others):
                place, q = by_plugin.position_body, by_plugin.q
                self.assertEqual((m.x, m.y, m.z, *m.q),
                                 (place.x_m, place.y_m, place.z_m, q.w, q.x, q.y, q.z))
                self.assertEqual(list(m.pose_covariance),
                                 by_plugin.pose_covariance.covariance_matrix)
                fields = json.loads(by_name.fields_json)
                self.assertEqual((7, 197), (by_name.system_id, by_name.component_id))
                for name in ("frame_id", "child_frame_id", "quality", "reset_counter", "vx",
                             "estimator_type", "velocity_covariance"):
                    self.assertEqual(getattr(m, name), fields[name], name)

    @NEEDS_ODOMETRY
    def test_north_and_weak_frames_are_sent_on_request(self):
        heard, _ = self.told(self.folder / "north", "--send-odometry", "--send-north",
                             "--send-weak")
        places = np.array([(m.x, m.y, m.z) for m in heard["ODOMETRY"]])
        self.assertNotIn("VISION_POSITION_ESTIMATE", heard)
        self.assertEqual({m.frame_id for m in heard["ODOMETRY"]}, {mavlink.MAV_FRAME_LOCAL_NED})
        north = world.rotation(0, 0, world.HEADING) @ world.VELOCITY
        travelled = places[-1] - places[0]
        cosine = travelled @ north / np.linalg.norm(travelled) / np.linalg.norm(north)
        self.assertLess(math.degrees(math.acos(min(1, cosine))), 8)

    def test_what_is_sent_needs_a_vehicle(self):
        for options in (("--send-odometry",), ("--send-vision-position",)):
            self.assert_refused(run("odometry", self.film, "--camera", self.camera, "-o",
                                    self.folder / "x", *options), "--mavlink")
        self.assert_refused(run("odometry", "--mavlink", self.address, "--camera", self.camera,
                                "-o", self.folder / "x", "--send-weak"), "--send-odometry")

    def test_info_of_an_old_ardupilot(self):
        with world.Vehicle(mavlink, self.port, autopilot="ardupilot", version=1):
            result = run("drone", "info", "--mavlink", self.address, "--json")
        self.assertEqual(result.returncode, 0, result.stderr)
        info = json.loads(result.stdout)
        self.assertEqual(info["vehicle"], "ArduPilot, system 7")
        self.assertGreater(info["attitudes_per_second"], 25)
        self.assertTrue(info["has_velocity"])
        self.assertAlmostEqual(info["height_m"], world.FLOOR, delta=0.4)

    def test_silence_and_wrong_addresses_have_a_line_of_their_own(self):
        info = ("drone", "info", "--duration", 0.4, "--mavlink")
        self.assert_refused(run(*info, self.address), "no MAVLink vehicle was heard")
        with world.Vehicle(mavlink, self.port, attitudes=False):
            self.assert_refused(run(*info, self.address), "PX4, system 7", "no ATTITUDE")
        with world.Vehicle(mavlink, self.port):
            self.assert_refused(run(*info, self.address, "--vehicle-id", 9),
                                "no autopilot of system 9")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
            taken.bind(("127.0.0.1", self.port))
            self.assert_refused(run(*info, self.address), "another program has this port")
        for wrong in ("tcp://127.0.0.1:5760", "udp://127.0.0.1", "udp://:99999", "udpout://:14550"):
            self.assert_refused(run(*info, wrong), wrong)
        self.assert_refused(run(*info, "/dev/ttyAMA0"), "a serial line needs a router to UDP")
        record = ("drone", "record", "--mavlink", self.address, "-o", self.folder / "new")
        self.assert_refused(run(*record, "--camera-source", "no_such_film.avi"), "no_such_film.avi")
        self.assertFalse((self.folder / "new").exists())
        self.assert_refused(run("drone", "record", "--mavlink", self.address, "--camera-source",
                                self.film, "-o", self.recording), "holds a recording already")

    @NEEDS_ODOMETRY
    def test_odometry_of_a_vehicle_requires_a_camera(self):
        self.assert_refused(run("odometry", "--mavlink", self.address, "-o", self.folder / "o"),
                            "--camera is required")

    def test_a_cut_recording_is_read_to_its_last_whole_packet(self):
        cut = self.folder / "cut"
        shutil.copytree(self.recording, cut)
        data = (cut / "vehicle.tlog").read_bytes()
        (cut / "vehicle.tlog").write_bytes(data[:len(data) // 2 + 3])
        lines = (cut / "frames.txt").read_text()
        (cut / "frames.txt").write_text(lines[:len(lines) // 2])
        result = run("drone", "replay", cut, "--json")
        self.assertEqual(result.returncode, 0, result.stderr)
        summary = json.loads(result.stdout)
        self.assertGreater(summary["attitudes"], 50)
        self.assertEqual(summary["packets_corrupted"], 0)
        (cut / "vehicle.tlog").write_bytes(b"")
        (cut / "frames.txt").write_text("")
        self.assert_refused(run("drone", "replay", cut), "is empty")

    def test_a_clock_that_was_set_back_is_named_by_its_line(self):
        back = self.folder / "back"
        shutil.copytree(self.recording, back)
        lines = (back / "frames.txt").read_text().splitlines()
        middle = len(lines) // 2
        for number, words in ((middle + 1, "set back"), (1, "is no frame")):
            changed = list(lines)
            changed[number - 1] = lines[0] if words == "set back" else "1.5 0 0 1"
            (back / "frames.txt").write_text("\n".join(changed) + "\n")
            self.assert_refused(run("drone", "replay", back), f"line {number}", words)


if __name__ == "__main__":
    unittest.main(verbosity=2)
