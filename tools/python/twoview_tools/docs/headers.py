"""Parses the public C headers: each declared symbol with its comment.

The parser relies on the style of these headers and does not parse C in general. A comment stands
before the declaration that it describes, or after it on the same line (and may continue below). A
`typedef struct` or `enum` has its name at both ends. One comment describes all names of one
statement (`float x, y;`).
"""

import dataclasses
import re

from .. import ROOT

FOLDERS = (ROOT / "lib/include", ROOT / "drivers/include")

COMMENT = re.compile(r"/\*.*?\*/", re.S)
DIRECTIVE = re.compile(r"#(?:\\\n|[^\n/]|/(?!\*))*")
ALONE = re.compile(r"(?:TV_BEGIN_DECLS|TV_END_DECLS|extern \"C\" \{|\})(?=\s|$)")


@dataclasses.dataclass
class Symbol:
    kind: str  # one of: file function struct opaque enum type macro field constant
    name: str
    comment: str
    code: str
    line: int
    parent: "Symbol | None" = None

    def __str__(self):
        return f"{self.parent.name}.{self.name}" if self.parent and self.parent.name else self.name


def public_headers():
    return sorted(path for folder in FOLDERS for path in folder.rglob("*.h"))


def plain(comment):
    """The text of a comment, without comment marks and without the common indentation of its
    further lines."""
    lines = comment[2:-2].strip().split("\n")
    indents = [len(line) - len(line.lstrip()) for line in lines[1:] if line.strip()]
    common = min(indents, default=0)
    return "\n".join([lines[0].strip()] + [line[common:].rstrip() for line in lines[1:]]).strip()


def statements(text, separator, offset=0):
    """Yields (code, comment, offset of the code) of each declaration in a scope. A code is a
    directive, or a statement up to the separator, or up to the opening brace of a function's
    body."""
    comment, position, last = "", 0, None
    pending = []

    def flush():
        nonlocal pending
        done, pending = pending, []
        return done

    while position < len(text):
        if text[position].isspace():
            end = re.compile(r"\s+").match(text, position).end()
            gap = text[position:end]
            if gap.count("\n") > 1:
                # A comment followed by a blank line describes the file, not a declaration.
                comment = ""
            if "\n" in gap:
                last = None
            position = end
            continue
        found = COMMENT.match(text, position)
        if found:
            if last is not None and not pending[last][1]:
                pending[last][1] = plain(found.group())
            else:
                yield from map(tuple, flush())
                comment = plain(found.group())
            position = found.end()
            continue
        yield from map(tuple, flush())
        found = ALONE.match(text, position)
        if found and separator == ";":
            position, comment = found.end(), ""
            continue
        found = DIRECTIVE.match(text, position)
        end = found.end() if found else statement_end(text, position, separator)
        pending.append([text[position:end], comment, offset + position])
        last, comment, position = len(pending) - 1, "", end
    yield from map(tuple, flush())


def statement_end(text, position, separator):
    depth = 0
    while position < len(text):
        found = COMMENT.match(text, position)
        if found:
            if separator == "," and depth == 0 and not text[found.end():].strip():
                return position  # the last constant of an enum ends here, without a comma
            position = found.end()
            continue
        character = text[position]
        depth += (character in "({[") - (character in ")}]")
        position += 1
        if depth == 0 and (character == separator or character == "}" and separator == ";" and
                           not re.match(r"\s*[a-z_0-9]+\s*(\[.*?\])?\s*;|\s*;", text[position:])):
            return position
    return position


def strip_comments(code):
    return re.sub(r"\s+", " ", COMMENT.sub(" ", code)).strip()


def members(parent, code, offset, line_of):
    """The fields of a struct, or the constants of an enum."""
    begin, end = code.index("{") + 1, code.rindex("}")
    kind, separator = ("constant", ",") if parent.kind == "enum" else ("field", ";")
    for part, comment, at in statements(code[begin:end], separator, offset + begin):
        inner = COMMENT.findall(part)
        if not comment and inner and "{" not in part:
            comment = plain(inner[-1])
        for name in names_of(strip_comments(part), kind):
            yield Symbol(kind, name, comment, strip_comments(part), line_of(at), parent)


def names_of(code, kind):
    if kind == "constant":
        return [re.match(r"\w+", code).group()]
    function = re.search(r"\(\*(\w+)\)", code)
    if function:
        return [function.group(1)]
    code = re.sub(r"\{.*\}", "", code).rstrip(";")
    pieces = code.split(",")
    return [re.findall(r"[A-Za-z_]\w*", re.sub(r"\[.*?\]", "", piece))[-1] for piece in pieces]


def parse(path):
    """The symbols of a header, in the order of the file."""
    text = path.read_text()
    line_of = lambda offset: text.count("\n", 0, offset) + 1
    about = COMMENT.match(text)
    yield Symbol("file", path.name, plain(about.group()) if about else "", "", 1)
    begin = about.end() if about else 0
    for code, comment, at in statements(text[begin:], ";", begin):
        bare, line = strip_comments(code), line_of(at)
        if code.startswith("#"):
            macro = re.match(r"#\s*define\s+(\w+)", bare)
            if macro and not macro.group(1).endswith("_H"):
                yield Symbol("macro", macro.group(1), comment, bare, line)
            continue
        if re.match(r"(typedef )?enum\b", bare):
            name = re.match(r"(?:typedef )?enum (\w*)", bare).group(1)
            parent = Symbol("enum", name, comment, bare, line)
        elif re.match(r"typedef struct \w+ \{", bare):
            parent = Symbol("struct", bare.split()[2], comment, bare, line)
        elif re.match(r"typedef struct \w+ \w+;", bare):
            yield Symbol("opaque", bare.split()[2], comment, bare, line)
            continue
        elif bare.startswith("typedef"):
            name = re.search(r"\(\*(\w+)\)", bare) or re.search(r"(\w+);$", bare)
            yield Symbol("type", name.group(1), comment, bare, line)
            continue
        else:
            signature = re.sub(r"\s*\{.*", ";", bare)
            name = re.search(r"(\w+)\(", signature).group(1)
            yield Symbol("function", name, comment, signature, line)
            continue
        inside = list(members(parent, code, at, line_of))
        if parent.name:
            yield parent
        # An unnamed enum with one constant, enum { NAME = 1 }, is listed as a constant.
        elif len(inside) == 1:
            inside[0].comment = inside[0].comment or comment
        yield from inside


def parameters(function):
    """(type, name, whether it is a pointer) of each parameter."""
    inside = function.code[function.code.index(function.name) + len(function.name):]
    inside = inside[inside.index("(") + 1:inside.rindex(")")]
    depth, piece, pieces = 0, "", []
    for character in inside + ",":
        depth += (character == "(") - (character == ")")
        if character == "," and depth == 0:
            pieces.append(piece.strip())
            piece = ""
        else:
            piece += character
    for piece in pieces:
        if piece in ("void", ""):
            continue
        callback = re.search(r"\(\*(\w+)\)", piece)
        if callback:
            yield piece, callback.group(1), True
            continue
        *words, name = [
            word for word in re.findall(r"\w+", re.sub(r"\[.*?\]", "", piece)) if word != "const"
        ]
        yield " ".join(words), name, "*" in piece or "[" in piece


def all_symbols():
    return {path: list(parse(path)) for path in public_headers()}


if __name__ == "__main__":
    for header, symbols in all_symbols().items():
        print(header.relative_to(ROOT))
        for symbol in symbols:
            print(f"  {symbol.line:4} {symbol.kind:9} {symbol}: {symbol.comment[:70]!r}")
