"""Tests of twoview drone over real sockets, with the drone of `twoview drone simulate`."""

import contextlib
import json
import os
import pathlib
import pty
import resource
import select
import signal
import struct
import subprocess
import sys
import tempfile
import termios
import time
import unittest

PROGRAM = os.environ["TWOVIEW_PROGRAM"]
HOST = "127.0.0.1"


def has_drone():
    return subprocess.run([PROGRAM, "drone", "--help"], capture_output=True).returncode == 0


def reconstruct(recording, output, *arguments):
    return subprocess.run([PROGRAM, "reconstruct", "--recording", recording, "-o", output,
                           *arguments], capture_output=True, text=True, timeout=120)


class Simulator:
    """A running `drone simulate` on free ports of the loopback; `options` are its command-line
    options."""

    def __init__(self, *options):
        command = [PROGRAM, "drone", "simulate", "--duration", "120"]
        for channel in ("at", "navdata", "video", "control", "recording"):
            command += [f"--{channel}-port", "0"]
        self.process = subprocess.Popen(command + list(options), stdout=subprocess.PIPE, text=True)
        words = self.process.stdout.readline().replace(",", "").split()
        self.port = {name: words[words.index(name) + 1]
                     for name in ("commands", "navdata", "video", "control")}

    def ports(self):
        return ["--host", HOST, "--at-port", self.port["commands"],
                "--navdata-port", self.port["navdata"], "--video-port", self.port["video"],
                "--control-port", self.port["control"]]

    def stop(self):
        """Ends the simulator as Ctrl-C does; returns its counts by name."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        text = self.process.communicate(timeout=20)[0]
        line = [line for line in text.splitlines() if line.startswith("done")]
        words = line[0].split(None, 1)[1] if line else ""
        return {name: int(value) for name, value in
                (part.strip().rsplit(" ", 1) for part in words.split(",") if part.strip())}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.communicate()


def run(*arguments, **options):
    return subprocess.run([PROGRAM, "drone", *arguments], capture_output=True, text=True,
                          timeout=60, **options)


def packets_of(path):
    """(the PaVE packets of a file, the number of bytes of an incomplete packet at its end)"""
    data = pathlib.Path(path).read_bytes()
    at, packets = 0, []
    while at + 64 <= len(data) and data[at:at + 4] == b"PaVE":
        size = struct.unpack_from("<H", data, at + 6)[0] + struct.unpack_from("<I", data, at + 8)[0]
        if at + size > len(data):
            break
        packets.append(data[at:at + size])
        at += size
    return packets, len(data) - at


def navdata_of(path):
    """([(host time, bytes) of each packet of a navdata.log], the number of bytes left over at its
    end)"""
    data = pathlib.Path(path).read_bytes()
    at, packets = 0, []
    while at + 12 <= len(data):
        host_ns, size = struct.unpack_from("<QI", data, at)
        if at + 12 + size > len(data):
            break
        packets.append((host_ns, data[at + 12:at + 12 + size]))
        at += 12 + size
    return packets, len(data) - at


@unittest.skipUnless(has_drone(), "this build has no drone verbs (libavcodec)")
class Drone(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.output = os.path.join(self.folder.name, "recording")

    def path(self, name):
        return os.path.join(self.output, name)

    def summary(self):
        return json.loads(pathlib.Path(self.path("summary.json")).read_text())

    def lines(self, name):
        return pathlib.Path(self.path(name)).read_text().splitlines()

    def assert_refused(self, result, *words):
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        for word in words:
            self.assertIn(word, result.stderr)

    def test_info_tells_state_battery_and_configuration(self):
        with Simulator() as drone:
            result = run("info", "--json", *drone.ports())
            self.assertEqual(result.returncode, 0, result.stderr)
            told = json.loads(result.stdout)
            self.assertEqual((told["state"], told["firmware"]), ("landed", "2.4.8"))
            self.assertIn("control:altitude_max", told["configuration"])
            self.assertEqual(drone.stop()["take offs"], 0)

    def test_nobody_at_the_host_is_said_in_one_line(self):
        started = time.time()
        result = run("info", "--host", HOST, "--navdata-port", "9", "--duration", "1")
        self.assert_refused(result, "no AR.Drone answers", HOST)
        self.assertLess(time.time() - started, 15)
        self.assert_refused(run("info", "--host", "no.such.host.invalid"), "no.such.host.invalid")
        self.assert_refused(run("info", "--navdata-port", "70000"), "--navdata-port")

    def test_a_port_in_use_is_named(self):
        with Simulator() as drone:
            result = run("simulate", "--at-port", drone.port["commands"], "--duration", "1")
            self.assert_refused(result, "port " + drone.port["commands"], "in use")

    def test_the_lens_is_written_as_a_camera_file(self):
        texts = []
        for more in ([], ["--camera", self.path("lens0.yaml")]):
            lens = self.path(f"lens{len(texts)}.yaml")
            ports = [word for c in ("at", "navdata", "video", "control", "recording")
                     for word in (f"--{c}-port", "0")]
            result = run("simulate", *ports, "--duration", "0.1", "--write-camera", lens, *more)
            self.assertEqual(result.returncode, 0, result.stderr)
            texts.append(pathlib.Path(lens).read_text())
        self.assertEqual(*texts)
        self.assertIn("568, 0, 320, 0, 567, 180, 0, 0, 1", " ".join(texts[0].split()))
        self.assertIn("-0.52, 0.27, 0, 0, 0", " ".join(texts[0].split()))

    def test_a_lens_of_another_size_is_scaled_where_that_is_wanted(self):
        big, lens = (os.path.join(self.folder.name, name) for name in ("big.yaml", "lens.yaml"))
        pathlib.Path(big).write_text(
            "image_width: 1280\nimage_height: 720\ncamera_name: c\n"
            "camera_matrix: {rows: 3, cols: 3, data: [1136, 0, 640.5, 0, 1134, 360.5, 0, 0, 1]}\n"
            "distortion_model: plumb_bob\n"
            "distortion_coefficients: {rows: 1, cols: 5, data: [-0.52, 0.27, 0, 0, 0]}\n")
        ports = [word for c in ("at", "navdata", "video", "control", "recording")
                 for word in (f"--{c}-port", "0")]
        command = ("simulate", *ports, "--duration", "0.1", "--camera", big, "--write-camera", lens)
        self.assert_refused(run(*command), "1280x720", "640x360", "--scale-camera")
        result = run(*command, "--scale-camera")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("568, 0, 320, 0, 567, 180, 0, 0, 1",
                      " ".join(pathlib.Path(lens).read_text().split()))

    def test_a_recording_holds_what_was_sent(self):
        with Simulator() as drone:
            result = run("record", "--duration", "4", "-o", self.output, "--frames", "--json",
                         *drone.ports())
            self.assertEqual(result.returncode, 0, result.stderr)
            summary = json.loads(result.stdout)
        self.assertEqual(summary, self.summary())
        self.assertEqual(
            set(summary),
            {
                "frames_received",
                "frames_decoded",
                "frames_dropped",
                "gaps",
                "navdata_received",
                "navdata_rejected",
                "reconnects",
                "seconds",
            },
        )
        packets, rest = packets_of(self.path("video.pave"))
        self.assertEqual((len(packets), rest), (summary["frames_received"], 0))
        self.assertGreater(len(packets), 5)
        navdata, rest = navdata_of(self.path("navdata.log"))
        self.assertEqual((len(navdata), rest), (summary["navdata_received"], 0))
        self.assertTrue(all(data[:4] == b"\x88\x77\x66\x55" for _, data in navdata))
        self.assertEqual(sorted(t for t, _ in navdata), [t for t, _ in navdata])
        frames = [line.split() for line in self.lines("frames.txt") if line[0] != "#"]
        self.assertEqual(len(frames), len(packets))
        self.assertTrue(all(len(frame) == 4 for frame in frames))
        attitudes = [line.split() for line in self.lines("attitude.tum") if line[0] != "#"]
        self.assertTrue(attitudes and all(len(line) == 8 for line in attitudes))
        for line in attitudes:
            self.assertAlmostEqual(sum(float(x) ** 2 for x in line[4:]), 1, places=6)
        self.assertEqual(len(os.listdir(self.path("frames"))), summary["frames_decoded"])
        again = run("replay", self.output, "--json", "--frames", self.path("again"))
        self.assertEqual(again.returncode, 0, again.stderr)
        replayed = json.loads(again.stdout)
        for key in ("frames_received", "frames_decoded", "navdata_received", "navdata_rejected"):
            self.assertEqual(replayed[key], summary[key], key)
        for name in os.listdir(self.path("frames")):
            self.assertEqual(pathlib.Path(self.path("frames"), name).read_bytes(),
                             pathlib.Path(self.path("again"), name).read_bytes())
        start = json.loads(run("replay", self.output, "--json", "--duration", "1").stdout)
        self.assertLessEqual(start["seconds"], 1)
        for key in ("frames_received", "navdata_received"):
            self.assertTrue(0 < start[key] < 0.5 * summary[key], (key, start, summary))
        self.assert_refused(run("replay", self.output, "--duration", "nan"), "--duration")
        pair = reconstruct(self.output, self.path("pair"), "--focal-35mm", "30", "--frames", "0",
                           "3", "--resize", "320", "--json")
        self.assertIn(pair.returncode, (0, 3), pair.stderr)
        found = json.loads(pair.stdout)
        self.assertEqual((found["cameras"][0]["source"], found["image_size0"]),
                         ("focal_35mm", [320, 180]))
        self.assert_refused(reconstruct(self.output, self.path("none")),
                            "--recording needs --camera, or --focal-35mm")
        self.assert_refused(reconstruct(self.output, self.path("none"), "--focal-35mm", "30",
                                        "--camera-in-body", "nan,0,0"), "--camera-in-body")
        with open(self.path("other.yaml"), "w", encoding="utf-8") as file:
            file.write("image_width: 640\nimage_height: 480\n"
                       "K: [500, 0, 320, 0, 500, 240, 0, 0, 1]\n")
        self.assert_refused(reconstruct(self.output, self.path("none"), "--camera",
                                        self.path("other.yaml")),
                            "the recording is 640x360, but camera", "for 640x480", "same video")
        # Another run into the same folder must not change the recording.
        again = run("record", "--duration", "1", "-o", self.output, *drone.ports())
        self.assert_refused(again, "holds a recording already: name another folder")
        self.assertEqual(summary, self.summary())

    def test_a_bad_link_costs_packets_and_nothing_else(self):
        with Simulator("--lose", "0.05", "--duplicate", "0.05", "--reorder", "0.05", "--truncate",
                       "0.02", "--corrupt", "0.02", "--garbage", "0.2",
                       "--cut-video-every", "2.5") as drone:
            result = run("record", "--duration", "8", "-o", self.output, "--json", *drone.ports())
            self.assertEqual(result.returncode, 0, result.stderr)
            summary = json.loads(result.stdout)
            self.assertGreaterEqual(drone.stop()["video cuts"], 2)
        self.assertGreater(summary["navdata_rejected"], 0)
        self.assertGreater(summary["reconnects"], 0)
        self.assertGreater(summary["gaps"], 0)
        # A cut costs the frames up to the next complete picture. How many frames come in the time
        # depends on the machine, what part of them is decoded does not.
        self.assertEqual(summary["frames_decoded"] + summary["frames_dropped"],
                         summary["frames_received"])
        self.assertGreater(4 * summary["frames_decoded"], summary["frames_received"])
        packets, rest = packets_of(self.path("video.pave"))
        self.assertEqual((len(packets), rest), (summary["frames_received"], 0))

    def test_a_killed_recording_is_whole_up_to_its_last_packet(self):
        with Simulator() as drone:
            recorder = subprocess.Popen([PROGRAM, "drone", "record", "-o", self.output, "--quiet",
                                         *drone.ports()])
            deadline = time.time() + 20
            while time.time() < deadline:
                time.sleep(0.2)
                if os.path.exists(self.path("video.pave")) and \
                        os.path.getsize(self.path("video.pave")) > 100000:
                    break
            recorder.kill()
            recorder.wait()
        self.assertGreater(len(packets_of(self.path("video.pave"))[0]), 1)
        self.assertGreater(len(navdata_of(self.path("navdata.log"))[0]), 10)

    def test_ctrl_c_ends_a_recording_well(self):
        with Simulator() as drone:
            recorder = subprocess.Popen([PROGRAM, "drone", "record", "-o", self.output, "--quiet",
                                         *drone.ports()])
            time.sleep(3)
            recorder.send_signal(signal.SIGINT)
            self.assertEqual(recorder.wait(timeout=10), 0)
        self.assertGreater(self.summary()["navdata_received"], 0)

    def test_progress_is_for_terminals_and_not_a_matter_of_colour(self):
        with Simulator() as drone:
            for variables, shown in (({"NO_COLOR": "1", "TERM": "xterm"}, True),
                                     ({"TERM": "dumb"}, False)):
                with self.subTest(**variables):
                    master, slave = pty.openpty()
                    recorder = subprocess.Popen(
                        [PROGRAM, "drone", "record", "-o", self.path(variables["TERM"]),
                         "--duration", "1", *drone.ports()], stdout=slave,
                        env={**os.environ, **variables})
                    self.assertEqual(recorder.wait(timeout=20), 0)
                    os.close(slave)
                    text = b""
                    with contextlib.suppress(OSError):  # what is read after the end
                        while block := os.read(master, 4096):
                            text += block
                    os.close(master)
                    self.assertEqual(b" navdata, " in text and b" reboots " in text, shown, text)
                    self.assertNotIn(b"\033", text)

    def test_a_full_disk_loses_nothing_that_was_recorded(self):
        def small_files():
            resource.setrlimit(resource.RLIMIT_FSIZE, (150000, 150000))

        with Simulator() as drone:
            result = run("record", "--duration", "20", "-o", self.output, "--quiet", *drone.ports(),
                         preexec_fn=small_files)
        self.assert_refused(result, "cannot write", "what was recorded before is kept")
        self.assertGreater(len(navdata_of(self.path("navdata.log"))[0]), 10)
        self.assertEqual(navdata_of(self.path("navdata.log"))[1], 0)
        self.assertEqual(packets_of(self.path("video.pave"))[1], 0)

    def test_a_recording_cut_anywhere_replays_up_to_there(self):
        with Simulator() as drone:
            run("record", "--duration", "3", "-o", self.output, "--quiet", *drone.ports())
        whole = {name: pathlib.Path(self.path(name)).read_bytes()
                 for name in ("video.pave", "navdata.log", "frames.txt")}
        for share in (0.0, 0.1, 0.37, 0.5, 0.93):
            for name, data in whole.items():
                pathlib.Path(self.path(name)).write_bytes(data[:int(len(data) * share)])
            result = run("replay", self.output, "--json")
            self.assertEqual(result.returncode, 0, result.stderr)
            told = json.loads(result.stdout)
            self.assertEqual(told["frames_received"], len(packets_of(self.path("video.pave"))[0]))
            self.assertEqual(told["navdata_received"], len(navdata_of(self.path("navdata.log"))[0]))
        self.assert_refused(run("replay", self.folder.name), "no recording")

    def test_an_output_that_cannot_be_is_refused(self):
        blocker = os.path.join(self.folder.name, "file")
        pathlib.Path(blocker).touch()
        self.assert_refused(
            run("record", "-o", os.path.join(blocker, "x"), "--duration", "1"), blocker
        )

    def test_a_dry_run_sends_nothing(self):
        with Simulator() as drone:
            result = run("fly", "--duration", "3", *drone.ports(), input="twx ")
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertIn("would ask: take off", result.stdout)
            counts = drone.stop()
        self.assertEqual((counts["commands obeyed"], counts["navdata sent"]), (0, 0))

    def test_flying_needs_a_terminal(self):
        self.assert_refused(
            run("fly", "--live", "--host", HOST, stdin=subprocess.DEVNULL), "terminal"
        )

    def test_keys_fly_the_drone_and_leaving_lands_it(self):
        truth = os.path.join(self.folder.name, "truth.txt")
        with Simulator("--truth", truth) as drone:
            master, slave = pty.openpty()
            pilot = subprocess.Popen([PROGRAM, "drone", "fly", "--live", *drone.ports()],
                                     stdin=slave, stdout=slave, stderr=subprocess.PIPE)
            os.close(slave)
            shown = b""

            def watch(seconds):
                nonlocal shown
                end = time.time() + seconds
                while time.time() < end:
                    if not select.select([master], [], [], 0.05)[0]:
                        continue
                    try:
                        shown += os.read(master, 4096)
                    except OSError:  # the read fails once the program has closed the terminal
                        return

            watch(3)
            os.write(master, b"t")
            watch(5)
            self.assertIn(b"in the air", shown)
            for _ in range(12):
                os.write(master, b"w")
                watch(0.1)
            shown = b""
            watch(1)
            os.write(master, b"\x1b")
            watch(12)
            self.assertEqual(pilot.wait(timeout=15), 0, pilot.stderr.read())
            pilot.stderr.close()
            os.close(master)
            counts = drone.stop()
        self.assertEqual(counts["take offs"], 1)
        self.assertIn(b"on the ground", shown)

    def test_a_second_ctrl_c_gives_the_terminal_its_mode_back(self):
        with Simulator() as drone:
            master, slave = pty.openpty()
            before = termios.tcgetattr(slave)
            pilot = subprocess.Popen([PROGRAM, "drone", "fly", "--live", *drone.ports()],
                                     stdin=slave, stdout=slave, stderr=subprocess.DEVNULL)
            shown = b""

            def read_until(text, seconds):
                nonlocal shown
                end = time.time() + seconds
                while text not in shown and time.time() < end:
                    if select.select([master], [], [], 0.05)[0]:
                        shown += os.read(master, 4096)

            read_until(b"on the ground", 10)
            self.assertNotEqual(termios.tcgetattr(slave), before)
            os.write(master, b"t")
            read_until(b"in the air", 10)
            self.assertIn(b"in the air", shown)
            pilot.send_signal(signal.SIGINT)  # it lands, which takes seconds
            time.sleep(0.3)
            self.assertIsNone(pilot.poll())
            pilot.send_signal(signal.SIGINT)
            self.assertEqual(pilot.wait(timeout=10), -signal.SIGINT)
            self.assertEqual(termios.tcgetattr(slave), before)
            os.close(slave)
            os.close(master)


if __name__ == "__main__":
    sys.exit(unittest.main())
