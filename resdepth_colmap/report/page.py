"""The page: template, styles and scripts of this package, and its data."""

import base64
import html
import importlib.resources
import json
import string
from collections.abc import Mapping
from typing import Any

ASSETS = "assets"
TEMPLATE = "report.html"
NOTICE = "vendor/NOTICE.txt"
STYLES = ("vendor/uPlot.min.css", "report.css")
LIBRARIES = ("vendor/three.min.js", "vendor/uPlot.iife.min.js")
SCRIPTS = (
    "elements.js",
    "blocks.js",
    "maps.js",
    "charts.js",
    "summary.js",
    "stage.js",
    "gallery.js",
    "table.js",
    "cloud.js",
    "main.js",
)

Blocks = Mapping[str, bytes]
"""Binary data by the id of its element."""


def render_page(title: str, data: Mapping[str, Any], blocks: Blocks) -> str:
    """The page as text; it loads nothing from the network.

    Args:
        title: Name of the workspace; any text.
        data: Plain values for the scripts, with any text.
        blocks: Data that the scripts decode on demand, by valid ids.
    """
    template = string.Template(read_asset(TEMPLATE))
    return template.substitute(
        title=html.escape(title),
        styles="\n".join(f"<style>\n{read_asset(name)}</style>" for name in STYLES),
        data=safe_json(data),
        notice=html.escape(read_asset(NOTICE)),
        blocks="\n".join(_block(name, content) for name, content in blocks.items()),
        libraries="\n".join(f"<script>{read_asset(n)}</script>" for n in LIBRARIES),
        scripts="\n".join(read_asset(name) for name in SCRIPTS),
    )


def safe_json(data: Mapping[str, Any]) -> str:
    """JSON that is safe in a script element, with any strings.

    It is ASCII without "<", so it can neither end the element nor open a comment, and
    names that are not valid Unicode survive.
    """
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e")


def read_asset(name: str) -> str:
    """The text of a file of this package."""
    folder = importlib.resources.files(__package__) / ASSETS
    return (folder / name).read_text(encoding="utf-8")


def _block(name: str, content: bytes) -> str:
    text = base64.b64encode(content).decode("ascii")
    return f'<script type="text/plain" id="{html.escape(name)}">{text}</script>'
