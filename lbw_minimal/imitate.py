from dataclasses import dataclass
@dataclass(frozen=True)
class Recipe:
    human_frames: int
    robot_frames: int
