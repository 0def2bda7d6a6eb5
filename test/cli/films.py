"""Writes QuickTime films of PNG pictures, byte by byte, so that a test decides what the container
says: the time of each picture, turn, shape of the pixels, edit list. The specification is ISO/IEC
14496-12 with QuickTime's sample entry."""
import struct

from cli_support import png_size

QUARTERS = {0: (1, 0, 0, 1), 90: (0, 1, -1, 0), 180: (-1, 0, 0, -1), 270: (0, -1, 1, 0)}
MIRROR = (-1, 0, 0, 1)


def atom(kind, *parts):
    body = b"".join(parts)
    return struct.pack(">I", len(body) + 8) + kind + body


def full(kind, *parts):
    return atom(kind, bytes(4), *parts)


def matrix(a, b, c, d):
    return struct.pack(">9i", a << 16, b << 16, 0, c << 16, d << 16, 0, 0, 0, 1 << 30)


def numbers(*values):
    return struct.pack(f">{len(values)}I", *values)


def mov(pictures, times_s, turn=QUARTERS[0], pixel_aspect=(1, 1), start_s=0.0, timescale=90000,
        last_s=None, sound_only=False, index_first=False, fields=1, more=b""):
    """pictures: PNG files in the order in which they are stored; times_s: when each is shown, in
    any order (composition offsets then say so). start_s: an empty edit before the first picture.
    last_s: how long the last one is shown. fields: 2 where the rows are of two fields. index_first:
    the index stands before the pictures, so that the beginning of the file is a film."""
    width, height = png_size(pictures[0])
    times = [round(t * timescale) for t in times_s]
    shown = sorted(times)
    steps = [b - a for a, b in zip(shown, shown[1:])]
    steps.append(round(last_s * timescale) if last_s else (steps[-1] if steps else timescale))
    duration = sum(steps)
    decoded = [sum(steps[:k]) for k in range(len(steps))]
    late = max(0, max(d - (t - shown[0]) for d, t in zip(decoded, times)))
    offsets = [t - shown[0] + late - d for d, t in zip(decoded, times)]
    edits = [(duration, late)]
    if start_s:
        edits.insert(0, (round(start_s * timescale), -1))
    sizes = [len(data) for data in pictures]
    head = atom(b"ftyp", b"qt  ", numbers(0), b"qt  ")

    def media(first):
        entry = atom(b"png ", bytes(6), struct.pack(">H", 1), bytes(16),
                     struct.pack(">HH", width, height), numbers(72 << 16, 72 << 16, 0),
                     struct.pack(">H", 1), bytes(32), struct.pack(">Hh", 24, -1),
                     atom(b"fiel", bytes([fields, 9 if fields == 2 else 0])),
                     atom(b"pasp", numbers(*pixel_aspect)), more)
        if sound_only:
            entry = atom(b"sowt", bytes(6), struct.pack(">H", 1), bytes(8),
                         struct.pack(">HHHH", 1, 16, 0, 0), numbers(8000 << 16))
        table = atom(
            b"stbl", full(b"stsd", numbers(1), entry),
            full(b"stts", numbers(len(steps)), *(numbers(1, step) for step in steps)),
            full(b"ctts", numbers(len(offsets)), *(numbers(1, value) for value in offsets))
            if any(offsets) else b"",
            full(b"stsc", numbers(1, 1, len(sizes), 1)),
            full(b"stsz", numbers(0, len(sizes)), numbers(*sizes)),
            full(b"stco", numbers(1, first)))
        kind, header = ((b"soun", full(b"smhd", bytes(4))) if sound_only
                        else (b"vide", full(b"vmhd", bytes(8))))
        return atom(
            b"mdia", full(b"mdhd", numbers(0, 0, timescale, duration), bytes(4)),
            full(b"hdlr", b"mhlr", kind, bytes(12), b"\0"),
            atom(b"minf", header,
                 atom(b"dinf", full(b"dref", numbers(1), atom(b"url ", numbers(1)))), table))

    whole = sum(length for length, _ in edits)
    heading = (
        atom(b"tkhd", numbers(3), numbers(0, 0, 1, 0, whole), bytes(8), bytes(8), matrix(*turn),
             numbers(width << 16, height << 16)),
        atom(b"edts", full(b"elst", numbers(len(edits)), *(
            struct.pack(">IiI", length, at, 1 << 16) for length, at in edits))))
    movie = full(b"mvhd", numbers(0, 0, timescale, whole, 1 << 16), struct.pack(">H", 1 << 8),
                 bytes(10), matrix(1, 0, 0, 1), bytes(24), numbers(2))

    def index(first):
        return atom(b"moov", movie, atom(b"trak", *heading, media(first)))

    if index_first:
        return head + index(len(head) + len(index(0)) + 8) + atom(b"mdat", *pictures)
    return head + atom(b"mdat", *pictures) + index(len(head) + 8)
