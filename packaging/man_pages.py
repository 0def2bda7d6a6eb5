#!/usr/bin/env python3
"""Writes the manual pages twoview.1 and twoview-VERB.1: the options from the program's own --help,
the text from docs/cli.md.

usage: man_pages.py -o FOLDER CLI_MD -- PROGRAM...   (PROGRAM may begin with an emulator)

A section of CLI_MD belongs to the verbs that its heading names ("detect and match"); the others
are part of twoview.1. SOURCE_DATE_EPOCH gives the date.
"""

import argparse
import datetime
import os
import pathlib
import re
import subprocess
import sys

LEFT_OUT = ("Where it is",)  # sections about the source tree
# Their --help needs packages that a build may not have.
PYTHON_VERBS = ("compare", "colmap", "import", "export", "rerun")


def run_help(program, words):
    """The text of `PROGRAM WORDS --help`."""
    run = subprocess.run([*program, *words, "--help"], capture_output=True, text=True, check=False)
    if run.returncode != 0:
        sys.exit(f"man_pages.py: {' '.join([*program, *words])} --help: {run.stderr.strip()}")
    return run.stdout


def verbs_of(text):
    """Names and short texts below "Subcommands:"."""
    found, inside = [], False
    for line in text.splitlines():
        if line and not line.startswith(" "):
            inside = line == "Subcommands:"
        elif inside and re.match(r"  [a-z]", line):
            name, about = line.split(None, 1)
            found.append((name, about))
        elif inside and line.strip() and found:
            found[-1] = (found[-1][0], f"{found[-1][1]} {line.strip()}")
    return found


def escape(text):
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return re.sub(r"(?m)^([.'])", r"\\&\1", text)


def inline(text):
    """A paragraph of Markdown: code becomes bold, a link its text."""
    text = re.sub(r"\[([^\]]+)\]\([^)]*\)", r"\1", text)
    parts = re.split(r"(`[^`]*`|\*\*[^*]+\*\*)", text)
    return "".join("\\fB" + escape(part.strip("`*")) + "\\fR" if part[:1] in "`*" and part[1:]
                   else escape(part) for part in parts)


def roff(markdown):
    """The lines of a section: paragraphs, lists, tables and code blocks."""
    lines, paragraph, code = [], [], False

    def end():
        if paragraph:
            text = inline(" ".join(paragraph))
            lines.extend([".PP", "\\&" + text if text[:1] in ".'" else text])
            paragraph.clear()

    for line in markdown.splitlines():
        if line.startswith("```"):
            end()
            lines.extend([".fi", ".RE"] if code else [".RS", ".nf"])
            code = not code
        elif code:
            lines.append(escape(line) or ".sp")
        elif line.startswith("|"):
            end()
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            if set("".join(cells)) <= set("-: "):
                del lines[-3:]  # the line above is the table's head
            else:
                lines.extend([".TP", inline(cells[0]), inline("; ".join(filter(None, cells[1:])))])
        elif line.startswith("- "):
            end()
            lines.append(".IP \\(bu 2")
            lines.append(inline(line[2:]))
        elif line.startswith("  ") and lines and not paragraph:
            lines.append(inline(line.strip()))
        elif line.strip():
            paragraph.append(line.strip())
        else:
            end()
    end()
    return lines


def options(text):
    """The lines of --help behind the usage, as they are: they already fit 80 columns or wrap."""
    lines = text.splitlines()
    start = next(i for i, line in enumerate(lines) if line.lower().startswith("usage:"))
    shown = [line for i, line in enumerate(lines[start:])
             if line.strip() or (i and lines[start + i - 1].strip())]
    return [".nf", *(escape(line) or ".sp" for line in shown), ".fi"]


def sections_of(page):
    """(heading, text) of each section of the page; the first is the page's introduction."""
    parts = re.split(r"(?m)^## (.*)$", page)
    return [("", parts[0]), *zip(parts[1::2], parts[2::2])]


def write(folder, name, about, date, version, body):
    title = escape(name.upper())
    lines = [f'.TH "{title}" "1" "{date}" "{escape(version)}" "User commands"', ".SH NAME",
             f"{escape(name)} \\- {escape(about)}", *body]
    (folder / f"{name}.1").write_text("\n".join(lines) + "\n", encoding="utf-8")


def main():
    parser = argparse.ArgumentParser(description="manual pages of the program twoview")
    parser.add_argument("-o", dest="folder", type=pathlib.Path, required=True)
    parser.add_argument("page", type=pathlib.Path)
    parser.add_argument("program", nargs="+")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    epoch = int(os.environ.get("SOURCE_DATE_EPOCH", 0)) or arguments.page.stat().st_mtime
    date = datetime.datetime.fromtimestamp(epoch, datetime.timezone.utc).strftime("%Y-%m-%d")
    program = arguments.program
    version = subprocess.run([*program, "--version"], capture_output=True, text=True,
                             check=True).stdout.strip()
    top = run_help(program, [])
    verbs = verbs_of(top)
    names = [name for name, _ in verbs]
    sections = sections_of(arguments.page.read_text(encoding="utf-8"))
    of_verb = {name: [(heading, text) for heading, text in sections
                      if name in re.findall(r"\w+", heading)] for name in names}
    general = [(heading, text) for heading, text in sections
               if heading and heading not in LEFT_OUT
               and not any((heading, text) in found for found in of_verb.values())]

    body = [".SH SYNOPSIS", "\\fBtwoview\\fR \\fIVERB\\fR [\\fIOPTION\\fR...]",
            ".SH DESCRIPTION", escape(top.splitlines()[0]) + ".", ".SH VERBS"]
    for name, about in verbs:
        body += [".TP", f"\\fBtwoview {escape(name)}\\fR", escape(about)]
    for heading, text in general:
        body += [f".SH {escape(heading.upper())}", *roff(text)]
    body += [".SH SEE ALSO", ", ".join(f"\\fBtwoview\\-{escape(name)}\\fR(1)" for name in names)]
    write(arguments.folder, "twoview", top.splitlines()[0], date, version, body)

    for name, about in verbs:
        text = None if name in PYTHON_VERBS else run_help(program, [name])
        body = [".SH SYNOPSIS", f"\\fBtwoview {escape(name)}\\fR [\\fIOPTION\\fR...]"]
        for heading, part in of_verb[name]:
            body += [".SH DESCRIPTION" if part is of_verb[name][0][1]
                     else f".SH {escape(heading.upper())}", *roff(part)]
        if not of_verb[name]:
            body += [".SH DESCRIPTION", escape(about) + "."]
        if text is None:
            body += [f".PP\n\\fBtwoview {escape(name)} \\-\\-help\\fR lists the options. "
                     "The verb is in the package \\fBpython3\\-twoview\\fR."]
        elif verbs_of(text):
            for sub, sub_about in verbs_of(text):
                body += [f".SH {escape(f'twoview {name} {sub}'.upper())}", escape(sub_about) + ".",
                         *options(run_help(program, [name, sub]))]
        else:
            body += [".SH OPTIONS", *options(text)]
        body += [".SH SEE ALSO", "\\fBtwoview\\fR(1)"]
        write(arguments.folder, f"twoview-{name}", about, date, version, body)


if __name__ == "__main__":
    main()
