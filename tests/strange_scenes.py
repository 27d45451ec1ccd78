"""The tasks' scenes with another person, room, light and camera, for `strangers.py`.

The kit's simulated human does the task, or what a story has it do (`strange_stories.py`); but the
camera is turned by up to 10 degrees and up to 20 % nearer or farther, skin, sleeve, thing and table
have other colours and surfaces, and a painted wall stands behind. Half of the films are mirrored.
"""

import cv2
import numpy as np

import tasks
from tasks.world import expert_actions
from tasks.world.scene import CAMERA_FOV, CAMERA_PITCH, FPS, numbers
from tests import strange_rooms as paint
from tests.strange_stories import Moment, Tool, people, staged, story

FAR = 0.999  # of the depth, 1 where nothing is


def film(rng, task, h, w, rate, kind="usable", tool=False):
    """Pictures (T, h, w, 3) uint8, and the paths (T, 2) of tip and object in their pixels.

    The camera sees the kit's picture in the middle, and half as much again around it. kind: one of
    the trial's; here a camera that moves and a clip that is cut short are as a usable one. tool:
    whether the hand holds one.
    """
    env = tasks.bare(task, embodiment="human", observation="state", jitter=0.01)
    start, actions = _rehearsed(rng, env)
    plain = kind in ("usable", "pan", "zoom", "carried about", "short")
    steep = kind == "steep" and task != "reach"
    env.reset(seed=start)
    if (plain and not tool) or steep:
        env.world.show_scenery(True)
        look = _Look(rng, env, [env.arm], h, w, steep)
        tips = _acted(env, actions)
    else:
        done = [Moment(tip, env.object_position()) for tip in _acted(env, actions)]
        env.reset(seed=start)
        told = done if plain else story(rng, env, kind, done)
        env.world.show_scenery(True)
        arms = people(rng, env, kind, told)
        look = _Look(rng, env, arms, h, w)
        tips = staged(env, told, arms, Tool(rng, env.world) if tool else None)
    pictures, places = [], []
    pace = rng.uniform(0.75, 1.25) if task != "slide" else rng.uniform(0.9, 1.1)
    due = 0.0  # s of the film's clock
    rest = round(rng.uniform(0.1, 0.4) * rate)
    for t, tip in enumerate(tips):
        while due <= t / FPS / pace:
            again = rest if not pictures else 0
            picture, place = look.picture(tip)
            pictures += [picture] * (1 + again)
            places += [place] * (1 + again)
            due += 1 / rate
    env.close()
    pictures, places = np.stack(pictures), np.stack(places)
    if rng.random() < 0.5:
        pictures = pictures[:, :, ::-1]
        places[..., 0] = w - places[..., 0]
    return pictures, places[:, 0], places[:, 1]


def _rehearsed(rng, env):
    """A seed, and the actions with which the task is done from there."""
    while True:
        start = int(rng.integers(1 << 30))
        env.reset(seed=start)
        actions = []
        for action in expert_actions(env, rng):
            actions.append(action)
            env.step(action)
        actions += [np.zeros(3)] * (35 if type(env).__name__ == "Slide" else 8)
        if [env.step(np.zeros(3)) for _ in actions[-35:]] and env.is_success():
            return start, actions


def _acted(env, actions):
    """Do the actions, and yield the tip (3,) m before each and in the end."""
    yield env.arm.tip_pose()[0]
    for action in actions:
        env.step(action)
        yield env.arm.tip_pose()[0]


class _Look:
    """How the scene is seen: other colours, surfaces, light and camera."""

    def __init__(self, rng, env, arms, h, w, steep=False):
        self.env, self.size, p = env, (h, w), env.world.p
        (x, y, z), distance = env.CAMERA
        turned = rng.uniform(-10, 10), CAMERA_PITCH + rng.uniform(-8, 5)
        if steep:  # from the front and from above; from behind the arm would hide the thing
            turned = rng.uniform(65, 80), rng.uniform(-50, -38)
        distance *= rng.uniform(0.8, 1.2)
        self.view = p.computeViewMatrixFromYawPitchRoll(
            (x, y, z), distance, yaw=turned[0], pitch=turned[1], roll=0, upAxisIndex=2
        )
        # The kit's field of view is the shorter side of what the camera sees in the middle.
        wide = 1.5 * h / (h / 1.5 if h <= w else w / 1.5) * np.tan(np.radians(CAMERA_FOV / 2)) / 1.5
        fov = 2 * np.degrees(np.arctan(wide))
        self.projection = p.computeProjectionMatrixFOV(fov, w / h, 0.3, 3.0)
        self.light = rng.uniform((-1, -1.5, 0.8), (1, -0.3, 2))
        self.wall = paint.wall(rng, h, w)
        self.grain = 1 + rng.uniform(0.0, 0.07) * paint.fbm(rng, h, w, (6, 40, 160))
        self.ambient = rng.uniform(0.4, 0.7)
        for arm in arms:
            self._dress(rng, arm)
        self._repaint(rng, {self.env.arm.body, *(arm.body for arm in arms)})

    def _dress(self, rng, arm):
        skin = paint.SKINS[rng.integers(5)] / 255
        sleeve, glove = paint.tone(rng, 20, 210, 40) / 255, rng.random() < 0.15
        bare = rng.random() < 0.3
        for name, link in [*arm.links.items(), ("base", -1)]:
            of_cloth = name in ("base", "upper_arm", "cuff") or (name == "forearm" and not bare)
            colour = sleeve if of_cloth or (glove and name == "hand") else skin
            arm.p.changeVisualShape(arm.body, link, rgbaColor=(*colour, 1))

    def _repaint(self, rng, bodies):
        world, p = self.env.world, self.env.world.p
        p.changeVisualShape(world.table, -1, rgbaColor=(*paint.tone(rng, 50, 200, 20) / 255, 1))
        stands = paint.tone(rng, 60, 200, 20) / 255
        for i in range(p.getNumBodies()):
            body = p.getBodyUniqueId(i)
            if body == world.table or body in bodies:
                continue
            colour = paint.tone(rng, 30, 225, 50) / 255
            if body in world.scenery and p.getNumBodies() > 20:
                colour = stands  # tiles and jars, all of a kind
            for shape in p.getVisualShapeData(body):
                tint = np.clip(colour * rng.uniform(0.8, 1.1), 0, 1)
                p.changeVisualShape(body, shape[1], rgbaColor=(*tint, 1))

    def picture(self, tip):
        """The picture (h, w, 3) uint8, and where tip (3,) m and object are in it, (2, 2)."""
        (h, w), p = self.size, self.env.world.p
        _, _, rgba, depth, _ = p.getCameraImage(
            w, h, self.view, self.projection, lightDirection=self.light, shadow=1,
            lightAmbientCoeff=self.ambient, lightDiffuseCoeff=0.95 - self.ambient,
            lightSpecularCoeff=0.05, renderer=p.ER_TINY_RENDERER, flags=p.ER_NO_SEGMENTATION_MASK,
        )  # fmt: skip
        seen = numbers(depth, np.float32).reshape(h, w) < FAR
        front = numbers(rgba, np.uint8).reshape(h, w, 4)[..., :3] * self.grain[..., None]
        share = cv2.GaussianBlur(seen.astype(np.float32), (3, 3), 0)[..., None]
        picture = self.wall * (1 - share) + front * share
        touched = self.env.CONTACT is not None
        points = tip, self.env.object_position() if touched else self.env.target_position()
        return np.clip(picture, 0, 255).astype(np.uint8), np.stack([self._pixel(x) for x in points])

    def _pixel(self, point):
        (h, w), matrices = self.size, (self.projection, self.view)
        a, b = (np.array(m).reshape(4, 4).T for m in matrices)
        clip = a @ b @ np.append(point, 1.0)
        return (clip[:2] / clip[3] * (1, -1) + 1) / 2 * (w, h)
