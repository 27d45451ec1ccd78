"""Star 8, put out the lamp: how much of it is left in a film, and what has it cost the rest?"""

import functools

import numpy as np

import tasks
from tasks.world import record_expert
from tests.grade.star import Star, shaped

# Of the lamp, one a film: its own, and one like the arm's, the tiles' and the mug's.
COLOURS = (0.8, 0.7, 0.35), (0.75, 0.53, 0.42), (0.6, 0.55, 0.48), (0.78, 0.12, 0.1)
AWAY = 0.0, -9.0, 0.0  # m, behind the camera


def left(put_out) -> float:
    """How far put_out(film) is from the film without a lamp, as a share of how far the film is."""
    shares = []
    for lit, dark in films():
        done = shaped(put_out(lit.copy()), lit, "the film")
        shares.append(np.abs(done - dark).sum() / np.abs(lit.astype(float) - dark).sum())
    return float(np.mean(shares))


@functools.cache
def films() -> list[tuple[np.ndarray, np.ndarray]]:
    """The human's films (T, 84, 84, 3) uint8, and the same without the lamp."""
    env, found = tasks.bare("coffee", embodiment="human"), []
    swing = env.swing
    for seed, colour in enumerate(COLOURS):
        env.world.p.changeVisualShape(env.lamp, -1, rgbaColor=(*colour, 1))
        env.swing = swing
        lit = record_expert(env, seed)[0]
        env.swing = lambda: env.world.p.resetBasePositionAndOrientation(
            env.lamp, AWAY, (0, 0, 0, 1)
        )
        found.append((lit, record_expert(env, seed)[0]))
    env.close()
    return found


STAR = Star(left, "of the lamp", bar=0.2, naive=0.46, ours=0.103)
