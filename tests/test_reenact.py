"""A clip's motion, done by the simulated human: every task is done, at other paces, too."""

from dataclasses import replace

import numpy as np
import pytest
from toy_pushes import seen

from lbw_minimal.clips.paths import Unusable, interpolate
from lbw_minimal.clips.retarget import lay
from tasks import TASKS, bare
from tasks.world import record_expert
from tasks.world.reenact import reenact

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
