"""What an independent parser of HTML finds in a page."""

import html.parser


class Elements(html.parser.HTMLParser):
    """Script elements by id, links, and the text outside of scripts."""

    def __init__(self) -> None:
        super().__init__()
        self.scripts: dict[str, str] = {}
        self.num_scripts = 0
        self.links: list[str] = []
        self.text = ""
        self._script: str | None = None

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = {key: value or "" for key, value in attrs}
        self.links += [found[key] for key in ("src", "href") if found.get(key)]
        if tag == "script":
            self.num_scripts += 1
            self._script = found.get("id", "")
            self.scripts[self._script] = ""

    def handle_endtag(self, tag: str) -> None:
        if tag == "script":
            self._script = None

    def handle_data(self, data: str) -> None:
        if self._script is None:
            self.text += data
        else:
            self.scripts[self._script] += data


def parsed(page: str) -> Elements:
    """Read a whole page."""
    elements = Elements()
    elements.feed(page)
    elements.close()
    return elements
