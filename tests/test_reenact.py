"""A clip's motion, done by the simulated human: every task is done, at other paces, too."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from toy_pushes import HIT, SCENE, seen

from lbw_minimal.clips.paths import Unusable, interpolate
from lbw_minimal.clips.retarget import Motion, lay
from tasks import TASKS, bare
from tasks.world import Recording, record_expert
from tasks.world import reenact as module
from tasks.world.reenact import commands, reenact

SCALE = 5  # times the kit's frames of 84 pixels: the size of the clip


def laid(name, **options):
    """A task's environment, and the motion of its expert's clip in its scene."""
    env = bare(name, embodiment="human", observation="state")
    env.reset(seed=0)
    scene = env.scene()
    return env, lay(expert(env, **options), scene)


def expert(env, fps=30.0, speed=1.0, mirror=False, noise=0.0):
    """The tracks of a clip in which the task's expert is filmed, at `speed` times its speed."""
    _, pixels, recording = record_expert(env, 3)
    s = np.arange(0, recording.times[-1] / speed, 1 / fps)
    world = (SCALE * interpolate(recording.times, pixels[:, i : i + 2], s * speed) for i in (0, 2))
    flip = [[-1, 0, 84 * SCALE], [0, 1, 0]] if mirror else np.eye(2, 3)
    return replace(seen(tuple(world), s, np.array(flip, float), noise), side=84 * SCALE)


@pytest.mark.parametrize("name", TASKS)
def test_an_experts_clip_mirrored_and_slower_does_the_task_again(name):
    env, motion = laid(name, fps=20, speed=0.8, mirror=True, noise=1.5)
    done = reenact(env, motion)
    end = done.recording.states[-1]
    assert done.recording.success[-1] and motion.mirrored
    assert np.linalg.norm(end[3:6] - end[6:9]) < 0.025  # m, well within success
    assert env.observation == "state" and len(done.frames) == len(done.recording.states)


def test_a_hit_that_is_too_weak_is_done_faster_and_the_user_is_told():
    done = reenact(*laid("slide", fps=60, speed=0.5))
    assert done.recording.success[-1]
    assert "as filmed it is too weak" in done.warnings[-1]
    factor = float(done.warnings[-1].split(" times")[0].split()[-1])
    assert 1.7 < factor < 3


def test_a_motion_that_does_not_do_the_task_is_refused():
    env, motion = laid("push")
    high = replace(motion, tip=np.stack([motion.tip[:, 0], np.full(len(motion.tip), 0.15)], 1))
    with pytest.raises(Unusable, match="ends 15 cm from the goal"):
        reenact(env, high)


def along(*x, contact=1, arrival=3):
    """A motion of the tip along x at 2 cm, with an object."""
    tip = np.stack([np.array(x, float), np.full(len(x), 0.02)], 1)
    return Motion(tip, tip, np.arange(len(x)) / 25, contact, arrival, np.eye(2, 3), False)


class Table:
    """An environment of which only the tip's goal is there."""

    STEP = 2.0

    def __init__(self, scene):
        self.scene, self.arm = lambda: scene, SimpleNamespace(goal=np.array([0.0, 0, 0.02]))

    begun = 0

    def reset(self, seed):
        assert seed == 0
        self.begun += 1


def ended(at, start=0.0, goal=1.0, done=True):
    """What is recorded when the object goes from `start` to `at`."""
    states = np.zeros((2, 9))
    states[:, 3], states[:, 6] = (start, at), goal
    return Recording(0, False, None, states, None, np.array([False, done]))


def test_the_goal_follows_the_motion_and_runs_ahead_of_it_from_contact_to_arrival():
    env, goals = Table(SCENE), []
    for action in commands(env, along(0, 1, 2, 3, 3), further=0.4):
        env.arm.goal = env.arm.goal + env.STEP * action
        goals.append(env.arm.goal.tolist())
    wanted = [[x, 0, 0.02] for x in (1, 2.2, 3.4, 3.4)]
    assert np.array(goals) == pytest.approx(np.array(wanted), abs=1e-6)
    (far,), (back,) = (commands(Table(SCENE), along(0, x)) for x in (9, -9))
    assert far.tolist() == [1, 0, 0] and back.tolist() == [-1, 0, 0]


def test_after_a_hit_the_hand_rests_for_as_long_as_a_puck_slides():
    actions = list(commands(Table(HIT), along(0, 0, 0)))
    assert len(actions) == 2 + 40 and not np.any(actions)


def test_a_hit_alone_becomes_faster_from_the_run_up_to_the_stop():
    motion = along(0, 0, 0, 0, 1, 2, 2, 2, contact=4, arrival=5)
    fast, slow = (module._faster(motion, factor).tip[:, 0] for factor in (2.0, 0.5))
    assert fast.tolist() == pytest.approx([0, 0, 0, 0, 2, 2, 2])
    assert slow.tolist() == pytest.approx([0, 0, 0, 0, 0.5, 1, 1.5, 2, 2, 2])
    at_once = module._faster(along(0, 1, 2, 2), 0.5).tip[:, 0]
    assert at_once.tolist() == pytest.approx([0, 0.5, 1, 1.5, 2, 2])


def rehearsing(monkeypatch, end):
    """Rehearsals end as `end` says of how much farther, or faster, the motion is; they are told."""
    asked = []

    def rehearse(env, motion, further=0.0):
        value = motion if isinstance(motion, float) else further
        asked.append(value)
        return end(value)

    monkeypatch.setattr(module, "_rehearse", rehearse)
    monkeypatch.setattr(module, "_faster", lambda motion, factor: factor)
    return asked


def test_a_push_goes_on_by_what_was_missing_until_it_is_within_a_centimetre(monkeypatch):
    """The object follows by half: 3, 1.5, 0.75 cm are missing. Then one that hardly follows."""
    asked = rehearsing(monkeypatch, lambda further: ended(0.97 + further / 2))
    assert module._measured_push(None, None) == (pytest.approx(0.045), True)
    assert asked == pytest.approx([0, 0.03, 0.045])
    asked = rehearsing(monkeypatch, lambda further: ended(0.9 + 0.05 * further))
    further, _ = module._measured_push(None, None)
    assert asked == pytest.approx([0, 0.1]) and further == asked[1]
    asked = rehearsing(monkeypatch, lambda further: ended(0.9 + 0.12 * further))
    module._measured_push(None, None)
    assert len(asked) == 6


def test_of_all_pushes_one_that_does_the_task_is_taken(monkeypatch):
    rehearsing(monkeypatch, lambda further: ended(0.95 + 0.2 * further, done=further < 0.06))
    assert module._measured_push(None, None)[1]
    rehearsing(monkeypatch, lambda further: ended(0.97, done=False))
    assert not module._measured_push(None, None)[1]


@pytest.mark.parametrize(
    ("reached", "factor", "word"),
    [
        (2.0, 2.0, "weak"), (0.5, 0.5, "strong"), (1.4, 1.4, ""), (0.7, 0.7, ""),
        (9.0, 4.0, "weak"), (0.1, 0.25, "strong"),
    ],
)  # fmt: skip
def test_a_hit_is_as_fast_as_the_object_needs(monkeypatch, reached, factor, word):
    """From 0.5 m to the goal at 1 m, which the hit reaches at `reached` times its speed."""
    asked = rehearsing(monkeypatch, lambda f: ended(0.5 + 0.5 * (f / reached) ** 2, start=0.5))
    notes, warnings = [], []
    assert module._timed_hit(None, None, notes, warnings) == pytest.approx(factor, rel=0.01)
    (text,) = notes + warnings
    assert bool(warnings) == bool(word) and word in text
    assert len(asked) <= 8 and asked[0] == 1


def test_between_a_weak_hit_and_a_strong_one_is_the_next(monkeypatch):
    """An arm that yields: the object gets to 4/5 of its way at first, and hardly farther with each
    tenth of speed; where it is hit too hard it leaps."""
    ends = {1.0: 0.8, 1.25: 0.9, 1.25 / 0.9: 0.95}
    asked = rehearsing(monkeypatch, lambda f: ended(ends.get(f, 1.4 if f > 1.45 else 1.005)))
    factor = module._timed_hit(None, None, [], [])
    assert asked[:4] == pytest.approx([1, 1.25, 1.25 / 0.9, 1.25 / 0.9 / 0.95])
    assert asked[4:] == pytest.approx([np.sqrt(asked[2] * asked[3])]) and factor == asked[4]


def test_a_hit_that_misses_is_done_as_fast_as_can_be(monkeypatch):
    """The object has not moved, so there is no proportion to tell how much faster."""
    asked = rehearsing(monkeypatch, lambda f: ended(1.0 if f > 3 else 0.5, start=0.5))
    assert module._timed_hit(None, None, [], []) == 4 and asked == [1, 4]


@pytest.mark.parametrize(("weak", "strong"), [(0.97, 1.2), (0.8, 1.02)])
def test_of_all_hits_the_one_that_came_nearest_is_done(monkeypatch, weak, strong):
    """However often: here a weak one and a strong one lead to the same two places for ever."""
    asked = rehearsing(monkeypatch, lambda f: ended(weak if f < 1.22 else strong))
    factor = module._timed_hit(None, None, [], [])
    assert (factor < 1.22) == (weak == 0.97) and len(asked) == 12


@pytest.mark.parametrize(
    ("reached", "odd"), [(1.45, False), (1.55, True), (0.69, False), (0.65, True)]
)
def test_a_hit_of_half_as_much_again_is_worth_a_warning(monkeypatch, reached, odd):
    rehearsing(monkeypatch, lambda f: ended((f / reached) ** 2))
    notes, warnings = [], []
    module._timed_hit(None, None, notes, warnings)
    assert (len(notes), len(warnings)) == ((0, 1) if odd else (1, 0))


def test_a_slow_run_up_belongs_to_the_hit():
    """A fifth of the top speed is no rest: at twice the speed it takes half as long, too."""
    motion = along(0, 0, 0.2, 0.4, 1.4, 2.4, 2.4, contact=4, arrival=5)
    assert module._faster(motion, 2.0).tip[:, 0].tolist() == pytest.approx([0, 0, 0.4, 2.4, 2.4])


def test_an_object_that_arrives_at_once_is_led_a_step_later():
    env, goals = Table(SCENE), []
    for action in commands(env, along(0, 1, 1, 1, contact=1, arrival=1), further=0.4):
        env.arm.goal = env.arm.goal + env.STEP * action
        goals.append(env.arm.goal[0])
    assert goals == pytest.approx([1, 1.4, 1.4])


def test_a_rehearsal_looks_at_no_picture_and_the_performance_does(monkeypatch):
    env, seen = Table(SCENE), []
    env.observation = "rgb"

    def film(env, seed, actions):
        seen.append((env.observation, seed, len(list(actions))))
        if len(seen) == 2:
            raise KeyboardInterrupt
        return None, None, "recording"

    monkeypatch.setattr(module, "film", film)
    assert module._rehearse(env, along(0, 1, 2)) == "recording" and env.observation == "rgb"
    with pytest.raises(KeyboardInterrupt):
        module._rehearse(env, along(0, 1, 2))
    assert env.observation == "rgb" and seen == 2 * [("state", 0, 2)]


def test_a_push_that_fails_is_done_again_at_two_thirds_of_the_pace(monkeypatch):
    motion, results = along(0, 1, 2, 2), iter([(0.0, False), (0.02, True)])
    monkeypatch.setattr(module, "_measured_push", lambda env, motion: next(results))
    monkeypatch.setattr(module, "film", lambda env, seed, actions: (None, None, ended(1.0)))
    env = Table(SCENE)
    done = reenact(env, motion)
    assert env.begun == 1  # a scene is told as it is after a reset
    assert done.motion.tip[:, 0].tolist() == pytest.approx([0, 2 / 3, 4 / 3, 2, 2, 2])
    assert "1.5 times slower" in done.warnings[0] and "aims 2.0 cm farther" in done.notes[0]
    monkeypatch.setattr(module, "_measured_push", lambda env, motion: (-0.02, True))
    assert "aims 2.0 cm less far than the clip's hand" in reenact(env, motion).notes[0]
    monkeypatch.setattr(module, "_measured_push", lambda env, motion: (0.009, True))
    done = reenact(Table(SCENE), motion)
    assert done.motion is motion and not done.notes + done.warnings


def slides(scale, power=2.0, most=9.0):
    """How far a thing goes of its way of 1 with a hit so many times as fast."""
    return lambda factor: ended(min(scale * factor**power, most), start=0.0, goal=1.0)


def test_hits_and_pushes_are_tried_as_they_were(monkeypatch, golden):
    """The guesses in their order, what is taken, and what is said of it; by seven tables."""
    figures = {}
    for name, end in {
        "weak": slides(0.3), "strong": slides(5.0), "steep": slides(0.02, 5.0),
        "never": slides(1e-4), "always": slides(40.0, 0.1), "exact": slides(0.995),
        "odd": slides(0.42, 1.0),
    }.items():  # fmt: skip
        asked, notes, warnings = rehearsing(monkeypatch, end), [], []
        taken = module._timed_hit(None, None, notes, warnings)
        figures[f"hit {name}"] = [*asked, taken]
        figures[f"hit {name}: said"] = notes + warnings
    for name, (give, done) in {
        "soon": (1.0, True), "slow": (0.6, True), "over": (1.8, True), "no nearer": (0.05, True),
        "undone": (0.5, False),
    }.items():  # fmt: skip

        def end(further, give=give, done=done):
            return ended(0.9 + give * further, done=done or further > 0.12)

        asked = rehearsing(monkeypatch, end)
        further, success = module._measured_push(None, None)
        figures[f"push {name}"] = [*asked, further, success]
    golden(figures)


def test_a_motion_is_led_and_hurried_as_it_was(golden):
    """Contact in the middle, arrival before the end; a run-up that creeps, a hand that recoils."""
    rng = np.random.default_rng(0)
    x = np.cumsum(np.r_[0, 0.001, 0, rng.uniform(0.005, 0.06, 9), -0.01, -0.02, 0.0, 0.0])
    tip = np.stack([0.45 + x, 0.08 + 0.02 * np.sin(np.arange(len(x)))], 1)
    times = np.arange(len(x)) / 25
    motion = Motion(tip, tip, times, 5, 11, np.eye(2, 3), False)
    figures = {}
    for name, scene in (("push", SCENE), ("hit", HIT)):
        env = Table(scene)
        env.STEP, rows = 0.08, []
        for action in commands(env, motion, further=0.05):
            assert action.dtype == np.float32
            env.arm.goal = env.arm.goal + 0.9 * env.STEP * action
            rows.append([*action])
        figures[name] = np.round(rows[:16], 4)
        figures[f"{name}: steps"] = len(rows)
    for factor in (0.4, 1.0, 1.7):
        fast = module._faster(motion, factor)
        figures[f"{factor}"] = [len(fast.tip), *fast.tip[::4, 0], *fast.tip[-1]]
    constants = "TRIES", "SWINGS", "CLOSE", "COAST", "ODD", "SLOWER"
    figures["numbers"] = [*(getattr(module, name) for name in constants), *module.SPEEDS]
    golden(figures, atol=1e-4)


@pytest.mark.parametrize("name", ["push", "coffee", "drawer"])
def test_a_persons_push_is_done_again_as_it_was(name, golden):
    """A quick one with a hand that stops too soon; how it goes hangs on contact."""
    env, motion = laid(name, fps=25, speed=1.1)
    env.reset(seed=0)
    x = motion.tip[:, 0]
    short = np.stack([x - 0.012 * (x - x[0]) / (x[-1] - x[0]), motion.tip[:, 1]], 1)
    done = reenact(env, replace(motion, tip=short))
    golden(
        {
            "steps": len(done.recording.actions),
            "frames": len(done.frames) - len(done.recording.states),
            "seed": done.recording.seed,
            "way": done.recording.states[::12, [0, 2, 3]].round(3),
            "warnings": len(done.warnings),
            "notes": len(done.notes),
            "done": bool(done.recording.success[-1]),
        },
        rtol=0,
        atol=5e-3,
    )
    env.close()


def test_what_is_not_done_at_the_end_is_told_by_how_far(monkeypatch):
    states = np.zeros((2, 9))
    states[-1, 3:6], states[-1, 6:9] = (0.5, 0.1, 0), (0.62, 0, 0.1)
    failed = Recording(0, False, None, states, None, np.array([True, False]))
    monkeypatch.setattr(module, "_measured_push", lambda env, motion: (0.02, True))
    monkeypatch.setattr(module, "film", lambda env, seed, actions: (None, None, failed))
    with pytest.raises(Unusable) as told:
        reenact(Table(SCENE), along(0, 1, 2))
    assert "the motion ends 19 cm from the goal" in str(told.value)
    assert "film one steady motion from the start to the goal" in f"{told.value} {vars(told.value)}"


@pytest.mark.parametrize(
    ("scene", "steps", "said"),
    [(HIT, 13, "goes along with the object for 0.5 s"), (HIT, 12, "the motion ends 41 cm"),
     (SCENE, 13, "the motion ends 41 cm")],
)  # fmt: skip
def test_a_hand_that_goes_along_for_more_than_half_a_second_has_not_hit(
    scene, steps, said, monkeypatch
):
    """It is told so if the object does not get there; a push goes along to its end."""
    states = np.zeros((2, 9))
    states[-1, 6] = 0.41
    failed = Recording(0, False, None, states, None, np.array([False, False]))
    monkeypatch.setattr(module, "_timed_hit", lambda env, motion, notes, warnings: motion)
    monkeypatch.setattr(module, "_measured_push", lambda env, motion: (0.0, True))
    monkeypatch.setattr(module, "film", lambda env, seed, actions: (None, None, failed))
    with pytest.raises(Unusable) as told:
        reenact(Table(scene), along(0, *range(steps + 1), steps, steps))
    assert said in str(told.value) and "41 cm from the goal" in str(told.value)


def test_a_slow_hand_that_goes_along_with_a_puck_is_told_so():
    """For six tenths of its way, in a second; in 0.3 s it is a hit."""
    env = bare("slide", embodiment="human", observation="state")
    env.reset(seed=0)
    scene = env.scene()
    (x, z), way = scene.start, scene.goal[0] - scene.start[0]
    for seconds in (1.0, 0.3):
        t = np.arange(0, seconds + 2.6, 1 / 30)
        gone = 0.6 * np.clip((t - 1) / seconds, 0, 1)
        glides = 0.4 * (1 - (1 - np.clip((t - 1 - seconds) / 0.8, 0, 1)) ** 2)
        tip = x - scene.contact + way * gone - 0.05 * np.clip(1 - t, 0, 1)
        tip, puck = (
            np.stack([tip, 0 * t + z], 1),
            np.stack([x + way * (gone + glides), 0 * t + z], 1),
        )
        motion = lay(seen((tip, puck), t), scene)
        if seconds == 0.3:
            assert reenact(env, motion).recording.success[-1]
        else:
            with pytest.raises(Unusable, match=r"goes along .* pushed and not hit: done again, it"):
                reenact(env, motion)
    env.close()


def test_a_push_that_was_done_on_the_way_and_is_not_at_the_end_failed(monkeypatch):
    """A mug that reached its place and fell over later, however near it lies."""
    end = ended(0.995)
    rehearsing(monkeypatch, lambda further: end._replace(success=np.array([True, False])))
    assert module._measured_push(None, None) == (0.0, False)
