"""After the paper: track the object, do not translate the picture. No network is trained to see.

In: a demonstration, and frames of the robot's world, (T, 84, 84, 3) uint8 each. Out: how far the
object has moved from where it began, in pixels, and how the arm stands to it. What human and robot
have in common is the object and how it moves. So nothing of the arm has to be translated: the robot
may find a way of its own. HuDOR (Guzey et al. 2024) and X-Sim (Dan et al. 2025) learn from such
rewards on real robots; what follows is this kit's own and far smaller.

A point moves as optical flow says: pyramidal Lucas-Kanade (Bouguet 2001), from OpenCV. A point is
kept if the flow back leads to where it came from. The object is the points that rest first, move
later, and move together. Its displacement is their median.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import cv2
import numpy as np

from lbw_minimal.training import InputError

WINDOW = 5  # pixels, both sides of what is compared: half of an object, which is 7 to 12 wide
BACK = 0.5  # pixels that the flow back may miss the point by
STILL = 1.0  # pixels: less is rest
GONE = 3.0  # pixels: a point that ends farther from its start has moved
FIRST = 0.25  # share of the demonstration in which the object still rests
LEAST = 2  # points that an object has: one alone may be a hand's, and agrees with itself
TOGETHER = 1.5  # pixels by which two points of one object may differ in their displacement
CORNER = 0.01  # of the best corner's strength; below that, a corner is noise
COLOUR = 30  # grey levels between two things, of 255; shading makes less
SHARE = 0.3  # of a film, in which the background is seen; at 0.5 the arm covers some for longer
ARM = 8  # grey levels between arm and background; a gripper hardly stands out from a wall
NEAR = 3.0  # pixels over which the arm's nearest pixels count; with 1.5 its speed is half noise
HAND = 4.2  # pixels, about the width of a hand, robot's or human's
FLOW: dict[str, Any] = {"winSize": (WINDOW, WINDOW), "maxLevel": 2}  # a half and a quarter


def corners(frame: np.ndarray, where: np.ndarray | None = None) -> np.ndarray:
    """Pixels (n, 2) that can be told from their neighbours in any direction, x and y.

    frame (84, 84, 3) uint8; where (84, 84): where to look. A red thing on brown ground has corners
    in red and hardly any in grey, so the strongest of the three colours counts.
    """
    strength = np.max([cv2.cornerMinEigenVal(c, 3) for c in cv2.split(frame)], axis=0)  # (84, 84)
    if where is not None:
        strength = strength * where
    best = strength == cv2.dilate(strength, np.ones((3, 3)))
    best &= strength > CORNER * strength.max()
    return np.argwhere(best)[:, ::-1].astype(np.float32)


def flow(
    frame: np.ndarray, following: np.ndarray, points: np.ndarray, guess: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Where points (n, 2) of a frame are in the following one, (n, 2), and whether each is kept.

    guess (n, 2): where to begin to look. Forward and backward: from where a point has come to, the
    flow is asked for the way back. What is covered, or slides along an edge, comes back elsewhere.
    """
    if not len(points):
        return points, np.zeros(0, bool)
    ahead = np.zeros_like(points) if guess is None else guess - points
    to, found = _lucas_kanade(frame, following, points, points + ahead)
    back, again = _lucas_kanade(following, frame, to, to - ahead)
    return to, found & again & (np.linalg.norm(back - points, axis=1) < BACK)


def _lucas_kanade(frame, following, points, guess):
    """Where OpenCV finds the points (n, 2), and whether it does; it wants them as (n, 1, 2)."""
    start, use = (p[:, None].astype(np.float32, "C") for p in (points, guess))
    to, found, _ = cv2.calcOpticalFlowPyrLK(
        frame, following, start, use, flags=cv2.OPTFLOW_USE_INITIAL_FLOW, **FLOW
    )
    return to[:, 0], found[:, 0] > 0


def follow(frames: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Paths (T, n, 2) of points (n, 2) of the first frame, and whether each was kept to the end."""
    paths, kept = [points], np.ones(len(points), bool)
    for frame, following in pairwise(frames):
        to, near = flow(frame, following, paths[-1])
        kept &= near
        paths.append(np.where(kept[:, None], to, paths[-1]))  # a lost point stays where it was
    return np.stack(paths), kept


def together(d: np.ndarray, weight: np.ndarray | float = 1.0) -> np.ndarray:
    """The largest group among displacements (T, n, 2) that agree with one of them: (n,) bool.

    weight (n,): how much each of them counts.
    """
    if not d.shape[1]:
        return np.zeros(0, bool)
    apart = np.linalg.norm(d[:, :, None] - d[:, None], axis=-1).max(axis=0)  # (n, n)
    alike = apart < TOGETHER
    return alike[(alike * weight).sum(axis=1).argmax()]


def object_points(paths: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Which of the points with paths (T, n, 2) are the object's, (n,) bool.

    A hand moves from the start, a table never, a lamp on its own. A thing that is pushed rests
    first, moves later, and all of its points move alike. Of several groups the one that has come
    farthest counts, all of its ways together: in front of tiles, an arm that passes by drags
    corners along for a few pixels.
    """
    d = paths - paths[0]
    far = np.linalg.norm(d, axis=-1)  # (T, n)
    rests = (far[: max(2, round(FIRST * len(far)))] < STILL).all(axis=0)
    moved = kept & rests & (far[-1] > GONE)
    moved[moved] = together(d[:, moved], far[-1, moved])
    return moved


@dataclass
class Demonstration:
    """What a demonstration says about the object: its path and its looks."""

    path: np.ndarray  # d^E (N, 2), pixels from where it began
    points: np.ndarray  # (n, 2) of the first frame
    corner: np.ndarray  # (2,) of the patch in the first frame
    patch: np.ndarray  # (h, w, 3) uint8, the object in the first frame
    mask: np.ndarray  # (h, w) uint8, 1 where the patch shows it
    behind: np.ndarray  # (2,) in the patch: where an arm stands that is to push it, see `watch`


def watch(demo: np.ndarray) -> Demonstration:
    """Find the object in a demonstration (N, 84, 84, 3) uint8, and how it moves.

    Raises InputError if no two points rest first, move later, and move together.
    """
    points = corners(demo[0])
    paths, kept = follow(demo, points)
    own = object_points(paths, kept)
    if own.sum() < LEAST:
        raise InputError(
            "no object rests first and moves later in the demonstration; tracks follow one."
        )
    d = np.median(paths[:, own] - points[own], axis=1)  # (N, 2)
    mask = silhouette(demo[0], demo[-1], d[-1], points[own])
    x, y, w, h = cv2.boundingRect(mask)
    patch, mask = demo[0, y : y + h, x : x + w], mask[y : y + h, x : x + w]
    pixels = np.argwhere(mask)[:, ::-1]
    middle, way = pixels.mean(axis=0), d[-1] / np.linalg.norm(d[-1])
    # Half an object behind it: to its side itself a hand on top would be about as near as one
    # behind. And no farther than a hand is wide, since what pushes would be away from there.
    side = ((pixels - middle) @ way).min()
    behind = middle + (side - min(-side, HAND)) * way
    return Demonstration(d, points[own], np.array([x, y]), patch, mask, behind)


def silhouette(
    first: np.ndarray, last: np.ndarray, d: np.ndarray, points: np.ndarray
) -> np.ndarray:
    """Pixels of the first frame that are the object's, (84, 84) uint8: 1 there.

    They have left, and are seen again in the last frame, d (2,) further on. Of several pieces the
    one with most of the object's points (n, 2) at or beside it counts.
    """
    shift = np.array([[1, 0, -d[0]], [0, 1, -d[1]]], np.float32)
    back = cv2.warpAffine(last, shift, first.shape[1::-1], borderMode=cv2.BORDER_REPLICATE)
    stays = cv2.absdiff(back, first).max(axis=-1) < COLOUR
    leaves = cv2.absdiff(last, first).max(axis=-1) > COLOUR
    count, label = cv2.connectedComponents((stays & leaves).astype(np.uint8))
    at = np.zeros(first.shape[:2], np.uint8)
    at[tuple(points.round().astype(int).T[::-1])] = 1
    votes = np.bincount(label[cv2.dilate(at, np.ones((5, 5))) > 0], minlength=count)
    if count < 2 or not votes[1:].any():
        return cv2.dilate(at, np.ones((WINDOW, WINDOW)))
    return (label == 1 + votes[1:].argmax()).astype(np.uint8)


def background(film: np.ndarray) -> np.ndarray:
    """What is behind all that moves in a film (M, 84, 84, 3) uint8: (84, 84, 3) uint8.

    Where an arm comes and goes, the wall is the colour that keeps coming back: the middle of the
    narrowest band of grey levels that holds SHARE of the frames. A median would show the arm
    wherever it covers the wall for half of the film.
    """
    levels = np.sort(film, axis=0)
    held = max(1, int(SHARE * len(film)))
    width = levels[held:].astype(int) - levels[:-held]
    middle = width.argmin(axis=0) + held // 2
    return np.take_along_axis(levels, middle[None], axis=0)[0]


def arm_near(
    frame: np.ndarray, wall: np.ndarray, thing: np.ndarray, place: np.ndarray
) -> np.ndarray | None:
    """Where the arm's pixels nearest to `place` (2,) are, (2,); None if no arm is in sight.

    frame, wall (84, 84, 3) uint8; thing (84, 84): where the object is. The arm is what stands out
    from the wall and comes in from outside the picture. Its nearest pixels are averaged, weighted
    by how near they are and how clearly they stand out, so that the place moves by less than a
    pixel at a time.
    """
    stands_out = cv2.absdiff(frame, wall).max(axis=-1).astype(np.float32)  # (84, 84)
    shown = ((stands_out > ARM) & (thing == 0)).astype(np.uint8)
    _, label = cv2.connectedComponents(shown)
    rim = np.unique(np.concatenate([label[0], label[-1], label[:, 0], label[:, -1]]))
    arm = np.argwhere(np.isin(label, rim[rim > 0]))[:, ::-1]  # (n, 2)
    if not len(arm):
        return None
    far = np.linalg.norm(arm - place, axis=1)
    clear = np.clip(stands_out[arm[:, 1], arm[:, 0]] / 40, 0, 1)
    weight = clear * np.exp((far.min() - far) / NEAR)
    return weight @ arm / weight.sum()


class Tracker:
    """The demonstration's object in the robot's world, frame by frame.

    demo: what `watch` found. wall (84, 84, 3) uint8: the robot's world without robot and object,
    from `background`. After `reset` and each `step` there are, (2,) each and in pixels: `d`, the
    object's displacement; `g`, the way from behind the object to the nearest of the arm; `ahead`,
    how far ahead of its start in the demonstration the object started.
    """

    def __init__(self, demo: Demonstration, wall: np.ndarray):
        self.demo, self.wall = demo, wall

    def reset(self, frame: np.ndarray) -> None:
        """Find the object in an episode's first frame (84, 84, 3) uint8 by its looks."""
        mask = self.demo.mask
        unlike = cv2.matchTemplate(
            frame, self.demo.patch, cv2.TM_SQDIFF, mask=cv2.merge([mask] * 3)
        )
        x, y = cv2.minMaxLoc(unlike)[2]
        thing = np.zeros(frame.shape[:2], np.uint8)
        thing[y : y + mask.shape[0], x : x + mask.shape[1]] = mask
        self.thing = cv2.dilate(thing, np.ones((5, 5)))  # its rim has corners, too
        self.behind = self.demo.behind + (x, y)
        self.ahead = (x, y) - self.demo.corner
        self.p_0 = self.p = corners(frame, self.thing)  # (n, 2)
        self.kept = np.ones(len(self.p), bool)
        self.d, self.v, self.frame = np.zeros(2), np.zeros(2), frame
        self.g = np.zeros(2)
        self._look(frame)

    def step(self, frame: np.ndarray) -> None:
        """Follow the object into the next frame (84, 84, 3) uint8.

        A point that is lost waits where the others say that it must be, and is looked for there in
        the next frame. Points that a gripper drags along do not agree with the rest. If fewer than
        two agree, the object is taken to rest where it was seen last.
        """
        to, kept = flow(self.frame, frame, self.p, self.p + self.v)
        kept[kept] = together((to - self.p_0)[None, kept])
        d = np.median((to - self.p_0)[kept], axis=0) if kept.sum() > 1 else self.d  # (2,)
        self.p = np.where(kept[:, None], to, self.p_0 + d)
        self.d, self.v, self.kept, self.frame = d, d - self.d, kept, frame
        self._look(frame)

    def _look(self, frame):
        shift = np.array([[1, 0, self.d[0]], [0, 1, self.d[1]]], np.float32)
        thing = cv2.warpAffine(self.thing, shift, frame.shape[1::-1])
        place = self.behind + self.d
        near = arm_near(frame, self.wall, thing, place)
        self.g = self.g if near is None else near - place  # an arm out of sight is where it was


def draw(demo: np.ndarray) -> np.ndarray:
    """The demonstration (N, 84, 84, 3) uint8 with the object's points in yellow, for the eye."""
    shown, out = watch(demo), demo.copy()
    at = (shown.points + shown.path[:, None]).round().astype(int).clip(0, demo.shape[1] - 1)
    for frame, points in zip(out, at, strict=True):
        frame[points[:, 1], points[:, 0]] = (255, 220, 0)
    return out
