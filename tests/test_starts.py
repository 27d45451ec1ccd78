"""Where episodes begin, what is felt and seen there, and who moves the arm in random data."""

import json
from itertools import islice
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest

import tasks
from lbw_minimal import imitate, video, wrappers
from tasks import world
from tasks.commands.recipe import fields_of
from tasks.world import DT, SUBSTEPS, Leg, expert_actions, random_actions
from tasks.world import motion as module
from tasks.world.env import LOW, TOUCH

# m along x, where random data puts the middle of the object; a drawer's grip.
SPANS = {
    "push": (0.50, 0.70),
    "slide": (0.50, 1.02),
    "coffee": (0.49, 0.69),
    "drawer": (0.493, 0.643),
}


def scattered(env, n):
    return np.array([env.reset(seed=i, options={"scatter": True})[0] for i in range(n)])


@pytest.mark.parametrize("name", SPANS)
def test_random_data_puts_the_object_anywhere_in_its_span(make, name):
    x = scattered(make(name), 120)[:, 3]
    low, high = SPANS[name]
    assert low - 1e-6 <= x.min() < low + 0.1 * (high - low)
    assert high - 0.1 * (high - low) < x.max() <= high + 1e-6
    assert abs(x.mean() - (low + high) / 2) < 0.13 * (high - low)


def test_reachs_ball_stands_still_and_its_arm_begins_anywhere(make):
    states = scattered(make("reach"), 60)
    assert np.ptp(states[:, 6:], axis=0).max() == 0
    low, high = np.array(make("reach").WORKSPACE)
    assert (states[:, :3].min(0) < low + 0.15 * (high - low)).all()
    assert (states[:, :3].max(0) > high - 0.15 * (high - low)).all()


@pytest.mark.parametrize("name", SPANS)
def test_about_half_of_the_scattered_starts_are_beside_the_object(make, name):
    """Low, within 5 cm of touching it; chance alone would do it in one of ten or fewer."""
    env = make(name)
    states = scattered(env, 80)
    gap = np.abs(states[:, 0] - states[:, 3]) - env.CONTACT
    low = states[:, 2] < env.WORKSPACE[0][2] + LOW + 1e-4
    beside = (gap < 0.05 + 1e-4) & low
    least, most = (0.1, 0.4) if name == "slide" else (0.25, 0.75)  # half of its pucks are too far
    assert least < beside.mean() < most


def test_beside_is_two_times_in_three_to_the_left_low_and_as_far_as_a_touch_or_5_cm_more(make):
    env, tips = make("push"), []
    env.reset(seed=0)
    p = env.world.p
    for _ in range(120):
        p.resetBasePositionAndOrientation(env.cube, (0.58, 0, 0.025), (0, 0, 0, 1))
        env.arm.reset(np.array([0.45, 0, 0.15]))
        env._stand_beside()
        tips.append(env.arm.goal)
    x, _, z = np.array(tips).T
    aside = np.abs(x - 0.58)
    assert env.CONTACT <= aside.min() < env.CONTACT + 0.005
    assert env.CONTACT + 0.045 < aside.max() <= env.CONTACT + 0.05
    assert env.WORKSPACE[0][2] <= z.min() < z.max() <= env.WORKSPACE[0][2] + LOW
    assert z.max() > env.WORKSPACE[0][2] + 0.9 * LOW
    assert 0.5 < (x < 0.58).mean() < 0.8


def test_an_object_in_the_arms_way_goes_to_the_far_end_of_its_span(make):
    env = make("push")
    for tip, end in ((0.46, 0.70), (0.70, 0.50)):
        env.reset(seed=0)
        env.arm.reset(np.array([tip, 0, 0.02]))
        places = []
        for _ in range(60):
            env.put(
                env.cube,
                np.array([0.0, 0, 0.025]),
                0.025,
                0.05,
                (0.46, 0.70) if end == 0.70 else (0.50, 0.72),
            )
            places.append(env.object_position()[0])
        away = np.abs(np.array(places) - tip)
        assert away.min() >= 0.025 + 0.024 - 1e-9
        assert (np.abs(np.array(places) - end) < 1e-9).sum() >= 3  # those that were drawn too near
    env.arm.reset(np.array([0.55, 0, 0.15]))  # above it, it is in no one's way
    for _ in range(60):
        env.put(env.cube, np.array([0.0, 0, 0.025]), 0.025, 0.05, (0.53, 0.57))
        places.append(env.object_position()[0])
    assert np.unique(places[-60:]).size == 60


def test_contact_is_how_deep_the_hand_is_in_a_thing(make):
    """A cube that is put 5 mm into the fingers, from the front; beside them it is not felt."""
    env = make("push")
    env.reset(seed=0)
    assert env.contact() == 0
    env.arm.reset(np.array([0.5, 0, 0.02]))
    depths = []
    for x in (0.5 + env.CONTACT + 0.01, 0.5 + env.CONTACT - 0.005):
        env.world.p.resetBasePositionAndOrientation(env.cube, (x, 0, 0.025), (0, 0, 0, 1))
        depths.append(env.contact())
    assert depths[0] == 0 and depths[1] > 0.003 > TOUCH
    env.world.p.performCollisionDetection()
    points = env.world.p.getContactPoints(env.arm.body, env.cube)
    assert depths[1] == pytest.approx(max(-point[8] for point in points), abs=1e-4)


@pytest.mark.parametrize("arm", ["robot", "human"])
def test_hand_and_fingers_alone_feel_a_thing(make, arm):
    """A cube is put into every part of the arm, its base too."""
    env = make("push", arm)
    env.reset(seed=0)
    p, body = env.world.p, env.arm.body
    feeling = {env.arm.links[name] for name in env.arm.spec.reach_links}
    touched = set()
    for link in range(-1, p.getNumJoints(body)):
        at = p.getBasePositionAndOrientation(body) if link < 0 else p.getLinkState(body, link)
        p.resetBasePositionAndOrientation(env.cube, at[0], (0, 0, 0, 1))
        p.performCollisionDetection()
        touched |= {point[3] for point in p.getContactPoints(body, env.cube)}
    assert touched == feeling


@pytest.mark.parametrize(("depth", "moved"), [(0.0009, False), (0.0011, True)])
def test_a_scattered_tip_that_is_in_a_thing_goes_to_the_left_end_of_its_box(
    depth, moved, make, monkeypatch
):
    """A centimetre inside of it, at the height where it was."""
    env = make("push")
    monkeypatch.setattr(env, "_stand_beside", lambda: None)
    env.reset(seed=3, options={"scatter": True})
    drawn = env.arm.goal.copy()
    monkeypatch.setattr(env, "contact", lambda: depth)
    env.reset(seed=3, options={"scatter": True})
    wanted = (0.42 + 0.01, 0, drawn[2]) if moved else drawn
    assert env.arm.goal == pytest.approx(wanted) and drawn[0] > 0.45


@pytest.mark.parametrize(
    ("depths", "goes"),
    [((0,), (1,)), ((0.0011, 0.0009), (1, -1)), ((0.002, 0.002), (1, -1, 0)), ((), (1, -1, 0))],
)
def test_a_tip_stands_on_the_other_side_where_it_would_be_in_a_thing_or_where_it_was(
    make, monkeypatch, depths, goes
):
    """Sides of the object in the order in which they are tried, 0 for where the tip was."""
    env, tried = make("push"), []
    env.reset(seed=0)
    p, before = env.world.p, np.array([0.45, 0, 0.15])
    p.resetBasePositionAndOrientation(env.cube, (0.58, 0, 0.025), (0, 0, 0, 1))
    env.arm.reset(before)
    told = iter(depths)
    monkeypatch.setattr(env, "contact", lambda: next(told, 0.002))
    monkeypatch.setattr(
        env.arm, "reset", lambda tip: tried.append(0 if tip is before else np.sign(tip[0] - 0.58))
    )
    env.arm.goal = before
    env._stand_beside()
    first = tried[0]
    assert [side * first for side in tried] == list(goes)


@pytest.mark.parametrize(("cube", "sides"), [(0.43, {1}), (0.73, {-1}), (0.58, {1, -1})])
def test_where_there_is_no_room_on_one_side_the_tip_stands_on_the_other(make, cube, sides):
    env, tips = make("push"), []
    env.reset(seed=0)
    for _ in range(30):
        env.world.p.resetBasePositionAndOrientation(env.cube, (cube, 0, 0.025), (0, 0, 0, 1))
        env.arm.reset(np.array([0.58, 0, 0.15]))
        env._stand_beside()
        tips.append(env.arm.goal)
    assert {np.sign(x - cube) for x, _, z in tips if z < 0.1} == sides


@pytest.mark.parametrize(("height", "in_the_way"), [(0.069, True), (0.071, False)])
def test_a_tip_two_centimetres_above_a_thing_is_in_no_ones_way(make, height, in_the_way):
    env = make("push")
    env.reset(seed=0)
    env.arm.goal = np.array([0.60, 0, height])
    env.put(env.cube, np.array([0.0, 0, 0.025]), 0.025, 0.05, (0.599, 0.602))
    assert (env.object_position()[0] == 0.602) == in_the_way


@pytest.mark.parametrize("name", ["reach", "push", "slide"])
def test_marks_of_the_target_are_seen_and_not_felt(make, name):
    env = make(name)
    env.reset(seed=0)
    mark = env.world.scenery[-1]
    assert env.world.p.getVisualShapeData(mark) and not env.world.p.getCollisionShapeData(mark, -1)


@pytest.mark.parametrize("name", tasks.TASKS)
def test_the_scene_for_a_clip_is_what_stands_there(make, name):
    env = make(name, "human")
    state, _ = env.reset(seed=0)
    scene = env.scene()
    low, high = env.WORKSPACE
    assert scene.low == (low[0], low[2]) and scene.high == (high[0], high[2])
    assert scene.tip == (env.START[0], env.START[2])
    assert scene.start == pytest.approx((state[3], state[5]), abs=1e-5)
    assert scene.goal == pytest.approx((state[6], state[8]), abs=1e-5)
    assert (scene.step, scene.contact, scene.height) == (env.STEP, env.CONTACT, env.PUSH_AT)
    assert scene.hit == (name == "slide")


def test_the_camera_sees_a_thing_where_it_says():
    """The red cube's middle, to half a pixel, at both ends of the picture."""
    env = tasks.bare("push")
    env.reset(seed=0)
    env.arm.reset(np.array([0.45, 0, 0.16]))
    for x, z in ((0.50, 0.025), (0.70, 0.025), (0.70, 0.17)):
        env.world.p.resetBasePositionAndOrientation(env.cube, (x, 0, z), (0, 0, 0, 1))
        red = env.world.render().astype(int)
        red = (red[..., 0] - red[..., 1]).clip(60) - 60
        row, column = np.mgrid[:84, :84] + 0.5
        middle = np.array([(red * column).sum(), (red * row).sum()]) / red.sum()
        # It is seen from a little above: the top shows, too.
        assert np.abs(middle - env.world.pixel((x, 0, z))).max() < 1.0
    env.close()


def test_what_the_arms_weigh_is_what_their_models_say(make):
    """The human's inertias are stated: 1/12 m l^2 and 0.01 kg m^2 of a hand of 0.4 kg and 15 cm."""
    env = make("reach", "human")
    info = env.world.p.getDynamicsInfo(env.arm.body, env.arm.links["hand"])
    assert info[0] == pytest.approx(0.4)
    assert info[2] == pytest.approx(3 * [0.4 * 0.15**2 / 12 + 0.01])


@pytest.mark.parametrize("embodiment", ["robot", "human"])
def test_joints_have_no_motor_and_no_damping_of_bullets_own(make, embodiment):
    """Let go, the arm falls as its energy says: what it loses in height it gains in speed."""
    env = make("reach", embodiment)
    env.reset(seed=0)
    p, arm = env.world.p, env.arm
    q, _ = arm.state()
    for _ in range(25):
        p.stepSimulation()
    q_then, dq = arm.state()
    kinetic = dq @ arm.mass_matrix(q_then) @ dq / 2

    def height(angles):
        arm._set(angles)
        links = [
            p.getLinkState(arm.body, i, computeForwardKinematics=True) for i in arm.links.values()
        ]
        masses = [p.getDynamicsInfo(arm.body, i)[0] for i in arm.links.values()]
        return 9.81 * sum(m * link[0][2] for m, link in zip(masses, links, strict=True))

    assert kinetic > 0.2  # J
    assert kinetic == pytest.approx(height(q) - height(q_then), rel=0.1)


def test_the_lamp_behind_the_human_swings_a_tenth_of_a_metre_in_1_3_seconds(make):
    env, begun = make("coffee", "human"), []
    for seed in range(20):
        env.reset(seed=seed)
        begun.append(env.world.position(env.lamp)[0])
    assert np.ptp(begun) > 0.12  # it begins anywhere
    x = []
    for _ in range(130):
        env.step(np.zeros(3))
        x.append(env.world.position(env.lamp)[0])
    wave = np.array(x) - 0.62
    assert np.abs(wave).max() == pytest.approx(0.10, abs=0.001)
    turns = np.sum((wave[1:] > 0) & (wave[:-1] <= 0))
    assert turns == 4  # of 5.2 s
    assert make("coffee").embodiment == "robot" and not hasattr(make("coffee"), "lamp")


def test_random_actions_are_held_for_4_to_12_steps_and_seldom_go_up():
    many = np.array(list(islice(random_actions(np.random.default_rng(0)), 6000)))
    changes = np.flatnonzero(np.any(np.diff(many, axis=0), axis=1)) + 1
    lengths = np.diff(changes)
    assert set(lengths) == set(range(4, 13))
    held = many[changes]
    assert held.min(0) == pytest.approx([-1, -1, -1], abs=0.02)
    assert held.max(0) == pytest.approx([1, 1, 0.6], abs=0.02)


@pytest.mark.parametrize("towards", [-1, 1])
def test_actions_towards_a_thing_go_its_way_at_about_their_height(towards):
    rng = np.random.default_rng(0)
    held = np.array(list(islice(random_actions(rng, towards), 3000)))
    assert (towards * held[:, 0]).min() >= 0 and (towards * held[:, 0]).max() > 0.95
    assert held[:, 2].min() == pytest.approx(-0.4, abs=0.02)
    assert held[:, 2].max() == pytest.approx(0.2, abs=0.02)
    assert np.abs(held[:, 1]).max() > 0.9


@pytest.mark.parametrize(("side", "height"), [(-1, 0.02), (1, 0.02), (-1, 0.12)])
def test_a_take_that_begins_beside_the_object_seeks_it_for_its_first_half(make, side, height):
    env = make("push")
    env.reset(seed=0)
    env.arm.reset(env.object_position() * (1, 1, 0) + (side * (env.CONTACT + 0.03), 0, height))
    ways = []
    for seed in range(12):
        wander = module._wander(env, np.random.default_rng(seed), 20)
        ways.append([action[0] for action in islice(wander, 20)])
    ways = -side * np.array(ways)
    sought = (ways >= 0).all(0)
    assert sought[:9].all() == (height == 0.02)
    assert not sought[10:].all()


def test_random_motion_is_filmed_in_takes_of_a_second_and_the_bar_counts_them(monkeypatch):
    asked, bar = [], []

    def takes(env, frames, seed, take):
        asked.append((frames, seed, take))
        yield from ((np.full((2, 1), i), i + np.arange(8.0).reshape(2, 4), None) for i in (0, 8))

    monkeypatch.setattr(module, "random_takes", takes)
    monkeypatch.setattr(module, "counted", lambda takes, total, name: bar.append(total) or takes)
    film, truth = module.record_random(None, 60, seed=3)
    assert asked == [(60, 3, 25)] and bar == [3]
    assert film[:, 0].tolist() == [0, 0, 8, 8] and truth.ravel().tolist() == [*range(16)]


@pytest.mark.parametrize(("gap", "height", "seeks"), [
    (0.049, LOW - 0.001, True), (-0.049, LOW - 0.001, True),
    (0.051, LOW - 0.001, False), (0.03, LOW + 0.001, False),
])  # fmt: skip
def test_beside_is_five_centimetres_from_a_touch_and_as_low_as_things_are(
    gap, height, seeks, monkeypatch
):
    """gap: m from where tip and object would touch, to the object's left or right."""
    low, contact = 0.02, 0.04
    x = np.sign(gap) * (contact + abs(gap))
    env = SimpleNamespace(
        CONTACT=contact, WORKSPACE=((0, 0, low), (1, 0, 1)), object_position=lambda: np.zeros(3),
        arm=SimpleNamespace(goal=np.array([x, 0, low + height])),
    )  # fmt: skip
    monkeypatch.setattr(module, "random_actions", lambda rng, towards=0.0: iter(100 * [towards]))
    ways = list(islice(module._wander(env, None, 10), 10))
    assert ways == (4 * [-np.sign(gap)] + 6 * [0] if seeks else 10 * [0])


def test_a_leg_shorter_than_a_step_takes_one_and_an_exact_one_is_never_bent_or_slowed():
    env = SimpleNamespace(STEP=1.0, arm=SimpleNamespace(goal=np.zeros(3)))
    ends = np.array([[0.5, 0, 0], [0.5, 0, 0.4]])
    env.waypoints = lambda: [Leg(ends[0], 0.01, exact=True), Leg(ends[1], 0.4, exact=True)]
    for seed in range(5):
        goals = []
        for action in expert_actions(env, np.random.default_rng(seed)):
            env.arm.goal = env.arm.goal + action
            goals.append(env.arm.goal)
        assert len(goals) == 1 + 10
        np.testing.assert_allclose([goals[0], goals[-1]], ends, atol=1e-6)
        assert np.abs(np.array(goals[1:])[:, 0] - 0.5).max() < 1e-6
        env.arm.goal = np.zeros(3)


def test_takes_of_random_motion_have_their_frames_and_each_a_place_of_its_own(monkeypatch):
    filmed = []

    def film(env, seed, actions, scatter):
        filmed.append((seed, len(list(actions)) + 1, scatter))
        return filmed[-1]

    monkeypatch.setattr(module, "film", film)
    monkeypatch.setattr(module, "_wander", lambda env, rng, take: iter(range(1000)))
    takes = list(module.random_takes(None, 60, seed=3, take=25))
    assert [n for _, n, _ in takes] == [25, 25, 10] and all(scatter for *_, scatter in takes)
    assert len({seed for seed, *_ in takes}) == 3
    assert takes == list(module.random_takes(None, 60, seed=3, take=25))
    assert takes[0][0] != next(module.random_takes(None, 60, seed=4, take=25))[0]


@pytest.mark.parametrize("name", tasks.TASKS)
def test_a_task_has_the_papers_horizon(name):
    """50 steps for reach and push, 300 for the others, of 1/25 s."""
    spec = gym.spec(tasks.id_of(name))
    assert spec.max_episode_steps == (50 if name in ("reach", "push") else 300)
    assert pytest.approx(1 / 25) == DT * SUBSTEPS


@pytest.mark.parametrize("name", tasks.TASKS)
def test_the_recipe_is_that_of_the_results(name):
    """All runs of `policies/`, three of each task: what the README's table is about."""
    for path in (tasks.ROOT / "solutions" / "results" / "policies").glob(f"{name}-*/metrics.json"):
        settings = json.loads(path.read_text())["settings"]
        ours = fields_of(tasks.module(name).RECIPE, "lbw")
        known = {key: value for key, value in settings["recipe"].items() if key in ours}
        assert known == {key: ours[key] for key in known} and len(known) > 8


def test_the_shipped_perception_or_ones_own_has_watched_the_first_human_video(monkeypatch):
    watched, asked = [], []
    perception = SimpleNamespace(watch=watched.append)
    monkeypatch.setattr(imitate, "load_perception", lambda *of: asked.append(of) or perception)
    monkeypatch.setattr(video, "read", lambda path: (path.relative_to(tasks.VIDEOS), []))
    assert tasks.trained_perception("slide") is perception
    assert tasks.trained_perception("slide", "mine") is perception
    assert [path.as_posix() for path in watched] == 2 * ["slide/expert_01.mp4"]
    assert asked == [(tasks.WEIGHTS / "slide", "slide"), ("mine", "slide")]


def test_an_agent_from_elsewhere_gets_the_mended_reward_unless_it_asks_for_another(monkeypatch):
    asked = []
    monkeypatch.setattr(imitate, "load_perception", lambda *of: SimpleNamespace(detect=of))
    monkeypatch.setattr(
        wrappers, "KeypointObservation", lambda env, detect: asked.append(detect) or env
    )
    monkeypatch.setattr(tasks, "trained_perception", lambda name: name)
    monkeypatch.setattr(tasks, "pace_film", lambda name: name)
    monkeypatch.setattr(imitate, "watched", lambda env, *of: asked.append(of) or (env, None))
    for reward in ((), ("literal",), (None,)):
        tasks.keypoint_env("coffee", *reward).close()
    assert asked[:2] == [("coffee", "coffee", "mended"), ("coffee", "coffee", "literal")]
    assert asked[2] == (tasks.WEIGHTS / "coffee", "coffee")


def test_in_reach_alone_nothing_is_moved():
    assert [name for name in tasks.TASKS if not tasks.moves_object(name)] == ["reach"]


def test_the_classifier_reward_is_shown_as_many_robot_videos_as_in_the_paper(monkeypatch):
    """Thirty-five; whoever wants fewer of them closes the world behind them."""
    asked, closed = [], []
    env = SimpleNamespace(close=lambda: closed.append(True))
    monkeypatch.setattr(tasks, "bare", lambda name, **options: asked.append(options) or env)
    monkeypatch.setattr(
        world, "expert_takes", lambda env, wanted: ((i, None, -i) for i in range(wanted))
    )
    assert list(tasks.robot_experts("push", 0.01)) == [(i, -i) for i in range(35)]
    some = tasks.robot_experts("push", 0.01)
    assert next(some) == (0, 0) and len(closed) == 1
    some.close()
    assert len(closed) == 2 and asked == 2 * [{"jitter": 0.01}]


def test_the_film_of_the_robots_pace_has_its_own_seed_and_400_frames(monkeypatch):
    asked = []

    def record(env, frames, seed):
        asked.append((env.embodiment, frames, seed))
        return np.zeros(1), None

    monkeypatch.setattr(world, "record_random", record)
    tasks.pace_film("reach", 9001)
    tasks.pace_film("reach", 9002, 7)
    assert asked == [("robot", 400, 9001), ("robot", 7, 9002)]
