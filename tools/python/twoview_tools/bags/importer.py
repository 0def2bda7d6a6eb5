"""A bag to a set folder (docs/formats.md): frames.txt, images/, cameras.yaml, imu.txt and
groundtruth.txt, by the header's stamps."""

import contextlib
import json
import math
import os
import shutil
import warnings
from array import array
from dataclasses import dataclass, field

import numpy as np
import twoview as tv
from twoview.camera_files import parse_cameras

from ..odometry.poses import quaternions_of, rotations_of
from ..progress import Lines
from . import BadInput, counted, pictures
from .frames import StaticFrames, is_rotation, plain
from .messages import Damaged, Decoder, role_of, stamp_ns

PEEK_BYTES = 64 << 20  # how far the first message of each topic is looked for
# Of the vertical, where an Imu does not state its own: what the drivers state for an autopilot.
ATTITUDE_SIGMA_RAD = math.radians(1)
FLIP = np.diag([1.0, -1.0, -1.0])  # forward, left, up to forward, right, down, and back
# The mean of the accelerations of a flight is gravity; one that lies farther than this from the
# vertical of the attitudes says that these are of other axes.
MOST_TILT_DEG = 20.0
NO_ORIENTATION, REPEATED = "has no orientation", "has the time of one before it"


def seconds_text(ns):
    """Nanoseconds as seconds, exactly."""
    return f"{'-' if ns < 0 else ''}{abs(ns) // 10**9}.{abs(ns) % 10**9:09d}"


def choose(topics, named, option, what):
    """The one topic of these, or the one that the option names; None for "none" and where there is
    none. BadInput that lists them otherwise."""
    names = sorted({topic.name for topic in topics})
    if named == "none":
        return None
    if named is not None:
        if named not in names:
            raise BadInput(f"no topic {named} with {what}; there "
                           + (f"are {', '.join(names)}" if len(names) > 1 else
                              f"is {names[0]}" if names else "is none"))
        return named
    if len(names) > 1:
        raise BadInput(f"{len(names)} topics have {what}: {', '.join(names)}; name one by {option}"
                       + ("" if option == "--image" else f", or {option} none"))
    return names[0] if names else None


def camera_of(topic):
    """/left/image_raw/compressed and /left/image_raw: the topic of the pictures as they were taken,
    which the transports of image_transport share."""
    last = topic.name.rpartition("/")[2]
    is_file = topic.type.endswith("CompressedImage")
    is_transport = is_file and last in ("compressed", "compressedDepth")
    return topic.name.rpartition("/")[0] if is_transport else topic.name


def is_rectified(base):
    return "rect" in base.rpartition("/")[2].split("_")


@dataclass
class Plan:
    """The topics that are read; None for what the bag does not have."""

    image: str
    base: str  # the image's topic without its transport
    camera: str = None
    imu: str = None
    truth: str = None
    frames: list = field(default_factory=list)

    def names(self):
        return {self.image, self.camera, self.imu, self.truth, *self.frames} - {None}


def write_file(path, buffers):
    """A new file of these buffers."""
    with open(path, "xb", buffering=0) as file:
        for buffer in buffers:
            view = memoryview(buffer).cast("B")
            while len(view):
                view = view[file.write(view):]


class Importer:
    """One run. `notes` has what the user must know."""

    def __init__(self, bag, arguments):
        self.bag, self.arguments = bag, arguments
        self.decode = Decoder()
        self.notes = []
        self.left_out = {}  # {(topic, why): count}
        self.statics = StaticFrames()

    # ---- which topics ----------------------------------------------------------------------------

    def plan(self):
        topics = self.bag.topics()
        if not topics:
            raise BadInput(f"{self.bag.path}: {self.bag.kind} without any message"
                           + (f"; {self.bag.cut}" if self.bag.cut else ""))
        roles = {}
        for topic in topics:
            roles.setdefault(role_of(topic), []).append(topic)
        if not roles.get("picture"):
            raise BadInput(f"{self.bag.path} has no topic of Image or CompressedImage, but "
                           + ", ".join(f"{topic.name} ({topic.type or topic.encoding})"
                                       for topic in topics[:12])
                           + (", ..." if len(topics) > 12 else ""))
        image = self._image(roles["picture"])
        plan = Plan(image.name, camera_of(image))
        plan.camera = self._camera(plan, roles)
        plan.imu = choose(roles.get("imu", []), self.arguments.imu, "--imu", "Imu")
        plan.truth = choose(roles.get("truth", []), self.arguments.truth, "--truth",
                            "Odometry or a pose")
        plan.frames = sorted({topic.name for topic in roles.get("frames", [])
                              if topic.name.endswith("tf_static")})
        return plan

    def _image(self, topics):
        """The pictures' topic: of several transports of one camera the raw one; depths only where
        there is nothing else."""
        if self.arguments.image is None and len({topic.name for topic in topics}) > 1:
            first = self._first({topic.name for topic in topics})
            seen = [topic for topic in topics if topic.name in first]
            seen = [topic for topic in seen if not pictures.is_depth(first[topic.name])] or seen
            raw = {topic.name for topic in seen if not topic.type.endswith("CompressedImage")}
            kept = [topic for topic in seen
                    if topic.name in raw or camera_of(topic) not in raw] or topics
        else:
            kept = topics
        name = choose(kept, self.arguments.image, "--image", "pictures")
        if name is None:
            raise BadInput("--image none: there is nothing to import without pictures")
        others = sorted({topic.name for topic in topics} - {name})
        if others and self.arguments.image is None:
            self.notes.append(f"{', '.join(others)}: depths, or another form of the same pictures, "
                              f"left out; --image takes one in place of {name}")
        return next(topic for topic in topics if topic.name == name)

    def _camera(self, plan, roles):
        """CameraInfo beside the picture's topic, by image_transport's rule."""
        known = {topic.name for topic in roles.get("camera", [])}
        beside = plan.base.rpartition("/")[0] + "/camera_info"
        if self.arguments.camera_info is None and beside in known:
            return beside
        num_cameras = len({camera_of(topic) for topic in roles["picture"]})
        if self.arguments.camera_info is None and num_cameras > 1 and known:
            self.notes.append(f"no {beside} for {plan.image}: none of {', '.join(sorted(known))} "
                              "is taken for it; --camera-info names one")
            return None
        return choose(roles.get("camera", []), self.arguments.camera_info, "--camera-info",
                      "CameraInfo")

    def _first(self, names):
        """{topic's name: its first message}, as far as they lie within PEEK_BYTES."""
        found, num_bytes, rest = {}, 0, set(names)
        for topic, _, data in self.bag.messages(names):
            num_bytes += len(data)
            if topic.name in rest:
                with contextlib.suppress(Damaged):
                    found[topic.name] = self.decode(topic, data)
                    rest.discard(topic.name)
            if not rest or num_bytes > PEEK_BYTES:
                break
        return found

    def _choose_clock(self, plan):
        """Whether the times are those of receipt: where one of the topics has no stamps, or as the
        option says. One clock serves all topics, since two may differ."""
        if self.arguments.time is not None:
            return self.arguments.time == "receive"
        first = self._first(plan.names() - {plan.camera, *plan.frames})
        unstamped = sorted(name for name, message in first.items()
                           if stamp_ns(message.header.stamp) == 0)
        if unstamped:
            self.notes.append(f"the headers of {', '.join(unstamped)} have no stamps (0): all "
                              "times are those at which the bag received the messages")
        return bool(unstamped)

    # ---- reading ---------------------------------------------------------------------------------

    def run(self, folder):
        """Writes the set into `folder`, which is there and empty. Returns what the summary says."""
        self.plan_ = plan = self.plan()
        self.by_receipt = self._choose_clock(plan)
        self.folder = folder
        self.frames = {}  # {time in ns: the file's name}
        self.samples, self.numbers = array("q"), array("d")  # of Imu: times in ns, numbers of each
        self.poses, self.pose_numbers = array("q"), array("d")  # likewise
        self.info = self.size = self.image_frame = self.imu_frame = self.pose_frame = None
        self.encoding = ""
        os.mkdir(os.path.join(folder, "images"))
        use = {plan.image: self._picture, plan.camera: self._camera_info, plan.imu: self._imu,
               plan.truth: self._pose, **dict.fromkeys(plan.frames, self._static)}
        progress = Lines(wanted=not self.arguments.quiet)
        for topic, receive_ns, data in self.bag.messages(plan.names()):
            try:
                use[topic.name](self.decode(topic, data), receive_ns)
            except Damaged as error:
                self._leave_out(topic.name, str(error))
            progress.tell(f"import: {len(self.frames)} pictures")
        if self.bag.cut:
            self.notes.append(self.bag.cut)
        if not self.frames:
            raise BadInput(f"{self.bag.path}: no picture of {plan.image} can be used"
                           + "".join(f"; {note}" for note in [*self._left_out_notes(), self.bag.cut]
                                     if note))
        return self._finish()

    def _leave_out(self, name, why):
        self.left_out[name, why] = self.left_out.get((name, why), 0) + 1

    def _time(self, message, receive_ns):
        """The time of a message in ns. Damaged where it has none."""
        if self.by_receipt:
            return receive_ns
        ns = stamp_ns(message.header.stamp)
        if ns == 0:
            raise Damaged("has no stamp")
        return ns

    def _picture(self, message, receive_ns):
        time = self._time(message, receive_ns)
        if time in self.frames:
            raise Damaged(REPEATED)
        is_file = hasattr(message, "format")
        try:
            ending, buffers, size = (pictures.encode_compressed if is_file
                                     else pictures.encode)(message)
        except BadInput as error:
            raise BadInput(f"{self.plan_.image}: {error}") from None
        if self.image_frame is None:
            self.image_frame, self.size = message.header.frame_id, size
            self.encoding = message.format if is_file else message.encoding
        name = f"images/{time:019d}{ending}"
        write_file(os.path.join(self.folder, name), buffers)
        self.frames[time] = name

    def _camera_info(self, message, _):
        """The first one counts; a note says where a later one differs."""
        about = {name.lower(): getattr(message, name) for name in (
            "width", "height", "distortion_model", *("DKRP" if hasattr(message, "K") else "dkrp"))}
        about = {name: value.tolist() if isinstance(value, np.ndarray) else value
                 for name, value in about.items()}
        roi = {name: int(getattr(message.roi, name))
               for name in ("x_offset", "y_offset", "width", "height")}
        about.update(binning_x=message.binning_x, binning_y=message.binning_y, roi=roi)
        if self.info is None:
            self.info = about
        elif about != self.info:
            raise Damaged("is of another camera than the first one, which is taken")

    def _static(self, message, _):
        for transform in message.transforms:
            self.statics.add(transform)

    def _imu(self, message, receive_ns):
        self.samples.append(self._time(message, receive_ns))
        q, a = message.orientation, message.linear_acceleration
        covariance = message.orientation_covariance
        self.imu_frame = message.header.frame_id
        self.numbers.extend((
            q.x, q.y, q.z, q.w, covariance[0], covariance[4], a.x, a.y, a.z,
            message.linear_acceleration_covariance[0]))

    def _pose(self, message, receive_ns):
        self.poses.append(self._time(message, receive_ns))
        if hasattr(message, "transform"):
            q, place = message.transform.rotation, message.transform.translation
        else:
            pose = message.pose.pose if hasattr(message.pose, "pose") else message.pose
            q, place = pose.orientation, pose.position
        self.pose_frame = getattr(message, "child_frame_id", "")
        self.pose_numbers.extend((q.x, q.y, q.z, q.w, place.x, place.y, place.z))

    def _rows(self, topic, times, numbers, is_good, why):
        """(times, rows) of what was collected, by time, the first of each time and where `is_good`
        of the rows; the others are left out."""
        times = np.frombuffer(times, np.int64)
        kept, first = np.unique(times, return_index=True)
        if len(kept) < len(times):
            self.left_out[topic, REPEATED] = len(times) - len(kept)
        rows = np.frombuffer(numbers).reshape(len(times), -1)[first]
        good = is_good(rows)
        if not good.all():
            self.left_out[topic, why] = int((~good).sum())
        return kept[good].tolist(), rows[good]

    # ---- writing ---------------------------------------------------------------------------------

    def _write(self, name, head, lines):
        with open(os.path.join(self.folder, name), "x", encoding="utf-8") as file:
            file.write(head)
            file.writelines(lines)

    def _finish(self):
        times = sorted(self.frames)
        self._write("frames.txt", "# timestamp filename\n",
                    (f"{seconds_text(time)} {self.frames[time]}\n" for time in times))
        summary = {
            "source": str(self.bag.path), "kind": self.bag.kind,
            "num_frames": len(times), "seconds": (times[-1] - times[0]) / 1e9,
            "size": None if self.size is None else list(map(int, self.size)),
            "encoding": self.encoding, "times": "receive" if self.by_receipt else "header",
            "topics": {"image": self.plan_.image, "camera_info": None, "imu": None, "truth": None},
            "num_attitudes": 0, "num_poses": 0, "cut": bool(self.bag.cut)}
        if self._write_camera():
            summary["topics"]["camera_info"] = self.plan_.camera
        if (count := self._write_imu(times)) > 0:
            summary["topics"]["imu"], summary["num_attitudes"] = self.plan_.imu, count
        if (count := self._write_truth(times)) > 0:
            summary["topics"]["truth"], summary["num_poses"] = self.plan_.truth, count
        self.notes += self._left_out_notes()
        summary["notes"] = self.notes
        return summary

    def _left_out_notes(self):
        return [f"{counted(number, 'message')} of {name} {'is' if number == 1 else 'are'} left "
                f"out: {'it' if number == 1 else 'each'} {why}"
                for (name, why), number in self.left_out.items()]

    def _write_camera(self):
        """cameras.yaml of CameraInfo; False where there is none, and a note says why."""
        topic = self.plan_.camera
        if topic is None or self.info is None:
            self.notes.append("no camera file: "
                              + ("--camera-info none" if self.arguments.camera_info == "none" else
                                 f"{topic} has no message" if topic else "no CameraInfo")
                              + "; give the other verbs --camera")
            return False
        about = dict(self.info)
        if is_rectified(self.plan_.base):  # as P has it, without distortion
            p = about["p"]
            about.update(k=[p[0], 0, p[2], 0, p[5], p[6], 0, 0, 1], d=[], distortion_model="none")
            self.notes.append(f"{self.plan_.image} is rectified: its camera is P of {topic}")
        if not any(about["k"]):
            self.notes.append(f"no camera file: {topic} is of a camera that was not calibrated "
                              f"({'P' if is_rectified(self.plan_.base) else 'K'} is 0)")
            return False
        if self.size is not None and about["width"] == about["height"] == 0:
            about["width"], about["height"] = map(int, self.size)
        about["distortion_model"] = about["distortion_model"] or "none" if not any(about["d"]) \
            else about["distortion_model"]
        del about["r"], about["p"]
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                camera, = parse_cameras(json.dumps(about), topic).values()
                tv.write_cameras(os.path.join(self.folder, "cameras.yaml"), {"cam0": camera},
                                 "cameras.yaml")
            except (ValueError, tv.StatusError) as error:
                raise BadInput(f"{error}; --camera-info none imports the rest") from None
        self.notes += [str(one.message) for one in caught]
        if self.size is not None and (camera.width, camera.height) != tuple(self.size):
            self.notes.append(f"{topic} is of pictures of {camera.width}x{camera.height}, "
                              f"{self.plan_.image} of {self.size[0]}x{self.size[1]}: the verbs "
                              "refuse it, or take it by --camera and --scale-camera")
        return True

    def _without_times(self, name, topic, times, frames):
        """Notes where none of the times lies within those of the pictures."""
        if times[-1] < frames[0] or times[0] > frames[-1]:
            self.notes.append(f"{name}: the stamps of {topic} ({seconds_text(times[0])} to "
                              f"{seconds_text(times[-1])} s) do not meet those of the pictures "
                              f"({seconds_text(frames[0])} to {seconds_text(frames[-1])} s): other "
                              "clocks? --time receive takes one clock for all")

    def _imu_axes(self, rows):
        """What turns the attitudes' world and body: FLIP for ROS's axes (z up), the identity where
        z is down, None where the accelerations contradict both."""
        rows = rows[(rows[:, 9] != -1) & np.isfinite(rows[:, 6:9]).all(1)]
        # The mean acceleration, in the world's frame.
        gravity = np.einsum("nij,nj->i", rotations_of(rows[:, :4]), rows[:, 6:9])
        length = np.linalg.norm(gravity)
        if length == 0:
            return FLIP
        tilt = math.degrees(math.acos(np.clip(gravity[2] / length, -1, 1)))
        if tilt <= MOST_TILT_DEG:
            return FLIP
        if tilt >= 180 - MOST_TILT_DEG:
            self.notes.append(f"the world of {self.plan_.imu} has z down, by its accelerations")
            return np.eye(3)
        self.notes.append(f"no imu.txt: the accelerations of {self.plan_.imu} lie {tilt:.0f} "
                          "degrees from the vertical of its attitudes")
        return None

    def _write_imu(self, frames):
        """imu.txt of the attitudes. Returns how many; 0 without, and then a note says why."""
        topic = self.plan_.imu
        if topic is None:
            return 0
        times, rows = self._rows(
            topic, self.samples, self.numbers,
            lambda rows: (rows[:, 4] != -1) & is_rotation(rows[:, :4]), NO_ORIENTATION)
        if not times:
            self.left_out.pop((topic, NO_ORIENTATION), None)  # the note says it of all
            self.notes.append(f"no imu.txt: {topic} has no orientation; rates and accelerations "
                              "are not used")
            return 0
        if len(rows) > 1 and (rows[:, :4] == rows[0, :4]).all():
            self.notes.append(f"no imu.txt: all {len(rows)} orientations of {topic} are the same "
                              "one: they were not measured")
            return 0
        if self.arguments.body_from_cam is not None:
            mount = rotations_of(np.roll(self.arguments.body_from_cam, -1))[0]
        else:
            pose = self.statics.between(self.imu_frame, self.image_frame)
            mount = None if pose is None else pose[0]
        if mount is None:
            self.notes.append("no imu.txt: no tf_static says how the camera "
                              f"('{self.image_frame}') is mounted on {topic} "
                              f"('{self.imu_frame}'); --body-from-cam does")
            return 0
        axes = self._imu_axes(rows)
        if axes is None:
            return 0
        if self.arguments.body_from_cam is None:
            mount = axes @ mount
        variances = rows[:, 4:6].max(1)
        is_known = (variances > 0) & np.isfinite(variances)
        if not is_known.all():
            self.notes.append(f"{topic} states no errors: 1 degree is taken for the vertical")
        sigmas = np.where(is_known, np.sqrt(np.where(is_known, variances, 0)), ATTITUDE_SIGMA_RAD)
        quaternions = rows[:, [3, 0, 1, 2]]  # w x y z
        if axes is FLIP:  # FLIP R FLIP turns about the axis (x, -y, -z)
            quaternions[:, 2:] *= -1
        quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
        w, x, y, z = np.roll(quaternions_of(mount)[0], 1)
        self._write(
            "imu.txt", f"# {topic}: attitudes\nbody_from_cam {w:.9f} {x:.9f} {y:.9f} {z:.9f}\n",
            (f"{seconds_text(time)} {q[0]:.9f} {q[1]:.9f} {q[2]:.9f} {q[3]:.9f} {sigma:.6g} "
             "nan 0 nan nan nan 0\n"
             for time, q, sigma in zip(times, quaternions.tolist(), sigmas.tolist())))
        self._without_times("imu.txt", topic, times, frames)
        return len(times)

    def _write_truth(self, frames):
        """groundtruth.txt. Returns how many poses; 0 without."""
        topic = self.plan_.truth
        if topic is None:
            return 0
        times, rows = self._rows(
            topic, self.poses, self.pose_numbers,
            lambda rows: np.isfinite(rows).all(1) & is_rotation(rows[:, :4]),
            "has a pose that is not finite, or whose quaternion is 0")
        if not times:
            self.notes.append(f"no groundtruth.txt: {topic} has no message that can be used")
            return 0
        R, t = rotations_of(rows[:, :4]), rows[:, 4:]
        mount = self.statics.between(self.pose_frame or "", self.image_frame)
        of = "the camera"
        if mount is not None:
            R, t = R @ mount[0], t + R @ mount[1]
        elif plain(self.pose_frame or "") != plain(self.image_frame or "") or not self.pose_frame:
            of = f"'{self.pose_frame}'" if self.pose_frame else "an unnamed frame"
            self.notes.append(f"groundtruth.txt: the poses of {topic} are of {of}, and no "
                              f"tf_static says where the camera ('{self.image_frame}') is in it: "
                              "positions are compared as they are")
        quaternions = quaternions_of(R)
        self._write("groundtruth.txt",
                    f"# {topic}: poses of {of}\n# timestamp tx ty tz qx qy qz qw\n",
                    (" ".join([seconds_text(time), *(f"{n:.9f}" for n in (*place, *q))]) + "\n"
                     for time, place, q in zip(times, t.tolist(), quaternions.tolist())))
        self._without_times("groundtruth.txt", topic, times, frames)
        return len(times)


def list_topics(bag):
    """[{name, type, encoding, count, rate_hz, used_for}] of a bag, by reading it once."""
    known = {(topic.name, topic.type): [topic, 0, None, None] for topic in bag.topics()}
    for topic, receive_ns, _ in bag.messages():
        row = known.setdefault((topic.name, topic.type), [topic, 0, None, None])
        row[1] += 1
        row[2] = receive_ns if row[2] is None else min(row[2], receive_ns)
        row[3] = receive_ns if row[3] is None else max(row[3], receive_ns)
    rows = []
    for topic, count, first, last in known.values():
        rate = (count - 1) * 1e9 / (last - first) if count > 1 and last > first else None
        rows.append({"name": topic.name, "type": topic.type, "encoding": topic.encoding,
                     "count": count, "rate_hz": rate, "used_for": role_of(topic)})
    return sorted(rows, key=lambda row: row["name"])


@contextlib.contextmanager
def new_folder(folder):
    """A temporary folder that becomes `folder` at the end; `folder` must be empty or missing."""
    folder = os.path.normpath(folder)
    if os.path.isdir(folder):
        if os.listdir(folder):
            raise BadInput(f"folder {folder} is not empty: give another -o")
    elif os.path.lexists(folder):
        raise BadInput(f"cannot write {folder}: it is a file")
    parent, name = os.path.split(folder)
    temporary = os.path.join(parent, f".{name}.{os.getpid()}")
    try:
        os.makedirs(temporary)
        yield temporary
        if os.path.isdir(folder):
            os.rmdir(folder)
        os.rename(temporary, folder)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def import_bag(bag, arguments):
    """Writes the set folder; returns the summary."""
    with new_folder(arguments.output) as temporary:
        return Importer(bag, arguments).run(temporary)
