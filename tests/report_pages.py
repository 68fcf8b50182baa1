"""Pages as a browser reads them, and a calibration that has something to tell on its page."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
from scenes import detections, poses

from camcal.formats.corners_file import save_corners
from camcal.observations import Detection

# Names that a page must not take for markup.
NAME = """<b>&"rear" 'cam'</b> 😀"""
ODD_IMAGE = "a <i>&'view'é😀.png"


class Page(HTMLParser):
    """What a browser would make of a page: its tags, its links, its text by element."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.text: dict[str, list[str]] = {}
        self.inside: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        """Remember a tag, and what follows as its text."""
        self.tags.append((tag, {name: value or "" for name, value in attributes}))
        self.inside.append(tag)
        self.text.setdefault(tag, []).append("")

    def handle_endtag(self, tag):
        """Close every tag up to this one."""
        while self.inside and self.inside.pop() != tag:
            pass

    def handle_data(self, data):
        """Add text to all open elements."""
        for tag in set(self.inside):
            self.text[tag][-1] += data

    def all(self, tag: str) -> list[dict[str, str]]:
        """Attributes of every element of a kind."""
        return [attributes for name, attributes in self.tags if name == tag]


def undated(page: Path) -> str:
    """Content of a page without the time it was made."""
    return re.sub(r"<time>[^<]*</time>", "", page.read_text(encoding="utf-8"))


def noisy_file(path: Path, *, moved_view: bool = False) -> None:
    """Corners of twelve views with 0.1 px of noise and one corner 5 px off; one view may be of a board that moved."""
    seen = detections(poses(12, 4), noise_px=0.1, seed=2)
    corners = np.array(seen[2].corners_px)
    corners[7] += 5
    seen[2] = Detection(seen[2].source, seen[2].size, seen[2].ids, corners, seen[2].sigma_px)
    if moved_view:
        corners = np.array(seen[5].corners_px)
        corners[::2] += [3, -2]
        seen[5] = Detection(seen[5].source, seen[5].size, seen[5].ids, corners, seen[5].sigma_px)
    save_corners(path, seen)
