#!/usr/bin/env python3
"""Doxygen's input filter: converts a public header to the form that Doxygen reads. usage:
doxygen_filter.py HEADER

Doxygen needs marked comments, one declaration for each name, and @param; the headers are written
for people and have none of these. For each symbol that headers.py finds, the filter prints the
comment and the declaration. In a function's comment a line "name: ..." becomes @param, and a line
that begins with "Returns" or "Statuses" becomes @return, up to the next line of such a kind.
"""

import pathlib
import re
import sys

from . import headers

# A line that begins with one of these starts a paragraph of its own in a function's comment.
SECTIONS = re.compile(
    r"(Time|Same input|Needs no context|The result is|A match|An image|\"No geometry\"|First "
    r"order|options may|Cameras, R)\b"
)


def escape(text):
    return re.sub(r"([@\\<>#&])", r"\\\1", text.replace("*/", ""))


def body(symbol):
    if symbol.kind != "function":
        return escape(symbol.comment)
    names = {name for _, name, _ in headers.parameters(symbol)}
    lines = []
    for line in symbol.comment.split("\n"):
        begins = re.match(r"(\*?\w+(?:, \*?\w+)*): ", line)
        named = [name.strip(" *") for name in begins.group(1).split(",")] if begins else []
        if named and set(named) <= names:
            lines.append(f"@param {','.join(named)} {escape(line[begins.end():])}")
        elif re.match(r"(Returns|Statuses) ", line):
            lines.append("@return " + escape(line))
        else:
            lines.append(("\n" if SECTIONS.match(line) else "") + escape(line))
    return "\n".join(lines)


def declaration(symbol):
    """The declaration of one name; the statement in the header may declare several."""
    if symbol.kind == "field" and "(*" not in symbol.code:
        first, *others = symbol.code.rstrip(";").split(",")
        base = re.match(r"(.*?)\**\s*\w+(\[[^]]*\])*$", first).group(1)
        for piece in [first[len(base):], *others]:
            if re.search(rf"\b{symbol.name}\b", piece):
                return f"{base} {piece.strip()};"
    if symbol.kind == "constant" and not symbol.parent.name:
        return "#define " + re.sub(r"^(\w+) = (.*?),?$", r"\1 (\2)", symbol.code)
    if symbol.kind == "constant":
        return symbol.code.rstrip(",") + ","
    return re.sub(r"^TV_API ", "", symbol.code)


def comment_of(symbol, tag=""):
    return f"/** {tag}{body(symbol)} */" if symbol.comment else ""


def normalised(path):
    symbols = list(headers.parse(path))
    seen = set()
    for symbol in symbols:
        inside = [member for member in symbols if member.parent is symbol]
        if symbol.kind == "file":
            yield comment_of(symbol, "@file\n")
        elif symbol.kind in ("struct", "enum"):
            private = symbol.kind == "struct" and "rivate" in symbol.comment
            yield comment_of(symbol)
            yield f"typedef {symbol.kind} {symbol.name} {{"
            for member in inside:
                if not private or member.comment:
                    yield comment_of(member)
                    yield declaration(member)
            yield f"}} {symbol.name};"
        elif symbol.name not in seen and not (symbol.parent and symbol.parent.name):
            seen.add(symbol.name)  # prints a macro once if both branches of an #if define it
            yield comment_of(symbol)
            yield declaration(symbol)


if __name__ == "__main__":
    print("\n".join(normalised(pathlib.Path(sys.argv[1]))))
