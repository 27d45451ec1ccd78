"""A toy of the push task for tests: frames drawn with rectangles, dynamics in a dozen lines.

A gripper on an arm (three visible parts) pushes a puck along a table, seen from the side. It has
what makes the real task hard for a reward: a puck that only contact moves, a demonstration that
pauses and is slower than the robot, keypoints with half a pixel of noise.
"""

import gymnasium as gym
import numpy as np

BASE, START, PUCK, GOAL = np.array([-0.9, -0.3]), np.array([-0.5, 0.0]), 0.0, 0.55
# In keypoint units: 1 is half the image.
TABLE, HALF_PUCK, HALF_GRIPPER, STEP = 0.6, 0.1, 0.06, 0.08
COLOURS = (60, 120, 180, 240)  # elbow, wrist, gripper, puck


class ToyPush(gym.Env):
    observation_space = gym.spaces.Box(0, 255, (84, 84, 3), np.uint8)
    action_space = gym.spaces.Box(-1, 1, (3,), np.float32)  # right, down, and depth, held by walls
    horizon = 50

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        self.position = START + self.np_random.uniform(-0.02, 0.02, 2)
        self.velocity = np.zeros(2)
        self.puck, self.puck_velocity, self.t = PUCK + self.np_random.uniform(-0.02, 0.02), 0.0, 0
        return self.frame(), {}

    def step(self, action):
        a = np.clip(action, -1, 1)
        self.velocity = 0.5 * self.velocity + 0.5 * STEP * a[:2]
        before = self.position
        self.position = np.clip(before + self.velocity, [-0.9, -0.6], [0.95, TABLE - HALF_GRIPPER])
        self.puck_velocity *= 0.5  # friction
        self.puck = np.clip(self.puck + self.puck_velocity, -0.8, 0.9)
        x, y = self.position
        reach = HALF_PUCK + HALF_GRIPPER
        if y > TABLE - 2 * HALF_PUCK and abs(x - self.puck) < reach:
            if before[1] <= TABLE - 2 * HALF_PUCK:  # came from above: stands on the puck
                self.position[1] = TABLE - 2 * HALF_PUCK
            else:
                new = x + reach if before[0] < self.puck else x - reach
                self.puck, self.puck_velocity = new, new - self.puck
        self.t += 1
        info = {"is_success": bool(abs(self.puck - GOAL) < 0.15)}
        return self.frame(), 0.0, False, self.t >= self.horizon, info

    def parts(self):
        """Centres (4, 2) of elbow, wrist, gripper, puck."""
        elbow = (BASE + self.position) / 2 + np.array([0, -0.2])
        wrist = self.position + np.array([-0.03, -0.2])
        return np.stack([elbow, wrist, self.position, [self.puck, TABLE - HALF_PUCK]])

    def frame(self):
        image = np.zeros((84, 84, 3), np.uint8)
        half = np.array([[0.06, 0.06], [0.06, 0.06], [HALF_GRIPPER] * 2, [HALF_PUCK] * 2])
        low, high = (
            np.clip((self.parts() + s * half + 1) * 42, 0, 84).round().astype(int) for s in (-1, 1)
        )
        for (x0, y0), (x1, y1), colour in zip(low, high, COLOURS, strict=True):
            image[y0:y1, x0:x1] = colour
        return image


def detect(frames):
    """Frames (B, 84, 84, 3) uint8 -> the parts' centres (B, 4, 2); a hidden part gives (0, 0)."""
    z = np.zeros((len(frames), 4, 2), np.float32)
    for b, image in enumerate(frames[..., 0]):
        for k, colour in enumerate(COLOURS):
            y, x = np.nonzero(image == colour)
            if len(x):
                z[b, k] = (x.mean() + 0.5) / 42 - 1, (y.mean() + 0.5) / 42 - 1
    return z


def follow(env, waypoints):
    """Frames of a scripted arm: visits every (x, y) at `speed`, rests there for `pause` frames."""
    frames = [env.reset(seed=0)[0]]
    for x, y, speed, pause in waypoints:
        for _ in range(60):
            gap = np.array([x, y]) - env.position
            if np.abs(gap).max() < 0.03:
                break
            a = np.clip((gap - 0.5 * env.velocity) / (0.5 * STEP), -speed, speed)
            frames.append(env.step(np.array([*a, 0]))[0])
        for _ in range(pause):
            frames.append(env.step(np.zeros(3))[0])
    return np.stack(frames)


def demonstration(goal=GOAL):
    """Frames of a slow 'human': rests, swings behind the puck, rests, pushes it home, rests."""
    env = ToyPush()
    reach = HALF_PUCK + HALF_GRIPPER
    behind, end = (-0.26, 0.5, 0.35, 4), (goal - reach, 0.5, 0.5, 3)
    return follow(env, [(*START, 1, 7), (-0.3, 0.3, 0.35, 0), behind, end])


def random_frames(n, seed=0):
    """n frames of the robot acting at random, each action held for 5 steps."""
    env, rng, frames = ToyPush(), np.random.default_rng(seed), []
    while len(frames) < n:
        frames.append(env.reset(seed=seed + len(frames))[0])
        for t in range(env.horizon):
            if t % 5 == 0:
                a = rng.uniform(-1, 1, 3)
            frames.append(env.step(a)[0])
    return np.stack(frames[:n])
