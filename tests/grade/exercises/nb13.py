"""Notebook 13, after the paper: there and back, whose points, what is lost, the reward."""

import numpy as np

from tests.grade.exercise import exercise


@exercise("13.1", "There and back")
def there_and_back(points, there, back, most):
    height, width = there.shape[:2]
    to = points + there[points[:, 1], points[:, 0]]
    x, y = np.round(to).astype(int).T
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    home = to + back[y.clip(0, height - 1), x.clip(0, width - 1)]
    return inside & (np.linalg.norm(home - points, axis=1) < most)


# How points miss their start, x and y: five is `most`, so it is (3, 4), too.
MISSES = (1, 1), (3, 4), (3, 3), (4, 4), (1, 7), (7, 1), (4, 3)


def _flows(rng, leaves=0.0):
    """Points, two flows, and what they may be off; a share of the points `leaves` the picture.

    These leave by each of its sides in turn, and would come home by the flow at the rim and by that
    at the other side, where no other point comes. All numbers are 64ths, so that sums are exact.
    """
    size = rng.permutation([rng.integers(24, 30), rng.integers(31, 40)])  # width, height
    n, unit = int(rng.integers(16, 22)), int(rng.integers(8, 24)) / 64
    there, back = (rng.integers(-192, 193, (*size[::-1], 2)) / 64 for _ in range(2))
    points = rng.choice(np.argwhere(np.ones([min(size) - 16] * 2)) + 8, n, replace=False)
    for k, p in enumerate(points):
        to = p + rng.integers(-3, 4, 2) + rng.integers(-25, 26, 2) / 64
        out, axis = k < leaves * n, k % 2
        if out:
            far = rng.integers(100, 250) / 64
            to[axis] = -far if k % 4 < 2 else size[axis] - 1 + far
            to[1 - axis] = 9 + 3 * (k // 4)  # or two would share a pixel of the rim
        there[p[1], p[0]] = to - p
        miss = unit * np.array(MISSES[0 if out else k % len(MISSES)]) * rng.choice([-1, 1], 2)
        q = np.round(to).astype(int)
        for x, y in (q.clip(0, size - 1), np.where(q < 0, q + size, q).clip(0, size - 1)):
            back[y, x] = p - to + miss
    return points, there, back, 5 * unit


there_and_back.check(
    "some come home, some do not",
    _flows,
    points=2,
    least=lambda rng: ((f := _flows(rng))[0][:1], *f[1:]),
)
there_and_back.check("some leave the picture", lambda rng: _flows(rng, 0.5), points=2)


def _at_the_rim(rng):
    """Points that come to just inside and just outside of the picture, at all four of its sides.

    All would come home by the flow at the pixel of the rim next to them.
    """
    size = rng.permutation([rng.integers(24, 30), rng.integers(31, 40)])  # width, height
    there, back = (rng.integers(-192, 193, (*size[::-1], 2)) / 64 for _ in range(2))
    points = []
    for axis, end in enumerate(size):
        for k, place in enumerate((-0.9, -0.4, 0, end - 1, end - 0.6, end - 0.4, end)):
            to = np.full(2, 4.0 + k)
            to[axis] = place
            p = to.copy()
            p[axis] = 3 if place < 3 else end - 4
            (x, y), (i, j) = p.astype(int), np.round(to).astype(int).clip(0, size - 1)
            there[y, x], back[j, i] = to - p, p - to
            points.append((x, y))
    return np.array(points)[rng.permutation(len(points))], there, back, 0.5


there_and_back.check("some come to the picture's rim", _at_the_rim)
there_and_back.mistake(
    "It is the nearest pixel that lies inside or not: round first, and ask the rounded numbers.",
    "(x >= 0) & (x < width) & (y >= 0) & (y < height)",
    "(to >= 0).all(1) & (to < (width, height)).all(1)",
)
there_and_back.mistake(
    "It is the nearest pixel that lies inside or not: round first, and ask the rounded numbers.",
    "(x >= 0) & (x < width) & (y >= 0) & (y < height)",
    "(to >= 0).all(1) & (to <= (width - 1, height - 1)).all(1)",
)
there_and_back.mistake(
    "A picture is asked for its row first, in both flows: flow[y, x]. You ask flow[x, y].",
    "there[points[:, 1], points[:, 0]]",
    "there[points[:, 0].clip(0, height - 1), points[:, 1].clip(0, width - 1)]",
    "back[y.clip(0, height - 1), x.clip(0, width - 1)]",
    "back[x.clip(0, height - 1), y.clip(0, width - 1)]",
)
there_and_back.mistake(
    "A picture is asked for its row first, in both flows: flow[y, x]. You ask flow[x, y].",
    "back[y.clip(0, height - 1), x.clip(0, width - 1)]",
    "back[x.clip(0, height - 1), y.clip(0, width - 1)]",
)
there_and_back.mistake(
    "astype(int) cuts towards 0, so that -0.9 + 0.5 becomes pixel 0: round with np.round.",
    "np.round(to)",
    "(to + 0.5)",
)
there_and_back.mistake(
    "Pixels run from 0 to width - 1 and height - 1, both of them inside: < width, and >= 0.",
    "(x < width) & (y >= 0) & (y < height)",
    "(x <= width) & (y >= 0) & (y <= height)",
)
there_and_back.mistake(
    "Pixels run from 0 to width - 1 and height - 1, both of them inside: < width, and >= 0.",
    "(x >= 0) & (x < width) & (y >= 0)",
    "(x > 0) & (x < width) & (y > 0)",
)
there_and_back.mistake(
    "A picture is asked for its row first: flow[y, x]. You ask flow[x, y].",
    "there[points[:, 1], points[:, 0]]",
    "there[points[:, 0], points[:, 1]]",
)
there_and_back.mistake(
    "The way back is taken from where the point has come to; you take it from where it began.",
    "back[y.clip(0, height - 1), x.clip(0, width - 1)]",
    "back[points[:, 1], points[:, 0]]",
)
there_and_back.mistake(
    "A point that has left the picture is not kept: nobody knows what became of it.",
    "return inside & (",
    "return (",
)
there_and_back.mistake(
    "Home is where it came to plus the flow back; you add that flow to where it began.",
    "home = to + back",
    "home = points + back",
)
there_and_back.mistake(
    "You keep the points that do not come home.",
    "axis=1) < most",
    "axis=1) > most",
)
there_and_back.mistake(
    "That asks how far a point has moved. What counts is by how much it misses its start on the "
    "way back.",
    "np.linalg.norm(home - points, axis=1)",
    "np.linalg.norm(to - points, axis=1)",
)
there_and_back.mistake(
    "`most` is a distance, of x and y together; you look at x alone.",
    "np.linalg.norm(home - points, axis=1)",
    "np.abs(home - points)[:, 0]",
)
there_and_back.mistake(
    "`most` is a length, the root of the sum of squares; you take the larger of the misses in x "
    "and in y.",
    "np.linalg.norm(home - points, axis=1)",
    "np.abs(home - points).max(1)",
)
there_and_back.mistake(
    "`most` is a length, the root of the sum of squares; you add up the misses in x and in y.",
    "np.linalg.norm(home - points, axis=1)",
    "np.abs(home - points).sum(1)",
)
there_and_back.mistake(
    "A point that misses by just `most` is not kept: < and not <=.",
    "axis=1) < most",
    "axis=1) <= most",
)
there_and_back.mistake(
    "A point can leave to the left and above, too: there Python counts a negative index from the "
    "other side, and raises nothing.",
    "(x >= 0) & ",
    "",
    "(y >= 0) & ",
    "",
)
there_and_back.mistake(
    "shape is (height, width, 2): x has to be less than the width, y less than the height.",
    "(x < width) & (y >= 0) & (y < height)",
    "(x < height) & (y >= 0) & (y < width)",
)
there_and_back.mistake(
    "shape is (height, width, 2): the rows come first.",
    "height, width = there",
    "width, height = there",
)
there_and_back.mistake(
    "The way home begins at q itself; the pixel nearest to it only says where the flow is asked.",
    "home = to + back",
    "home = np.round(to) + back",
)
there_and_back.mistake(
    "B leads from q back to the start, so it is added: home is q + B(q).",
    "home = to + back",
    "home = to - back",
)
there_and_back.mistake(
    "A picture is asked for its row first: flow[y, x]. You ask flow[x, y].",
    "there[points[:, 1], points[:, 0]]",
    "there[points[:, 0], points[:, 1]]",
    "back[y.clip(0, height - 1), x.clip(0, width - 1)]",
    "back[x.clip(0, height - 1), y.clip(0, width - 1)]",
)
for first in ("there[points[:, 1], points[:, 0]]", "there[points[:, 0], points[:, 1]]"):
    there_and_back.mistake(  # only where a point is inside, as in a loop
        "A picture is asked for its row first: flow[y, x]. You ask flow[x, y].",
        "there[points[:, 1], points[:, 0]]",
        first,
        "home = to + back[y.clip(0, height - 1), x.clip(0, width - 1)]",
        "home = to.copy()\n    home[inside] += back[x[inside], y[inside]]",
    )
there_and_back.mistake(
    "A point comes to the pixel nearest to it: round, where you cut the fraction off.",
    "np.round(to).astype(int)",
    "to.astype(int)",
)


@exercise("13.2", "Whose points are these?")
def object_points(paths, kept, still, gone):
    far = np.linalg.norm(paths - paths[0], axis=2)
    rests = (far[: len(paths) // 4] < still).all(axis=0)
    return kept & rests & (far[-1] > gone)


def _paths(rng, *kinds):
    """Paths (T, n, 2), kept, and the two distances, of points of these kinds and of the object."""
    T = int(rng.integers(12, 30))
    quarter = T // 4
    still, gone = int(rng.integers(7, 20)) * 5 / 64, int(rng.integers(40, 76)) * 5 / 64
    courses = []
    count = int(rng.integers(3, 6))
    names = [*(k for k in kinds for _ in range(int(rng.integers(2, 4)))), *["object"] * count]
    for name in names:
        start = T // 2 + 1 if name == "late" else quarter + int(rng.integers(0, 2))
        rise = np.clip((np.arange(T) - start + 1) / (T - start), 0, 1) * gone * rng.uniform(1.5, 3)
        far = {
            "hand": np.linspace(0, 4 * gone, T),
            "table": np.zeros(T),
            "slow": rise * 0.3,
            "lamp": gone * 2 * np.sin(np.pi * np.clip(np.arange(T) - quarter, 0, None) / T) ** 2,
            "flash": np.where(np.arange(T) == quarter - 1, 2 * still, rise),
        }.get(name, rise)
        if name == "lamp":
            far = far * np.append(np.ones(T - 1), 0.2)
        angle = rng.choice([0.5, 1, 1.5, 2]) * np.pi + rng.uniform(0.2, 0.6)
        trembles = 0.2 * still * rng.uniform(-1, 1, (T, 2)) / np.sqrt(2)
        way = far[:, None] * np.array([np.cos(angle), np.sin(angle)]) + trembles
        courses.append(rng.uniform(20, 60, 2) + way - way[0])
    courses += [] if "slow" not in kinds else _on_the_brink(rng, T, still, gone)
    order = rng.permutation(len(courses))
    kept = np.array([*names, *["brink"] * (len(courses) - len(names))]) != "lost"
    return np.stack(courses, 1)[:, order], kept[order], still, gone


def _on_the_brink(rng, T, still, gone):
    """Paths (T, 2) that are just `still` off at a time, that end just `gone` off, and that end a
    bit more or less than that from the start, but not from the places soon after it.

    The way is (3, 4) fifths, and what is multiplied by it has 64ths, so that lengths are exact.
    """
    quarter, found = T // 4, []
    for rests, ends in (
        ((0, still), 2 * gone), ((0, 0), gone),
        ((0.75 * still, -0.75 * still), gone - 0.25 * still),
        ((0.75 * still, -0.75 * still), gone + 0.25 * still),
        ((-0.75 * still, 0.75 * still), gone - 0.25 * still),
        ((-0.75 * still, 0.75 * still), gone + 0.25 * still),
    ):  # fmt: skip
        far = np.full(T, float(ends))
        far[0], far[1], far[2 : quarter + 1] = 0, *rests
        way = np.array([3, 4]) * rng.choice([-1, 1], 2)
        found.append(rng.integers(20, 60, 2) + far[:, None] / 5 * way)
    return found


object_points.check(
    "a hand, a table and an object", lambda rng: _paths(rng, "hand", "table"), points=2
)
object_points.check(
    "points that were lost",
    lambda rng: _paths(rng, "lost", "table"),
    least=lambda rng: ((p := _paths(rng, "lost"))[0][:, :1], p[1][:1], *p[2:]),
)
object_points.check("a lamp that swings back", lambda rng: _paths(rng, "lamp", "hand"))
object_points.check("points that hardly move", lambda rng: _paths(rng, "slow", "late", "hand"))
object_points.check(
    "a twitch at the end of the first quarter", lambda rng: _paths(rng, "flash", "table")
)
object_points.mistake(
    "A point that was lost says nothing about where it went: `kept` has to be True.",
    "kept & rests",
    "rests",
)
object_points.mistake(
    "Less than `still` and more than `gone`: a point that is just as far off is not the object's.",
    "< still",
    "<= still",
    "> gone",
    ">= gone",
)
object_points.mistake(
    "Less than `still`: a point that is once just as far off does not rest, < and not <=.",
    "< still",
    "<= still",
)
object_points.mistake(
    "More than `gone`: a point that ends just as far off has not gone, > and not >=.",
    "> gone",
    ">= gone",
)
object_points.mistake(
    "How far a point ends is measured from its start, paths[0]; you measure from where the first "
    "quarter ended.",
    "far[-1] > gone",
    "np.linalg.norm(paths[-1] - paths[len(paths) // 4], axis=1) > gone",
)
object_points.mistake(
    "A point's start is its place in the first frame, paths[0].",
    "paths - paths[0]",
    "paths - paths[1]",
)
object_points.mistake(
    "The object rests in EVERY frame of the first quarter: a hand moves from the start, and you "
    "count its points.",
    "kept & rests & (far[-1] > gone)",
    "kept & (far[-1] > gone)",
)
object_points.mistake(
    "The object has to move later: a table rests, too, and you count its points.",
    "kept & rests & (far[-1] > gone)",
    "kept & rests",
)
object_points.mistake(
    "You keep no point at all. The object rests in the first quarter alone, and how far it is, is "
    "measured from its own start, paths[0].",
    "far[: len(paths) // 4]",
    "far",
)
object_points.mistake(
    "The first quarter of the frames is asked for; you take the first half.",
    "len(paths) // 4",
    "len(paths) // 2",
)
object_points.mistake(
    "What counts is where it ends. You take how far it ever was, and a lamp that swings back is "
    "in.",
    "far[-1] > gone",
    "far.max(axis=0) > gone",
)
object_points.mistake(
    "How far from its start does a point end? You take the last step alone.",
    "(far[-1] > gone)",
    "(np.linalg.norm(paths[-1] - paths[-2], axis=1) > gone)",
)
object_points.mistake(
    "x alone does not say how far a point is from its start: take the length of both together.",
    "np.linalg.norm(paths - paths[0], axis=2)",
    "np.abs(paths - paths[0])[:, :, 0]",
)
object_points.mistake(
    "`still` and `gone` have changed places.",
    "< still",
    "< gone",
    "> gone",
    "> still",
)
object_points.mistake(
    "You ask about one frame; the object is near its start in EVERY frame of the first quarter.",
    "(far[: len(paths) // 4] < still).all(axis=0)",
    "(far[len(paths) // 4] < still)",
)
object_points.mistake(
    "That is one frame more than the first quarter: its frames are 0 to T // 4 - 1.",
    "len(paths) // 4",
    "len(paths) // 4 + 1",
)
object_points.mistake(
    "Resting is to stay near the start, paths[0]. You compare each frame with the one before, and "
    "what drifts slowly rests.",
    "(far[: len(paths) // 4] < still)",
    "(np.linalg.norm(np.diff(paths, axis=0), axis=2)[: len(paths) // 4] < still)",
)
object_points.mistake(
    "Each frame of the first quarter has to be near the start; the mean over them forgives a "
    "twitch.",
    "(far[: len(paths) // 4] < still).all(axis=0)",
    "(far[: len(paths) // 4].mean(axis=0) < still)",
)


@exercise("13.3", "Lost and found")
def lost_and_found(p_0, to, kept, d):
    if kept.any():
        d = np.median((to - p_0)[kept], axis=0)
    return d, np.where(kept[:, None], to, p_0 + d)


def _seen(rng, lost, dragged=0):
    """Where points began, where flow puts them, which were kept, and the last displacement."""
    n = int(rng.integers(7, 12))
    p_0, d = rng.uniform(20, 60, (n, 2)), rng.uniform(2, 12, 2) * rng.choice([-1, 1], 2)
    to = p_0 + d + rng.uniform(0.5, 1.5, 2) + rng.uniform(-0.3, 0.3, (n, 2))
    order = rng.permutation(n)
    gone, off = order[:lost], order[lost : lost + dragged]
    to[gone] += rng.uniform(8, 20, (len(gone), 2)) * rng.choice([-1, 1], (len(gone), 2))
    to[off] += rng.uniform(5, 9, (len(off), 2))
    kept = np.ones(n, bool)
    kept[gone] = False
    return p_0, to, kept, d


lost_and_found.check("some points are lost", lambda rng: _seen(rng, int(rng.integers(2, 5))))
lost_and_found.check("most points are lost", lambda rng: _seen(rng, 6))
lost_and_found.mistake(
    "Those that were kept decide, be they few; only with none of them does the displacement stay.",
    "kept.any()",
    "kept.mean() > 0.5",
)
lost_and_found.check(
    "none is lost",
    lambda rng: _seen(rng, 0),
    least=lambda rng: ((s := _seen(rng, 0))[0][:1], s[1][:1], s[2][:1], s[3]),
)
lost_and_found.check("a gripper drags one along", lambda rng: _seen(rng, 3, dragged=1), points=2)


def _all_lost(rng):
    p_0, to, kept, d = _seen(rng, 2)
    return p_0, to, np.zeros_like(kept), d


lost_and_found.check("all are lost", _all_lost)
lost_and_found.mistake(
    "A gripper that drags one point along moves the mean. The median does not mind one of many.",
    "np.median",
    "np.mean",
)
lost_and_found.mistake(
    "Points that were lost have no say in the displacement: take the kept ones alone.",
    "(to - p_0)[kept]",
    "(to - p_0)",
)
lost_and_found.mistake(
    "Where flow puts a lost point is wrong. Put it where the kept ones say that it must be.",
    "np.where(kept[:, None], to, p_0 + d)",
    "to",
)
lost_and_found.mistake(
    "A lost point does not wait at its start, p_0, but where the object has gone: p_0 + d.",
    "np.where(kept[:, None], to, p_0 + d)",
    "np.where(kept[:, None], to, p_0)",
)
lost_and_found.mistake(
    "A kept point stays where flow has found it; you move it onto the median.",
    "np.where(kept[:, None], to, p_0 + d)",
    "p_0 + d",
)
lost_and_found.mistake(
    "With no point kept there is no median. The object is where it was last: d.",
    "    if kept.any():\n        d = np.median((to - p_0)[kept], axis=0)\n",
    "    d = np.median((to - p_0)[kept], axis=0)\n",
)
lost_and_found.mistake(
    "With no point kept the object is where it was last, at d; yours goes back to its start.",
    "    if kept.any():\n        d = np.median((to - p_0)[kept], axis=0)\n",
    "    d = np.median((to - p_0)[kept], axis=0) if kept.any() else np.zeros(2)\n",
)
lost_and_found.mistake(
    "A displacement is counted from the start, p_0, and not from the last one: the median alone.",
    "d = np.median",
    "d = d + np.median",
)
lost_and_found.mistake(
    "The kept ones stay where flow has found them, and the lost ones are put at p_0 + d; yours is "
    "the other way round.",
    "np.where(kept[:, None], to, p_0 + d)",
    "np.where(kept[:, None], p_0 + d, to)",
)
lost_and_found.mistake(
    "A displacement is a place now minus a place at the start; you take the places themselves.",
    "(to - p_0)[kept]",
    "to[kept]",
)
lost_and_found.mistake(
    "Lost points wait at the new displacement; you put them at the one before.",
    "    if kept.any():\n        d = np.median((to - p_0)[kept], axis=0)\n"
    "    return d, np.where(kept[:, None], to, p_0 + d)",
    "    new = np.median((to - p_0)[kept], axis=0) if kept.any() else d\n"
    "    return new, np.where(kept[:, None], to, p_0 + d)",
)
lost_and_found.mistake(
    "x and y have a median each: over the points, axis 0.",
    "axis=0",
    "axis=None",
)
lost_and_found.mistake(
    "x and y have a median each: axis=0.",
    "np.median((to - p_0)[kept], axis=0)",
    "np.median((to - p_0)[kept]) * np.ones(2)",
)
lost_and_found.mistake(
    "The median of an even number of points lies between the middle two: np.median takes it, "
    "torch.median the lower one.",
    "np.median((to - p_0)[kept], axis=0)",
    "np.sort((to - p_0)[kept], axis=0)[(kept.sum() - 1) // 2]",
)
lost_and_found.mistake(
    "The median of an even number of points lies between the middle two; yours is the upper one.",
    "np.median((to - p_0)[kept], axis=0)",
    "np.sort((to - p_0)[kept], axis=0)[kept.sum() // 2]",
)


@exercise("13.4", "What the object is paid for")
def reward(d, d_next, g_next, d_E, t, lam):
    def length(x):
        return min(np.linalg.norm(x), 2 * L) / L

    L = np.linalg.norm(d_E, axis=1).max()
    last = len(d_E) - 1
    now, goal = d_E[min(t, last)], d_E[min(t + 1, last)]
    r1 = -length(d_next - goal)
    r2 = -length(d_next - d - (goal - now))
    r3 = -(1 - np.linalg.norm(goal) / L) * length(g_next)
    return lam[0] * r1 + lam[1] * r2 + lam[2] * r3


def _step(rng, at=None, far=0.0, swings=False):
    """A step of an episode. at: the share of the demonstration that has passed; far: how far the
    object was thrown and the arm is, in demonstrations; swings: it ends before its farthest."""
    N = int(rng.integers(9, 20))
    way = rng.uniform(10, 40) * np.array([np.cos(a := rng.uniform(0, 6.28)), np.sin(a)])
    share = np.concatenate([np.zeros(3), np.cumsum(rng.uniform(0.5, 1, N - 3))])
    d_E = (share / share[-1])[:, None] * way + rng.uniform(-0.3, 0.3, (N, 2))
    d_E[0] = 0
    if swings:
        d_E[-1] *= 0.6
    t = int(rng.integers(2, N - 2)) if at is None else N - 1 + int(rng.integers(0, 4))
    L = np.linalg.norm(way)
    d = d_E[min(t, N - 1)] + rng.uniform(-0.4, 0.4, 2) * L
    d_next = d + rng.uniform(-0.2, 0.2, 2) * L + far * way
    g_next = rng.uniform(0.1, 0.5, 2) * rng.choice([-1, 1], 2) * L * (1 + 6 * far)
    return d, d_next, g_next, d_E, t, rng.uniform(0.5, 3, 3)


reward.check("a step on the way", _step, points=2)
reward.check("the demonstration is over", lambda rng: _step(rng, at=1.0, swings=True))
reward.check("an object that was thrown far away", lambda rng: _step(rng, far=3.0))
reward.mistake(
    "r1 judges where the step has led: d_next, where you take d.",
    "-length(d_next - goal)",
    "-length(d - goal)",
)
reward.mistake(
    "The step t leads to the demonstration's frame t + 1; you compare with frame t.",
    "r1 = -length(d_next - goal)",
    "r1 = -length(d_next - now)",
)
reward.mistake(
    "An object that is thrown away costs at most 2 a part: cap the length at twice L.",
    "min(np.linalg.norm(x), 2 * L) / L",
    "np.linalg.norm(x) / L",
)
reward.mistake(
    "Those are pixels. A length is divided by L, or a long way pays less than a short one.",
    "min(np.linalg.norm(x), 2 * L) / L",
    "min(np.linalg.norm(x), 2 * L)",
)
reward.mistake(
    "The cap is twice the demonstration's longest displacement, 2 L; yours is L.",
    "2 * L",
    "L",
)
reward.mistake(
    "The approach counts by what the demonstration's object still has to go; yours counts always.",
    "-(1 - np.linalg.norm(goal) / L) * length(g_next)",
    "-length(g_next)",
)
reward.mistake(
    "The approach counts by what the DEMONSTRATION's object still has to go; you take the robot's. "
    "It could touch the object once and be done with it.",
    "np.linalg.norm(goal) / L) * length",
    "np.linalg.norm(d_next) / L) * length",
)
reward.mistake(
    "The approach counts in the beginning and fades: 1 minus the share of the way.",
    "(1 - np.linalg.norm(goal) / L)",
    "(np.linalg.norm(goal) / L)",
)
reward.mistake(
    "r2 compares two steps: the object's, d_next - d, and the demonstration's.",
    "d_next - d - (goal - now)",
    "d_next - (goal - now)",
)
reward.mistake(
    "The demonstration's step leads from its frame t to t + 1; yours goes the other way.",
    "(goal - now)",
    "(now - goal)",
)
reward.mistake(
    "A reward is at most 0 here: each part is minus a length.",
    "r1 = -length",
    "r1 = length",
    "r2 = -length",
    "r2 = length",
    "r3 = -(",
    "r3 = (",
)
reward.mistake(
    "L is the LONGEST displacement; the last need not be it.",
    "np.linalg.norm(d_E, axis=1).max()",
    "np.linalg.norm(d_E[-1])",
)
reward.mistake(
    "An arm that is away costs, as r1 and r2 do: r3 has a minus, too.",
    "r3 = -(",
    "r3 = (",
)
reward.mistake(
    "A length in pixels is cut off at 2 L, and then divided by L; yours is cut off at 2 pixels.",
    "min(np.linalg.norm(x), 2 * L) / L",
    "min(np.linalg.norm(x), 2) / L",
)
reward.mistake(
    "L is the longest displacement, from the start; yours is the length of the path.",
    "np.linalg.norm(d_E, axis=1).max()",
    "np.linalg.norm(np.diff(d_E, axis=0), axis=1).sum()",
)
reward.mistake(
    "The step t leads from the demonstration's frame t to t + 1; yours is one later.",
    "d_E[min(t, last)], d_E[min(t + 1, last)]",
    "d_E[min(t + 1, last)], d_E[min(t + 2, last)]",
)
reward.mistake(
    "The weights belong to r1, r2 and r3 in this order.",
    "lam[0] * r1 + lam[1] * r2 + lam[2] * r3",
    "lam[2] * r1 + lam[1] * r2 + lam[0] * r3",
)
reward.mistake(
    "When the demonstration has ended it stands still: both of its frames are then the last one, "
    "and its step is 0. Yours goes on with its last step.",
    "now, goal = d_E[min(t, last)], d_E[min(t + 1, last)]",
    "now, goal = d_E[min(t, last - 1)], d_E[min(t + 1, last)]",
)
reward.mistake(
    "The length is cut off at 2 L, and not each of its coordinates.",
    "min(np.linalg.norm(x), 2 * L) / L",
    "np.linalg.norm(np.clip(x, -2 * L, 2 * L)) / L",
)
reward.mistake(
    "The approach is weighed by where the demonstration is next, d_E of t + 1; yours is that of t.",
    "np.linalg.norm(goal) / L) * length",
    "np.linalg.norm(now) / L) * length",
)
reward.mistake(
    "L is the largest length of a displacement, of x and y together; yours is the largest number.",
    "np.linalg.norm(d_E, axis=1).max()",
    "np.abs(d_E).max()",
)
