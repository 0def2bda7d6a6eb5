"""Folders of pictures and of results, by the rules of the program: the order of names
(tools/twoview/files/natural_order.h; both run the cases of test/formats/names.json), what is left
out of a folder (files/folder.h), which pictures are copies (files/copies.h; cases of copies.json),
and whose results a folder holds (base/output.h). This module imports nothing but Python's own."""

import collections
import filecmp
import os
import re

_PIECES = re.compile(rb"[0-9]+|[^0-9]")
_ZERO = b"0"[0]
_FIRST = {b"/": 0, b".": 1}


def natural_key(name):
    """The key that sorts names so that frame2 comes before frame10. Runs of ASCII digits are whole
    numbers of any length; capitals count as small letters, other bytes compare as they are, with /
    lowest and the dot next; names that are equal by this, such as a01 and a1, compare by their
    bytes."""
    data = name.encode("utf-8", "surrogateescape")
    pieces = []
    for piece in _PIECES.findall(data.lower()):
        if piece[:1].isdigit():
            digits = piece.lstrip(b"0")
            # Compared with a character that is no digit, a number counts as the character "0".
            pieces.append((2 + _ZERO, len(digits), digits))
        else:
            pieces.append((_FIRST.get(piece, 2 + piece[0]), 0, b""))
    return pieces, data


_WORDS = "(?:copy|copie|copia|cópia|kopie|kopia|kopio|kopi|копия|コピー|副本|복사본)"
_COUNT = r"\(?[0-9]{1,3}\)?"
#: the patterns of files/copies.cc, of bytes as there
_MARKS = [(mark, re.compile(pattern.encode(), re.I)) for mark, pattern in (
    ("word", r"(.+?)(?:(?: - | — |[ _.-])\(?|\()(?:(?:another|[0-9]+(?:st|nd|rd|th)) )?" + _WORDS
     + "(?: ?" + _COUNT + r")?\)?"),
    ("word", r"(.+?) ?\([^()]*" + _WORDS + r"[^()]*\)"),
    ("word", _WORDS + "(?: " + _COUNT + ")? (?:of|von|de|di|av) (.+)"),
    ("word", r"(.+)\.sync-conflict-[0-9]{8}-[0-9]{6}(?:-[A-Z0-9]+)?"),
    ("number", r"(.+?) ?\([0-9]{1,3}\)"),
    ("number", r"(.+)~[0-9]{1,3}"),
    ("bare number", r"(.+)[ _-][0-9]{1,3}"))]
_STRENGTH = [mark for mark, _ in _MARKS]
#: correlation from which on two pictures are one, stored with other settings, or edited
_SAME_STORED, _SAME_EDITED = 0.995, 0.8


def copy_name(stem):
    """(how the name, without its ending, says that its file is a copy: "word", "number" or "bare
    number"; the name without this mark); (None, "") where it does not."""
    for mark, pattern in _MARKS:
        match = pattern.fullmatch(os.fsencode(stem))
        if match:
            return mark, os.fsdecode(match[1])
    return None, ""


def _original(stem, stems):
    """(the mark, the stem of the picture that this would be a copy of), (None, "")."""
    folder, name = os.path.split(stem)
    strongest = None
    while True:
        mark, name = copy_name(name)
        if mark is None:
            return None, ""
        if strongest is None or _STRENGTH.index(mark) < _STRENGTH.index(strongest):
            strongest = mark
        if os.path.join(folder, name) in stems:
            return strongest, os.path.join(folder, name)


def copies_of(folder, names, correlation):
    """(the names of the pictures that are copies of others, by the rule of files/copies.h; a note
    on names of copies that show something else, or ""). `correlation` of two paths is that of their
    pictures' brightness."""
    stems = {}
    for name in names:
        stems.setdefault(os.path.splitext(name)[0], name)
    marked, series, has_series = [], set(), False
    for name in names:
        mark, stem = _original(os.path.splitext(name)[0], stems)
        if mark is None:
            continue
        original = stems[stem]
        paths = os.path.join(folder, name), os.path.join(folder, original)
        is_equal = _have_same_bytes(*paths)
        is_same = is_equal
        if not is_equal and mark != "bare number" and (mark == "word" or original not in series):
            is_same = correlation(*paths) > (_SAME_EDITED if mark == "word" else _SAME_STORED)
        if not is_same and mark != "word":
            series.add(original)
            has_series = has_series or mark == "number"
        marked.append((name, original, mark, is_equal, is_same))
    copies, kept = [], {"word": [], "number": [], "bare number": []}
    for name, original, mark, is_equal, is_same in marked:
        is_one_of_many = original in series if is_equal else has_series
        if is_same and (mark == "word" or not is_one_of_many):
            copies.append(name)
        else:
            kept[mark].append((name, original))
    # One original with numbers behind its name is a series, which needs no word.
    is_series = len({original for _, original in kept["number"]}) < 2
    return copies, _kept_note(kept["word"] + (not is_series) * kept["number"])


def _kept_note(kept):
    if not kept:
        return ""
    more = f" (and {len(kept) - 1} more)" if len(kept) > 1 else ""
    name, original = kept[0]
    return f"{name}{more} has the name of a copy of {original}, but shows something else: it is " \
           "taken as a picture of its own; where the folder holds two films, move one of them away"


def _have_same_bytes(path, other):
    try:
        return filecmp.cmp(path, other, shallow=False)
    except OSError:
        return False


def second_endings(names, endings):
    """The names that differ from another picture's in their ending only, but for one of each name:
    of the ending that most of its folder have, of the first in `endings` on a tie."""
    def ending(name):
        return os.path.splitext(name)[1].lower()
    counts = collections.Counter((os.path.dirname(name), ending(name)) for name in names)
    best = {}
    for name in sorted(names, key=lambda name: (-counts[os.path.dirname(name), ending(name)],
                                                endings.index(ending(name)))):
        best.setdefault(os.path.splitext(name)[0], name)
    return [name for name in names if best[os.path.splitext(name)[0]] != name]


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
