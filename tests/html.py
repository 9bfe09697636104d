"""What a page of HTML holds."""

from __future__ import annotations

from html.parser import HTMLParser

#: Elements without an end.
VOID = {"meta", "br", "img", "link", "input", "hr"}
#: Attributes that lead to something else.
ADDRESSES = ("src", "href", "xlink:href", "action", "srcset")


class Reader(HTMLParser):
    """Elements with their attributes in order, the text, and whether every element is closed."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.open: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)

    def count(self, tag: str) -> int:
        return sum(name == tag for name, _ in self.elements)

    @property
    def text(self) -> str:
        return "".join(self.texts)

    @property
    def addresses(self) -> list[str]:
        """Wherever the page leads, or takes something from."""
        return [value or "" for _, attrs in self.elements for name, value in attrs.items() if name in ADDRESSES]
