"""Checks the built site: every link and anchor leads somewhere, and no page asks another host for anything.

python docs/check_site.py docs/_build/html
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

#: attributes that a browser follows by itself, by tag; links of <a> are the reader's choice
LOADED = {"img": "src", "script": "src", "iframe": "src", "source": "src", "video": "src", "link": "href"}
#: links that say something of the page and load nothing
NOT_LOADED = {"canonical", "index", "search", "next", "prev", "author", "copyright"}
REMOTE_STYLE = re.compile(r"(?:url\(|@import)\s*[\"']?(?:https?:)?//")


class Page(HTMLParser):
    """The anchors of a page, its links, and what it loads."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.loaded: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.anchors |= {values[name] for name in ("id", "name") if name in values}
        if tag == "a" and values.get("href"):
            self.links.append(values["href"])
        elif values.get(LOADED.get(tag, "")) and not NOT_LOADED & set(values.get("rel", "").split()):
            self.loaded.append(values[LOADED[tag]])


def faults(folder: Path) -> Iterator[str]:
    """Yield what is wrong with the pages of a folder, a line each."""
    written = (path for path in sorted(folder.rglob("*.html")) if "_static" not in path.parts)
    pages = {path: Page(path) for path in written}
    for path, page in pages.items():
        where = path.relative_to(folder)
        yield from (f"{where}: loads {url}" for url in page.loaded if _remote(url))
        for url in dict.fromkeys(page.links + page.loaded):
            if url.startswith("data:") or urlsplit(url).scheme or _remote(url):
                continue
            file, anchor = unquote(urlsplit(url).path), unquote(urlsplit(url).fragment)
            target = Path(os.path.normpath(path.parent / file)) if file else path
            if not target.is_file():
                yield f"{where}: no file {url}"
            elif anchor and target in pages and anchor not in pages[target].anchors:
                yield f"{where}: no anchor {url}"
    for path in sorted(folder.rglob("*.css")):
        if REMOTE_STYLE.search(path.read_text(encoding="utf-8", errors="replace")):
            yield f"{path.relative_to(folder)}: loads from another host"


def _remote(url: str) -> bool:
    return url.startswith("//") or urlsplit(url).scheme in ("http", "https")


if __name__ == "__main__":
    found = list(faults(Path(sys.argv[1])))
    print(*found, sep="\n", end="\n" if found else "")
    sys.exit(bool(found))
