"""What stands beside undistorted files: their camera and, if wanted, the mask and the maps they were made with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from camcal.errors import InputError
from camcal.formats.camera_file import camera_yaml
from camcal.formats.images import write_image
from camcal.formats.output import write_atomically
from camcal.records import Intrinsics
from camcal.undistortion.maps import UndistortMap, dense_map, valid_mask
from camcal.workflows.undistort.geometry import Cameras
from camcal.workflows.undistort.inputs import COMPANIONS
from camcal.workflows.undistort.plan import Place

_MAPS_NPZ = "maps.npz"
_MASK, _MAPS_TIFF = COMPANIONS


@dataclass(frozen=True, slots=True, eq=False)
class Companions:
    """What is written beside the results.

    Attributes
    ----------
    place : Place
    intrinsics : Intrinsics
        The camera of the results.
    mask, maps : bool
        Whether these are wanted too.
    """

    place: Place
    intrinsics: Intrinsics
    mask: bool = False
    maps: bool = False

    @property
    def image_names(self) -> tuple[str, ...]:
        """Names of the images among them."""
        return (*([_MASK] if self.mask else []), *([_MAPS_TIFF] if self.maps else []))

    def withdraw_camera(self) -> None:
        """Remove another camera that stands there: its presence would say that it belongs to all results."""
        path = self.place.camera_file
        try:
            if path.exists() and path.read_bytes() != camera_yaml(self.intrinsics).encode():
                path.unlink()
        except OSError as error:
            raise InputError(f"{path}: cannot be removed ({(error.strerror or str(error)).lower()}). Remove it.") from None

    def write(self, build_map: Callable[[], UndistortMap] | None = None) -> None:
        """Write all of them, the camera last: it says that everything is there.

        Parameters
        ----------
        build_map : callable, optional
            Gives the map that the results were made with; for the mask and the maps.

        Raises
        ------
        InputError
            If one cannot be written.
        """
        if build_map is not None and self.mask:
            write_image(self.place.companion(_MASK), valid_mask(build_map()))
        if build_map is not None and self.maps:
            from camcal.formats.maps_file import save_maps_npz, save_maps_tiff

            map_x, map_y = dense_map(build_map())
            save_maps_npz(self.place.companion(_MAPS_NPZ), map_x, map_y)
            save_maps_tiff(self.place.companion(_MAPS_TIFF), map_x, map_y)
        write_atomically(self.place.camera_file, camera_yaml(self.intrinsics))


def camera_of_results(known: Intrinsics, cameras: Cameras) -> Intrinsics:
    """Return the camera of the results with what is known of it: everything, if it is the one that was calibrated."""
    if cameras.target is known.camera and known.camera.dist.any():
        return known
    return Intrinsics(cameras.target, name=known.name, verdict=known.verdict)
