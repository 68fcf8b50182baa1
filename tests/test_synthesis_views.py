"""Whole views: poses that keep what the scenario says, views that depend on seed and index alone, and every config."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from camcal.boards.aprilgrid import AprilGrid
from camcal.boards.checkerboard import Checkerboard
from camcal.boards.spec import parse_board
from camcal.errors import InputError
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.synthesis.poses import sample_pose, sample_poses
from camcal.synthesis.render import render_ideal, render_view, true_detection
from camcal.synthesis.scenario import Light, PoseSampling, Scenario, Sensor

CONFIGS = sorted((Path(__file__).parent.parent / "configs").glob("*.yaml"))
CAMERA = Camera((320, 240), [[260, 0, 163.1], [0, 262, 116.4], [0, 0, 1]], [-0.2, 0.05])
SMALL = Scenario("small", 11, CAMERA, Checkerboard(5, 4, 0.03), PoseSampling(9))
TAGS = AprilGrid(4, 3, 0.05, 0.015)


def config(path) -> Scenario:
    """A config as a scenario, with every key named by its dataclass."""
    data = yaml.safe_load(path.read_text(encoding="utf-8"))
    for key, kind in (("views", PoseSampling), ("light", Light), ("sensor", Sensor)):
        assert set(data[key]) == {field.name for field in fields(kind)}
    c = data["camera"]
    k = c["distortion"]
    K = [[c["fx"], c["skew"], c["cx"]], [0, c["fy"], c["cy"]], [0, 0, 1]]
    camera = Camera(c["size"], K, [k["k1"], k["k2"], 0, 0, k["k3"]])
    views = {key: tuple(value) if isinstance(value, list) else value for key, value in data["views"].items()}
    return Scenario(
        data["name"],
        data["seed"],
        camera,
        parse_board(data["board"]),
        PoseSampling(**views),
        Light(**data["light"]),
        Sensor(**data["sensor"]),
    )


def corners_of(scenario):
    """True corners of every view."""
    return [true_detection(scenario.camera, scenario.board, pose, "x").corners_px for pose in sample_poses(scenario)]


def assert_same(a, b):
    """Two views agree in every bit."""
    np.testing.assert_array_equal(a.image, b.image)
    np.testing.assert_array_equal(a.T_cam_board.R, b.T_cam_board.R)
    np.testing.assert_array_equal(a.T_cam_board.t, b.T_cam_board.t)
    np.testing.assert_array_equal(a.detection.corners_px, b.detection.corners_px)


def test_a_view_depends_on_seed_and_index_alone():
    """Rendered first, last or in a larger dataset, view 4 is the same to the bit; another seed or index is another view."""
    alone = render_view(SMALL, 4)
    for index in (2, 0, 7):
        render_view(SMALL, index)
    assert_same(render_view(SMALL, 4), alone)
    assert_same(render_view(replace(SMALL, views=PoseSampling(40)), 4), alone)
    assert not np.array_equal(render_view(replace(SMALL, seed=12), 4).T_cam_board.t, alone.T_cam_board.t)
    assert not np.array_equal(render_view(SMALL, 5).image, alone.image)


def test_noise_does_not_depend_on_the_pose_draws():
    """Two scenarios that differ in their poses only have the same noise in the same view."""
    sensor = Sensor(read_noise_levels=8.0, bits=16)
    still = Light(0.5, 0.5, 0.5)
    one = render_view(replace(SMALL, sensor=sensor, light=still), 1)
    other = render_view(replace(SMALL, sensor=sensor, light=still, views=PoseSampling(9, tilt_deg=(30, 40))), 1)
    assert not np.array_equal(one.T_cam_board.R, other.T_cam_board.R)
    # Rounding sums in another order may move a value across a rounding limit.
    assert np.abs(one.image.astype(int) - other.image.astype(int)).max() <= 1


def test_poses_keep_their_ranges():
    """Tilt to the line of sight, and fill as the larger share of width and height, lie in their ranges."""
    views = PoseSampling(18, tilt_deg=(20.0, 40.0), fill=(0.4, 0.6))
    scenario = replace(SMALL, views=views)
    square = SMALL.board.square_m
    centre = SMALL.board.object_points.mean(axis=0)
    x0, y0, x1, y1 = -square, -square, SMALL.board.columns * square, SMALL.board.rows * square
    t = np.linspace(0, 1, 200)
    along = np.concatenate(
        [
            np.stack([x0 + t * (x1 - x0), np.full_like(t, y), 0 * t], axis=-1) for y in (y0, y1)
        ] + [
            np.stack([np.full_like(t, x), y0 + t * (y1 - y0), 0 * t], axis=-1) for x in (x0, x1)
        ]
    )  # fmt: skip
    for pose in sample_poses(scenario):
        sight = pose.apply(centre)
        tilt = np.degrees(np.arccos(pose.R[:, 2] @ sight / np.linalg.norm(sight)))
        assert 20 - 1e-6 <= tilt <= 40 + 1e-6
        print_px = CAMERA.project(pose.apply(along))
        fill = (np.ptp(print_px, axis=0) / CAMERA.size).max()
        # Placed to within 0.5 %; the outline it is placed by has 8 points a side.
        assert 0.4 * 0.99 <= fill <= 0.6 * 1.01
        assert CAMERA.contains(print_px, 1.0).all()


def test_roll_is_the_turn_about_the_normal():
    """Without tilt, before the optical axis, the board's x axis points where the roll says."""
    camera = Camera((320, 240), [[260, 0, 159.5], [0, 260, 119.5], [0, 0, 1]])
    for roll in (-90.0, 0.0, 35.0):
        views = PoseSampling(5, tilt_deg=(0, 0), roll_deg=(roll, roll), fill=(0.9, 0.9))
        R = sample_pose(replace(SMALL, camera=camera, views=views), 4).R
        turned = np.degrees(np.arctan2(R[1, 0], R[0, 0]))
        # The board moves a little with its jitter, and the line of sight with it: under 2 degrees here.
        assert turned == pytest.approx(roll, abs=2)


def test_partial_boards_leave_the_frame_but_keep_features_in_it():
    """Some boards are cut by the frame; each keeps two fifths of its features, and the truth lists exactly those inside."""
    scenario = replace(SMALL, board=TAGS, views=PoseSampling(18, fill=(0.8, 1.3), partial=True))
    seen = []
    for pose in sample_poses(scenario):
        detection = true_detection(CAMERA, TAGS, pose, "x")
        pixels = CAMERA.project(pose.apply(TAGS.object_points))
        inside = ((pixels >= -0.5) & (pixels <= np.array([319.5, 239.5]))).all(axis=1)
        np.testing.assert_array_equal(detection.ids, np.flatnonzero(inside))
        seen.append(inside.mean())
    assert min(seen) >= 0.4
    assert sum(share < 1 for share in seen) >= 9


def test_a_view_carries_its_truth():
    """Ids, positions, unknown sigma, name and size of the rendered corners."""
    view = render_view(SMALL, 3)
    assert view.detection.source == "view_0003.png"
    assert view.detection.size == (320, 240)
    assert view.image.shape == (240, 320)
    assert view.detection.ids.tolist() == list(range(20))
    assert np.isnan(view.detection.sigma_px).all()
    np.testing.assert_array_equal(view.detection.corners_px, CAMERA.project(view.T_cam_board.apply(SMALL.board.object_points)))


def test_an_exposure_is_the_ideal_image_and_noise():
    """What the sensor adds to the ideal image is its noise: standard deviation 2 levels and rounding, mean 0."""
    view = render_view(SMALL, 0)
    ideal = render_ideal(CAMERA, SMALL.board, view.T_cam_board, SMALL.light, blur_sigma_px=0.7)
    noise = view.image - 255 * ideal
    assert noise.std() == pytest.approx(np.sqrt(4 + 1 / 12), abs=4 * 2.02 / np.sqrt(2 * noise.size))
    assert noise.mean() == pytest.approx(0, abs=4 * 2.02 / np.sqrt(noise.size))


def test_board_side_up():
    """Seen upright, the square diagonally up-left of the first corner is black, the one right of it white."""
    camera = Camera((320, 240), [[300, 0, 160], [0, 300, 120], [0, 0, 1]])
    pose = Pose(np.eye(3), np.array([-0.06, -0.045, 0.3]))
    image = render_ideal(camera, SMALL.board, pose)
    # The first corner is at (100, 75) and a square is 30 px wide.
    assert image[60, 85] == pytest.approx(SMALL.light.black)
    assert image[60, 115] == pytest.approx(SMALL.light.white)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"views": PoseSampling(3, fill=(1.2, 1.4))}, "no room for the board.*Lower fill"),
        ({"views": PoseSampling(3, partial=True)}, "checkerboard must be seen whole"),
    ],
)
def test_what_cannot_be_placed_is_an_error(change, message):
    """A board larger than the image, or a checkerboard that leaves it, is refused with what to change."""
    with pytest.raises(InputError, match=message):
        render_view(replace(SMALL, **change), 0)


@pytest.mark.parametrize("index", [-1, 9])
def test_there_are_no_other_views(index):
    """Views are counted from 0 to count - 1."""
    with pytest.raises(ValueError, match="no such view"):
        render_view(SMALL, index)


def test_all_configs_are_there():
    """The six scenarios that are promised."""
    names = {path.stem for path in CONFIGS}
    assert names == {"webcam_720p", "wide_action", "industrial_5mp", "phone_12mp", "aprilgrid_rig", "blur_noise"}


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_every_config_covers_the_image_with_a_lens_that_holds(path):
    """Corners in all nine thirds of the image, none cut off unless partial, and a lens that is sound over all of it."""
    scenario = config(path)
    camera, distortion = scenario.camera, scenario.camera.dist
    assert scenario.name == path.stem
    assert distortion[[0, 1, 4]].all()
    assert not distortion[[2, 3, 5, 6, 7]].any()
    fx, fy, cx, cy, skew = camera.intrinsics[:5]
    assert fx != fy
    assert skew == 0
    assert abs(cx - (camera.size[0] - 1) / 2) > 1
    assert abs(cy - (camera.size[1] - 1) / 2) > 1
    border = np.array([[u, v] for u in (-0.5, camera.size[0] - 0.5) for v in (-0.5, camera.size[1] - 0.5)])
    assert np.isfinite(camera.unproject(border)).all()
    found = corners_of(scenario)
    assert len(found) == scenario.views.count
    if not scenario.views.partial:
        assert {len(corners) for corners in found} == {scenario.board.feature_count}
    ninth = np.floor((np.concatenate(found) + 0.5) / camera.size * 3).clip(0, 2).astype(int)
    assert len(np.unique(ninth, axis=0)) == 9
    # Corners reach into the outer eighth of the image on every side.
    share = (np.concatenate(found) + 0.5) / camera.size
    assert (share.min(axis=0) < 1 / 8).all()
    assert (share.max(axis=0) > 7 / 8).all()


def test_one_view_of_a_config_renders_as_its_sensor_says():
    """A 720p webcam view is an 8-bit image of 1280 x 720 that shows white paper and black ink at their levels."""
    scenario = config(next(path for path in CONFIGS if path.stem == "webcam_720p"))
    image = render_view(scenario, 4).image
    assert image.shape == (720, 1280)
    assert image.dtype == np.uint8
    assert np.percentile(image, 99) == pytest.approx(0.86 * 255, rel=0.1)
    assert np.percentile(image, 1) == pytest.approx(0.154 * 255, rel=0.2)
