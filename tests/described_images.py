"""A small picture, encoded plainly or with all that may be said of it; and the parts that such a file is made of."""

from __future__ import annotations

import io
import zlib

import cv2
import numpy as np
from PIL import Image as Pillow
from PIL import ImageCms, PngImagePlugin, TiffImagePlugin

# Smooth, so that no codec has to give up on it.
PICTURE = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 255, (40, 60, 3), dtype=np.uint8), (0, 0), 3)
GREY = PICTURE[..., 0].copy()
# Beside colours, formats of their own kind: grey only, bits, floats.
ENCODED = {
    ".pgm": GREY,
    ".pbm": GREY,
    ".pfm": GREY.astype(np.float32),
    ".hdr": PICTURE / np.float32(255),
    ".pic": PICTURE / np.float32(255),
}
RGB = Pillow.fromarray(PICTURE[..., ::-1])
NOTE = "camcal: lens distortion removed"
PROFILE = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
XMP = b'<?xpacket begin="" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/"/><?xpacket end="w"?>'


def made_exif() -> Pillow.Exif:
    """Orientation, maker, exposure, a maker's note and a place."""
    exif = Pillow.Exif()
    exif[0x0112] = 6
    exif[0x010F] = "Maker"
    exif.get_ifd(0x8769)[0x829A] = 0.008
    exif.get_ifd(0x8769)[0x927C] = bytes(range(256))
    exif.get_ifd(0x8825)[2] = (48.0, 1.0, 2.5)
    return exif


EXIF = made_exif().tobytes()
BLOCK = EXIF.removeprefix(b"Exif\0\0")


def plain(kind: str) -> bytes:
    """An encoded picture without metadata."""
    return cv2.imencode(f".{kind}", PICTURE)[1].tobytes()


def described(kind: str) -> bytes:
    """An encoded picture with EXIF, XMP, profile, resolution and, where there are such, comments."""
    stream = io.BytesIO()
    if kind == "jpg":
        RGB.save(stream, "JPEG", exif=EXIF, icc_profile=PROFILE, xmp=XMP, comment=b"hello", dpi=(300, 300))
    elif kind == "png":
        texts = PngImagePlugin.PngInfo()
        texts.add_text("Comment", "hello")
        texts.add_text("Author", "somebody " * 50, zip=True)
        texts.add_itxt("XML:com.adobe.xmp", XMP.decode(), zip=True)
        RGB.save(stream, "PNG", exif=EXIF, icc_profile=PROFILE, pnginfo=texts, dpi=(300, 300))
    elif kind == "webp":
        RGB.save(stream, "WEBP", lossless=True, exif=EXIF, icc_profile=PROFILE, xmp=XMP)
    else:
        exif = made_exif()
        tags = TiffImagePlugin.ImageFileDirectory_v2()
        tags[700] = XMP
        for code in (0x0112, 0x010F):
            tags[code] = exif[code]
        for code in (0x8769, 0x8825):
            tags[code] = dict(exif.get_ifd(code))
        RGB.save(stream, "TIFF", tiffinfo=tags, icc_profile=PROFILE, dpi=(300, 300))
    return stream.getvalue()


def segments(content: bytes) -> list[tuple[int, bytes]]:
    """Segments of a JPEG up to its first scan."""
    found = []
    position = 2
    while content[position + 1] != 0xDA:
        end = position + 2 + int.from_bytes(content[position + 2 : position + 4])
        found.append((content[position + 1], content[position:end]))
        position = end
    return found


def beside(content: bytes) -> list[bytes]:
    """Application and comment segments of a JPEG."""
    return [raw for marker, raw in segments(content) if 0xE0 <= marker <= 0xEF or marker == 0xFE]


def segment(marker: int, body: bytes) -> bytes:
    """A JPEG segment."""
    return bytes((0xFF, marker)) + (len(body) + 2).to_bytes(2) + body


def chunks(content: bytes) -> list[tuple[bytes, bytes]]:
    """Chunks of a PNG."""
    found = []
    position = 8
    while position < len(content):
        end = position + 12 + int.from_bytes(content[position : position + 4])
        found.append((content[position + 4 : position + 8], content[position:end]))
        position = end
    return found


def chunk(kind: bytes, body: bytes) -> bytes:
    """A PNG chunk."""
    return len(body).to_bytes(4) + kind + body + zlib.crc32(kind + body).to_bytes(4)


def box(kind: bytes, body: bytes) -> bytes:
    """A JPEG 2000 box."""
    return (8 + len(body)).to_bytes(4) + kind + body


def profiled_jp2(*beside: bytes) -> bytes:
    """A JPEG 2000 with a colour profile, and other boxes before the pixels."""
    content = plain("jp2")
    start, end = content.index(b"jp2h") - 4, content.index(b"jp2c") - 4
    stored = content[start + 8 : content.index(b"colr") - 4]
    return content[:start] + box(b"jp2h", stored + box(b"colr", b"\2\0\0" + PROFILE)) + b"".join(beside) + content[end:]
