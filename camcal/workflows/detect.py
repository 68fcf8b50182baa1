"""`camcal detect`: what is seen of a board in photographs, as a file of corners and as pictures to look at."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np

from camcal.boards.base import Board
from camcal.detection.half_seen import half_seen
from camcal.detection.overlay import draw_detection, draw_rejection, draw_unreadable
from camcal.detection.sampling import gray8
from camcal.errors import InputError
from camcal.formats.board_file import load_board
from camcal.formats.corner_exchange.table import check_holds, format_of, write_corners
from camcal.formats.images import EXTENSIONS, ImageFile, read_image, write_image
from camcal.formats.output import claim_file, claim_folder
from camcal.formats.text import shown
from camcal.nearest import did_you_mean
from camcal.observations import Detection, Image, Rejected
from camcal.workflows.inputs import Images, images_to_work_on
from camcal.workflows.observe import Refined, observe
from camcal.workflows.parallel import each
from camcal.workflows.reporting import LogReporter, Reporter

REFINEMENTS = ("saddle", "opencv")
"""How corners can be refined while there is no calibration yet: by a blurred saddle, by cv2.cornerSubPix."""

_KEPT_SUFFIXES = (".jpg", ".jpeg", ".png")


@dataclass(frozen=True, slots=True, eq=False)
class DetectionRun:
    """What `detect` saw.

    Attributes
    ----------
    views : tuple of Detection or Rejected
        One for each image, sorted by name.
    refused : dict of str to tuple of str
        By image, a clause for each corner that the refinement refused: its id and why.
    board : Board
    output : Path or None
        The file of corners that was written; None if there was nothing to write, or nowhere to write it to.
    overlays : tuple of Path
        The pictures that were written.
    """

    views: tuple[Detection | Rejected, ...]
    refused: Mapping[str, tuple[str, ...]]
    board: Board
    output: Path | None = None
    overlays: tuple[Path, ...] = ()

    @property
    def detections(self) -> tuple[Detection, ...]:
        """The views in which the board was found, sorted by name."""
        return tuple(view for view in self.views if isinstance(view, Detection))

    @property
    def rejected(self) -> tuple[Rejected, ...]:
        """The others, sorted by name."""
        return tuple(view for view in self.views if isinstance(view, Rejected))

    def as_dict(self) -> dict[str, object]:
        """Return the result as plain values, for JSON."""
        return {
            "board": self.board.spec,
            "features": self.board.feature_count,
            "found": len(self.detections),
            "images": {view.source: self._entry(view) for view in self.views},
            "output": None if self.output is None else str(self.output),
            "overlays": [str(path) for path in self.overlays],
        }

    def _entry(self, view: Detection | Rejected) -> dict[str, object]:
        """One image as plain values."""
        if isinstance(view, Rejected):
            return {"found": False, "corners": 0, "reason": view.reason}
        return {
            "found": True,
            "corners": len(view),
            "size": list(view.size),
            "sigma_px": median_sigma_px(view),
            "edge_width_px": view.edge_width_px,
            "notes": list(view.notes),
            "refused": list(self.refused.get(view.source, ())),
        }


def detect(
    images: Images,
    board: str | Board,
    output: str | Path | None = None,
    *,
    overlay: str | Path | None = None,
    refine: str = "saddle",
    force: bool = False,
    jobs: int | None = None,
    reporter: Reporter | None = None,
) -> DetectionRun:
    """Find the board in every image, without calibrating anything.

    Parameters
    ----------
    images : path, sequence of path, sequence of ndarray, or dict of str to ndarray
        Image files, folders or globs; or images in memory of shape (height, width) or (height, width, 3), blue first.
    board : str or Board
        A one-liner such as `checkerboard:9x6:25mm`, the name of a sample board, or a board file; or the board itself.
    output : path, optional
        File for the corners: .csv, which `calibrate` takes in place of images, or .vnl for mrcal.
    overlay : path, optional
        Folder for a picture of each image with what was seen in it, also of those in which the board was not found.
    refine : str
        How corners are refined: `saddle` (a blurred saddle is fitted to each) or `opencv` (cv2.cornerSubPix).
    force : bool
        Whether a file or folder that exists is written to.
    jobs : int, optional
        Images worked on at once; all processors by default. It changes no bit of the result.
    reporter : Reporter, optional

    Returns
    -------
    DetectionRun
        Look at its `detections`: they may be none, and no file of corners is written then.

    Raises
    ------
    InputError
        If a file, the board or an option cannot be used.

    Examples
    --------
    >>> import camcal
    >>> camera = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06])
    >>> pose = camcal.Pose.from_rvec([0.3, -0.2, 0.1], [-0.07, -0.05, 0.3])
    >>> image = camcal.render(camera, "checkerboard:7x6:20mm", pose)
    >>> found = camcal.detect({"board": image, "nothing": 0 * image}, "checkerboard:7x6:20mm")
    >>> [(view.source, len(view)) for view in found.detections], [view.source for view in found.rejected]
    ([('board', 42)], ['nothing'])
    """
    reporter = reporter or LogReporter()
    target = load_board(board) if isinstance(board, str) else board
    _check_refinement(refine)
    corner_format = format_of(output or "corners.csv")
    if output is not None:
        check_holds(corner_format, output, target)
    found = images_to_work_on(images, reporter)
    pictures = {} if overlay is None else _pictures(found, Path(overlay))
    file = None if output is None else claim_file(output, force=force)
    if overlay is not None:
        claim_folder(overlay, force=force)
        for below in sorted({path.parent for path in pictures.values()}):
            claim_folder(below, force=True)
    refined, rejected = observe(found, target, refine, jobs, reporter)
    seen: dict[str, Refined | Rejected] = {view.detection.source: view for view in refined}
    seen |= {view.source: view for view in rejected}
    if pictures:

        def draw(image: ImageFile) -> None:
            # Read once more, so that memory does not grow with the number of images.
            write_image(pictures[image.name], _picture(image, seen[image.name], target))

        with reporter.progress("Drawing", len(found)) as advance:
            each(draw, found, jobs, advance)
    detections = [view.detection for view in refined]
    if file is not None and detections:
        write_corners(file, detections, target, corner_format)
    views = [view if isinstance(view, Rejected) else view.detection for view in seen.values()]
    return DetectionRun(
        tuple(sorted(views, key=lambda view: view.source)),
        {view.detection.source: view.refused for view in refined if view.refused},
        target,
        file if detections else None,
        tuple(sorted(pictures.values())),
    )


def median_sigma_px(seen: Detection) -> float:
    """Typical standard deviation of a view's corners per axis, pixels; NaN if it is known of none."""
    known = seen.sigma_px[np.isfinite(seen.sigma_px)]
    return float(np.median(known)) if known.size else float("nan")


def _check_refinement(refine: str) -> None:
    """Refuse what refines nothing, or needs a calibration."""
    if refine in REFINEMENTS:
        return
    problem = f"--refine: unknown (got {shown(refine)}, expected {' or '.join(REFINEMENTS)})."
    if refine == "warped":
        raise InputError(f"{problem} warped needs a first calibration: run camcal calibrate.")
    raise InputError(problem + did_you_mean(refine, REFINEMENTS))


def _pictures(found: Sequence[ImageFile], folder: Path) -> dict[str, Path]:
    """Where the picture of each image goes: the image's own name, as JPEG or PNG; never onto one of the images."""
    names = {image.name: _picture_name(image.name) for image in found}
    counts = Counter(names.values())
    for source, name in names.items():
        if name != source and counts[name] > 1:
            names[source] = f"{source}.png"
    sources = {image.path.resolve() for image in found if image.pixels is None}
    for name in names.values():
        if (folder / name).resolve() in sources:
            raise InputError(f"{folder}: the picture of {name} would replace the image itself. Choose another folder.")
    return {source: folder / name for source, name in names.items()}


def _picture_name(source: str) -> str:
    """Name of an image's picture, unless another image's picture has it."""
    name = PurePosixPath(source)
    if name.suffix.lower() in _KEPT_SUFFIXES:
        return source
    return str(name.with_suffix(".png")) if name.suffix.lower() in EXTENSIONS else f"{source}.png"


def _picture(image: ImageFile, view: Refined | Rejected, board: Board) -> Image:
    """Draw what was seen in an image."""
    try:
        pixels = read_image(image.path) if image.pixels is None else image.pixels
    except InputError as error:
        reason = view.reason if isinstance(view, Rejected) else str(error)
        return draw_unreadable(image.name, reason)
    if isinstance(view, Rejected):
        return draw_rejection(pixels, view.source, view.reason, half_seen(gray8(pixels), board))
    return draw_detection(pixels, view.detection, board, np.reshape(view.refused_px, (-1, 2)))
