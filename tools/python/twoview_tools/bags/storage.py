"""The raw messages of a bag, in a stream and in the order in which they lie there.

| what | recognised by |
| --- | --- |
| a ROS 1 bag (also .bag.active) | the line #ROSBAG V2.0 |
| an MCAP file | its magic bytes |
| a sqlite3 file of ROS 2 | its magic bytes, and a table `messages` |
| a ROS 2 bag: a folder of the latter two | metadata.yaml, or the files where there is none |

Each is read from its beginning, not by the index at its end, so that a bag that was cut gives what
is whole: `Bag.cut` then says where it ends. Memory: one chunk, or one message of sqlite3.
"""

import bz2
import contextlib
import os
import sqlite3
import struct
import tempfile
from dataclasses import dataclass
from io import BytesIO

import lz4.frame
import yaml
import zstandard
from mcap import exceptions as mcap_errors
from mcap import opcode, records, stream_reader
from mcap import reader as mcap_reader
from mcap.data_stream import ReadDataStream

from ..folders import natural_key
from . import BadInput, counted

ROS1, MCAP, SQLITE3 = b"#ROSBAG V", b"\x89MCAP0\r\n", b"SQLite format 3\0"
ZSTD = b"\x28\xb5\x2f\xfd"
MOST_HEADER_BYTES = 1 << 24  # of a ROS 1 record; the message's definition lies in one


@dataclass(frozen=True)
class Topic:
    """Messages of one name, type and encoding."""

    name: str
    type: str  # as in sensor_msgs/msg/Image, for ROS 1, too
    encoding: str  # "ros1", "cdr", or another one of MCAP
    definition: str = ""  # the text that defines the type, where the bag has it
    definition_format: str = ""  # "ros1msg", "ros2msg", "ros2idl", or another one of MCAP


def full_type(name):
    """sensor_msgs/Image as ROS 2 names it, sensor_msgs/msg/Image."""
    package, slash, rest = name.partition("/")
    return f"{package}/msg/{rest}" if slash and "/" not in rest else name


class _Cut(Exception):
    """The file ends within a record, or goes on with what is none; the text says at which byte."""


def _bytes_words(offset, size):
    return f"after {offset} of its {size} bytes"


# ---- ROS 1 ---------------------------------------------------------------------------------------

def _fields(header):
    """{name: value} of a record's header."""
    found, at, size = {}, 0, len(header)
    while at < size:
        start = at + 4
        end = start + int.from_bytes(header[at:start], "little")
        equals = header.find(b"=", start, end)
        if end > size or equals < 0:
            raise _Cut
        found[header[start:equals]] = header[equals + 1:end]
        at = end
    return found


def _ros1_record(file, size):
    """(header fields, the number of bytes of the data that follows) of the record at the file's
    place; None at the end."""
    at = file.tell()
    if at == size:
        return None
    head = file.read(4)
    length = struct.unpack("<I", head)[0] if len(head) == 4 else MOST_HEADER_BYTES + 1
    if length > MOST_HEADER_BYTES or at + 8 + length > size:
        raise _Cut
    fields = _fields(file.read(length))
    if len(fields.get(b"op", b"")) != 1:
        raise _Cut
    return fields, struct.unpack("<I", file.read(4))[0]


def _uncompressed(name, data):
    """The bytes of a chunk, as far as they can be had where it was cut."""
    with contextlib.suppress(EOFError, OSError, RuntimeError):
        if name == "bz2":
            return bz2.BZ2Decompressor().decompress(data)
        if name == "lz4":
            return lz4.frame.LZ4FrameDecompressor().decompress(data)
        if name == "none":
            return data
        raise BadInput(f"a chunk is compressed by '{name}', which no ROS 1 bag is")
    return b""


class Ros1File:
    """A ROS 1 bag, format 2.0."""

    kind = "a ROS 1 bag"

    def __init__(self, path):
        self.path = path

    def _topic(self, fields, data):
        about = _fields(bytes(data))
        text = about.get(b"message_definition", b"").decode("utf-8", "replace")
        return Topic((about.get(b"topic") or fields[b"topic"]).decode("utf-8", "replace"),
                     full_type(about[b"type"].decode("utf-8", "replace")), "ros1", text,
                     "ros1msg" if text else "")

    def topics(self):
        """[Topic] by the index at the bag's end; None where there is none."""
        found = {}
        with contextlib.suppress(_Cut, KeyError, struct.error), open(self.path, "rb") as file:
            size = os.fstat(file.fileno()).st_size
            file.readline()
            fields, length = _ros1_record(file, size)
            index, = struct.unpack("<Q", fields[b"index_pos"])
            if not file.tell() + length <= index <= size:
                return None
            file.seek(index)
            while (record := _ros1_record(file, size)) is not None:
                data = file.read(record[1])
                if record[0][b"op"] == b"\x07":
                    topic = self._topic(record[0], data)
                    found[topic] = None
            return list(found)
        return None

    def messages(self, wanted):
        """As Bag.messages. Raises _Cut."""
        connections = {}
        buffer = bytearray(1 << 20)
        with open(self.path, "rb") as file:
            size = os.fstat(file.fileno()).st_size
            file.readline()
            at = file.tell()
            try:
                while (record := _ros1_record(file, size)) is not None:
                    fields, length = record
                    is_whole = file.tell() + length <= size
                    op = fields[b"op"]
                    if op == b"\x05":
                        # The same memory for each chunk: new memory of this size costs more time
                        # than the reading.
                        num_bytes = min(length, size - file.tell())
                        if num_bytes > len(buffer):
                            buffer = bytearray(num_bytes)
                        chunk = memoryview(buffer)[:num_bytes]
                        chunk = _uncompressed(fields[b"compression"].decode("ascii", "replace"),
                                              chunk[:file.readinto(chunk)])
                        yield from self._of_chunk(memoryview(chunk), connections, wanted)
                    elif op in (b"\x02", b"\x07") and is_whole:  # a record outside any chunk
                        yield from self._message(fields, file.read(length), connections, wanted)
                    else:
                        file.seek(length, os.SEEK_CUR)
                    if not is_whole:
                        raise _Cut
                    at = file.tell()
            except (_Cut, KeyError, struct.error):
                raise _Cut(_bytes_words(at, size)) from None

    def _message(self, fields, data, connections, wanted):
        number = struct.unpack("<I", fields[b"conn"])[0]
        if fields[b"op"] == b"\x07":
            topic = self._topic(fields, data)
            connections[number] = topic if wanted is None or topic.name in wanted else None
        elif (topic := connections[number]) is not None:
            seconds, nanoseconds = struct.unpack("<II", fields[b"time"])
            yield topic, seconds * 10**9 + nanoseconds, data

    def _of_chunk(self, chunk, connections, wanted):
        """The messages in a chunk; raises _Cut where it ends early."""
        at, size = 0, len(chunk)
        while at < size:
            length, = struct.unpack_from("<I", chunk, at)
            if at + 8 + length > size:
                raise _Cut
            fields = _fields(bytes(chunk[at + 4:at + 4 + length]))
            at += 4 + length
            length, = struct.unpack_from("<I", chunk, at)
            at += 4
            if at + length > size:
                raise _Cut
            if fields[b"op"] in (b"\x02", b"\x07"):
                yield from self._message(fields, chunk[at:at + length], connections, wanted)
            at += length


# ---- MCAP ----------------------------------------------------------------------------------------

MCAP_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log and publish time; the data follows
MCAP_DESCRIPTIONS = {opcode.Opcode.SCHEMA: records.Schema, opcode.Opcode.CHANNEL: records.Channel}


def _mcap_records(chunk):
    """(opcode, body) of each whole record in the bytes of a chunk, without copying them."""
    at, size = 0, len(chunk)
    while at + 9 <= size:
        end = at + 9 + int.from_bytes(chunk[at + 1:at + 9], "little")
        if end > size:
            return
        yield chunk[at], chunk[at + 9:end]
        at = end


class McapFile:
    """An MCAP file, by itself or in the folder of a ROS 2 bag."""

    kind = "an MCAP file"
    _ENDS = (mcap_errors.McapError, struct.error, zstandard.ZstdError, RuntimeError, ValueError,
             UnicodeDecodeError, EOFError, MemoryError)

    def __init__(self, path):
        self.path = path

    @staticmethod
    def _topic(channel, schema):
        if schema is None:
            return Topic(channel.topic, "", channel.message_encoding)
        text = schema.data.decode("utf-8", "replace") if "proto" not in schema.encoding else ""
        return Topic(channel.topic, full_type(schema.name), channel.message_encoding, text,
                     schema.encoding)

    def _whole(self, chunk):
        """The bytes of a chunk; none where they are damaged, which `damaged` counts."""
        try:
            stream, size = stream_reader.get_chunk_data_stream(chunk, validate_crc=True)
            return stream.read(size)
        except self._ENDS:
            self.damaged += 1
            return b""

    def _cut_chunk(self, file, at):
        """The bytes of the chunk that begins at this byte, as far as they go."""
        file.seek(at)
        head = file.read(9)
        if len(head) < 9 or head[0] != opcode.Opcode.CHUNK:
            return b""
        data = file.read()
        with contextlib.suppress(*self._ENDS):
            name_bytes, = struct.unpack_from("<I", data, 28)
            name, body = data[32:32 + name_bytes], data[40 + name_bytes:]
            if name == b"zstd":
                return zstandard.ZstdDecompressor().decompressobj().decompress(body)
            if name == b"lz4":
                return lz4.frame.LZ4FrameDecompressor().decompress(body)
            return body
        return b""

    def topics(self):
        """[Topic] by the summary at the file's end; None where there is none."""
        with contextlib.suppress(*self._ENDS), open(self.path, "rb") as file:
            summary = mcap_reader.make_reader(file).get_summary()
            if summary is not None and summary.channels:
                return list(dict.fromkeys(
                    self._topic(channel, summary.schemas.get(channel.schema_id))
                    for channel in summary.channels.values()))
        return None

    def messages(self, wanted):
        """As Bag.messages. Raises _Cut."""
        schemas, channels = {}, {}
        self.damaged = 0

        def take(record):
            if isinstance(record, records.Schema):
                schemas[record.id] = record
            elif isinstance(record, records.Channel):
                topic = self._topic(record, schemas.get(record.schema_id))
                is_wanted = wanted is None or topic.name in wanted
                channels[record.id] = topic if is_wanted else None

        def messages(chunk):
            for code, body in _mcap_records(memoryview(chunk)):
                if code == opcode.Opcode.MESSAGE:
                    channel, _, log_time, _ = MCAP_MESSAGE.unpack_from(body)
                    if (topic := channels[channel]) is not None:
                        yield topic, log_time, body[MCAP_MESSAGE.size:]
                elif code in MCAP_DESCRIPTIONS:
                    take(MCAP_DESCRIPTIONS[code].read(ReadDataStream(BytesIO(body))))

        with open(self.path, "rb") as file:
            size = os.fstat(file.fileno()).st_size
            at = 0
            try:
                for record in stream_reader.StreamReader(file, emit_chunks=True,
                                                         record_size_limit=size).records:
                    if isinstance(record, records.DataEnd):
                        if self.damaged:
                            raise _Cut(f"in {counted(self.damaged, 'chunk')}")
                        return
                    if isinstance(record, records.Chunk):
                        yield from messages(self._whole(record))
                    elif isinstance(record, records.Message):
                        if (topic := channels[record.channel_id]) is not None:
                            yield topic, record.log_time, record.data
                    else:
                        take(record)
                    at = file.tell()
            except (*self._ENDS, KeyError):
                pass
            with contextlib.suppress(KeyError, struct.error):
                yield from messages(self._cut_chunk(file, at))
            raise _Cut(_bytes_words(at, size))


# ---- sqlite3 -------------------------------------------------------------------------------------

class Sqlite3File:
    """A sqlite3 file of ROS 2."""

    kind = "a sqlite3 file of ROS 2"

    def __init__(self, path):
        self.path = path

    @contextlib.contextmanager
    def _open(self):
        # A journal beside the file holds what a recording that was killed had not yet moved.
        has_journal = os.path.exists(self.path + "-wal") and os.path.getsize(self.path + "-wal") > 0
        mode = "mode=ro" if has_journal else "immutable=1"
        uri = "file:" + os.path.abspath(self.path).replace("%", "%25").replace(
            "?", "%3f").replace("#", "%23")
        with contextlib.closing(sqlite3.connect(f"{uri}?{mode}", uri=True)) as database:
            # Without it sqlite3 refuses a file with fewer pages than its header says, whole.
            database.execute("PRAGMA writable_schema=ON")
            yield database

    def _topics(self, database):
        """{id: Topic}."""
        names = {row[0] for row in database.execute("SELECT name FROM sqlite_master")}
        if not {"topics", "messages"} <= names:
            raise BadInput(f"{self.path}: a sqlite3 file without the tables of a ROS 2 bag")
        definitions = {}
        if "message_definitions" in names:
            definitions = {row[0]: row[1:] for row in database.execute(
                "SELECT topic_type, encoding, encoded_message_definition FROM "
                "message_definitions") if row[2]}
        found = {}
        for number, name, kind, encoding in database.execute(
                "SELECT id, name, type, serialization_format FROM topics"):
            form, text = definitions.get(kind, ("", ""))
            found[number] = Topic(name, full_type(kind), encoding, text, form)
        return found

    def topics(self):
        """[Topic]; None where the file does not tell."""
        with contextlib.suppress(sqlite3.Error), self._open() as database:
            return list(dict.fromkeys(self._topics(database).values()))
        return None

    def messages(self, wanted):
        """As Bag.messages. Raises _Cut."""
        count = 0
        try:
            with self._open() as database:
                topics = {number: topic for number, topic in self._topics(database).items()
                          if wanted is None or topic.name in wanted}
                # By the row, which is the order of recording: no index is needed, which a cut may
                # have taken, and no sorting.
                for number, receive_ns, data in database.execute(
                        "SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN "
                        f"({','.join('?' * len(topics))}) ORDER BY id", list(topics)):
                    yield topics[number], receive_ns, data
                    count += 1
        except sqlite3.Error as error:
            raise _Cut(f"after {count} messages that are whole ({error})") from None


# ---- files and folders ---------------------------------------------------------------------------

ENDINGS = (".db3", ".mcap", ".db3.zstd", ".mcap.zstd")
FILES = ((ROS1, Ros1File), (MCAP, McapFile), (SQLITE3, Sqlite3File))


class Bag:
    """A bag that open_bag has recognised."""

    def __init__(self, path, files, kind, is_compressed=False):
        self.path, self.kind = path, kind
        self.cut = ""  # after messages(): where a file ends early, in words
        self._files = files
        self._is_compressed = is_compressed  # each message by itself

    def topics(self):
        """[Topic] of the bag: by its index where it has one, else by reading it."""
        found = {}
        for file in self._files:
            topics = file.topics()
            if topics is None:
                topics = dict.fromkeys(topic for topic, _, _ in self._of_file(file, None))
            found.update(dict.fromkeys(topics))
        return list(found)

    def messages(self, wanted=None):
        """(topic, receive time in ns, data) of each message of the topics `wanted` (names; None:
        all), in the order in which they lie in the bag. The data is a buffer that is valid until
        the next message is read."""
        self.cut = ""
        for file in self._files:
            yield from self._of_file(file, wanted)

    def _of_file(self, file, wanted):
        unpack = zstandard.ZstdDecompressor()
        try:
            for topic, receive_ns, data in file.messages(wanted):
                yield topic, receive_ns, (unpack.decompress(data, 1 << 30) if self._is_compressed
                                          else data)
        except _Cut as end:
            self.cut = f"{file.path} is cut or damaged {end}: what is whole was read"


def _head(path):
    try:
        with open(path, "rb") as file:
            return file.read(16)
    except OSError as error:
        raise BadInput(f"cannot read {path}: {error.strerror}") from None


@contextlib.contextmanager
def _unpacked(path):
    """The path of the file, or of its content where it is compressed as a whole (.db3.zstd)."""
    if not _head(path).startswith(ZSTD):
        yield path
        return
    with tempfile.NamedTemporaryFile(prefix="twoview-import-") as file:
        with open(path, "rb") as source, contextlib.suppress(zstandard.ZstdError):
            zstandard.ZstdDecompressor().copy_stream(source, file)
        file.flush()
        yield file.name


def _file_of(path, shown):
    head = _head(path)
    for magic, kind in FILES:
        if head.startswith(magic):
            if kind is Ros1File and not head.startswith(b"#ROSBAG V2.0\n"):
                raise BadInput(f"{shown}: {head.split(bytes([10]))[0].decode('ascii', 'replace')}, "
                               "of which 2.0 is read: bring it to 2.0 by rosbag fix")
            return kind(path)
    raise BadInput(f"{shown} is empty" if not head else
                   f"{shown} is no bag of ROS 1 or ROS 2 and no MCAP file")


def _metadata(path):
    """(names of the files, whether each message is compressed) of metadata.yaml; None without."""
    file = os.path.join(path, "metadata.yaml")
    try:
        with open(file, encoding="utf-8") as text:
            about = yaml.safe_load(text)["rosbag2_bagfile_information"]
        mode, form = (str(about.get(key) or "").lower()
                      for key in ("compression_mode", "compression_format"))
        if mode in ("file", "message") and form != "zstd":
            raise BadInput(f"{file}: compressed by '{form}'; zstd is read")
        # Older versions of ROS 2 name the files from the folder above.
        return [name if os.path.exists(os.path.join(path, name)) else os.path.basename(name)
                for name in about["relative_file_paths"]], mode == "message"
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError, AttributeError, yaml.YAMLError):
        return None  # cut, as the files may be


@contextlib.contextmanager
def open_bag(path):
    """A Bag of a file or a folder. BadInput where it is none."""
    with contextlib.ExitStack() as stack:
        if not os.path.isdir(path):
            unpacked = stack.enter_context(_unpacked(path))
            file = _file_of(unpacked, path)
            yield Bag(path, [file], file.kind)
            return
        known = _metadata(path)
        names, is_compressed = known or (sorted(
            (name for name in os.listdir(path) if name.endswith(ENDINGS)), key=natural_key), False)
        if not names:
            raise BadInput(f"{path}: a folder without metadata.yaml, .db3 and .mcap is no ROS 2 bag"
                           + (": name one of its ROS 1 bags" if any(
                               name.endswith(".bag") for name in os.listdir(path)) else ""))
        files = []
        for name in names:
            shown = os.path.join(path, name)
            files.append(_file_of(stack.enter_context(_unpacked(shown)), shown))
        kinds = {"sqlite3" if isinstance(file, Sqlite3File) else "MCAP" for file in files}
        yield Bag(path, files, f"a ROS 2 bag ({' and '.join(sorted(kinds))}"
                  + ("" if known else ", without metadata.yaml") + ")", is_compressed)
