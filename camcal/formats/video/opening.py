"""Videos opened: a file that is none, a file without pictures, a file that was cut, each named as what it is."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from camcal.errors import InputError
from camcal.formats.text import unreadable
from camcal.formats.video.trimming import FrameRange

if TYPE_CHECKING:
    from av import VideoStream
    from av.container import InputContainer
    from av.stream import Stream


def open_video(path: Path) -> InputContainer:
    """Open a video file.

    Raises
    ------
    InputError
        If it is missing, a folder, empty, unreadable or no video.
    """
    import av

    try:
        if path.is_dir():
            raise InputError(f"{path}: a folder (expected a video). Name a file in it.")
        size = path.stat().st_size
        if size == 0:
            raise InputError(f"{path}: empty file (0 bytes). Copy it again.")
        # An absolute path: before a colon libav would look for a protocol. Tags that are not UTF-8 are kept byte for byte.
        return av.open(str(path.absolute()), "r", metadata_errors="surrogateescape")
    except av.FFmpegError as error:
        if isinstance(error, PermissionError):
            raise unreadable(path, error) from None
        raise InputError(f"{path}: not a video that can be read ({size} bytes; truncated, or another kind of file).") from None
    except OSError as error:
        raise unreadable(path, error) from None


def main_stream(path: Path, container: InputContainer) -> VideoStream:
    """Return the video itself: not a cover picture, not a proxy beside it.

    Raises
    ------
    InputError
        If there is none, or no decoder for it.
    """
    videos = [stream for stream in container.streams.video if not is_cover(stream)]
    if not videos:
        kinds = ", ".join(sorted({stream.type for stream in container.streams})) or "nothing"
        raise InputError(f"{path}: no video in this file (got {kinds}). Name a video.")
    best = container.streams.best("video")
    stream = next((video for video in videos if best is not None and video.index == best.index), videos[0])
    if stream.codec_context is None:
        raise InputError(f"{path}: a video codec that cannot be decoded. Convert it to H.264 first.")
    for other in container.streams.video:
        if other.index != stream.index and not is_cover(other):
            other.discard = type(other.discard)["all"]
    return stream


def is_cover(stream: Stream) -> bool:
    """Tell whether a stream is a picture attached to the file, such as a cover or a thumbnail."""
    return bool(stream.disposition & type(stream.disposition)["attached_pic"])


def refuse_cut_file(path: Path, stream: VideoStream, chosen: FrameRange) -> None:
    """Refuse, before any work, a file whose index reaches past its end, unless only whole frames are asked for.

    Raises
    ------
    InputError
        Which names the frames that are whole.
    """
    whole = _complete_frames(path, stream)
    if whole is not None and (chosen.stop is None or chosen.stop > whole):
        raise InputError(
            f"{path}: truncated file (its index reaches past its end). Copy it again, or take what is whole "
            f"with --frames 0:{whole}."
        )


def _complete_frames(path: Path, stream: VideoStream) -> int | None:
    """Count the frames before the first one that a cut file lacks; None if it holds all that its index names, or has none."""
    length = path.stat().st_size
    for number, entry in enumerate(stream.index_entries):
        if entry.pos + entry.size > length:
            # Frames are stored in the order of decoding; those that wait for the missing one are not whole either.
            return max(0, number - stream.codec_context.reorder_depth)
    return None
