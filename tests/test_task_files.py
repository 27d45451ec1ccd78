"""The task files compute what they computed when the shipped results were made."""

import functools
import sys
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
from digests import digest

import tasks
from lbw_minimal.imitate import Recipe
from lbw_minimal.training import InputError
from tasks import __main__ as kit
from tasks import needs
from tasks.world import expert_actions, film, random_takes

ARMS = ("robot", "human")
every_task = pytest.mark.parametrize("name", tasks.TASKS)


def things(env):
    """All bodies but the arm: what they weigh, where they stand, what is seen and felt of them."""
    p = env.world.p
    for body in map(p.getBodyUniqueId, range(p.getNumBodies())):
        if body != env.arm.body:
            links = range(-1, p.getNumJoints(body))
            yield [
                *np.concatenate(p.getBasePositionAndOrientation(body)),
                *(x for k in links for x in p.getDynamicsInfo(body, k)[:2]),
                *(x for v in p.getVisualShapeData(body) for x in (v[2], *v[3], *v[5], *v[7])),
                *(x for k in links for c in p.getCollisionShapeData(body, k) for x in c[2:4]),
                *(x for k in links[1:] for x in joint(p.getJointInfo(body, k))),
            ]


def joint(info):
    return info[2], *info[6:12], *info[13], *info[14]


def flat(row):
    return np.concatenate([np.ravel(x) for x in row])


def short(metres):
    """To a hundredth of a millimetre, which keeps the files of figures small."""
    return np.round(np.asarray(metres, float), 5)


@every_task
def test_the_scene_is_built_as_it_was(name, make, golden):
    """The robot's things behind the table; of the human's, who has a hundred tiles, the first and
    the last tile and all that is none, in short: its place, its size, its colour."""
    robot = [flat(row) for row in things(make(name, "robot"))]
    count = len(list(things(make(name, "human"))))
    seen = np.array([looks(make(name, "human"), k) for k in range(count)])
    tile = np.isclose(seen[:, 3:6], (0.05, 0.004, 0.05)).all(1)
    tiles = seen[tile] if tile.any() else seen[:1]
    golden(
        {
            "robot's": np.concatenate(robot[1:] or robot),
            "numbers": [len(robot), count, tile.sum()],
            "human's": seen[~tile].round(4),
            "tiles": np.concatenate([tiles[0], tiles[-1], *map(digest, tiles.T)]).round(4),
        },
        atol=1e-5,
    )


def looks(env, k):
    """Place, size and colour of the first shape of the k-th thing."""
    p = env.world.p
    body = [b for b in map(p.getBodyUniqueId, range(p.getNumBodies())) if b != env.arm.body][k]
    shape = p.getVisualShapeData(body)[0]
    return [*p.getBasePositionAndOrientation(body)[0], *shape[3], *shape[7][:3]]


@every_task
def test_the_scene_looks_as_it_did(name, make, golden):
    """Means of 6 x 6 fields of a picture, a step after a start."""
    figures = {}
    for arm in ARMS:
        env = make(name, arm)
        env.reset(seed=1)
        env.step(np.array([1.0, 0, -1]))
        picture = env.world.render()
        fields = picture.reshape(6, 14, 6, 14, 3).mean((1, 3)).round(1)
        # where the human's scene is the robot's in other colours, some of its fields are enough
        figures[arm] = fields if arm == "robot" or name == "coffee" else fields[::2, ::2]
        figures[f"{arm}'s edges"] = digest(np.abs(np.diff(picture.astype(float), axis=1)))
        figures[f"{arm}'s places"] = env.true_pixels()
    golden(figures, atol=0.1)


@every_task
def test_starts_are_drawn_as_they_were(name, golden):
    """Where tip and object start: by jitter, and anywhere; the human's lamp swings meanwhile."""
    figures = {}
    for arm in ARMS:
        env = tasks.bare(name, embodiment=arm, observation="state", jitter=0.05)
        jittered = [env.reset(seed=seed)[0][:6] for seed in range(4)]
        options = {"scatter": True}
        anywhere = [env.reset(seed=seed, options=options)[0][[0, 2, 3]] for seed in range(16)]
        figures[f"{arm}, moved"] = short(jittered if arm == "robot" else jittered[:2])
        figures[f"{arm}, anywhere"] = short(anywhere)
        figures[f"{arm}, drawn next"] = env.np_random.random()
        env.close()
    golden(figures, atol=2e-5)


@pytest.fixture(scope="module")
def experts(make):
    """Recordings of a plain and a human-like expert, by task and arm."""

    @functools.cache
    def experts(name, arm):
        env = make(name, arm)
        rngs = None, np.random.default_rng(1)
        return [film(env, 0, expert_actions(env, rng))[2] for rng in rngs]

    return experts


@every_task
def test_an_expert_means_to_do_what_it_did(name, experts, golden):
    golden(
        {
            f"{arm} {kind}": [len(done.actions), *digest(done.actions[:12]), *done.actions[-1]]
            for arm in ARMS
            for kind, done in zip(("plain", "bent"), experts(name, arm), strict=True)
        },
        atol=2e-3,  # the actions are of where the arm is
    )


@every_task
def test_things_go_where_the_expert_sent_them(name, experts, golden):
    figures = {}
    for arm in ARMS:
        for kind, done in zip(("plain", "bent"), experts(name, arm), strict=True):
            some = done.states[:: max(1, len(done.states) // 5)]
            figures[f"{arm} {kind}: way"] = some[:, [0, 2, 3, 5]].round(4)
            figures[f"{arm} {kind}: done"] = bool(done.success[-1])
    # m: contact makes much of how a processor rounds, and a hit the most
    golden(figures, rtol=0, atol=0.012 if name == "slide" else 4e-3)


@pytest.fixture(scope="module")
def takes(make):
    """Recordings of takes of random motion, the last of them brief, by task and arm."""

    @functools.cache
    def takes(name, arm):
        return [take[2] for take in random_takes(make(name, arm), 190, seed=3, take=25)]

    return takes


@every_task
def test_random_motion_is_drawn_as_it_was(name, takes, golden):
    """Some of the takes begin beside the object, and go towards it for their first half."""
    done = takes(name, "robot")
    golden(
        {
            "seeds": [take.seed for take in done],
            "scattered": all(take.scatter for take in done),
            "frames": [len(take.states) for take in done],
            "actions": np.round([digest(take.actions) for take in done], 4),
        },
        atol=2e-4,
    )


@every_task
def test_random_motion_goes_where_it_went(name, takes, golden):
    golden(
        {
            arm: np.round([take.states[-1, [0, 2, 3]] for take in takes(name, arm)], 4)
            for arm in ARMS
        },
        rtol=0,
        atol=5e-3,  # m: contact makes much of how a processor rounds
    )


@every_task
def test_a_task_states_what_it_stated(name, make, golden):
    """Its recipe, sizes and words, its scene for a person's clip, and its registration."""
    env, module = make(name), tasks.module(name)
    env.reset(seed=0)
    recipe, scene, spec = module.RECIPE, env.scene(), gym.spec(tasks.id_of(name))
    stated = (env.STEP, env.KP, env.OVERSPEED, env.PUSH_AT, env.CONTACT or -1, module.HORIZON)
    golden(
        {
            "recipe": {k: str(v) for k, v in vars(recipe).items() if v != vars(Recipe(0, 0))[k]},
            "scene": {k: str(np.round(v, 6)) for k, v in vars(scene).items() if v is not None},
            "stated": flat([*stated, env.LEASH, env.WORKSPACE, env.START, *env.CAMERA]),
            "target": env.target_position(),
            "words": [tasks.sentence(name), tasks.goal(name), spec.id, str(spec.entry_point)],
            "steps": spec.max_episode_steps,
            "moves": tasks.moves_object(name),
            "legs": flat(
                x for end, seconds, exact in env.waypoints() for x in (end, seconds, exact)
            ),
        }
    )


def nearer(env, gap):
    """The distance to the target is this, and what is asked about moves no more."""
    way = np.array([0.6, 0, 0.8])
    env.object_position = lambda: env.target_position() + gap * way


@pytest.mark.parametrize(("name", "reach"), [("reach", 0.05), ("push", 0.05), ("coffee", 0.07)])
def test_success_begins_at_the_papers_distance(name, reach):
    env = tasks.bare(name, observation="state")
    env.reset(seed=0)
    for gap, done in ((0.99 * reach, True), (1.01 * reach, False)):
        nearer(env, gap)
        assert env.is_success() is done
    env.close()


def test_a_puck_has_to_rest_within_five_centimetres():
    env = tasks.bare("slide", observation="state")
    env.reset(seed=0)
    for gap, speed, done in (
        (0.0495, 0.0195, True), (0.0505, 0.0195, False), (0.0495, 0.0205, False),
    ):  # fmt: skip
        nearer(env, gap)
        env.world.p.resetBaseVelocity(env.puck, (0, speed, 0))
        assert env.is_success() is done
    env.close()


def test_a_drawer_is_shut_from_31_5_millimetres():
    env = tasks.bare("drawer", observation="state")
    env.reset(seed=0)
    for q, done in ((-0.032, False), (-0.0314, True), (0.0, True)):
        env.world.p.resetJointState(env.drawer, 0, q)
        assert env.is_success() is done
    env.close()


# The package and its command line -----------------------------------------------------------------


def test_the_package_names_what_it_named(golden):
    root = tasks.ROOT
    golden(
        {
            "tasks": list(tasks.TASKS),
            "experts": tasks.ROBOT_EXPERTS,
            "folders": [p.relative_to(root).as_posix() for p in (tasks.VIDEOS, tasks.WEIGHTS)],
            "root": (root / "pyproject.toml").exists(),
            "ids": [tasks.id_of(name) for name in ("push", "pour_tea")],
            "needs": list(needs.NEEDS),
            "overview": kit.overview().splitlines(),
        }
    )


def test_a_command_line_goes_to_its_task_or_command_and_says_how_it_ended(monkeypatch, capsys):
    """What remains of it goes along; a mistake is a sentence on stderr, and 2."""
    told = []

    class Module:
        def __init__(self, name):
            self.name = name

        def main(self, *given):
            told.append((self.name, *given))
            if given[-1] == ["--bad"]:
                raise InputError("a mistake.")
            return 5 if given[-1] == ["--five"] else None

    monkeypatch.setattr(kit, "import_module", Module)
    monkeypatch.setattr(sys, "argv", ["tasks", "push", "--fast"])
    codes = [kit.main(), kit.main(["coffee", "--five"]), kit.main(["table"])]
    codes += [
        kit.main(["table", "--five"]),
        kit.main(["reach", "--bad"]),
        kit.main(["eyes", "--bad"]),
    ]
    assert codes == [0, 0, 0, 5, 2, 2]
    assert told == [
        ("tasks.commands.run", "push", ["--fast"]), ("tasks.commands.run", "coffee", ["--five"]),
        ("tasks.commands.table", []), ("tasks.commands.table", ["--five"]),
        ("tasks.commands.run", "reach", ["--bad"]), ("tasks.commands.eyes", ["--bad"]),
    ]  # fmt: skip
    assert capsys.readouterr() == ("", "error: a mistake.\nerror: a mistake.\n")
    assert kit.main(["pull"]) == 2
    there = ", ".join((*tasks.TASKS, *kit.COMMANDS))
    assert capsys.readouterr().err == (
        f"error: pull: there is no such task or command; choose one of {there}.\n"
    )
    for asked in (["-h"], ["--help", "push"], []):
        assert kit.main(asked) == 0
        assert capsys.readouterr().out == kit.overview() + "\n"


def test_what_a_task_lacks_is_said_or_left_empty(monkeypatch):
    """A file without words has no sentence; a scene of an own camera closes; a name is needed."""
    module = type("Module", (), {"__doc__": "One\n  line. \n\nAnother."})
    monkeypatch.setattr(tasks, "module", lambda name: module)
    assert tasks.sentence("x") == "One line."
    module.__doc__ = None
    assert tasks.sentence("x") == ""
    module.Pour = type("Pour", (), {"GOAL": "", "CONTACT": 0.0})
    assert tasks.goal("pour") == "" and tasks.moves_object("pour") is True
    with pytest.raises(InputError) as told:
        tasks.keypoint_env("pour")
    assert str(told.value) == (
        "pour: there is no such task; choose one of reach, push, slide, coffee, drawer."
    )


def test_experts_are_counted_by_their_name_and_filmed_with_the_jitter(monkeypatch):
    asked = []
    monkeypatch.setattr(tasks, "counted", lambda things, *of: asked.append(of) or things)
    monkeypatch.setattr("tasks.world.expert_takes", lambda env, n: [(n, "pixels", env.jitter)])
    assert list(tasks.robot_experts("push", 0.02)) == [(35, 0.02)]
    assert asked == [(35, "robot experts")]


def test_an_environment_of_an_own_reward_is_the_tasks(monkeypatch):
    """Its arguments go along, whatever pays."""
    monkeypatch.setattr(
        "lbw_minimal.imitate.load_perception",
        lambda folder, name: SimpleNamespace(detect=lambda frames: np.zeros((len(frames), 5, 2))),
    )
    env = tasks.keypoint_env("reach", None, jitter=0.02, embodiment="human")
    assert (env.unwrapped.jitter, env.unwrapped.embodiment) == (0.02, "human")
    assert env.reset(seed=0)[0].shape == (10,) and env.spec.max_episode_steps == 50
    env.close()


def test_only_a_seed_begins_the_draws_anew():
    """Episodes without one go on with what is drawn; another environment draws the same."""

    def starts():
        env = tasks.bare("push", observation="state", jitter=0.05)
        seen = [env.reset(seed=3)[0], env.reset()[0], env.reset()[0], env.reset(seed=0)[0]]
        env.close()
        return np.array(seen)

    first = starts()
    np.testing.assert_array_equal(first, starts())
    assert len(np.unique(first, axis=0)) == 4


def test_only_a_scattered_start_is_moved_out_of_contact(monkeypatch):
    env = tasks.bare("push", observation="state")
    before = env.reset(seed=0)[0]
    monkeypatch.setattr(env, "contact", lambda: 0.01)
    np.testing.assert_array_equal(env.reset(seed=0)[0], before)
    assert env.reset(seed=0, options={"scatter": True})[0][0] == pytest.approx(0.43, abs=1e-4)
    env.close()


@pytest.mark.parametrize(
    ("x", "z", "moved"), [(0.471, 0.124, True), (0.471, 0.126, False), (0.467, 0.124, False)]
)
def test_a_tip_that_would_start_in_the_drawer_is_put_before_it(x, z, moved):
    """Open by 15 cm its handle begins at 49.3 cm; 2 cm above its front there is room."""
    env = tasks.bare("drawer", observation="state")
    env.reset(seed=0)
    env.np_random = SimpleNamespace(uniform=lambda low, high: low)
    env.arm.reset(np.array([x, 0, z]))
    env.place(np.zeros(3), True)
    assert env.object_position()[0] == pytest.approx(0.493)
    assert env.arm.goal.tolist() == pytest.approx([0.43 if moved else x, 0, z])
    env.close()
