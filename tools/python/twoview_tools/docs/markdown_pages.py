"""Parses Markdown pages into links, headings and code, for the tests of docs/."""

import re

from .. import ROOT


def pages():
    return [ROOT / "README.md", ROOT / "CHANGELOG.md", ROOT / "examples" / "README.md",
            *sorted((ROOT / "docs").rglob("*.md"))]


class Page:
    """A page. prose: (line number, text) of each line outside code blocks. blocks: (language, line
    number of the opening fence, text) of each code block."""

    def __init__(self, path):
        self.path, self.prose, self.blocks = path, [], []
        block, language, fence, begin = None, "", "", 0
        for number, line in enumerate(path.read_text().split("\n"), 1):
            opens = re.match(r"\s*(```+)\s*(\w*)", line)
            if block is None and opens:
                block, fence, language, begin = [], opens[1], opens[2], number
            elif block is not None and line.strip() == fence:
                self.blocks.append((language, begin, "\n".join(block) + "\n"))
                block = None
            elif block is not None:
                block.append(line)
            else:
                self.prose.append((number, line))

    def __str__(self):
        return self.path.relative_to(ROOT).as_posix()

    def before(self, line):
        """The text of the HTML comment directly before the block that begins at a line; empty if
        there is none."""
        text = "\n".join(self.path.read_text().split("\n")[:line - 1]).rstrip()
        found = re.search(r"<!--((?:(?!<!--).)*)-->$", text, re.S)
        return found[1].strip() if found else ""

    def anchors(self):
        found = {}
        for _, line in self.prose:
            heading = re.match(r"#{1,6} (.*)", line)
            if heading:
                name = slug(heading[1])
                found[name] = found.get(name, 0) + 1
        return set(found)

    def links(self):
        """(line, target, anchor) of each link or picture without a scheme such as https:. The
        target is empty for an anchor of the same page."""
        for number, line in self.prose:
            line = re.sub(r"`[^`]*`", "", line)
            for target in re.findall(r"\]\(([^()\s]+)\)", line):
                if not re.match(r"[a-z]+:", target):
                    yield (number, *(target.split("#") + [""])[:2])

    def code(self):
        """Yields (line number, text) of each `code` span in the prose."""
        for number, line in self.prose:
            for text in re.findall(r"`([^`]+)`", line):
                yield number, text


def slug(heading):
    """The anchor of a heading, as GitHub and the site form it."""
    heading = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading).lower()
    return re.sub(r"[^\w\- ]", "", heading).strip().replace(" ", "-")
