"""`camcal synth`: a scenario rendered to images, with the truth in the files that `calibrate` writes."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from camcal.formats.board_file import save_board
from camcal.formats.camera_file import save_intrinsics
from camcal.formats.corners_file import save_corners
from camcal.formats.images import write_image
from camcal.formats.output import claim_folder, remove_file
from camcal.formats.scenario_file import load_scenario
from camcal.formats.views_file import save_views
from camcal.observations import Detection
from camcal.records import Intrinsics, ViewRecord
from camcal.resources import config_path
from camcal.synthesis.render import render_view
from camcal.synthesis.scenario import Scenario
from camcal.workflows.parallel import each
from camcal.workflows.reporting import LogReporter, Reporter

IMAGES = "images"
_VIEW_NAME = re.compile(r"view_\d{4,}\.png")


@dataclass(frozen=True, slots=True)
class Synthesis:
    """What `synth` wrote.

    Attributes
    ----------
    scenario : Scenario
    folder : Path
        Holds `images/`, camera.yaml, views.yaml, corners.csv and board.yaml.
    corners : int
        Number of features inside the images, over all views.
    """

    scenario: Scenario
    folder: Path
    corners: int


def synth(
    config: str | Path,
    output: str | Path,
    *,
    force: bool = False,
    jobs: int | None = None,
    reporter: Reporter | None = None,
) -> Synthesis:
    """Render a scenario with its exact truth.

    Parameters
    ----------
    config : str or path
        A scenario file, or the name of a shipped one.
    output : path
        Folder for images and truth.
    force : bool
        Whether a folder that exists is written into; an earlier dataset's images there are replaced as a whole.
    jobs : int, optional
        Images rendered at once; all processors by default. It changes no bit of the result.
    reporter : Reporter, optional

    Returns
    -------
    Synthesis

    Raises
    ------
    InputError
        If the scenario is wrong or the folder cannot be written.

    Examples
    --------
    >>> import tempfile, camcal
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     made = camcal.synth("webcam_720p", f"{folder}/data")
    ...     sorted(path.name for path in made.folder.iterdir()), made.corners
    (['board.yaml', 'camera.yaml', 'corners.csv', 'images', 'views.yaml'], 1080)
    """
    reporter = reporter or LogReporter()
    scenario = load_scenario(scenario_file(config))
    folder = Path(output)
    claim_folder(folder, force=force)
    images = folder / IMAGES
    claim_folder(images, force=True)
    # Truth and views of an earlier dataset must not mix with these, not even if this run is interrupted.
    for stale in [folder / "camera.yaml", *(path for path in images.iterdir() if _VIEW_NAME.fullmatch(path.name))]:
        remove_file(stale)

    def render(index: int) -> tuple[Detection, ViewRecord]:
        view = render_view(scenario, index)
        write_image(images / view.detection.source, view.image)
        record = ViewRecord(view.detection.source, T_cam_board=view.T_cam_board, corners=len(view.detection))
        return view.detection, record

    count = scenario.views.count
    with reporter.progress("Rendering", count) as advance:
        rendered = each(render, range(count), jobs, advance)
    detections = [detection for detection, _ in rendered]
    save_board(folder / "board.yaml", scenario.board)
    save_corners(folder / "corners.csv", detections, [np.full((len(d), 2), np.nan) for d in detections])
    save_views(folder / "views.yaml", [record for _, record in rendered])
    save_intrinsics(folder / "camera.yaml", Intrinsics(scenario.camera, name=scenario.name, board=scenario.board.spec))
    return Synthesis(scenario, folder, sum(len(d) for d in detections))


def scenario_file(config: str | Path) -> Path:
    """Return the path of a scenario file: a file as it is named, else a shipped scenario of that name."""
    path = Path(config)
    if path.exists() or path.suffix or path.name != str(config):
        return path
    return config_path(str(config))
