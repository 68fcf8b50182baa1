"""What stands beside undistorted files: their camera and, if wanted, the mask and the maps they were made with."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from camcal.formats.camera_file import camera_yaml
from camcal.formats.images import write_image
from camcal.formats.ledger_file import Ledger
from camcal.formats.output import holds, remove_file, write_atomically
from camcal.records import Intrinsics
from camcal.undistortion.maps import UndistortMap, dense_map, valid_mask
from camcal.workflows.reporting import Reporter
from camcal.workflows.undistort.geometry import Cameras
from camcal.workflows.undistort.inputs import COMPANIONS
from camcal.workflows.undistort.plan import Place, is_there

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
    def names(self) -> tuple[str, ...]:
        """Names of those that are wanted beside the camera."""
        return (*([_MASK] if self.mask else []), *([_MAPS_NPZ, _MAPS_TIFF] if self.maps else []))

    def withdraw(self, ledger: Ledger | None, key: str, results: Collection[str]) -> tuple[Path, ...]:
        """Remove what stands there and is of another camera: its presence would say that it belongs to all results.

        A mask and maps are removed only where the ledger proves that an earlier run wrote them.

        Parameters
        ----------
        ledger : Ledger or None
            Of the folder, if it has one.
        key : str
            Of the map that the results are made with.
        results : collection of str
            Names of the results, which may be called as a mask or maps are.

        Returns
        -------
        tuple of Path
            A mask and maps that stay, and may be of another camera.

        Raises
        ------
        InputError
            If something cannot be removed.
        """
        camera = self.place.camera_file
        is_same = holds(camera, camera_yaml(self.intrinsics).encode())
        doubtful = []
        for name in (_MASK, _MAPS_NPZ, _MAPS_TIFF):
            path = self.place.companion(name)
            made_with = ledger.companion_settings(name) if ledger else None
            if name in results or made_with == key or not is_there(path):
                continue
            if made_with is not None:
                remove_file(path)
            elif not is_same and name not in self.names:
                doubtful.append(path)
        if not is_same:
            remove_file(camera)
        return tuple(doubtful)

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


def warn_of_doubtful(paths: Sequence[Path], reporter: Reporter) -> None:
    """Say which files beside the results may be of another camera."""
    if paths:
        names = " and ".join(path.name for path in paths)
        them, ones = ("it", "a new one") if len(paths) == 1 else ("them", "new ones")
        reporter.warn(f"{paths[0].parent}: {names} may be of another camera. Remove {them}, or write {ones}.")


def camera_of_results(known: Intrinsics, cameras: Cameras) -> Intrinsics:
    """Return the camera of the results with what is known of it: everything, if it is the one that was calibrated."""
    if cameras.target is known.camera and known.camera.dist.any():
        return known
    return Intrinsics(cameras.target, name=known.name, verdict=known.verdict)
