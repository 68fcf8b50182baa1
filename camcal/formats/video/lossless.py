"""Whether a video was encoded without loss: what the headers of the codecs that can do both say."""

from __future__ import annotations

from collections.abc import Iterator

_ALWAYS = frozenset(
    (
        *("ffv1", "ffvhuff", "huffyuv", "utvideo", "magicyuv", "png", "apng", "qtrle", "rawvideo", "v210", "v410", "v308"),
        *("r210", "r10k", "y41p", "yuv4", "zlib", "mszh", "lagarith", "flic", "bmp", "tiff", "targa", "rscc", "msrle", "gif"),
    )
)
_HIGH_PROFILES = (44, 83, 86, 100, 110, 118, 122, 128, 134, 135, 138, 139, 244)
_H264_SPS, _HEVC_PPS = 7, 34


def is_lossless(codec: str, extradata: bytes) -> bool:
    """Tell whether a video stream is lossless.

    Parameters
    ----------
    codec : str
        libav's name.
    extradata : bytes
        The stream's parameter sets, as MP4 (avcC, hvcC) or as a transport stream holds them.

    Returns
    -------
    bool
        Of H.264 what its sequence parameter set says (qpprime_y_zero_transform_bypass_flag, ITU-T H.264 7.3.2.1.1), of HEVC
        its picture parameter set (transquant_bypass_enabled_flag, ITU-T H.265 7.3.2.3). VP9 and AV1 say it nowhere but in
        their frames: False.
    """
    if codec in _ALWAYS:
        return True
    try:
        if codec == "h264":
            return any(_h264_bypass(unit) for unit in _units(extradata, 6) if unit[0] & 31 == _H264_SPS)
        if codec == "hevc":
            return any(_hevc_bypass(unit) for unit in _units(extradata, 23) if unit[0] >> 1 & 63 == _HEVC_PPS)
    except (IndexError, ValueError):
        return False
    return False


class _Bits:
    """Reads a unit's bits, without the bytes that only keep start codes from appearing in it."""

    def __init__(self, unit: bytes) -> None:
        payload = unit.replace(b"\0\0\3", b"\0\0")
        self._bits = f"{int.from_bytes(payload):0{8 * len(payload)}b}"
        self._at = 0

    def flag(self) -> bool:
        return self.number(1) == 1

    def number(self, bits: int) -> int:
        if self._at + bits > len(self._bits):
            raise ValueError("end of the unit")
        self._at += bits
        return int(self._bits[self._at - bits : self._at] or "0", 2)

    def golomb(self) -> int:
        """Read an unsigned Exp-Golomb code; a signed one has the same length."""
        zeros = self._bits.index("1", self._at) - self._at
        self._at += zeros
        return self.number(zeros + 1) - 1


def _h264_bypass(unit: bytes) -> bool:
    bits = _Bits(unit[1:])
    profile = bits.number(8)
    bits.number(16)
    bits.golomb()
    if profile not in _HIGH_PROFILES:
        return False
    if bits.golomb() == 3:
        bits.flag()
    bits.golomb()
    bits.golomb()
    return bits.flag()


def _hevc_bypass(unit: bytes) -> bool:
    bits = _Bits(unit[2:])
    bits.golomb()
    bits.golomb()
    bits.number(7)
    for _ in range(3):
        bits.golomb()
    bits.number(2)
    if bits.flag():
        bits.golomb()
    bits.golomb()
    bits.golomb()
    bits.number(3)
    return bits.flag()


def _units(extradata: bytes, header: int) -> Iterator[bytes]:
    """Split parameter sets into units: after start codes, or by length behind a header of 6 (avcC) or 23 (hvcC) bytes."""
    if extradata[:3] == b"\0\0\1" or extradata[:4] == b"\0\0\0\1":
        yield from (unit for unit in extradata.split(b"\0\0\1") if unit.strip(b"\0"))
        return
    if header == 6:
        yield from _counted(extradata, header, extradata[5] & 31)
        return
    at = header
    for _ in range(extradata[22]):
        count = int.from_bytes(extradata[at + 1 : at + 3])
        at += 3
        for unit in _counted(extradata, at, count):
            at += 2 + len(unit)
            yield unit


def _counted(data: bytes, at: int, count: int) -> Iterator[bytes]:
    """Read units that each follow their length in two bytes."""
    for _ in range(count):
        length = int.from_bytes(data[at : at + 2])
        yield data[at + 2 : at + 2 + length]
        at += 2 + length
