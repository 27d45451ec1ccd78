"""Notebook 12, your own arm: time stamps, cuts, the affine fit, the object's progress."""

import numpy as np

from tests.grade.exercise import exercise


@exercise("12.1", "By the time stamps")
def resample(times, path, fps):
    n = int((times[-1] - times[0]) * fps) + 1
    t = times[0] + np.arange(n) / fps
    return np.stack([np.interp(t, times, column) for column in path.T], axis=1)


def _filmed(rng, begin=0.0, rest=(0.6, 0.9)):
    """Uneven times, a path and a rate; the last moment lies `rest` of a step after the last one."""
    T, D, fps = int(rng.integers(6, 12)), int(rng.integers(2, 4)), int(rng.integers(5, 40))
    lasts = (int(rng.integers(5, 25)) + rng.uniform(*rest)) / fps  # s
    steps = rng.uniform(0.2, 1.8, T - 1)
    times = begin + np.concatenate([[0], np.cumsum(steps) / steps.sum()]) * lasts
    return times, rng.uniform(0, 300, (T, D)), fps


def _to_the_last(rng):
    """Times whose binary digits end, so that the last step falls on the last moment."""
    T, fps = int(rng.integers(5, 10)), int(2 ** rng.integers(2, 5))
    steps = rng.integers(1, 12, T - 1) / 64
    steps[-1] += (-steps.sum() * fps % 1) / fps
    times = np.concatenate([[0], np.cumsum(steps)]) + int(rng.integers(0, 3))
    return times, rng.uniform(0, 300, (T, int(rng.integers(2, 4)))), fps


resample.check(
    "frames that come unevenly",
    _filmed,
    points=2,
    least=lambda rng: ((f := _filmed(rng))[0], f[1][:, :1], f[2]),
)
resample.check(
    "a piece that does not begin at 0", lambda rng: _filmed(rng, float(rng.uniform(1, 9)))
)
resample.check("a last step that falls on the last moment", _to_the_last)
resample.mistake(
    "You spread the frames evenly over the clip. Each has a moment of its own, in `times`.",
    "np.interp(t, times, column)",
    "np.interp(t, np.linspace(times[0], times[-1], len(times)), column)",
)
resample.mistake(
    "That is as many points as the clip has frames. How many there are follows from its length in "
    "seconds and from fps.",
    "t = times[0] + np.arange(n) / fps",
    "t = np.linspace(times[0], times[-1], len(times))",
)
resample.mistake(
    "You take the frame nearest in time. Between two frames lies a place between two places.",
    "return np.stack([np.interp(t, times, column) for column in path.T], axis=1)",
    "return path[np.abs(times - t[:, None]).argmin(1)]",
)
resample.mistake(
    "You hold a frame until the next one comes. Between two frames lies a place between two "
    "places.",
    "return np.stack([np.interp(t, times, column) for column in path.T], axis=1)",
    "return path[np.searchsorted(times, t, side='right') - 1]",
)
resample.mistake(
    "The first moment is times[0], and a piece of a clip need not begin at 0.",
    "t = times[0] + np.arange(n) / fps",
    "t = np.arange(n) / fps",
)
resample.mistake(
    "A step that falls on the last moment counts; yours stops before it.",
    "n = int((times[-1] - times[0]) * fps) + 1",
    "n = int(np.ceil((times[-1] - times[0]) * fps))",
)
resample.mistake(
    "Your last point is after the last frame, where nothing was filmed: round down.",
    "int((times[-1] - times[0]) * fps) + 1",
    "int((times[-1] - times[0]) * fps) + 2",
)
resample.mistake(
    "Your last point may be after the last frame: a step that is not over by then does not count, "
    "so round down, neither up nor to the nearest.",
    "int((times[-1] - times[0]) * fps) + 1",
    "round((times[-1] - times[0]) * fps) + 1",
)
resample.mistake(
    "A step lasts 1 / fps seconds; yours lasts fps of them.",
    "np.arange(n) / fps",
    "np.arange(n) * fps",
)
resample.mistake(
    "One point is missing: with n steps there are n + 1 points.",
    "int((times[-1] - times[0]) * fps) + 1",
    "int((times[-1] - times[0]) * fps)",
)
resample.mistake(
    "The columns are turned round: x comes first, as in `path`.",
    "column in path.T",
    "column in path.T[::-1]",
)
resample.mistake(
    "The values are right, but a row is a moment and a column a coordinate: (N, D), as in `path`.",
    "axis=1",
    "axis=0",
)
resample.mistake(
    "The steps are 1 / fps, whatever is left at the end; linspace to the last moment "
    "stretches them.",
    "times[0] + np.arange(n) / fps",
    "np.linspace(times[0], times[-1], n)",
)


@exercise("12.2", "The longest piece without a cut")
def longest_piece(times, tip, most):
    speed = np.linalg.norm(np.diff(tip, axis=0), axis=1) / np.diff(times)
    cuts = [int(i) + 1 for i in np.flatnonzero(speed > most)]
    edges = [0, *cuts, len(times)]
    pieces = [(edges[k], edges[k + 1]) for k in range(len(edges) - 1)]
    return max(pieces, key=lambda piece: times[piece[1] - 1] - times[piece[0]])


def _cut_film(rng, frames, slow=None, waits=True, gap=None):
    """Times, the tip's path and the highest speed of a hand, px/s; a cut between the pieces.

    frames: how many each piece has. slow: the piece whose frames come rarely, and which so lasts
    longest, while the tip goes farthest in the first. waits: in a longer piece, after one frame,
    nothing comes for over a second. gap: the piece after which nothing comes for longer than any
    piece lasts.
    """
    most = float(rng.uniform(60, 300))
    steps, shares = [], []
    for k, n in enumerate(frames):
        step = rng.uniform(0.03, 0.06, n) * (8 if k == slow else 1)
        share = rng.uniform(0.3, 0.95, n) * (0.01 if k and slow else 1)
        if waits and n > 3:
            step[1] = rng.uniform(1.2, 1.6)
            share[1] = 0.95
        share[-1] = rng.uniform(1.05, 1.3)  # the cut after it
        step[-1] = 5 if k == gap else step[-1]
        steps, shares = [*steps, *step], [*shares, *share]
    steps, shares = np.array(steps[:-1]), np.array(shares[:-1])
    angle = rng.choice([0.25, 0.75, 1.25, 1.75], len(steps)) * np.pi + rng.uniform(-0.2, 0.2)
    way = np.stack([np.cos(angle), np.sin(angle)], 1) * (most * shares * steps)[:, None]
    tip = (150, 90) + np.concatenate([[[0, 0]], np.cumsum(way, axis=0)])
    return np.concatenate([[0], np.cumsum(steps)]) + float(rng.uniform(0, 3)), tip, most


def _several(rng, at):
    """Three or four pieces, the one at index `at` with most frames and so the longest."""
    frames = [int(n) for n in rng.integers(4, 6, int(rng.integers(3, 5)))]
    frames[at] += 30
    return _cut_film(rng, frames, gap=0 if at else 1)


longest_piece.check("cuts, and the longest piece between two of them", lambda r: _several(r, 1))
longest_piece.check("the longest piece comes first", lambda r: _several(r, 0))
longest_piece.check("the longest piece comes last", lambda r: _several(r, -1))
longest_piece.mistake(
    "A piece ends with its own last frame; yours lasts until the next one begins, over the cut.",
    "times[piece[1] - 1] - times[piece[0]]",
    "times[min(piece[1], len(times) - 1)] - times[piece[0]]",
)


def _brisk(rng):
    """A clip without a cut, in which the hand once is just as fast as it may be: (3, 4) fifths of
    that in times of 64ths, so that no sum and no quotient rounds."""
    steps, most = rng.integers(2, 40, int(rng.integers(6, 12))) / 64, 5 * int(rng.integers(12, 60))
    shares = rng.permutation([4, *rng.integers(1, 4, len(steps) - 1)]) / 4
    ways = (most / 5 * steps * shares)[:, None] * np.array([3, 4])
    tip = (150, 90) + np.concatenate([[[0, 0]], np.cumsum(ways, axis=0)])
    return np.concatenate([[0], np.cumsum(steps)]), tip, float(most)


longest_piece.check("a clip without a cut, at just the highest speed once", _brisk)
longest_piece.mistake(
    "A cut is where the speed exceeds `most`: a hand that is just as fast is no cut, > and not >=.",
    "speed > most",
    "speed >= most",
)
longest_piece.check(
    "few frames that last long against many that do not",
    lambda rng: _cut_film(rng, [5, int(rng.integers(9, 12)), 6], slow=2, waits=False),
)
longest_piece.mistake(
    "The longest piece is the one that lasts longest, in seconds; yours is the one in which the "
    "tip goes farthest.",
    "times[piece[1] - 1] - times[piece[0]]",
    "np.linalg.norm(np.diff(tip[slice(*piece)], axis=0), axis=1).sum()",
)
longest_piece.mistake(
    "The longest piece is the one that lasts longest, in seconds; you count its frames.",
    "times[piece[1] - 1] - times[piece[0]]",
    "piece[1] - piece[0]",
)
longest_piece.mistake(
    "`most` is a speed, in pixels a second; you compare it with a way, from one frame to the next.",
    " / np.diff(times)",
    "",
)
longest_piece.mistake(
    "The step i leads from frame i to frame i + 1, and the new piece begins with the second.",
    "int(i) + 1",
    "int(i)",
)
longest_piece.mistake(
    "`last` is the first frame that no longer belongs to the piece, as in a slice.",
    "return max(pieces, key=lambda piece: times[piece[1] - 1] - times[piece[0]])",
    "first, last = max(pieces, key=lambda piece: times[piece[1] - 1] - times[piece[0]])\n"
    "    return first, last - 1",
)
longest_piece.mistake(
    "After the last cut comes one more piece, up to the clip's end.",
    "edges = [0, *cuts, len(times)]",
    "edges = [0, *cuts] if cuts else [0, len(times)]",
)
longest_piece.mistake(
    "Before the first cut there is a piece, too, from frame 0 on.",
    "edges = [0, *cuts, len(times)]",
    "edges = [*cuts, len(times)] if cuts else [0, len(times)]",
)
longest_piece.mistake(
    "A hand moves in x and in y: the speed is the length of both together; you take x alone.",
    "np.linalg.norm(np.diff(tip, axis=0), axis=1)",
    "np.abs(np.diff(tip[:, 0]))",
)
longest_piece.mistake(
    "You add up the ways in x and in y. The way between two places is the straight line, the root "
    "of the sum of squares.",
    "np.linalg.norm(np.diff(tip, axis=0), axis=1)",
    "np.abs(np.diff(tip, axis=0)).sum(1)",
)
longest_piece.mistake(
    "Each step takes its own time; you divide all of them by the clip's usual one.",
    "np.diff(times)",
    "np.diff(times).mean()",
)
longest_piece.mistake(
    "You return the shortest piece, where the longest is wanted.", "return max(", "return min("
)
longest_piece.mistake(
    "Return frames, not seconds: the indices of the first one and of the one after the last.",
    "return max(pieces, key=lambda piece: times[piece[1] - 1] - times[piece[0]])",
    "first, last = max(pieces, key=lambda piece: times[piece[1] - 1] - times[piece[0]])\n"
    "    return times[first], times[last - 1]",
)


@exercise("12.3", "From pixels to metres")
def fit(start, end, scene_start, scene_end):
    (dx, dy), (way, rise) = end - start, scene_end - scene_start
    a = way / dx
    s = abs(a)
    b = (rise + s * dy) / dx
    A = np.array([[a, 0.0], [b, -s]])
    return np.column_stack([A, scene_start - A @ start])


def _ways(rng, side, level=False):
    """Start and end in the picture, px, and in the scene, m; side: -1 for a way to the left."""
    start, scene = rng.uniform(60, 200, 2), rng.uniform(0.05, 0.6, 2)
    way = np.array([side * rng.uniform(40, 160), rng.choice([-1, 1]) * rng.uniform(8, 30)])
    there = np.array([rng.uniform(0.1, 0.3), rng.choice([-1, 1]) * rng.uniform(0.01, 0.04)])
    flat = np.array([1.0, 0.0 if level else 1.0])
    return start, start + way * flat, scene, scene + there * flat


fit.check("a level way to the right", lambda rng: _ways(rng, 1, level=True), atol=1e-8)
fit.check("a level way to the left", lambda rng: _ways(rng, -1, level=True), atol=1e-8)
fit.check("a way that rises or falls", lambda rng: _ways(rng, 1), points=2, atol=1e-8)
fit.check("a way to the left that rises or falls", lambda rng: _ways(rng, -1), atol=1e-8)
LEFT = "A clip that goes to the left is mirrored: a has the sign of dx, and s alone is positive."
UP = "y counts downwards in a picture, and z upwards in the scene: a pixel down is -s metres."
fit.mistake(LEFT, "a = way / dx", "a = way / abs(dx)")
fit.mistake(UP, "[b, -s]", "[b, s]", "rise + s * dy", "rise - s * dy")
fit.mistake(UP, "[b, -s]", "[b, s]")
fit.mistake(
    "With a mirrored clip left and right change places, up and down do not: s is positive.",
    "s = abs(a)",
    "s = a",
)
fit.mistake(
    "The end does not get to its height where the way rises or falls in the picture: b sees to it.",
    "b = (rise + s * dy) / dx",
    "b = 0.0",
)
fit.mistake(
    "b leads the end to its height in the scene. You level its way in the picture, and leave out "
    "by how much the goal is higher than the start.",
    "rise + s * dy",
    "s * dy",
)
fit.mistake(
    "b has to make up for the dy pixels that -s takes down: mind its sign.",
    "rise + s * dy",
    "rise - s * dy",
)
fit.mistake(
    "The scale comes from the way across, dx; you take the length of the whole way in the picture.",
    "a = way / dx",
    "a = way / np.hypot(dx, dy) * np.sign(dx)",
)
fit.mistake(
    "The last column is what is left of scene_start once A has moved start: scene_start - A start. "
    "You leave out what A does to it.",
    "scene_start - A @ start",
    "scene_start",
)
fit.mistake(
    "The last column is in metres: take from scene_start what A makes of start, not start itself.",
    "scene_start - A @ start",
    "scene_start - start",
)
fit.mistake(
    "The last column is missing its start: you took the end's pixels with the scene's start.",
    "scene_start - A @ start",
    "scene_start - A @ end",
)
fit.mistake(
    "Metres a pixel, not pixels a metre: a is way / dx.",
    "a = way / dx",
    "a = dx / way",
)
fit.mistake(
    "What stands upright in the picture has to stand upright in the scene, so x must not depend "
    "on y: b belongs into the second row.",
    "[[a, 0.0], [b, -s]]",
    "[[a, b], [0.0, -s]]",
)
fit.mistake(
    "Widths and heights have the same scale, s = |a|; yours are scaled each on their own.",
    "s = abs(a)",
    "s = abs(rise / dy) if dy else abs(a)",
)
fit.mistake(
    "z along the way has a part from dy, too: b makes up for -s dy.",
    "(rise + s * dy) / dx",
    "rise / dx",
)
fit.mistake(
    "The scale is fixed by x alone, way / dx; yours compares whole lengths, and misses the end.",
    "a = way / dx",
    "a = np.hypot(way, rise) / np.hypot(dx, dy)",
)


@exercise("12.4", "How far it has come")
def progress(path, start, end):
    way = end - start
    share = (path - start) @ way / (way @ way)
    return np.maximum.accumulate(np.clip(share, 0, 1))


def _way(rng, shares, aside=0.0):
    """A path along these shares of a way, up to `aside` of its length off the straight line."""
    way = rng.choice([-1, 1], 2) * rng.uniform(30, 120, 2)
    start = rng.uniform(80, 200, 2)
    off = rng.uniform(-aside, aside, len(shares))[:, None] * way[::-1] * (1, -1)
    return start + np.asarray(shares)[:, None] * way + off, start, start + way


def _rising(rng):
    """Shares from near 0 to nearly 1, an uneven way."""
    steps = rng.uniform(0.2, 1, int(rng.integers(5, 15)))
    return np.cumsum(steps) / (1.08 * steps.sum())


def _noisy(rng):
    """Shares that now and then fall, and that never leave 0 to 1."""
    shares = _rising(rng)
    shares[2] = shares[1] - 0.6 * shares[0]
    shares[3] = shares[1] - 0.3 * shares[0]  # still behind, though ahead of the one before
    shares[-1] = shares[-2] - 0.05
    return shares


progress.mistake(
    "You compare with the frame before alone: keep the largest share of all frames so far.",
    "np.maximum.accumulate(np.clip(share, 0, 1))",
    "np.maximum(np.clip(share, 0, 1), np.append(0, np.clip(share[:-1], 0, 1)))",
)
progress.check("on the straight line", lambda rng: _way(rng, _rising(rng)))
progress.check("beside it", lambda rng: _way(rng, _rising(rng), aside=0.3))
progress.check("noise that throws it back", lambda rng: _way(rng, _noisy(rng)))
progress.check(
    "before the start and beyond the end",
    lambda rng: _way(rng, [-0.1, -0.03, *0.9 * _rising(rng), 1.02, 1.1], aside=0.1),
)
progress.mistake(
    "It never comes back: what is pushed does not return by itself, so a smaller share after a "
    "larger one is noise. Keep the largest so far.",
    "np.maximum.accumulate(np.clip(share, 0, 1))",
    "np.clip(share, 0, 1)",
)
progress.mistake(
    "A share lies between 0 and 1, also before the start and beyond the end.",
    "np.clip(share, 0, 1)",
    "share",
)
progress.mistake(
    "Beyond the end the share stays at 1; you cut off what is below 0 alone.",
    "np.clip(share, 0, 1)",
    "np.maximum(share, 0)",
)
progress.mistake(
    "Before the start the share is 0; you cut off what is above 1 alone.",
    "np.clip(share, 0, 1)",
    "np.minimum(share, 1)",
)
progress.mistake(
    "Only the way along the line counts. You take the distance from the start, which grows "
    "sideways and backwards, too.",
    "(path - start) @ way / (way @ way)",
    "np.linalg.norm(path - start, axis=1) / np.linalg.norm(way)",
)
progress.mistake(
    "Divided by the way's length that is pixels; a share is divided by its square.",
    "(way @ way)",
    "np.sqrt(way @ way)",
)
progress.mistake(
    "The way begins at start: subtract it before you project.",
    "(path - start) @ way",
    "path @ way",
)
progress.mistake(
    "That is what is still to go; 0 is at the start, and 1 at the end.",
    "(path - start) @ way / (way @ way)",
    "(end - path) @ way / (way @ way)",
)
progress.mistake(
    "You look at x alone; the way has a y as well.",
    "(path - start) @ way / (way @ way)",
    "(path[:, 0] - start[0]) / way[0]",
)
progress.mistake(
    "Sorted, the shares no longer belong to their frames. Keep the largest so far instead.",
    "np.maximum.accumulate(np.clip(share, 0, 1))",
    "np.sort(np.clip(share, 0, 1))",
)
progress.mistake(
    "The largest so far, not the smallest: it goes on, not back.",
    "np.maximum.accumulate",
    "np.minimum.accumulate",
)
progress.mistake(
    "1 is at `end`. You divide by the farthest that the path itself has come.",
    "return np.maximum.accumulate(np.clip(share, 0, 1))",
    "share = np.maximum.accumulate(np.maximum(share, 0))\n    return share / share.max()",
)
