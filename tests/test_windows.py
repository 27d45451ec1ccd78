"""What moves is rendered in a window of the picture: none of it is outside, and it looks alike."""

import cv2
import numpy as np
import pybullet
import pytest

import tasks
from tasks import TASKS
from tasks.world import World, expert_actions
from tasks.world.env import TaskEnv
from tasks.world.scene import WHOLE
from tasks.world.windows import CORNERS, Window, box_round, ends_inside, turn

EMBODIMENTS = ("robot", "human")


@pytest.fixture
def world():
    world = World("robot", TaskEnv.CAMERA)
    world.paint()
    yield world
    world.p.disconnect()


def outside(world):
    """Pixels of what moves that are not in the window, and pixels in the window."""
    _, depth = world._composite(WHOLE)
    seen, window = depth < world.depth, world._window()
    if window is None:
        return seen.sum(), 0
    within = np.zeros_like(seen)
    within[window.top : window.bottom, window.left : window.right] = True
    return (seen & ~within).sum(), within.sum()


@pytest.mark.parametrize("arm", EMBODIMENTS)
@pytest.mark.parametrize("task", TASKS)
def test_nothing_moves_outside_of_the_window_and_a_frame_looks_as_without(task, arm):
    """Its projection rounds otherwise, so that an edge may fall on the next pixel of 168 x 168."""
    env = tasks.bare(task, embodiment=arm, observation="state")
    env.reset(seed=1, options={"scatter": True})
    shares, alike = [], []
    for i, action in enumerate(expert_actions(env, np.random.default_rng(0))):
        env.step(action)
        if i % 6 == 0:
            lost, kept = outside(env.world)
            assert lost == 0
            shares.append(kept / 168**2)
            (whole, _), (part, _) = map(env.world._composite, (WHOLE, env.world._window()))
            assert (whole != part).any(axis=2).sum() <= 20
            alike.append(np.array_equal(whole, part))
    env.close()
    assert np.mean(shares) < 0.8
    assert np.mean(alike) > 0.8


@pytest.mark.parametrize("arm", EMBODIMENTS)
def test_no_posture_of_the_arm_is_outside_of_the_window(arm):
    env = tasks.bare("push", embodiment=arm, observation="state")
    env.reset(seed=0)
    rng, p, shares = np.random.default_rng(0), env.world.p, []
    for _ in range(25):
        for joint in env.arm.joints:
            p.resetJointState(env.arm.body, joint, rng.uniform(-2, 2))
        at, turned = rng.uniform((0.2, -0.3, 0), (0.9, 0.3, 0.4)), rng.normal(size=4)
        p.resetBasePositionAndOrientation(env.cube, at, turned / np.linalg.norm(turned))
        lost, kept = outside(env.world)
        assert lost == 0
        shares.append(kept)
    env.close()
    assert min(shares) < 0.5 * 168**2


def shape(p, kind, **size):
    """A body of one visual shape that is moved and turned in the frame of its base."""
    return p.createMultiBody(
        0, -1, p.createVisualShape(
            kind, visualFramePosition=(0.02, 0.01, 0.03),
            visualFrameOrientation=p.getQuaternionFromEuler((0.5, 0.8, 1.1)), **size,
        ), basePosition=(0.56, 0, 0.15), baseOrientation=p.getQuaternionFromEuler((1, 0.3, 0.2)),
        baseInertialFramePosition=(0.05, 0.02, 0.01),
        baseInertialFrameOrientation=p.getQuaternionFromEuler((0.2, 0.4, 0.1)),
    )  # fmt: skip


WEDGE = "v -1 0 0\nv 2 0 0\nv 0 3 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


@pytest.mark.parametrize(
    "kind, size",
    [
        (pybullet.GEOM_BOX, {"halfExtents": (0.02, 0.05, 0.09)}),
        (pybullet.GEOM_SPHERE, {"radius": 0.06}),
        (pybullet.GEOM_CYLINDER, {"radius": 0.02, "length": 0.16}),
        (pybullet.GEOM_CAPSULE, {"radius": 0.02, "length": 0.12}),
        (pybullet.GEOM_MESH, {"meshScale": (0.02, 0.03, 0.05)}),
    ],
)
def test_the_window_fits_each_kind_of_shape(world, tmp_path, kind, size):
    if kind == pybullet.GEOM_MESH:
        path = tmp_path / "wedge.obj"
        path.write_text(WEDGE)
        size = size | {"fileName": str(path)}
    world.shapes.add(shape(world.p, kind, **size))
    lost, kept = outside(world)
    _, depth = world._composite(WHOLE)
    rows, columns = np.nonzero(depth < world.depth)
    least = (np.ptp(rows) + 1) * (np.ptp(columns) + 1)
    assert lost == 0
    assert 300 < least < kept < 2.6 * least  # a box round a ball is larger in a picture


def test_the_window_is_no_wider_for_what_of_a_bar_is_above_the_picture(world):
    """It comes in from the upper left, from beyond where the picture ends at the left."""
    bar = world.box((0.01, 0.01, 0.6), (0, 0, 0), (1, 0, 0, 1))
    slanted = world.p.getQuaternionFromEuler((0, -0.6, 0))
    world.p.resetBasePositionAndOrientation(bar, (0.28, 0, 0.6), slanted)
    lost, kept = outside(world)
    _, depth = world._composite(WHOLE)
    rows, columns = np.nonzero(depth < world.depth)
    assert lost == 0 == rows.min()
    assert columns.min() > 30
    assert kept < 1.2 * (np.ptp(rows) + 1) * (np.ptp(columns) + 1)


def placed(x, y):
    """Pixels (2, 1, 8) of a box that covers x and y from the first number to the second."""
    return np.where(CORNERS[:, None, :2] < 0, [x[0], y[0]], [x[1], y[1]]).transpose(2, 1, 0)


def test_a_box_reaches_as_far_as_what_of_it_is_in_the_picture():
    """Of 100 x 100 pixels and one more on each side."""
    slanted = np.where(CORNERS[:, 2] < 0, [[40.0], [-100.0]], [[80.0], [100.0]])[:, None]
    beyond = (-900, 900)
    for pixels, low, high in (
        (placed((20, 30), (40, 60)), (20, 40), (30, 60)),
        (slanted, (59.8, -100), (80, 100)),  # comes in at y = -1
        (slanted[::-1], (-100, 59.8), (100, 80)),
        (120 - slanted, (40, 20), (56.2, 220)),  # leaves at y = 101
        (placed((-900, 30), beyond), (-900, -900), (30, 900)),
        (placed(beyond, beyond), (-900, -900), (900, 900)),
        (placed((10, 20), (-1, 50)), (10, -1), (20, 50)),  # an edge runs along the picture's
        (placed((10, 20), (50, 101)), (10, 50), (20, 101)),
    ):
        found = ends_inside(pixels, 100)
        np.testing.assert_allclose(found, np.array([low, high])[..., None], atol=1e-9)
    for x, y in (((20, 30), (-9, -2)), ((20, 30), (102, 900))):
        assert np.isnan(ends_inside(placed(x, y), 100)[0][0])
        assert np.isnan(ends_inside(placed(y, x), 100)[1][1])


@pytest.mark.parametrize("axis", range(3))
def test_the_box_round_a_mesh_is_turned_as_the_mesh_is(axis):
    """A sheet of 1 x 2 that is turned by 30 degrees about one axis of its file."""
    turned = turn(pybullet.getQuaternionFromAxisAngle(np.eye(3)[axis], np.radians(30)))
    sheet = (CORNERS * (0.5, 1, 0) + (4, 5, 6)) @ turned.T
    lines = [f"v {x} {y} {z}" for x, y, z in sheet] + ["f 1 2 3", "f 4 5 6", "f 6 7 8"]
    corners = box_round(pybullet.GEOM_MESH, (1, 1, 1), "b.obj", {"b.obj": "\n".join(lines)})
    apart = np.linalg.norm(corners[:, None] - sheet, axis=2)
    np.testing.assert_allclose(apart.min(axis=0), 0, atol=1e-9)
    np.testing.assert_allclose(apart.min(axis=1), 0, atol=1e-9)


def test_a_mesh_that_is_gone_is_known_by_its_text(world, tmp_path):
    path = tmp_path / "gone.obj"
    path.write_text(WEDGE)
    body = shape(world.p, pybullet.GEOM_MESH, fileName=str(path), meshScale=(0.02, 0.03, 0.05))
    path.unlink()
    world.shapes.add(body, {"gone.obj": WEDGE})
    lost, kept = outside(world)
    assert lost == 0 < kept < 0.5 * 168**2


def test_a_body_of_which_a_mesh_cannot_be_read_is_seen_anywhere(world, tmp_path):
    """As an arm of one's own may have: the renderer reads more than the kit does."""
    path = tmp_path / "gone.obj"
    path.write_text(WEDGE)
    body = shape(world.p, pybullet.GEOM_MESH, fileName=str(path), meshScale=(0.02, 0.03, 0.05))
    path.unlink()
    world.shapes.add(body)
    assert world._window() == WHOLE
    assert (world.render() != cv2.resize(world.backdrop, (84, 84))).any()


def test_a_body_that_the_world_did_not_add_is_seen_anywhere(world):
    world.box((0.02, 0.02, 0.02), (0.5, 0, 0.02), (1, 0, 0, 1))
    assert world._window() != WHOLE
    before = world.render()
    world.p.createMultiBody(
        0, -1, world.p.createVisualShape(world.p.GEOM_SPHERE, radius=0.02), (0.62, 0, 0.25)
    )
    assert world._window() == WHOLE
    assert (world.render() != before).any()


def test_where_a_body_reaches_behind_the_camera_all_is_rendered(world):
    world.box((0.01, 1.5, 0.01), (0.56, -1.0, 0.3), (1, 0, 0, 1))
    assert world._window() == WHOLE


def test_what_is_out_of_sight_needs_no_rendering(world, monkeypatch):
    still = world.render()
    ball = world.sphere(0.03, (0.56, 0, 0.15), (1, 0, 0, 1))
    assert (world.render() != still).any()
    monkeypatch.setattr(world.p, "getCameraImage", None, raising=False)
    for place in ((3, 0, 0.1), (0.56, 0, 2), (-2, 0, 0.1), (0.56, 0, -2), (0.56, -9, 0)):
        world.p.resetBasePositionAndOrientation(ball, place, (0, 0, 0, 1))
        assert world._window() is None
        assert np.array_equal(world.render(), still)


def test_a_window_shows_its_part_of_the_picture(world):
    """A point is as far from the window's corner as from there in the whole picture."""
    window, point = Window(30, 50, 114, 92), (0.52, 0.03, 0.17)
    assert window.size == (84, 42)
    x, y = 2 * world.pixel(point)  # of 168
    world.projection = window.projection(world.projection, 168)
    right, down = world.pixel(point) / 84 * window.size
    np.testing.assert_allclose((window.left + right, window.top + down), (x, y), atol=1e-9)
    assert 30 < x < 114 and 50 < y < 92


def test_the_whole_picture_has_the_projection_it_had(world):
    np.testing.assert_array_equal(WHOLE.projection(world.projection, 168), world.projection)


def test_a_plane_is_no_shape_that_a_box_holds():
    with pytest.raises(ValueError, match="type 6"):
        box_round(pybullet.GEOM_PLANE, (1, 1, 1), "", {})
