"""Hooks of mkdocs: add pages from files outside docs/, and support the features of GitHub's
Markdown that Python-Markdown lacks."""

import pathlib
import posixpath
import re

from mkdocs.structure.files import File

from twoview_tools import ROOT
from twoview_tools.docs import formulas, reference

# The pages of the site that are made from files outside docs/.
ELSEWHERE = {"examples/README.md": "examples.md", "CHANGELOG.md": "changelog.md"}

FENCE = re.compile(r"\s*(```|~~~)")
ITEM = re.compile(r"(\s{0,3})([-*]|\d+\.) ")


def on_config(config):
    config.reference = reference.Reference(ROOT / "out" / "reference" / "xml")
    generated = set(ELSEWHERE.values()) | set(config.reference.order())
    known = {
        path.relative_to(config.docs_dir).as_posix()
        for path in pathlib.Path(config.docs_dir).rglob("*.md")
    }
    listed = set()
    config.nav = expand(config.nav, config.reference.order() + sorted(known - generated), listed)
    return config


def expand(nav, pages, listed):
    """Replaces each pattern of the navigation by the pages that no entry has named yet."""
    named = set(re.findall(r"'([^'*]*\.md)'", str(nav)))
    out = []
    for entry in nav:
        if isinstance(entry, dict):
            (title, inside), = entry.items()
            inside = expand(inside, pages, listed) if isinstance(inside, list) else inside
            out += [{title: inside}] if inside else []
        elif "*" in entry:
            found = [
                page
                for page in pages
                if pathlib.PurePosixPath(page).match(entry)
                and posixpath.dirname(page) == posixpath.dirname(entry)
                and page not in named | listed
            ]
            out += found
            listed |= set(found)
        else:
            out.append(entry)
            listed.add(entry)
    return out


def on_files(files, config):
    for page, text in config.reference.pages().items():
        files.append(File.generated(config, page, content=text))
    for source, page in ELSEWHERE.items():
        files.append(File.generated(config, page, content=(ROOT / source).read_text()))
    files.append(File.generated(config, "decisions.md", content=decisions()))
    return files


def decisions():
    """The table of the decisions, as the page decisions.md."""
    text = (ROOT / "docs" / "decisions" / "README.md").read_text()
    return re.sub(r"\]\((\w[\w-]*\.md)", r"](decisions/\1", text)


def on_page_markdown(markdown, page, config, files):
    place = page.file.src_uri
    source = {page: source for source, page in ELSEWHERE.items()}.get(place, "docs/" + place)
    markdown = markdown.replace(
        "{{root}}", posixpath.relpath(".", posixpath.dirname(place) or ".") + "/"
    )
    markdown = re.sub(r"(!?)\[((?:[^][]|\[[^]]*\])*)\]\(([^()\s#]*)(#[^()\s]*)?\)",
                      lambda found: link(found, source, place), markdown)
    return with_blank_lines(formulas.rendered(markdown))


def link(found, source, place):
    """A link that leads out of docs/ is replaced by a link to the page made from that file, or else
    by its text."""
    image, text, target, anchor = found.groups()
    if not target or re.match(r"[a-z]+:", target):
        return found.group()
    path = posixpath.normpath(posixpath.join(posixpath.dirname(source), target))
    header = re.match(r"(?:lib|drivers)/include/(twoview|twoview_drivers)/(.*)\.h$", path)
    if path in ELSEWHERE:
        path = ELSEWHERE[path]
    elif header:
        path = f"reference/{'drivers/' if header[1] == 'twoview_drivers' else ''}{header[2]}.md"
    elif path.startswith("docs/"):
        path = path.removeprefix("docs/")
    else:
        return text
    return (
        f"{image}[{text}]({posixpath.relpath(path, posixpath.dirname(place) or '.')}{anchor or ''})"
    )


def with_blank_lines(markdown):
    """Adds the blank line that Python-Markdown, unlike GitHub, needs between a paragraph and a list
    or table."""
    out, fenced, before = [], False, ""
    for line in markdown.split("\n"):
        if FENCE.match(line):
            fenced = not fenced
        elif not fenced and before.strip() and not before.startswith(("    ", "\t")):
            starts_list = (
                ITEM.match(line) and not ITEM.match(before) and not before.startswith("  ")
            )
            starts_table = line.startswith("|") and not before.startswith("|")
            if starts_list or starts_table:
                out.append("")
        out.append(line)
        before = line
    return "\n".join(out)
