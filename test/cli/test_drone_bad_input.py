"""Tests of twoview drone with bad hosts, ports, options, firmware and disks: docs/contract.md lists
each mistake with its test."""

import json
import os
import pathlib
import random
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest

from test_drone import HOST, PROGRAM, Simulator, has_drone, navdata_of, packets_of, run


class Garbage:
    """A host that answers on every port with random bytes, or accepts everything and answers
    nothing."""

    def __init__(self, is_silent=False):
        self.random = random.Random(5)
        self.is_silent = is_silent
        self.udp = {name: self.bound(socket.SOCK_DGRAM) for name in ("at", "navdata")}
        self.tcp = {name: self.bound(socket.SOCK_STREAM) for name in ("video", "control")}
        self.commands = []
        self.ends = threading.Event()
        self.threads = [threading.Thread(target=self.serve_udp)] + \
            [threading.Thread(target=self.serve_tcp, args=(s,)) for s in self.tcp.values()]

    @staticmethod
    def bound(kind):
        made = socket.socket(socket.AF_INET, kind)
        made.bind((HOST, 0))
        if kind == socket.SOCK_STREAM:
            made.listen()
        made.settimeout(0.02)
        return made

    def ports(self):
        told = ["--host", HOST]
        for name, made in {**self.udp, **self.tcp}.items():
            told += [f"--{name}-port", str(made.getsockname()[1])]
        return told

    def some(self):
        data = self.random.randbytes(self.random.randrange(1, 1400))
        start = self.random.choice([b"", b"\x88\x77\x66\x55", b"PaVE\x02\x04\x44\x00"])
        return start + data

    def serve_udp(self):
        listener = None
        while not self.ends.is_set():
            try:
                self.commands.append(self.udp["at"].recvfrom(2048)[0])
            except OSError:
                pass
            try:
                listener = self.udp["navdata"].recvfrom(2048)[1]
            except OSError:
                pass
            if listener and not self.is_silent:
                for _ in range(20):
                    self.udp["navdata"].sendto(self.some(), listener)

    def serve_tcp(self, listener):
        while not self.ends.is_set():
            try:
                client = listener.accept()[0]
                with client:
                    client.settimeout(0.1)
                    while not self.ends.is_set():
                        if not self.is_silent:
                            client.sendall(self.some())
                        time.sleep(0.01)
            except OSError:
                pass

    def __enter__(self):
        for thread in self.threads:
            thread.start()
        return self

    def __exit__(self, *_):
        self.ends.set()
        for thread in self.threads:
            thread.join()
        for made in (*self.udp.values(), *self.tcp.values()):
            made.close()


@unittest.skipUnless(has_drone(), "this build has no drone verbs (libavcodec)")
class DroneBadInput(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def path(self, *names):
        return os.path.join(self.folder.name, *names)

    def assert_refused(self, result, *words):
        self.assertEqual(result.returncode, 2, result.stdout + result.stderr)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        for word in words:
            self.assertIn(word, result.stderr)

    def test_a_host_that_sends_garbage(self):
        with Garbage() as host:
            self.assert_refused(
                run("info", "--duration", "2", *host.ports()), "no AR.Drone answers"
            )
            self.assert_refused(
                run("record", "-o", self.path("r"), "--duration", "2", "--quiet", *host.ports()),
                "not an AR.Drone's",
            )
            self.assertEqual(host.commands, [])

    def test_a_host_that_takes_everything_and_says_nothing(self):
        with Garbage(is_silent=True) as host:
            self.assert_refused(
                run("info", "--duration", "2", *host.ports()), "no AR.Drone answers"
            )
            self.assert_refused(
                run("record", "-o", self.path("r"), "--duration", "2", "--frames", *host.ports()),
                "nothing came from",
            )
            # Nothing is left, so that the same command serves when the drone is there.
            self.assertFalse(os.path.exists(self.path("r")))
            os.mkdir(self.path("r"))
            self.assert_refused(
                run("record", "-o", self.path("r"), "--duration", "1", *host.ports()),
                "nothing came from",
            )
            self.assertEqual(os.listdir(self.path("r")), [])
            self.assertEqual(host.commands, [])

    def test_an_unknown_firmware(self):
        with Simulator("--firmware", "9.8.7-\x1b[31mbeta") as drone:
            told = json.loads(run("info", "--json", *drone.ports()).stdout)
            self.assertEqual((told["state"], told["firmware"]), ("landed", "9.8.7-?[31mbeta"))
            result = run(
                "record", "-o", self.path("r"), "--duration", "3", "--json", *drone.ports()
            )
            self.assertEqual(result.returncode, 0, result.stderr)
        summary = json.loads(result.stdout)
        self.assertEqual(summary["navdata_rejected"], 0)
        self.assertGreater(summary["navdata_received"], 100)
        self.assertGreater(
            len(pathlib.Path(self.path("r", "attitude.tum")).read_text().splitlines()), 100
        )

    def test_values_out_of_range_are_refused(self):
        for arguments in (
            ("info", "--duration", "0"),
            ("info", "--at-port", "-1"),
            ("info", "--video-port", "65536"),
            ("record", "-o", "x", "--duration", "-1"),
            ("record", "-o", "x", "--duration", "nan"),
            ("record", "--duration", "1"),
            ("record", "-o", "x", "--host", ""),
            ("replay", "x", "--speed", "-1"),
            ("replay", "x", "--speed", "1e9"),
            ("replay",),
            ("fly", "--speed", "0"),
            ("fly", "--speed", "1.1"),
            ("fly", "--speed", "nan"),
            ("simulate", "--lose", "1.5"),
            ("simulate", "--fps", "0"),
            ("simulate", "--pave-header", "66"),
            ("simulate", "--first-sequence", "-1"),
            ("simulate", "--start", "1"),
            ("simulate", "--start", "100,0"),
            ("simulate", "--start", "nan,0"),
            ("simulate", "--lose", "nan"),
            ("simulate", "--yaw-deg", "400"),
            ("simulate", "--images", "no-such.png"),
            ("simulate", "--camera", "no-such.yaml"),
            (
                "simulate",
                "--truth",
                "/no/such/folder/truth.txt",
                "--at-port",
                "0",
                "--navdata-port",
                "0",
                "--video-port",
                "0",
                "--control-port",
                "0",
                "--recording-port",
                "0",
            ),
            ("juggle",),
            (),
        ):
            with self.subTest(arguments=arguments):
                self.assert_refused(run(*arguments, cwd=self.folder.name, stdin=subprocess.DEVNULL))
        self.assertEqual(os.listdir(self.folder.name), [])
        self.assert_refused(run("info", HOST), HOST, "(see twoview drone info --help)")

    def test_ports_in_use_are_named(self):
        with Simulator() as drone:
            for name, port in (("navdata", drone.port["navdata"]), ("video", drone.port["video"]),
                               ("control", drone.port["control"])):
                others = [
                    word
                    for other in ("at", "navdata", "video", "control", "recording")
                    if other != name
                    for word in (f"--{other}-port", "0")
                ]
                result = run("simulate", f"--{name}-port", port, *others, "--duration", "1")
                self.assert_refused(result, "port " + port, "in use")

    def test_ctrl_c_at_any_moment(self):
        """After Ctrl-C each verb ends within 10 s, prints at most one line, and leaves no
        incomplete file."""
        chance = random.Random(7)
        with Simulator() as drone:
            for k in range(15):
                output = self.path(f"r{k}")
                verb = (["record", "-o", output, "--quiet"], ["info"], ["fly"])[k % 3]
                process = subprocess.Popen(
                    [PROGRAM, "drone", *verb, *drone.ports()],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.PIPE,
                )
                time.sleep(chance.uniform(0, 1))
                process.send_signal(signal.SIGINT)
                _, error = process.communicate(timeout=10)
                # The status is 2 where the verb has nothing to show yet, -SIGINT before its handler
                # is installed.
                self.assertIn(process.returncode, (0, 2, -signal.SIGINT), error)
                self.assertLessEqual(error.count(b"\n"), 1, error)
                if not os.path.exists(os.path.join(output, "video.pave")):
                    continue
                self.assertEqual(packets_of(os.path.join(output, "video.pave"))[1], 0)
                self.assertEqual(navdata_of(os.path.join(output, "navdata.log"))[1], 0)
                for name in os.listdir(output):
                    self.assertIn(
                        name,
                        ("video.pave", "navdata.log", "attitude.tum", "frames.txt", "summary.json"),
                    )
            self.assertEqual(drone.stop()["take offs"], 0)

    def test_ctrl_c_ends_a_simulator_at_any_moment(self):
        chance = random.Random(8)
        for _ in range(4):
            ports = [word for name in ("at", "navdata", "video", "control", "recording")
                     for word in (f"--{name}-port", "0")]
            process = subprocess.Popen(
                [PROGRAM, "drone", "simulate", "--quiet", *ports], stderr=subprocess.PIPE
            )
            time.sleep(chance.uniform(0, 1))
            process.send_signal(signal.SIGINT)
            self.assertEqual(process.communicate(timeout=10)[1], b"")
            self.assertIn(process.returncode, (0, -signal.SIGINT))

    @unittest.skipUnless(
        os.geteuid() == 0 and sys.platform == "linux", "a small file system needs root"
    )
    def test_a_disk_that_is_full(self):
        small = self.path("small")
        os.mkdir(small)
        if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=600k", "tmpfs", small],
                          capture_output=True).returncode != 0:
            self.skipTest("no mount here")
        self.addCleanup(subprocess.run, ["umount", small])
        for frames in ([], ["--frames"]):
            output = os.path.join(small, "r")
            with Simulator() as drone:
                result = run(
                    "record", "--duration", "30", "-o", output, "--quiet", *frames, *drone.ports()
                )
                self.assert_refused(
                    result, "cannot write", "No space left", "what was recorded before is kept"
                )
                self.assertEqual(drone.stop()["take offs"], 0)
            self.assertEqual(packets_of(os.path.join(output, "video.pave"))[1], 0)
            self.assertEqual(navdata_of(os.path.join(output, "navdata.log"))[1], 0)
            self.assertGreater(len(navdata_of(os.path.join(output, "navdata.log"))[0]), 10)
            self.assertEqual(run("replay", output, "--quiet").returncode, 0)
            subprocess.run(["rm", "-r", output], check=True)


if __name__ == "__main__":
    sys.exit(unittest.main())
