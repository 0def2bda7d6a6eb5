"""Makes the page: one file that needs no network."""

import base64
import datetime
import platform
from pathlib import Path

import jinja2

from .. import ROOT
from . import inputs

PARTS = Path(__file__).resolve().parent / "page"
PROGRAM_STYLE = ROOT / "tools" / "twoview" / "report" / "style.css"


def sections(outcomes):
    """[(section, [outcome])] in the order of the paper."""
    grouped = {}
    for outcome in outcomes:
        grouped.setdefault(outcome["experiment"].section, []).append(outcome)
    return list(grouped.items())


def render(outcomes, version, seconds):
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True,
                                     undefined=jinja2.StrictUndefined)
    environment.filters["base64"] = lambda data: base64.b64encode(data).decode()
    style = PROGRAM_STYLE.read_text(encoding="utf-8") + (PARTS / "page.css").read_text(
        encoding="utf-8"
    )
    return environment.from_string((PARTS / "page.html").read_text(encoding="utf-8")).render(
        sections=sections(outcomes), style=style, version=version, seconds=seconds,
        missing=[o for o in outcomes if o["problem"]],
        made=datetime.datetime.now().strftime("%Y-%m-%d %H:%M"), machine=inputs.machine(),
        system=f"{platform.system()} {platform.machine()}, Python {platform.python_version()}")
