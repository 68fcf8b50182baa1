"""The metadata of JPEG files, copied from file to file byte for byte.

Source of the layout: T.871 (JFIF); Exif 2.32, section 4.5; XMP part 3; ICC.1:2022, annex B.4; CIPA DC-007 (further pictures).
"""

from __future__ import annotations

from collections.abc import Iterable

from camcal.formats.imaging.blocks import CENTIMETRE_M, INCH_M, Metadata, as_they_are
from camcal.formats.imaging.jpeg_header import colour_of, jpeg_header
from camcal.formats.imaging.jpeg_segments import (
    ADOBE,
    COMMENT,
    END_MARK,
    START_MARK,
    Segment,
    end_of_picture,
    is_beside_pixels,
    split_jpeg,
)

_EXIF, _XMP, _ICC = b"Exif\0\0", b"http://ns.adobe.com/xap/1.0/\0", b"ICC_PROFILE\0"
_JFIF, _MORE_XMP, _PICTURES = b"JFIF\0", b"http://ns.adobe.com/xmp/extension/\0", b"MPF\0"
_LONGEST_BODY = 65533
_MOST_PARTS = 255


def size(content: bytes) -> tuple[int, int] | None:
    """Read (width, height) in pixels; None if there is no frame header before the first scan."""
    header = jpeg_header(content)
    return header.size if header else None


def defect(content: bytes) -> str | None:
    """Follow the segments to the first scan and look for an end mark behind it.

    The end mark of a thumbnail stands before the scan; phones append all sorts of things behind the end mark.
    """
    _, scan = split_jpeg(content)
    whole = scan and content.rfind(END_MARK, scan) >= 0
    return None if whole else f"truncated image (it ends after {len(content)} bytes)"


def obstacle(content: bytes) -> str | None:
    """Say why the pixels of a JPEG cannot be changed without losing some of what they mean."""
    header = jpeg_header(content)
    return None if header and header.colour in {"grey", "ycc", "rgb"} else "CMYK, or colours of an unknown kind"


expansions = as_they_are


def with_metadata_of(source: bytes, encoded: bytes, note: str) -> tuple[bytes, list[str]]:
    """Give an encoded JPEG every segment beside the pixels that another has, byte for byte, and a comment.

    The thumbnail in the Exif segment stays as it is, as does everything in there. What no longer holds stays behind: the
    index of further pictures behind the end (they are not copied), and Adobe's note that the pixels are red, green and
    blue if they are now encoded as luminance and chrominance.

    Returns
    -------
    encoded : bytes
    left_behind : list of str
        What was not copied.
    """
    segments, scan = split_jpeg(source)
    recoded = colour_of(segments) == "rgb"
    kept = [
        segment
        for segment in segments
        if is_beside_pixels(segment)
        and not (segment.marker == 0xE2 and segment.body.startswith(_PICTURES))
        and not (recoded and segment.marker == 0xEE and segment.body.startswith(ADOBE))
    ]
    behind = source[end_of_picture(source, scan) :].strip(b"\0\xff")
    left_behind = ["what follows the picture in its file (more pictures, a film or a depth map)"] if behind else []
    return _put_in(encoded, [*kept, *_comments(note)]), left_behind


def metadata(content: bytes) -> Metadata:
    """Collect what other formats can hold too."""
    segments, _ = split_jpeg(content)
    blocks = {prefix: [s.body[len(prefix) :] for s in segments if s.body.startswith(prefix)] for prefix in (_EXIF, _XMP, _ICC)}
    names = {_other_name(segment) for segment in segments if is_beside_pixels(segment)}
    return Metadata(
        exif=next(iter(blocks[_EXIF]), None),
        xmp=next(iter(blocks[_XMP]), None),
        icc=b"".join(part[2:] for part in sorted(blocks[_ICC], key=lambda part: part[:1])) or None,
        dots_per_metre=_dots_per_metre(segments),
        comments=tuple(s.body.rstrip(b"\0").decode("utf-8", "replace") for s in segments if s.marker == COMMENT),
        others=tuple(sorted(names - {""})),
    )


def with_metadata(encoded: bytes, described: Metadata, note: str) -> tuple[bytes, list[str]]:
    """Give an encoded JPEG the metadata of a file of another format, and a comment.

    Returns
    -------
    encoded : bytes
    left_behind : list of str
        What does not fit into a JPEG.
    """
    left_behind = []
    segments: list[Segment] = [_jfif(described.dots_per_metre)]
    for name, prefix, block in (("EXIF", _EXIF, described.exif), ("XMP", _XMP, described.xmp)):
        if block is not None and len(prefix) + len(block) > _LONGEST_BODY:
            left_behind.append(f"{name} of {len(block)} bytes")
        elif block is not None:
            segments.append(Segment(0xE1, prefix + block))
    room = _LONGEST_BODY - len(_ICC) - 2
    icc = described.icc or b""
    parts = [icc[start : start + room] for start in range(0, len(icc), room)]
    if len(parts) > _MOST_PARTS:
        left_behind.append(f"colour profile of {len(icc)} bytes")
        parts = []
    segments += [Segment(0xE2, _ICC + bytes((number, len(parts))) + part) for number, part in enumerate(parts, 1)]
    comments = [text for text in described.comments if len(text.encode()) <= _LONGEST_BODY]
    if len(comments) < len(described.comments):
        left_behind.append(f"comments of more than {_LONGEST_BODY} bytes")
    return _put_in(encoded, [*segments, *_comments(*comments, note)]), left_behind


def _comments(*texts: str) -> list[Segment]:
    """Comment segments."""
    return [Segment(COMMENT, text.encode()) for text in texts]


def _put_in(encoded: bytes, segments: Iterable[Segment]) -> bytes:
    """Put segments at the front of an encoded JPEG, in place of those that its encoder wrote beside the pixels."""
    own, scan = split_jpeg(encoded)
    coding = (segment for segment in own if not is_beside_pixels(segment))
    return b"".join([START_MARK, *(segment.to_bytes() for segment in (*segments, *coding)), memoryview(encoded)[scan:]])


def _jfif(dots_per_metre: tuple[float, float] | None) -> Segment:
    """JFIF's segment, with the resolution in dots per inch or, where that is not known, the shape of a pixel alone."""
    dots = [min(max(round(dots * INCH_M), 1), 65535) for dots in dots_per_metre or (0, 0)]
    unit = 1 if dots_per_metre else 0
    return Segment(0xE0, _JFIF + bytes((1, 2, unit)) + dots[0].to_bytes(2) + dots[1].to_bytes(2) + b"\0\0")


def _dots_per_metre(segments: Iterable[Segment]) -> tuple[float, float] | None:
    """Resolution that JFIF's segment states."""
    body = next((segment.body for segment in segments if segment.marker == 0xE0 and segment.body.startswith(_JFIF)), b"")
    unit_m = {1: INCH_M, 2: CENTIMETRE_M}.get(body[7]) if len(body) >= 12 else None
    return (int.from_bytes(body[8:10]) / unit_m, int.from_bytes(body[10:12]) / unit_m) if unit_m else None


def _other_name(segment: Segment) -> str:
    """Name a segment that other formats have no place for; empty if they have, or it only tells how pixels are coded."""
    known = (_EXIF, _XMP, _ICC, ADOBE, _PICTURES, _JFIF)
    if segment.marker == COMMENT or segment.body.startswith(known):
        return ""
    if segment.body.startswith(_MORE_XMP):
        return "extended XMP"
    return "IPTC" if segment.body.startswith(b"Photoshop 3.0\0") else f"APP{segment.marker - 0xE0}"
