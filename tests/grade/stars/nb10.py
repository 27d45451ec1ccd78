"""Star 10, eyes or clock: does a control tell robots that look from robots that do not?"""

import numpy as np

from tests.grade.star import Star

ROBOTS, PLAYS = 200, 30  # episodes that may be played with each
NEAR = 0.2  # how near to the thing is a success
CAMERAS = ("open", "grey", "other")


class Robot:
    """A robot in a world of one line: a thing lies at x, and it has to end near x.

    looks: whether it goes where it sees the thing; else it goes to the middle, and `reach` is how
    much farther than NEAR it sweeps things up there. shy: whether a grey picture stops it, for it
    never saw one. clumsy: how often it fails whatever it sees.
    """

    def __init__(self, rng: np.random.Generator):
        self.rng, self.plays = rng, 0
        self.looks, self.shy = rng.random() < 0.5, rng.random() < 0.5
        self.reach = 0.0 if self.looks else rng.choice([0.0, 0.3, 1.0])
        self.clumsy = rng.uniform(0, 0.4)

    def play(self, camera: str, spread: float) -> bool:
        """Whether an episode succeeds with x in -spread to spread, at most 1.

        camera: "open"; "grey"; "other", which shows another episode. Raises RuntimeError after
        PLAYS episodes.
        """
        if camera not in CAMERAS or not 0 <= spread <= 1:
            raise ValueError(f"camera={camera!r}, spread={spread!r}: {CAMERAS}, and from 0 to 1.")
        if self.plays == PLAYS:
            raise RuntimeError(f"{PLAYS} episodes are all that there are")
        self.plays += 1
        x, other = self.rng.uniform(-spread, spread, 2)
        shown = {"open": x, "other": other, "grey": 0.0}[camera]
        goes = shown + self.rng.normal(0, 0.05) if self.looks else 0.0
        fails = self.rng.random() < self.clumsy or (camera == "grey" and self.shy)
        return bool(abs(goes - x) < NEAR + self.reach and not fails)


def right(sees) -> float:
    """Share of the robots of which sees(play) says rightly whether they look."""
    said = []
    for seed in range(ROBOTS):
        robot = Robot(np.random.default_rng(seed))
        said.append(bool(sees(robot.play)) == robot.looks)
    return float(np.mean(said))


STAR = Star(right, "of the robots", bar=0.95, naive=0.87, ours=0.98)
