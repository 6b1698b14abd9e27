"""XML as elements that know where they stand in the text: read safely, and edited in place.

No document type, hence no entities, is accepted; nothing outside the text is fetched. Places are bytes of the
UTF-8 text, so that an edit replaces what it means and leaves every other byte as it is. lxml cannot: of
`<a b='1' />` it makes `<a b="1"/>`, and 215 of the 297 lines of a real machine's URDF come out otherwise.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NoReturn
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

from beamstiff.errors import BeamstiffError, shown, suggest
from beamstiff.units import number

DEEPEST = 100
_ATTRIBUTE = re.compile(rb"""\s*([^\s=<>/"']+)\s*=\s*("[^"]*"|'[^']*')""")
_TAG_END = re.compile(rb"""(?:"[^"]*"|'[^']*'|[^>"'])*>""")


@dataclass
class Element:
    """One element; a text keeps where it came from."""

    name: str
    attributes: dict[str, str]
    source: str  # file, for messages
    line: int
    # start, inside, close, end: bytes: of ``<``, after the start tag's ``>``, of ``</`` (of the end of
    # ``<.../>``), after its end
    start: int
    inside: int
    close: int = 0
    end: int = 0
    text: str = ""  # what stands in it beside its children
    children: list[Element] = field(default_factory=list)

    def fail(self, message: str) -> NoReturn:
        """Raise the error of this element, with its file, line and name."""
        tag = f"{self.name} {self.attributes.get('name', '')[:60]}".strip()
        raise BeamstiffError(f"{self.source}:{self.line}: <{tag}>: {message}")

    def all(self, name: str) -> list[Element]:
        """Return the children of a name."""
        return [child for child in self.children if child.name == name]

    def one(self, name: str) -> Element | None:
        """Return the only child of a name, or None; raises where there are several."""
        found = self.all(name)
        if len(found) > 1:
            found[1].fail(f"found a second time in <{self.name}>, expected one")
        return found[0] if found else None

    def need(self, name: str) -> Element:
        """Return the only child of a name; raises where there is none."""
        child = self.one(name)
        if child is None:
            self.fail(f"<{name}> is missing{suggest(name, [child.name for child in self.children])}")
        return child

    def attribute(self, name: str) -> str:
        """Return an attribute; raises where it is missing or empty."""
        value = self.attributes.get(name, "").strip()
        if not value:
            self.fail(f"the attribute {name} is missing{suggest(name, self.attributes)}")
        return value

    def numbers(self, text: str, count: int, what: str) -> list[float]:
        """Return the numbers of a text separated by blanks; raises where they are not `count` finite ones."""
        words = text.split()
        if len(words) != count:
            self.fail(f"{what}: found {shown(text.strip())}, expected {count} number{'s'[: count > 1]}")
        try:
            return [number(word) for word in words]
        except BeamstiffError as error:
            self.fail(f"{what}: {error}")


def parse_xml(text: str, source: str) -> Element:
    """Return the root element of an XML text."""
    data = text.encode("utf-8")
    parser = expat.ParserCreate(encoding="utf-8")
    parser.buffer_text = True
    root: list[Element] = []
    open_elements: list[Element] = []

    def begin(name: str, attributes: dict[str, str]) -> None:
        at = parser.CurrentByteIndex
        tag = _TAG_END.match(data, at)
        inside = tag.end() if tag else at
        name = name.partition(":")[0] if name.startswith("beamstiff:") else name  # as SDF has it
        element = Element(name, attributes, source, parser.CurrentLineNumber, at, inside)
        if len(open_elements) >= DEEPEST:
            element.fail(f"found more than {DEEPEST} elements inside one another, expected fewer")
        (open_elements[-1].children if open_elements else root).append(element)
        open_elements.append(element)

    def finish(_: str) -> None:
        element = open_elements.pop()
        at = parser.CurrentByteIndex
        empty = data[element.inside - 2 : element.inside] == b"/>"
        element.close = element.inside if empty else at
        element.end = element.inside if empty else data.index(b">", at) + 1

    def characters(more: str) -> None:
        open_elements[-1].text += more

    def refuse(*_: object) -> None:
        raise BeamstiffError(
            f"{source}:{parser.CurrentLineNumber}: found a document type (<!DOCTYPE>), which may define "
            "entities: expected a file without it"
        )

    parser.StartElementHandler, parser.EndElementHandler = begin, finish
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = characters, refuse
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        reason = expat.errors.messages[error.code]
        raise BeamstiffError(f"{source}:{error.lineno}: not well-formed XML: {reason}") from None
    return root[0]


@dataclass(frozen=True)
class Edit:
    """Bytes to be replaced."""

    start: int
    end: int
    text: str


def set_attribute(text: bytes, element: Element, name: str, value: str) -> Edit:
    """Return the edit that gives an attribute a value, where it stands or after the last one."""
    tag = text[element.start : element.inside]
    last = len(re.match(rb"<[^\s/>]+", tag)[0])  # type: ignore[index]  # an element has a name
    for match in _ATTRIBUTE.finditer(tag, last):
        last = match.end()
        if match[1].decode() == name:
            return Edit(element.start + match.start(2), element.start + match.end(2), quoteattr(value))
    return Edit(element.start + last, element.start + last, f" {name}={quoteattr(value)}")


def add_child(text: bytes, element: Element, child: str) -> Iterator[Edit]:
    """Yield the edits that put a child at the end of an element, indented as its last child is."""
    outer = _indent(text, element.start)
    inner = _indent(text, element.children[-1].start) if element.children else outer + "  "
    if text[element.inside - 2 : element.inside] == b"/>":
        yield Edit(
            element.inside - 2,
            element.inside,
            f">\n{inner}{_shifted(child, inner)}\n{outer}</{element.name}>",
        )
        return
    at = element.children[-1].end if element.children else element.inside
    yield Edit(at, at, f"\n{inner}{_shifted(child, inner)}" + ("" if element.children else f"\n{outer}"))


def _shifted(child: str, indent: str) -> str:
    return child if "<![CDATA[" in child else child.replace("\n", f"\n{indent}")


def _indent(text: bytes, at: int) -> str:
    line = text[text.rfind(b"\n", 0, at) + 1 : at]
    return line.decode() if not line.strip() else ""


def remove(text: bytes, element: Element) -> Edit:
    """Return the edit that takes an element out, with the blanks before it."""
    start = element.start
    while start and text[start - 1 : start] in (b" ", b"\t"):
        start -= 1
    if text[start - 1 : start] == b"\n":
        start -= 2 if text[start - 2 : start - 1] == b"\r" else 1
    return Edit(start, element.end, "")


def apply_edits(text: bytes, edits: list[Edit]) -> str:
    """Return the text with its edits made, from the last to the first."""
    for edit in sorted(edits, key=lambda edit: (edit.start, edit.end), reverse=True):
        text = text[: edit.start] + edit.text.encode("utf-8") + text[edit.end :]
    return text.decode("utf-8")
