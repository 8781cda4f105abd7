"""The player of a motion as a separate page: one document without requests, for a frame of another page."""

from __future__ import annotations

import base64
import hashlib
from functools import cache
from pathlib import Path

import jinja2

from vanedamp.studies.headline import format_value
from vanedamp.studies.report.motion import RunFrames

_FOLDER = Path(__file__).parent


def motion_page(motion: RunFrames, remark: str = "") -> str:
    """Return the document that plays a motion, with a remark below it."""
    return _template().render(motion=motion, data=motion.to_json(), script=_script(), remark=remark)


def script_source() -> str:
    """Return the player's script as a source of a Content-Security-Policy's script-src.

    A frame with srcdoc is under the policy of the page around it, which forbids scripts that it does not name.
    """
    digest = hashlib.sha256(_script().encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode()}'"


@cache
def _script() -> str:
    return (_FOLDER / "motion.js").read_text(encoding="utf-8")


def environment() -> jinja2.Environment:
    """Return the templates of this folder, whose values are escaped, with the filter `shown`."""
    templates = jinja2.Environment(
        loader=jinja2.FileSystemLoader(_FOLDER), autoescape=True, trim_blocks=True, lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )  # fmt: skip
    templates.filters["shown"] = format_value
    return templates


@cache
def _template() -> jinja2.Template:
    return environment().get_template("motion_page.html")
