"""Makes the pages of the C reference, one for each header, from Doxygen's XML
(tools/docs/Doxyfile)."""

import html
import pathlib
import re
import xml.etree.ElementTree as ElementTree

LIBRARY = [
    "reconstruct",
    "context",
    "image",
    "feature",
    "match",
    "camera",
    "two_view",
    "triangulate",
    "dense",
    "depth_map",
    "room",
    "bundle",
    "absolute_pose",
    "window",
    "odometry", "path",
    "status",
    "version",
    "alloc",
]
DRIVERS = [
    "source",
    "clock",
    "attitude",
    "file_source",
    "h264",
    "status",
    "mavlink/session",
    "mavlink/estimate",
    "mavlink/udp",
    "ardrone/session",
    "ardrone/sockets",
    "ardrone/replay",
    "ardrone/transport",
    "ardrone/navdata",
    "ardrone/pave",
    "ardrone/at",
    "ardrone/config",
    "ardrone/pilot",
]


class Reference:
    def __init__(self, xml):
        self.xml = pathlib.Path(xml)
        self.compounds = {}
        self.place_of = {}  # {symbol: "page#heading" of the description}
        for entry in ElementTree.parse(self.xml / "index.xml").getroot():
            if entry.get("kind") in ("file", "struct"):
                compound = ElementTree.parse(self.xml / f"{entry.get('refid')}.xml").getroot()[0]
                self.compounds[entry.get("refid")] = compound
        self.headers = {}
        for compound in self.compounds.values():
            if compound.get("kind") == "file":
                path = compound.find("location").get("file")
                self.headers[path] = compound
                for _, symbol in self.symbols(compound):
                    for name in [name_of(symbol)] + [
                        value.findtext("name") for value in symbol.findall("enumvalue")
                    ]:
                        self.place_of[name] = f"{page_name(path)}#{name_of(symbol)}"
        assert {page_name(path) for path in self.headers} - {"reference/twoview.md"} == set(
            self.order()
        ), "a header is missing in LIBRARY or DRIVERS of twoview_tools/docs/reference.py"

    def order(self):
        return [f"reference/{name}.md" for name in LIBRARY] + [
            f"reference/drivers/{name}.md" for name in DRIVERS
        ]

    def symbols(self, compound):
        """(line, element) of a header's macros, types, structs and functions, in the order of the
        file."""
        found = []
        for member in compound.iter("memberdef"):
            found.append((int(member.find("location").get("line")), member))
        for inner in compound.findall("innerclass"):
            struct = self.compounds[inner.get("refid")]
            found.append((int(struct.find("location").get("line")), struct))
        return sorted(found, key=lambda pair: pair[0])

    def pages(self):
        """Returns {page: its text in Markdown} for all pages of the reference."""
        return {
            page_name(path): self.page(path, compound)
            for path, compound in self.headers.items()
            if not path.endswith("/twoview.h")
        }

    def page(self, path, compound):
        name = path.split("include/")[1]
        about = self.text(compound.find("detaileddescription"))
        lines = [f"# {name}", "", f"```c\n#include <{name}>\n```", "", *about, ""]
        for _, symbol in self.symbols(compound):
            lines += self.entry(symbol) + [""]
        return "\n".join(lines)

    def entry(self, symbol):
        name = name_of(symbol)
        lines = [f"## {name} {{: #{name} }}", "", "```c", declaration(symbol), "```", ""]
        lines += self.text(symbol.find("detaileddescription"))
        lines += self.parameters(symbol)
        rows = [(value.findtext("name"), (value.findtext("initializer") or "").lstrip("= "), value)
                for value in symbol.findall("enumvalue")]
        rows += [
            (field_of(field), "", field)
            for field in symbol.iter("memberdef")
            if symbol.tag == "compounddef"
        ]
        rows = [(title, value, "<br>".join(self.text(element.find("detaileddescription"))))
                for title, value, element in rows]
        if rows and symbol.tag == "compounddef":
            lines += ["", "| field | |", "| --- | --- |"]
            lines += [f"| `{title}` | {said} |" for title, _, said in rows if said]
        elif rows:
            lines += ["", "| constant | |", "| --- | --- |"]
            lines += [
                f"| `{title}` {f'= {value}' if value else ''} | {said} |"
                for title, value, said in rows
            ]
        return lines

    def parameters(self, symbol):
        rows = []
        for item in symbol.findall("detaileddescription//parameteritem"):
            names = ", ".join(f"`{name.text}`" for name in item.iter("parametername"))
            said = "<br>".join(self.text(item.find("parameterdescription")))
            rows.append(f"| {names} | {said} |")
        lines = ["", "| parameter | |", "| --- | --- |", *rows] if rows else []
        for section in symbol.findall("detaileddescription//simplesect[@kind='return']"):
            lines += ["", *self.text(section)]
        return lines

    def text(self, element):
        """The paragraphs of a description as HTML in lines of Markdown, without its lists of
        parameters."""
        lines = []
        for para in element.findall("para") if element is not None else []:
            words = self.words(para)
            if words:
                lines += ["", words] if lines else [words]
        return lines

    def words(self, para):
        pieces = [para.text or ""]
        for child in para:
            if child.tag not in ("parameterlist", "simplesect"):
                pieces.append("".join(child.itertext()))
            pieces.append(child.tail or "")
        words = html.escape(" ".join("".join(pieces).split()), quote=False)
        words = re.sub(r"([*|\[\]{}])", lambda found: f"&#{ord(found.group())};", words)
        # Split into alternating pieces of text, which may name symbols and pages, and code.
        pieces = words.split("`")
        pieces[0::2] = [
            re.sub(r"docs/([\w/-]+)\.md|\w+", self.link, piece) for piece in pieces[0::2]
        ]
        pieces[1::2] = [f"<code>{piece}</code>" for piece in pieces[1::2]]
        return "".join(pieces)

    def link(self, found):
        word, page = found.group(), found.group(1)
        if page:
            return f"[{pathlib.PurePosixPath(page).name.replace('_', ' ')}]({{{{root}}}}{page}.md)"
        if word in self.place_of:
            return f"[`{word}`]({{{{root}}}}{self.place_of[word]})"
        return word.replace("_", "&#95;")


def page_name(path):
    folder, name = path.split("include/")[1].removesuffix(".h").split("/", 1)
    return f"reference/{'drivers/' if folder == 'twoview_drivers' else ''}{name}.md"


def name_of(symbol):
    return symbol.findtext("compoundname") or symbol.findtext("name")


def field_of(member):
    arguments = member.findtext("argsstring") or ""
    kind = "".join(member.find("type").itertext())
    if "(*" in kind:
        return re.sub(r"\(\*.*", f"(*{member.findtext('name')}{arguments}", kind)
    return f"{kind} {member.findtext('name')}{arguments}".replace("* ", "*")


def declaration(symbol):
    kind, name = symbol.get("kind"), name_of(symbol)
    if kind == "function":
        flat = (
            f"{''.join(symbol.find('type').itertext())} {name}"
            f"{symbol.findtext('argsstring')};"
        ).replace("* ", "*")
        flat = flat.replace("static tv_", "static inline tv_")
        return flat if len(flat) <= 80 else re.sub(r"(?<=[(,]) ?(?=[a-z])", "\n    ", flat)
    if kind == "define":
        value = symbol.findtext("initializer") or ""
        parameters = ", ".join(p.findtext("defname") or "" for p in symbol.findall("param"))
        return f"#define {name}{f'({parameters})' if parameters else ''} {value}".rstrip()
    if kind == "typedef":
        arguments = symbol.findtext("argsstring") or ""
        if "(*" not in symbol.findtext("definition"):
            return f"{symbol.findtext('definition')};"
        return (
            f"typedef {symbol.findtext('definition').split('(*')[0].replace('typedef ', '')} "
            f"(*{name}{arguments};"
        )
    return (
        f"typedef {kind} {name} {{ .. }} {name};"
        if symbol.find(".//memberdef") is not None or kind == "enum"
        else f"typedef {kind} {name} {name};"
    )
