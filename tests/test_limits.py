"""What no action, start, argument or copy breaks: every task, both arms."""

import copy
import itertools
import os
import pickle
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pybullet
import pytest
import torch
from gymnasium.error import ClosedEnvironmentError, InvalidAction, ResetNeeded, UnsupportedMode

import tasks
from tasks.world.scene import DT, FPS, SUBSTEPS

SCENES = [(name, arm) for name in tasks.TASKS for arm in ("robot", "human")]
FEW_OR_THOUSAND = [7, pytest.param(1000, marks=pytest.mark.slow)]  # one of each kind, or many
STEPS = 80  # actions of a sequence; the elbow of slide's robot took 58 to swing up
CORNERS = np.array(list(itertools.product((-1, 0, 1), repeat=3)))


def make(name, arm="robot", **options):
    options = {"observation": "state"} | options
    return gym.make(tasks.id_of(name), embodiment=arm, **options).unwrapped


def sequence(i):
    """Actions (STEPS, 3): of seven kinds in turn, with all periods from 1 to 25."""
    rng, t, period = np.random.default_rng(i), np.arange(STEPS), 1 + i // 7 % 25
    one, other = CORNERS[rng.integers(27, size=2)]
    return [
        lambda: rng.choice([-1, 1], (STEPS, 3)),  # signs
        lambda: np.where(t[:, None] // period % 2, one, other),  # two actions in turn
        lambda: np.where(t[:, None] // rng.integers(1, 26, 3) % 2, 1, -1),  # x, y, z by themselves
        lambda: CORNERS[rng.integers(27, size=STEPS)][t // period],  # full actions, each held
        lambda: rng.uniform(-1, 1, (STEPS, 3))[t // period],
        lambda: rng.uniform(-1, 1, (STEPS, 3)),
        lambda: np.broadcast_to(one, (STEPS, 3)),
    ][i % 7]()  # fmt: skip


def strain(env, actions, seed, scatter):
    """How far out of its box the tip got, in m, and the joints' top share of their speed limit."""
    low, high = np.array(env.WORKSPACE)
    limit = env.OVERSPEED * np.array(env.arm.spec.speed)
    out, share, actuate = 0.0, 0.0, env.arm.actuate

    def watch():
        nonlocal share
        share = max(share, (np.abs(env.arm.state()[1]) / limit).max())
        actuate()

    env.reset(seed=seed, options={"scatter": scatter})
    env.arm.actuate = watch
    for action in actions:
        state, _, lost, _, info = env.step(action)
        tip, thing = state[:3], state[3:6]
        assert np.isfinite(state).all()
        assert lost == info["object_lost"] == (thing[2] < 0)
        assert thing[2] > -0.1  # m: what is lost falls no further
        out = max(out, (low - tip).max(), (tip - high).max())
    env.arm.actuate = actuate
    return out, share


@pytest.mark.parametrize("count", FEW_OR_THOUSAND)
@pytest.mark.parametrize(("name", "arm"), SCENES)
def test_whatever_the_actions_arm_and_object_stay_within_their_limits(name, arm, count):
    env = make(name, arm)
    for i in range(count):
        out, share = strain(env, sequence(i), seed=i, scatter=i % 2 == 1)
        assert out < 0.01 and share <= 1, f"sequence {i}: {1000 * out:.1f} mm, {share:.2f} times"
    env.close()


@pytest.mark.parametrize(("name", "i"), [("drawer", 13), ("coffee", 254), ("push", 576)])
def test_a_knock_or_a_press_does_not_spin_the_wrist_past_its_limit(name, i):
    """Of a thousand sequences those that would; how near they come hangs on the processor."""
    env = make(name)
    _, share = strain(env, sequence(i), seed=i, scatter=i % 2 == 1)
    assert 0.9 < share <= 1
    env.close()


@pytest.mark.parametrize("arm", ["robot", "human"])
def test_joints_that_are_spun_turn_on_at_their_limit_after_one_simulation_step(arm):
    """Elbow and wrist at twice their limits, one each way, as after a knock."""
    env = make("reach", arm)
    env.reset(seed=0)
    limit, joints = env.arm.speed, env.arm.joints
    q, seen, actuate = env.arm.state()[0], [], env.arm.actuate
    for joint, sign in ((3, 1), (5, -1)):
        env.world.p.resetJointState(env.arm.body, joints[joint], q[joint], sign * 2 * limit[joint])
    env.arm.actuate = lambda: seen.append(env.arm.state()) or actuate()
    env.step(np.zeros(3))
    speeds, angles = np.array([dq for _, dq in seen]), np.array([q for q, _ in seen])
    assert speeds[0, 3] == pytest.approx(2 * limit[3])
    assert (np.abs(speeds[1:]) <= limit + 1e-12).all()
    assert speeds[1, [3, 5]] == pytest.approx([limit[3], -limit[5]])
    turned = np.diff(angles[:4], axis=0)[:, [3, 5]] * (1, -1)
    assert (turned > 0).all() and turned[0] == pytest.approx(2 * limit[[3, 5]] / 250, rel=0.2)
    # They are slowed down where they are: the way of a step is at most twice the limit's.
    assert (np.abs(np.diff(angles, axis=0)) <= 2 * limit / 250 + 1e-9).all()
    env.close()


def test_only_slide_turns_its_joints_faster_than_they_are_rated():
    speeds = {name: make(name).arm.speed.tolist() for name in tasks.TASKS}
    rated = [2.175] * 4 + [2.61] * 3  # rad/s, the Panda's
    twice = speeds.pop("slide")
    assert twice == [2 * speed for speed in rated]
    assert all(speed == rated for speed in speeds.values())


STARTS = [
    ({"scatter": True}, 0.0),
    ({}, 0.005),
    ({}, 0.02),
    ({}, 0.05),
]


@pytest.mark.parametrize("count", [20, pytest.param(500, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("name", "arm"), SCENES)
def test_no_start_is_deeper_in_contact_than_a_millimetre(name, arm, count):
    for options, jitter in STARTS:
        env = make(name, arm, jitter=jitter)
        for seed in range(count):
            state, _ = env.reset(seed=seed, options=options)
            env.world.p.performCollisionDetection()
            depth = max((-point[8] for point in env.world.p.getContactPoints()), default=0)
            assert depth < 0.001, f"{options}, jitter {jitter}, seed {seed}: {1000 * depth:.1f} mm"
            assert np.clip(state[:3], *env.WORKSPACE) == pytest.approx(state[:3], abs=1e-6)
        env.close()


WRONG_ACTIONS = [
    None,
    0.5,
    np.float32(0),
    [0, 0],
    np.zeros(4),
    np.zeros((1, 3)),
    [np.nan, 0, 0],
    [0, np.inf, 0],
    ["left", "up", "down"],
    "up",
    {"x": 1},
    [1, [2], 3],
    [None, 0, 0],
    [True, False, True],
    np.zeros(3, complex),
]


@pytest.mark.parametrize("action", WRONG_ACTIONS, ids=repr)
def test_an_action_that_is_not_three_finite_numbers_is_refused(reach, action):
    before, _ = reach.reset(seed=0)
    with pytest.raises(InvalidAction) as error:
        reach.step(action)
    assert str(error.value) == f"action={action!r}: give three finite numbers in [-1, 1]."
    np.testing.assert_array_equal(reach.true_state(), before)


@pytest.fixture(scope="module")
def reach():
    env = make("reach")
    yield env
    env.close()


def test_what_is_beyond_1_counts_as_1(reach):
    ways = []
    for action in (np.array([1, 0, -1]), [3, 0, -7], np.float32([1, 0, -1])):
        reach.reset(seed=0)
        ways.append(reach.step(action)[0])
    np.testing.assert_array_equal(ways[0], ways[1])
    np.testing.assert_array_equal(ways[0], ways[2])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"scater": True}, r"options={'scater': True}: the one option is {'scatter': True}."),
        ({"scatter": True, "x": 1}, "the one option is"),
        ("scatter", "options='scatter': the one option is"),
        ({"scatter": "yes"}, r"options={'scatter': 'yes'}: 'scatter' is True or False."),
        ({"scatter": None}, "'scatter' is True or False."),
    ],
)
def test_unknown_options_of_a_reset_are_refused(reach, options, message):
    reach.reset(seed=0)
    before = reach.np_random.bit_generator.state
    with pytest.raises(ValueError, match=message):
        reach.reset(seed=1, options=options)
    assert reach.np_random.bit_generator.state == before


@pytest.mark.parametrize("jitter", [-0.001, 0.06, np.nan, np.inf, None, "little", [0.01]], ids=repr)
def test_a_jitter_that_no_start_can_have_is_refused(jitter):
    with pytest.raises(ValueError, match=r"jitter=.*: give metres, from 0 to 0.05."):
        make("push", jitter=jitter)


def test_unknown_arm_observation_and_render_mode_are_refused():
    with pytest.raises(ValueError, match=r"embodiment=\['robot'\]: choose 'robot' or 'human'."):
        tasks.module("reach").Reach(embodiment=["robot"])
    with pytest.raises(ValueError, match=r"observation='depth': choose 'rgb' or 'state'."):
        tasks.module("reach").Reach(observation="depth")
    with pytest.raises(UnsupportedMode, match=r"render_mode='bogus': choose 'rgb_array' or None."):
        tasks.module("reach").Reach(render_mode="bogus")


def test_calls_in_the_wrong_order_say_what_to_do():
    env = make("reach", render_mode="rgb_array")
    with pytest.raises(ResetNeeded, match=r"step\(\) before reset\(\): call reset\(\) first."):
        env.step(np.zeros(3))
    env.reset(seed=0)
    env.close()
    env.close()
    for name, call in (
        ("step", lambda: env.step(np.zeros(3))), ("reset", env.reset), ("render", env.render),
    ):  # fmt: skip
        with pytest.raises(
            ClosedEnvironmentError, match=rf"{name}\(\) after close\(\): make a new"
        ):
            call()


COPIES = {"deepcopy": copy.deepcopy, "pickle": lambda env: pickle.loads(pickle.dumps(env))}


@pytest.mark.parametrize("how", COPIES)
@pytest.mark.parametrize("name", tasks.TASKS)
def test_a_copy_is_an_environment_of_its_own(name, how):
    env = make(name, "human", jitter=0.01)
    env.reset(seed=1)
    twin = COPIES[how](env)
    before = env.true_state()
    with pytest.raises(ResetNeeded):
        twin.step(np.ones(3))
    states = [twin.reset(seed=2)[0], *(twin.step(np.ones(3))[0] for _ in range(5))]
    np.testing.assert_array_equal(env.true_state(), before)
    again = [env.reset(seed=2)[0], *(env.step(np.ones(3))[0] for _ in range(5))]
    np.testing.assert_array_equal(again, states)
    env.close()
    twin.step(np.ones(3))
    twin.close()


def test_an_environment_runs_in_a_process_that_gymnasium_spawns():
    spawn = {"context": "spawn"}
    envs = gym.make_vec(
        "LbW-Push-v0", num_envs=1, vectorization_mode="async", vector_kwargs=spawn, jitter=0.005
    )
    alone = make("push", observation="rgb", jitter=0.005)
    for seed in (3, 4):
        np.testing.assert_array_equal(envs.reset(seed=[seed])[0][0], alone.reset(seed=seed)[0])
    assert envs.step(np.zeros((1, 3), np.float32))[0].shape == (1, 84, 84, 3)
    envs.close()
    alone.close()


def test_a_copy_has_all_of_its_arguments():
    given = {"embodiment": "human", "render_mode": "rgb_array", "observation": "state"}
    env = tasks.module("reach").Reach(**given, jitter=0.01)
    twin = pickle.loads(pickle.dumps(env))
    for name, value in (given | {"jitter": 0.01}).items():
        assert getattr(twin, name) == value, name
    env.close(), twin.close()


@pytest.mark.parametrize("observation", ["rgb", "state"])
@pytest.mark.parametrize("name", tasks.TASKS)
def test_what_is_observed_lies_in_the_space_that_is_announced(name, observation):
    env = make(name, observation=observation)
    seen = [env.reset(seed=0)[0], env.step(np.ones(3))[0]]
    assert all(env.observation_space.contains(x) for x in seen)
    assert env.action_space == gym.spaces.Box(-1, 1, (3,), np.float32)
    if observation == "state":  # what falls or is thrown may be anywhere
        assert env.observation_space == gym.spaces.Box(-np.inf, np.inf, (9,), np.float32)
    env.close()


def test_a_picture_is_given_to_who_asked_for_pictures_25_times_a_second(reach):
    assert reach.render() is None
    env = make("reach", render_mode="rgb_array")
    env.reset(seed=0)
    assert env.render().shape == (84, 84, 3)
    assert env.metadata == {"render_modes": ["rgb_array"], "render_fps": FPS}
    assert pytest.approx(FPS) == 1 / (DT * SUBSTEPS) == 25
    env.close()


def test_a_closed_environments_simulator_is_gone():
    env = make("reach")
    client = env.world.client
    assert pybullet.isConnected(client)
    env.close()
    assert not pybullet.isConnected(client)


def test_numbers_of_other_libraries_are_numbers(reach):
    """NumPy's True, and a tensor; one that wants a gradient has to be asked for its numbers."""
    for value in (True, np.True_):
        reach.reset(seed=0, options={"scatter": value})
    reach.step(torch.zeros(3))
    with pytest.raises(InvalidAction, match="give three finite numbers"):
        reach.step(torch.zeros(3, requires_grad=True))


FALLING = {"push": "cube", "slide": "puck", "coffee": "mug"}


@pytest.mark.parametrize("name", FALLING)
def test_an_object_that_fell_ends_the_episode_and_stays_where_it_is(name):
    env = make(name)
    env.reset(seed=0)
    body = getattr(env, FALLING[name])
    env.world.p.resetBasePositionAndOrientation(body, (0.6, 0.4, 0.1), (0, 0, 0, 1))  # no table
    for _ in range(10):
        state, reward, terminated, truncated, info = env.step(np.zeros(3))
        if terminated:
            break
    assert terminated and info["object_lost"] and not truncated
    assert reward == 0 and not info["is_success"]
    for _ in range(20):
        later, _, terminated, _, info = env.step(np.ones(3))
        np.testing.assert_array_equal(later, state)
        assert terminated and info["object_lost"]
    _, info = env.reset(seed=0)
    assert not info["object_lost"]
    assert not env.step(np.zeros(3))[2]
    env.close()


def test_a_drawer_never_starts_wider_open_than_its_rail_is_long():
    env = make("drawer", jitter=0.05)
    for seed in range(8):
        env.reset(seed=seed)
        assert -0.15 <= env.world.p.getJointState(env.drawer, 0)[0] <= -0.10
    env.close()


@pytest.mark.parametrize(("height", "lost"), [(0.02, False), (-0.002, True)])
def test_an_object_is_lost_as_soon_as_its_middle_is_below_the_tables_top(height, lost):
    """In a step, 40 ms, it falls by 8 mm."""
    env = make("push")
    env.reset(seed=0)
    env.world.p.resetBasePositionAndOrientation(env.cube, (0.6, 0.4, height), (0, 0, 0, 1))
    _, _, terminated, _, info = env.step(np.zeros(3))
    assert terminated == info["object_lost"] == lost
    env.close()


def test_a_killed_process_leaves_no_files(tmp_path):
    code = (
        "import os, signal, tasks, gymnasium as gym; "
        "envs = [gym.make('LbW-Reach-v0', embodiment=arm) for arm in ('robot', 'human')]; "
        "os.kill(os.getpid(), signal.SIGKILL)"
    )
    done = subprocess.run([sys.executable, "-c", code], env=os.environ | {"TMPDIR": str(tmp_path)})
    assert done.returncode == -9
    assert list(tmp_path.iterdir()) == []
