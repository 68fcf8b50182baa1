"""The photographs of a calibration as its report shows them: found again, made small, and with the lens taken out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from camcal.errors import CamcalError, InputError
from camcal.formats.images import find_images
from camcal.formats.imaging.header import image_size
from camcal.formats.imaging.pixels import Coding, decode, encode
from camcal.formats.text import read_bytes
from camcal.geometry.camera import Camera
from camcal.observations import Calibration, Image
from camcal.records import ViewRecord
from camcal.report.photograph import Photograph, Picture
from camcal.undistortion.maps import UndistortMap, undistort_image, undistort_map
from camcal.undistortion.target import target_camera
from camcal.workflows.parallel import each
from camcal.workflows.reporting import Reporter

MOST_SHOWN = 100
"""A page shows no more photographs than this: the used views that fit worst and, up to half of it, rejected images."""

_MOST_BYTES = 2_700_000
_LARGEST_PICTURE_BYTES, _SMALLEST_PICTURE_BYTES = 90_000, 7_000
_WIDEST_PX, _NARROWEST_PX = 960, 160
_BYTES_PER_PIXEL = 0.14
_QUALITIES = (82, 72, 60, 45)
_BRIGHTEST_SHARE = 0.999
_REDUCED = ((8, cv2.IMREAD_REDUCED_COLOR_8), (4, cv2.IMREAD_REDUCED_COLOR_4), (2, cv2.IMREAD_REDUCED_COLOR_2))
_WHOLE = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH


@dataclass(frozen=True, slots=True)
class Shown:
    """What there is to show.

    Attributes
    ----------
    photographs : dict of str to Photograph
        By image name.
    missing : str
        A sentence about those that are not shown; empty if all are.
    """

    photographs: Mapping[str, Photograph]
    missing: str


def places(views: Sequence[ViewRecord], folder: Path, images: str | Path | None = None) -> dict[str, Path]:
    """Say where each photograph should be.

    Parameters
    ----------
    views : sequence of ViewRecord
    folder : Path
        What the views' paths are relative to.
    images : path, optional
        A folder in which the photographs are by their names, instead of where the views say.
    """
    if images is not None:
        # Names that text cannot hold are written in escapes, so that they are looked up instead of joined.
        listed = _by_name(Path(images))
        return {view.source: listed.get(view.source, Path(images) / view.source) for view in views}
    return {view.source: folder / view.path for view in views if view.path}


def _by_name(folder: Path) -> dict[str, Path]:
    """Images of a folder, by the names that a calibration gives them."""
    try:
        return {image.name: image.path for image in find_images([folder]).images}
    except InputError:
        return {}


def photographs(calibration: Calibration, places: Mapping[str, Path], *, jobs: int | None, reporter: Reporter) -> Shown:
    """Read the photographs and make them small, so that a page with fifty of them stays below 5 MB.

    One that is not there, cannot be read or is of another size than its corners is passed over and counted.

    Parameters
    ----------
    calibration : Calibration
    places : dict of str to Path
        Where the photographs are, by image name.
    jobs : int or None
        Images worked on at once; all processors if None.
    reporter : Reporter
    """
    names = _chosen(calibration)
    used = {seen.source for seen in calibration.detections}
    pictures = sum(2 if name in used else 1 for name in names)
    budget = int(np.clip(_MOST_BYTES / max(pictures, 1), _SMALLEST_PICTURE_BYTES, _LARGEST_PICTURE_BYTES))
    studio = _Studio.of(calibration.camera, budget)

    def work(name: str) -> Photograph | None:
        return studio.photograph(places[name], name in used) if name in places else None

    with reporter.progress("Photographs", len(names)) as advance:
        made = each(work, names, jobs, advance)
    found = {name: photograph for name, photograph in zip(names, made, strict=True) if photograph is not None}
    every = len(calibration.detections) + len(calibration.rejected)
    return Shown(found, _missing([name for name in names if name not in found], len(names), every))


def _chosen(calibration: Calibration) -> list[str]:
    """Names of the images to show: rejected ones, and the used ones that fit worst."""
    rejected = [rejection.source for rejection in calibration.rejected][: MOST_SHOWN // 2]
    order = np.argsort(-np.array(calibration.view_rms_px), kind="stable")[: MOST_SHOWN - len(rejected)]
    return [calibration.detections[index].source for index in order.tolist()] + rejected


def _missing(names: Sequence[str], chosen: int, every: int) -> str:
    """Say which photographs are not shown."""
    sentences = []
    if len(names) == chosen:
        sentences.append(
            "The photographs were not found, so the corners stand alone: name their folder with `camcal report --images`."
        )
    elif names:
        sentences.append(f"Not found or not readable: {', '.join(names[:3])}{' and more' if len(names) > 3 else ''}.")
    if every > chosen:
        sentences.append(f"Photographs are shown of {chosen} of {every} images, those that fit worst first.")
    return " ".join(sentences)


@dataclass(frozen=True, slots=True)
class _Studio:
    """Makes small pictures of one camera's photographs."""

    camera: Camera
    budget: int
    width: int
    map: UndistortMap | None

    @classmethod
    def of(cls, camera: Camera, budget: int) -> _Studio:
        """Choose the width that the bytes per picture allow, and work out the map that takes the lens out at that size."""
        width, height = camera.size
        wanted = int(np.sqrt(budget / _BYTES_PER_PIXEL * width / height))
        chosen = min(width, max(_NARROWEST_PX, min(_WIDEST_PX, wanted)))
        small = camera.scaled((chosen, max(1, round(chosen * height / width))))
        try:
            undistort = undistort_map(small, target_camera(small))
        except CamcalError:
            # A lens that leaves nothing valid to show has no twin.
            undistort = None
        return cls(camera, budget, chosen, undistort)

    def photograph(self, path: Path, used: bool) -> Photograph | None:
        """Make the pictures of one photograph; None if it is not there or not the one that the corners were seen in."""
        try:
            content = read_bytes(path)
            image, size = _read(path, content, self.width)
        except InputError:
            return None
        if used and size != self.camera.size:
            return None
        small = _resized(image, self.width, size)
        twin = None
        if used and self.map is not None:
            twin = _encoded(undistort_image(small, self.map), self.budget)
        return Photograph(size, _encoded(small, self.budget), twin)


def _read(path: Path, content: bytes, width: int) -> tuple[Image, tuple[int, int]]:
    """Decode an image, at a fraction of its size where that is enough, to 8-bit colours; and its own (width, height)."""
    size = image_size(content)
    flags = _WHOLE
    if size is not None:
        flags = next((reduced for by, reduced in _REDUCED if size[0] // by >= 2 * width), _WHOLE)
    image = decode(path, content, flags | cv2.IMREAD_IGNORE_ORIENTATION)
    if image.dtype != np.uint8:
        image = _eight_bits(image)
    return image, size or (image.shape[1], image.shape[0])


def _eight_bits(image: Image) -> Image:
    """Stretch an image of more depth to what a screen shows."""
    finite = np.nan_to_num(image, nan=0.0, posinf=0.0, neginf=0.0).astype(np.float32)
    white = float(np.quantile(finite, _BRIGHTEST_SHARE))
    stretched: Image = np.clip(finite * (255 / white if white > 0 else 1.0), 0, 255).astype(np.uint8)
    return stretched


def _resized(image: Image, width: int, size: tuple[int, int]) -> Image:
    """Average an image down to a width; one that is smaller stays as it is."""
    if image.shape[1] <= width and size[0] <= width:
        return image
    return cv2.resize(image, (width, max(1, round(width * size[1] / size[0]))), interpolation=cv2.INTER_AREA)


def _encoded(image: Image, budget: int) -> Picture:
    """Encode a picture, ever coarser and then smaller until it takes no more bytes than it may."""
    while True:
        height, width = image.shape[:2]
        for quality in _QUALITIES:
            content = encode("picture.jpg", image, Coding(quality=quality, subsampling=(2, 2)))
            if len(content) <= budget:
                return Picture(content, (width, height))
        if width <= _NARROWEST_PX:
            return Picture(content, (width, height))
        smaller = max(_NARROWEST_PX, int(0.8 * width))
        image = cv2.resize(image, (smaller, max(1, round(smaller * height / width))), interpolation=cv2.INTER_AREA)
