"""The things of the tasks, as the simulator has them: their sizes, weights, places and limits."""

import numpy as np
import pytest

import tasks
from tasks.world import FINGER, GREEN, RED, expert_actions


@pytest.fixture
def make(make):
    """Environments at their fixed start."""

    def started(name, arm="robot"):
        env = make(name, arm)
        env.reset(seed=0)
        return env

    return started


def size(p, body, link=-1):
    """Full lengths along x, y and z of what is seen of a link, in m."""
    kind, (a, b, _) = next(row[2:4] for row in p.getVisualShapeData(body) if row[1] == link)
    return {p.GEOM_BOX: (a, b, _), p.GEOM_CYLINDER: (2 * b, 2 * b, a)}.get(kind, 3 * (2 * a,))


@pytest.mark.parametrize(
    ("name", "thing", "extent", "mass", "friction"),
    [
        # Fetch's cube. 0.2 kg shoot away when pinched; with friction 1.0 a push tips it over.
        ("push", "cube", (0.05, 0.05, 0.05), 0.4, 0.6),
        # Fetch's puck and friction, by which it slides v^2 / (2 * 0.1 * 9.81).
        ("slide", "puck", (0.05, 0.05, 0.04), 0.4, 0.1),
        # Meta-World's mug; with its friction of 1.0 a push at half its height tips it over.
        ("coffee", "mug", (0.056, 0.056, 0.066), 0.11, 0.5),
    ],
)
def test_what_is_pushed_is_as_large_and_heavy_as_in_its_source(
    make, name, thing, extent, mass, friction
):
    env = make(name)
    p, body = env.world.p, getattr(env, thing)
    assert size(p, body) == pytest.approx(extent)
    assert p.getDynamicsInfo(body, -1)[:2] == pytest.approx((mass, friction))
    assert p.getVisualShapeData(body)[0][7] == pytest.approx(RED)
    table = p.getDynamicsInfo(env.world.table, -1)[1]
    assert table * friction == pytest.approx(friction)  # Bullet multiplies them


@pytest.mark.parametrize(
    ("name", "way"), [("push", 0.15), ("slide", 0.41), ("coffee", 0.18), ("drawer", 0.15)]
)
def test_a_thing_starts_in_the_middle_and_as_far_from_its_goal_as_its_task_says(make, name, way):
    """Along x alone; it stands on the table, and an arm that starts is 4 cm or more from it."""
    env = make(name)
    lacks = env.target_position() - env.object_position()
    assert lacks == pytest.approx((way, 0, 0), abs=2e-4)
    tip = env.arm.tip_pose()[0]
    assert env.object_position()[0] - env.CONTACT - tip[0] > -0.02 and tip[2] > 0.1


@pytest.mark.parametrize(
    ("name", "thing"), [("push", "cube"), ("slide", "puck"), ("coffee", "mug")]
)
def test_a_thing_is_put_by_its_own_half_width_and_height(make, monkeypatch, name, thing):
    """By these a scattered one keeps clear of the arm; at the fixed start no span is asked."""
    env, put = make(name), []
    monkeypatch.setattr(env, "put", lambda *of: put.append(of))
    x = env.object_position()
    for scatter in (True, False):
        env.place(np.array([0.01, 0.002, 0]), scatter)
    wide, _, high = size(env.world.p, getattr(env, thing))
    for (body, at, half, height, span), scatter in zip(put, (True, False), strict=True):
        assert body == getattr(env, thing) and at == pytest.approx(x + (0.01, 0.002, 0), abs=1e-4)
        assert (half, height) == pytest.approx((wide / 2, high))
        assert (span is not None) == scatter


def test_a_mug_is_felt_as_a_cylinder_and_its_handle_stands_out_by_two_centimetres(make):
    """The handle is on the far side from the hand, and weighs next to nothing."""
    env = make("coffee")
    p, mug = env.world.p, env.mug
    felt = [len(p.getCollisionShapeData(mug, link)) for link in range(-1, 3)]
    assert felt == [1, 0, 0, 0]
    assert sum(p.getDynamicsInfo(mug, link)[0] for link in range(3)) < 0.01 * 0.11 * 3
    upright = np.array(p.getLinkState(mug, 2)[0]) - env.object_position()
    assert upright[0] + size(p, mug, 2)[0] / 2 == pytest.approx(0.028 + 0.020 + 0.002, abs=1e-6)
    assert size(p, mug, 2)[2] == pytest.approx(0.036 + 0.008)
    bars = [p.getLinkState(mug, i)[0][2] - env.object_position()[2] for i in (0, 1)]
    assert bars == pytest.approx([0.018, -0.018], abs=1e-6)
    assert upright[0] - 0.020 / 2 < 0.028 + 0.02 / 2  # it is fixed to the mug


def test_the_goal_of_a_task_is_marked_where_it_is(make):
    """A ball of 1.8 cm, smaller than the 5 cm that count, and green discs on the table."""
    for name, extent in (
        ("reach", 3 * (0.036,)), ("push", (0.06, 0.06, 0.001)), ("slide", (0.06, 0.06, 0.001))
    ):  # fmt: skip
        env = make(name)
        p, mark = env.world.p, env.world.scenery[-1]
        assert size(p, mark) == pytest.approx(extent)
        assert env.world.position(mark)[:2] == pytest.approx(env.target_position()[:2])
        assert p.getVisualShapeData(mark)[0][7][:3] == pytest.approx(GREEN[:3])


def test_the_outlet_hangs_above_the_mug_and_the_hands_way_before_it_is_free(make):
    """Rays upwards from under the mug's rim, 6.6 cm high, at its goal."""
    env = make("coffee")
    p, x = env.world.p, env.target_position()[0]
    ways = np.array([-0.04, -0.02, 0, 0.023])
    hits = p.rayTestBatch([(x + dx, 0, 0.01) for dx in ways], [(x + dx, 0, 0.5) for dx in ways])
    heights = [hit[3][2] if hit[0] >= 0 else np.inf for hit in hits]
    assert heights == pytest.approx([np.inf, np.inf, np.inf, 0.08])


def test_a_drawer_that_is_pulled_or_pushed_ends_where_its_rail_does(make):
    env = make("drawer")
    p = env.world.p
    for q, speed, end in ((-0.149, -1.0, -0.15), (-0.001, 1.0, 0.0)):
        p.resetJointState(env.drawer, 0, q, targetVelocity=speed)
        for _ in range(10):
            env.step(np.zeros(3))
        assert p.getJointState(env.drawer, 0)[0] == pytest.approx(end, abs=0.002)


def test_a_drawer_slides_into_its_cabinet_without_touching_it(make):
    env = make("drawer")
    p = env.world.p
    for q in (-0.15, -0.08, 0.0):
        p.resetJointState(env.drawer, 0, q)
        p.performCollisionDetection()
        assert not p.getContactPoints(env.drawer, env.cabinet)


@pytest.mark.parametrize(
    ("tip", "moved"),
    [((0.66, 0, 0.12), True), ((0.66, 0, 0.13), False), ((0.44, 0, 0.05), False)],
)
def test_a_tip_that_would_start_in_an_open_drawer_starts_before_it(make, tip, moved):
    """The front is 8 cm high about 6.5 cm, and the tip keeps 2 cm above it."""
    env = make("drawer")
    for _ in range(20):
        env.arm.reset(np.array(tip))
        env.place(np.zeros(3), True)
        wanted = (0.43, 0, tip[2]) if moved else tip
        assert env.arm.goal == pytest.approx(wanted)


def test_a_tip_beside_an_open_drawer_keeps_two_fingers_from_its_grip(make):
    env, gaps = make("drawer"), {True: [], False: []}
    for _ in range(60):
        env.arm.reset(np.array([0.55, 0, 0.06]))
        env.place(np.zeros(3), True)
        gap = env.object_position()[0] - 0.55
        gaps[bool(env.arm.goal[0] < 0.5)].append(gap)
    assert max(gaps[True]) <= 2 * FINGER + 1e-9 <= min(gaps[False]) + 2e-9
    assert min(gaps[True]) < 0 and len(gaps[False]) > 5


def test_a_drawers_grip_is_as_large_in_the_picture_as_a_cube_and_all_of_it_is_felt(make):
    env = make("drawer")
    p = env.world.p
    extents = [size(p, env.drawer, link) for link in range(3)]
    assert extents[1] == pytest.approx((0.045, 0.10, 0.044))
    assert extents[0] == pytest.approx((0.012, 0.16, 0.08))
    assert p.getDynamicsInfo(env.drawer, 0)[0] == pytest.approx(0.8)
    assert all(p.getCollisionShapeData(env.drawer, link) for link in range(3))
    (front,) = {p.getLinkState(env.drawer, 1)[0][0] - 0.045 / 2}
    assert env.object_position()[0] == pytest.approx(front, abs=1e-6)


def test_slides_hand_is_quick_along_the_table_and_slow_up_and_down():
    """1 m/s at full action, 25 times a second. A landing at 0.6 m/s turns the wrist too fast.

    It stays 30 cm from the goal: the puck has to get there by itself.
    """
    slide, task = tasks.module("slide").Slide, tasks.module("slide")
    assert pytest.approx(1) == slide.STEP * 25
    assert slide.LEASH == (0.06, 0.06, 0.025)
    assert task.TARGET - slide.WORKSPACE[1][0] == pytest.approx(0.30)
    assert slide.WORKSPACE[1][0] - slide.START[0] >= task.STROKE


def test_a_goal_ahead_by_more_than_a_step_would_be_hidden_from_the_policy():
    """No frame shows the goal. With 5 cm instead of 3 push was solved in no episode."""
    for name in ("reach", "push", "coffee", "drawer"):
        env = getattr(tasks.module(name), name.capitalize())
        assert env.LEASH == 0.03 >= env.STEP
    steps = {"reach": 0.03, "push": 0.03, "coffee": 0.012, "drawer": 0.01}
    for name, step in steps.items():  # with 3 cm chance pushes a mug or shuts a drawer
        assert step == getattr(tasks.module(name), name.capitalize()).STEP


@pytest.mark.parametrize(
    ("name", "half_way", "tip", "thing", "within"),
    [
        ("reach", (0.5542, 0.0866), (0.6782, 0.0599), 0.6782, 0.0003),
        ("push", (0.4759, 0.0202), (0.6294, 0.0184), 0.6648, 0.0003),
        ("slide", (0.6228, 0.0200), (0.6270, 0.0200), 0.9270, 0.0050),
        ("coffee", (0.4545, 0.0300), (0.6485, 0.0296), 0.6820, 0.0003),
        ("drawer", (0.4819, 0.0634), (0.6301, 0.0619), 0.6430, 0.0003),
    ],
)
def test_the_robots_expert_ends_where_it_did_when_the_shipped_policies_learnt(
    make, name, half_way, tip, thing, within
):
    """In m along x and z; its world and its arm are those of the results. A puck goes as far as
    the last bit of a hit says, see `test_recordings.py`; so do the human's, there."""
    env = make(name)
    states = [env.true_state()]
    states += [env.step(action)[0] for action in expert_actions(env)]
    middle, end = states[len(states) // 2], states[-1]
    assert middle[[0, 2]] == pytest.approx(half_way, abs=0.0003)
    assert end[[0, 2]] == pytest.approx(tip, abs=0.0003)
    assert end[3] == pytest.approx(thing, abs=within)
