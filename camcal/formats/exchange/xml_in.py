"""XML in: elements that remember their lines; nothing outside the file is read and no entity is expanded."""

from __future__ import annotations

from dataclasses import dataclass, field
from xml.parsers import expat

from camcal.errors import InputError

_DEEPEST_NESTING = 40


@dataclass(slots=True)
class Element:
    """One element.

    Attributes
    ----------
    tag : str
    attributes : dict of str
    line : int
        Where it begins, counted from 1.
    text : str
        Its own text, without white space around it.
    children : list of Element
    """

    tag: str
    attributes: dict[str, str]
    line: int
    text: str = ""
    children: list[Element] = field(default_factory=list)

    def child(self, tag: str) -> Element | None:
        """Return the first child of a name; None if there is none."""
        return next((child for child in self.children if child.tag == tag), None)

    def child_text(self, tag: str, otherwise: str = "") -> str:
        """Return the text of the first child of a name."""
        child = self.child(tag)
        return otherwise if child is None else child.text


def parse_xml(name: str, content: bytes) -> Element:
    """Read an XML file.

    Parameters
    ----------
    name : str
        The file as the user named it.
    content : bytes

    Returns
    -------
    Element
        The root.

    Raises
    ------
    InputError
        If it is not valid XML, is nested absurdly, or defines entities.
    """
    parser = expat.ParserCreate("utf-8")
    top = Element("", {}, 1)
    open_elements = [top]

    def begin(tag: str, attributes: dict[str, str]) -> None:
        if len(open_elements) > _DEEPEST_NESTING:
            raise InputError(f"{name}:{parser.CurrentLineNumber}: nested too deeply (more than {_DEEPEST_NESTING} levels)")
        element = Element(tag, attributes, parser.CurrentLineNumber)
        open_elements[-1].children.append(element)
        open_elements.append(element)

    def end(_: str) -> None:
        element = open_elements.pop()
        element.text = element.text.strip()

    def text(data: str) -> None:
        open_elements[-1].text += data

    def entity(*_: object) -> None:
        raise InputError(f"{name}:{parser.CurrentLineNumber}: defines an entity (expected plain XML). Write it out.")

    parser.StartElementHandler = begin
    parser.EndElementHandler = end
    parser.CharacterDataHandler = text
    parser.EntityDeclHandler = entity
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        problem = expat.ErrorString(error.code)
        raise InputError(f"{name}:{error.lineno}: not valid XML ({problem}). Correct this line.") from None
    return top.children[0]
