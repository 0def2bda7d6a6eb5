"""Folders of pictures and of results, by the rules of the program: the order of names
(tools/twoview/files/natural_order.h; both run the cases of test/formats/names.json), what is left
out of a folder (files/folder.h), and whose results a folder holds (base/output.h). This module
imports nothing but Python's own."""

import os
import re

_PIECES = re.compile(rb"[0-9]+|[^0-9]")
_ZERO = b"0"[0]


def natural_key(name):
    """The key that sorts names so that frame2 comes before frame10. Runs of ASCII digits are whole
    numbers of any length; other bytes compare as they are, with / lowest; names that are equal by
    this, such as a01 and a1, compare by their bytes."""
    data = name.encode("utf-8", "surrogateescape")
    pieces = []
    for piece in _PIECES.findall(data):
        if piece[:1].isdigit():
            digits = piece.lstrip(b"0")
            # A number takes the place of the byte "0" against another byte.
            pieces.append((1 + _ZERO, len(digits), digits))
        else:
            pieces.append((0 if piece == b"/" else 1 + piece[0], 0, b""))
    return pieces, data


def left_out_words(left_out, where):
    """One line on [(name, why)]: how many pictures of `where` are left out, and the first of each
    reason; "" if there are none."""
    counts = {}
    for name, why in left_out:
        first, count = counts.get(why, (name, 0))
        counts[why] = first, count + 1
    if not left_out:
        return ""
    text = "; ".join(f"{name} {why}" + (f" (so are {count - 1} more)" if count > 1 else "")
                     for why, (name, count) in counts.items())
    return f"{len(left_out)} picture{'s' * (len(left_out) > 1)} of {where} " \
           f"{'are' if len(left_out) > 1 else 'is'} left out: {text}"


def foreign_result(folder, names, always):
    """The first of these names that lies in the folder where the files that every run of the tool
    leaves, `always`, do not all lie there: it is something else's, which must not be replaced. None
    where there is none."""
    def is_there(name):
        return os.path.isfile(os.path.join(folder, name))
    if all(is_there(name) for name in always):
        return None
    return next((name for name in names if is_there(name)), None)


def foreign_words(folder, name, verb):
    return f"folder {folder} holds {name}, which is not of an earlier run of twoview {verb}: " \
           "give another -o"
