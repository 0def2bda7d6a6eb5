"""Names pictures of formats that are not read, in the words of the program
(tools/twoview/files/image_file.cc, unread_picture). This module imports nothing but os."""

import os

ENDINGS = (".heic", ".heif", ".avif", ".gif")
HEIC = (b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"mif1", b"msf1")


def unread_picture(path):
    """Such as "is a HEIC picture, which is not read: convert it to JPEG"; "" for what is none of
    HEIC, AVIF and GIF, and for what cannot be read."""
    try:
        with open(path, "rb") as file:
            head = file.read(16)
    except OSError:
        return ""
    if head[:6] in (b"GIF87a", b"GIF89a"):
        return "is a GIF picture, which is not read: convert it to PNG"
    if head[4:8] == b"ftyp" and head[8:12] in (b"avif", b"avis"):
        return "is an AVIF picture, which is not read: convert it to PNG or JPEG"
    if head[4:8] == b"ftyp" and head[8:12] in HEIC:
        return ("is a HEIC picture, which is not read: convert it to JPEG, or let the phone save "
                "JPEG")
    return ""


def unread_pictures(folder, names):
    """[(name, what it is)] of those of these files that are pictures of such formats."""
    return [(name, what) for name in names if name.lower().endswith(ENDINGS)
            for what in [unread_picture(os.path.join(folder, name))] if what]
