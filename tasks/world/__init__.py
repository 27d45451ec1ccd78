"""What the five tasks share: the scene, the two arms, their controller, and who moves them.

`scene` holds table, camera and shapes, `bodies` the arms' models, `arm` the controller, `env` the
Gymnasium environment, `motion` the expert and random motion, `recording` what is kept of an
episode, `viewer` the scene in a browser. A task file and a notebook take the names below from here.
"""

from tasks.world.env import Leg, TaskEnv
from tasks.world.motion import (
    expert_actions,
    expert_takes,
    random_actions,
    random_takes,
    record_expert,
    record_random,
)
from tasks.world.recording import Recording, film, load_recordings, save_recordings
from tasks.world.scene import DT, FINGER, GREEN, RED, SIZE, SUBSTEPS, Part, World

__all__ = [
    "DT",
    "FINGER",
    "GREEN",
    "RED",
    "SIZE",
    "SUBSTEPS",
    "Leg",
    "Part",
    "Recording",
    "TaskEnv",
    "World",
    "expert_actions",
    "expert_takes",
    "film",
    "load_recordings",
    "random_actions",
    "random_takes",
    "record_expert",
    "record_random",
    "save_recordings",
]
