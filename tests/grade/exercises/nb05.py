"""Notebook 5, Transporter: from heat map to keypoint to transport (Eq. 6-7)."""

import numpy as np
import torch

from tests.grade.exercise import exercise, gradients


def _tensor(rng, *shape, scale=1.0):
    return torch.from_numpy(np.float32(scale * rng.normal(size=shape)))


def _map(rng, square=False):
    """B, K, h and w of heat maps."""
    B, K = (int(n) for n in rng.integers((2, 2), (4, 6)))
    h, w = (int(n) for n in rng.choice(np.arange(4, 13), 2, replace=False))
    return B, K, h, h if square else w


def _peaks(rng):
    """Logits with one clear peak a map."""
    B, K, h, w = _map(rng)
    logits = np.zeros((B, K, h, w), np.float32)
    for b in range(B):
        for k in range(K):
            logits[b, k, rng.integers(h), rng.integers(w)] = 20
    return torch.from_numpy(logits)


@exercise("5.1", "From heat map to keypoint", probe=gradients("soft_argmax", logits=0))
def soft_argmax(logits):
    h, w = logits.shape[2:]
    p = logits.flatten(2).softmax(-1).view(logits.shape)
    x = (2 * torch.arange(w) + 1) / w - 1
    y = (2 * torch.arange(h) + 1) / h - 1
    return torch.stack([(p.sum(2) * x).sum(-1), (p.sum(3) * y).sum(-1)], -1)


soft_argmax.check("a clear peak is found where it is", lambda rng: (_peaks(rng), "values"))
soft_argmax.check(
    "several things share the probability",
    lambda rng: (_tensor(rng, *_map(rng), scale=2), "values"),
    least=lambda rng: (_tensor(rng, *_map(rng), scale=2)[:1, :1], "values"),
)
soft_argmax.check(
    "logits as large as 200", lambda rng: (_tensor(rng, *_map(rng, True), scale=200), "values")
)
soft_argmax.check(
    "it has a gradient, unlike an argmax", lambda rng: (_tensor(rng, *_map(rng)), "gradient")
)
# Both raise the same, and both are right where a map is a square.
EXCHANGED = (
    "A map has h rows and w columns. Yours exchanges them somewhere, and is right for squares "
    "alone: see whether the view is (B, K, h, w), and whether y's centres are made from h."
)
soft_argmax.mistake(
    "The values are right, but no gradient leaves your function, and the detector would not learn: "
    "no detach, no numpy, no torch.no_grad.",
    "p = logits",
    "p = logits.detach()",
)
soft_argmax.mistake(
    "A map has h rows: y is divided by h, yours by w.",
    "(2 * torch.arange(h) + 1) / h",
    "(2 * torch.arange(h) + 1) / w",
)
soft_argmax.mistake(
    "Your softmax goes over the keypoints of a cell: it goes over the cells of a keypoint's map.",
    "logits.flatten(2).softmax(-1).view(logits.shape)",
    "logits.softmax(1)",
)
soft_argmax.mistake(
    "Your softmax goes over all keypoints' maps at once: each map sums to 1 by itself.",
    "logits.flatten(2).softmax(-1)",
    "logits.flatten(1).softmax(-1)",
)
soft_argmax.mistake(
    "Your softmax goes over each column by itself, so that a map sums to w, not to 1: flatten its "
    "cells first.",
    "logits.flatten(2).softmax(-1).view(logits.shape)",
    "logits.softmax(2)",
)
soft_argmax.mistake(
    "x belongs to the columns: sum p over the rows first, axis 2, then weigh with x.",
    "(p.sum(2) * x).sum(-1), (p.sum(3) * y)",
    "(p.sum(3) * x).sum(-1), (p.sum(2) * y)",
)
soft_argmax.mistake(
    "Return (B, K, 2): x and y of a keypoint stand along the last axis.",
    "(p.sum(3) * y).sum(-1)], -1)",
    "(p.sum(3) * y).sum(-1)], 1)",
)
soft_argmax.mistake(
    "The map fills [-1, 1]: yours fills [0, 1].",
    "(2 * torch.arange(w) + 1) / w - 1",
    "(torch.arange(w) + 0.5) / w",
    "(2 * torch.arange(h) + 1) / h - 1",
    "(torch.arange(h) + 0.5) / h",
)
soft_argmax.mistake(
    "A cell's place is its centre, (2 j + 1) / w - 1; yours is its left or upper edge.",
    "(2 * torch.arange(w) + 1) / w - 1",
    "2 * torch.arange(w) / w - 1",
    "(2 * torch.arange(h) + 1) / h - 1",
    "2 * torch.arange(h) / h - 1",
)
soft_argmax.mistake(
    "x and y are swapped: x runs along the last axis, to the right, and comes first.",
    "torch.stack([(p.sum(2) * x).sum(-1), (p.sum(3) * y).sum(-1)], -1)",
    "torch.stack([(p.sum(3) * y).sum(-1), (p.sum(2) * x).sum(-1)], -1)",
)
soft_argmax.mistake(
    "Your cells run from edge to edge: cell 0's centre is half a cell inside, at 1 / w - 1.",
    "(2 * torch.arange(w) + 1) / w - 1",
    "torch.linspace(-1, 1, w)",
    "(2 * torch.arange(h) + 1) / h - 1",
    "torch.linspace(-1, 1, h)",
)
soft_argmax.mistake(
    "Your softmax does not go over the whole map of one keypoint: flatten its h * w cells first.",
    "logits.flatten(2).softmax(-1).view(logits.shape)",
    "logits.softmax(-1) / logits.shape[2]",
)
soft_argmax.mistake(
    "Your softmax goes over each row by itself, so that a map sums to h, not to 1: flatten its "
    "cells first.",
    "logits.flatten(2).softmax(-1).view(logits.shape)",
    "logits.softmax(-1)",
)
soft_argmax.mistake(
    "y runs down, as the rows do: row 0 is at 1 / h - 1; yours runs up.",
    "(2 * torch.arange(h) + 1) / h - 1",
    "1 - (2 * torch.arange(h) + 1) / h",
)
soft_argmax.mistake(
    "You return the largest cell, which has no gradient: take the mean place under the softmax.",
    "logits.flatten(2).softmax(-1)",
    "(logits.flatten(2) == logits.flatten(2).amax(-1, keepdim=True)).float()",
)
soft_argmax.mistake(
    "Return places in [-1, 1], not cell numbers.",
    "(2 * torch.arange(w) + 1) / w - 1",
    "1.0 * torch.arange(w)",
    "(2 * torch.arange(h) + 1) / h - 1",
    "1.0 * torch.arange(h)",
)
soft_argmax.mistake(
    "exp of a large logit overflows: use softmax, which subtracts the largest first.",
    "logits.flatten(2).softmax(-1)",
    "(logits.flatten(2).exp() / logits.flatten(2).exp().sum(-1, keepdim=True))",
)
soft_argmax.mistake(
    "One softmax over all cells, then sums over rows or columns: two softmaxes, one along each "
    "axis, are blind to where both agree.",
    "(p.sum(2) * x).sum(-1), (p.sum(3) * y).sum(-1)",
    "(logits.mean(2).softmax(-1) * x).sum(-1), (logits.mean(3).softmax(-1) * y).sum(-1)",
)
soft_argmax.mistake(
    EXCHANGED, "(2 * torch.arange(h) + 1) / h - 1", "(2 * torch.arange(w) + 1) / w - 1"
)
soft_argmax.mistake(EXCHANGED, ".view(logits.shape)", ".view(*logits.shape[:2], w, h)")
soft_argmax.mistake(
    "squeeze() drops every axis of length 1, that of one image or one keypoint, too: leave it out.",
    "(p.sum(3) * y).sum(-1)], -1)",
    "(p.sum(3) * y).sum(-1)], -1).squeeze()",
)
soft_argmax.mistake(
    "One softmax over all cells, then sums over rows or columns: yours adds logits up before.",
    "(p.sum(2) * x).sum(-1), (p.sum(3) * y).sum(-1)",
    "(logits.sum(2).softmax(-1) * x).sum(-1), (logits.sum(3).softmax(-1) * y).sum(-1)",
)


@exercise("5.2", "One map per image (the H of Eq. 6)", probe=gradients("heat_map", z=0))
def heat_map(z, sigma, size):
    cells = (2 * torch.arange(size) + 1) / size - 1
    x = torch.exp(-(((cells - z[..., 0, None]) / sigma) ** 2))
    y = torch.exp(-(((cells - z[..., 1, None]) / sigma) ** 2))
    h = y[..., :, None] * x[..., None, :]
    return 1 - (1 - h).prod(1, keepdim=True)


def _points(rng, least=0.1, K=None, ask="values"):
    """Keypoints (B, K, 2), a width and a size."""
    B, some, size = (int(n) for n in rng.integers((2, 2, 12), (6, 7, 25)))
    z = rng.uniform(-0.9, 0.9, (B, K or some, 2))
    sigma = float(rng.uniform(least, least + 0.15))
    if ask == "gradient":  # one stands on the very centre of a cell
        z[0, 0] = (2 * rng.integers(size, size=2) + 1) / size - 1
    return torch.from_numpy(np.float32(z)), sigma, size, ask


heat_map.check(
    "one keypoint",
    lambda rng: _points(rng, K=1),
    least=lambda rng: ((p := _points(rng))[0][:1, :1], *p[1:]),
)
heat_map.check("keypoints anywhere", lambda rng: _points(rng, 0.2))
heat_map.check(
    "several on one spot: no value above 1",
    lambda rng: ((p := _points(rng, 0.3))[0][:, :1].expand(p[0].shape).clone(), *p[1:]),
)
heat_map.check(
    "the gradient reaches the keypoints", lambda rng: _points(rng, 0.2, ask="gradient"), atol=1e-4
)
heat_map.mistake(
    "The values are right, but where a keypoint stands on a cell's centre 1 - h is 0, and its "
    "logarithm has no gradient: multiply.",
    "1 - (1 - h).prod(1, keepdim=True)",
    "1 - torch.exp(torch.log(1 - h).sum(1, keepdim=True))",
)
heat_map.mistake(
    "The values are right, but no gradient leaves your function, and the detector would not learn: "
    "no detach, no numpy, no torch.tensor of numbers, no torch.no_grad.",
    "cells = (2",
    "z = z.detach()\n    cells = (2",
)
heat_map.mistake(
    "The Gaussian's width is the argument sigma; yours is always 0.1.", "/ sigma", "/ 0.1"
)
heat_map.mistake(
    "You return how little a cell is covered: H is 1 minus the product.",
    "1 - (1 - h).prod(1, keepdim=True)",
    "(1 - h).prod(1, keepdim=True)",
)
heat_map.mistake(
    "The product of h_k is what all keypoints cover at once: take 1 minus the product of (1 - "
    "h_k).",
    "1 - (1 - h).prod(1, keepdim=True)",
    "h.prod(1, keepdim=True)",
)
heat_map.mistake(
    "Divide by sigma squared: the whole of d / sigma is squared.",
    "torch.exp(-(((cells - z[..., 0, None]) / sigma) ** 2))",
    "torch.exp(-((cells - z[..., 0, None]) ** 2) / sigma)",
    "torch.exp(-(((cells - z[..., 1, None]) / sigma) ** 2))",
    "torch.exp(-((cells - z[..., 1, None]) ** 2) / sigma)",
)
heat_map.mistake(
    "You return the mean of the keypoints' maps: take 1 minus the product of (1 - h_k).",
    "1 - (1 - h).prod(1, keepdim=True)",
    "h.mean(1, keepdim=True)",
)
heat_map.mistake(
    "Your maps sum past 1 where keypoints overlap: Eq. 6 wants one H per image, never above 1.",
    "1 - (1 - h).prod(1, keepdim=True)",
    "h.sum(1, keepdim=True)",
)
heat_map.mistake(
    "Eq. 6 wants one H per image; you return one map per keypoint.",
    "1 - (1 - h).prod(1, keepdim=True)",
    "h",
)
heat_map.mistake(
    "x and y are swapped: y picks the row, x the column.",
    "y[..., :, None] * x[..., None, :]",
    "x[..., :, None] * y[..., None, :]",
)
heat_map.mistake(
    "The Gaussian here is exp(-d^2 / sigma^2), without a factor 2.",
    "/ sigma) ** 2",
    "/ sigma) ** 2 / 2",
)
heat_map.mistake(
    "Your cells run from edge to edge: cell 0's centre is half a cell inside, at 1 / size - 1, as "
    "in 5.1.",
    "(2 * torch.arange(size) + 1) / size - 1",
    "torch.linspace(-1, 1, size)",
)
heat_map.mistake(
    "The square of the distance stands in the exponent, (d / sigma)^2; yours has the distance "
    "itself.",
    "torch.exp(-(((cells - z[..., 0, None]) / sigma) ** 2))",
    "((cells - z[..., 0, None]) / sigma) ** 2",
    "torch.exp(-(((cells - z[..., 1, None]) / sigma) ** 2))",
    "((cells - z[..., 1, None]) / sigma) ** 2",
    "y[..., :, None] * x[..., None, :]",
    "torch.exp(-(y[..., :, None] + x[..., None, :]).sqrt())",
)
heat_map.mistake(
    "A sum that is cut at 1 is not it: take 1 minus the product of all (1 - h_k).",
    "1 - (1 - h).prod(1, keepdim=True)",
    "h.sum(1, keepdim=True).clamp(max=1)",
)
heat_map.mistake(
    "The largest h_k is not it: two keypoints cover more than one. Take 1 minus the product of (1 "
    "- h_k).",
    "1 - (1 - h).prod(1, keepdim=True)",
    "h.amax(1, keepdim=True)",
)
heat_map.mistake(
    "squeeze() drops every axis of length 1, that of one image, too: leave it out.",
    "1 - (1 - h).prod(1, keepdim=True)",
    "1 - (1 - h).prod(1).squeeze().unsqueeze(-3)",
)
heat_map.mistake(
    "Keep a dimension of size 1 for the channels, so that H multiplies features of any number of "
    "them.",
    "prod(1, keepdim=True)",
    "prod(1)",
)


@exercise("5.3", "Transport (Eq. 6)", probe=gradients("transport", graph=(0, 2), phi_y=1, h_y=3))
def transport(phi_x, phi_y, h_x, h_y):
    phi_x, h_x = phi_x.detach(), h_x.detach()
    return (1 - h_x) * (1 - h_y) * phi_x + h_y * phi_y


def _features(rng, ask="values"):
    B, C, *size = (int(n) for n in rng.integers((2, 2, 4, 4), (5, 7, 10, 10)))
    h = [torch.from_numpy(np.float32(rng.uniform(0, 1, (B, 1, *size)))) for _ in range(2)]
    return _tensor(rng, B, C, *size), _tensor(rng, B, C, *size), *h, ask


transport.check(
    "features and maps anywhere",
    _features,
    least=lambda rng: (*(x[:1, :1] for x in _features(rng)[:4]), "values"),
)
transport.check(
    "where neither frame has a keypoint, the source stays",
    lambda rng: (*(f := _features(rng))[:2], 0 * f[2], 0 * f[3], f[4]),
)
transport.check(
    "the gradient reaches what is pasted, and where", lambda rng: _features(rng, "gradient")
)
transport.mistake(
    "The values are right, but no gradient leaves your function: y's features and its keypoints "
    "would not learn. No detach around the whole, no numpy, no torch.no_grad.",
    "(1 - h_x) * (1 - h_y) * phi_x + h_y * phi_y",
    "((1 - h_x) * (1 - h_y) * phi_x + h_y * phi_y).detach()",
)
transport.mistake(
    "The values are right, but y's map says where is pasted, and no gradient reaches it: no detach "
    "of h_y.",
    "h_x.detach()",
    "h_x.detach()\n    h_y = h_y.detach()",
)
transport.mistake(
    "The values are right, but 1 - h_y does not come from x: cut off phi_x and h_x alone, or "
    "nothing.",
    "(1 - h_x) * (1 - h_y) * phi_x",
    "((1 - h_x) * (1 - h_y) * phi_x).detach()",
)
transport.mistake(
    "What is cut out stays in: x's features are multiplied by (1 - H_x)(1 - H_y).",
    "(1 - h_x) * (1 - h_y) * phi_x",
    "phi_x",
)
transport.mistake(
    "H marks where the keypoints are, 1 - H the rest: yours keeps x's features at the keypoints.",
    "(1 - h_x) * (1 - h_y) * phi_x",
    "h_x * h_y * phi_x",
)
transport.mistake(
    "At y's keypoints y's features are added to what is left: yours takes them off.",
    "phi_x + h_y * phi_y",
    "phi_x - h_y * phi_y",
)
transport.mistake("What is pasted is missing: + H_y Phi(y).", " + h_y * phi_y", "")
transport.mistake(
    "What is pasted counts in full at y's keypoints: yours loses it where x has one.",
    "+ h_y * phi_y",
    "+ (1 - h_x) * h_y * phi_y",
)
transport.mistake(
    "The source is cut out at both frames' keypoints: (1 - H_x) and (1 - H_y). You forget H_y.",
    "(1 - h_x) * (1 - h_y) * phi_x",
    "(1 - h_x) * phi_x",
)
transport.mistake(
    "The source is cut out at both frames' keypoints: (1 - H_x) and (1 - H_y). You forget H_x.",
    "(1 - h_x) * (1 - h_y) * phi_x",
    "(1 - h_y) * phi_x",
)
transport.mistake(
    "What is pasted comes from y, at y's keypoints; yours comes from x.",
    "h_y * phi_y",
    "h_y * phi_x",
)
transport.mistake(
    "What is pasted stands at y's keypoints, not at x's.", "+ h_y * phi_y", "+ h_x * phi_y"
)
transport.mistake(
    "x and y are exchanged: x's features stay, y's are pasted at y's keypoints.",
    "(1 - h_y) * phi_x + h_y * phi_y",
    "(1 - h_y) * phi_y + h_x * phi_x",
)
transport.mistake(
    "A cell is cut out if either frame has a keypoint there: (1 - H_x)(1 - H_y), which is not 1 - "
    "H_x H_y.",
    "(1 - h_x) * (1 - h_y)",
    "(1 - h_x * h_y)",
)
transport.mistake(
    "Where both maps cover, 1 - H_x - H_y takes off twice: (1 - H_x)(1 - H_y).",
    "(1 - h_x) * (1 - h_y)",
    "(1 - h_x - h_y)",
)
transport.mistake(
    "What is left is (1 - H_x)(1 - H_y), the product; you take off the larger of the two.",
    "(1 - h_x) * (1 - h_y)",
    "(1 - torch.maximum(h_x, h_y))",
)
transport.mistake(
    "The values are right, but no gradient reaches y's features, and they are what is learnt: no "
    "detach there.",
    "h_y * phi_y",
    "h_y * phi_y.detach()",
)


@exercise("5.4", "The loss (Eq. 7), weighted", probe=gradients("loss", y_hat=0))
def loss(y_hat, y, median):
    weight = 1 + 10 * (y - median).abs().mean(1, keepdim=True)
    return (weight * (y_hat - y) ** 2).mean()


def _images(rng, ask="values"):
    B, H, W = (int(n) for n in rng.integers((2, 4, 5), (5, 11, 12)))
    return _tensor(rng, B, 3, H, W), _tensor(rng, B, 3, H, W), _tensor(rng, 1, 3, H, W), ask


loss.check(
    "images anywhere",
    _images,
    least=lambda rng: ((i := _images(rng))[0][:1], i[1][:1], *i[2:]),
)
loss.check(
    "a perfect picture costs nothing", lambda rng: ((y := _images(rng))[1], y[1].clone(), *y[2:])
)
loss.check(
    "a frame that is the median: every pixel counts once",
    lambda rng: ((y := _images(rng))[0], y[2].expand(y[0].shape).clone(), *y[2:]),
)
loss.check("the gradient reaches the picture", lambda rng: _images(rng, "gradient"))
loss.mistake(
    "The values are right, but no gradient leaves your function, and nothing would learn: no "
    "detach, no item, no numpy, no torch.no_grad.",
    ".mean()\n",
    ".mean().detach()\n",
)
loss.mistake(
    "The weight is missing: a pixel that differs from the median counts more.", "weight * (y", "(y"
)
loss.mistake("The factor 10 is missing: 1 + 10 m.", "1 + 10 *", "1 +")
loss.mistake(
    "The loss is the mean over all entries, not their sum.",
    "(weight * (y_hat - y) ** 2).mean()",
    "(weight * (y_hat - y) ** 2).sum()",
)
loss.mistake(
    "m is a mean over the three colours; yours is their sum.",
    ".abs().mean(1, keepdim=True)",
    ".abs().sum(1, keepdim=True)",
)
loss.mistake(
    "A pixel's weight has to meet that pixel's own error; yours is a mean over the picture before.",
    ".abs().mean(1, keepdim=True)",
    ".abs().mean()",
)
loss.mistake(
    "m is a mean of absolute differences, not of squares.",
    ".abs().mean(1, keepdim=True)",
    ".square().mean(1, keepdim=True)",
)
loss.mistake(
    "The weight is one number a pixel: the mean over the three colours, with the channel's "
    "dimension kept.",
    ".mean(1, keepdim=True)",
    "",
)
loss.mistake(
    "Take |y - median| first, then its mean over the colours: yours lets colours that go up and "
    "down cancel.",
    ".abs().mean(1, keepdim=True)",
    ".mean(1, keepdim=True).abs()",
)
loss.mistake(
    "Do not divide by the mean weight: take the plain mean of weight times square over all "
    "entries.",
    "(weight * (y_hat - y) ** 2).mean()",
    "(weight * (y_hat - y) ** 2).mean() / weight.mean()",
)
loss.mistake(
    "Do not divide by the weights' sum: take the plain mean over all entries.",
    "(weight * (y_hat - y) ** 2).mean()",
    "(weight * (y_hat - y) ** 2).sum() / weight.sum()",
)
loss.mistake(
    "The weight stands beside the square; yours is squared, too.",
    "weight * (y_hat - y) ** 2",
    "weight**2 * (y_hat - y) ** 2",
)
loss.mistake(
    "Every pixel counts at least once: the weight is 1 + 10 times the difference.",
    "1 + 10 *",
    "10 *",
)
loss.mistake(
    "Squared differences: a missing object costs more than a blurred edge.",
    "(y_hat - y) ** 2",
    "(y_hat - y).abs()",
)
loss.mistake(
    "The weight marks what moves in the true frame y, not in your own reconstruction.",
    "(y - median)",
    "(y_hat - median)",
)
loss.mistake(
    "Keep the colours' axis, keepdim=True: (B, H, W) does not fit (B, 3, H, W).",
    "keepdim=True",
    "keepdim=False",
)


@exercise("5.5", "Does it follow the truth?")
def r2(z, truth):
    half = len(z) // 2
    A = np.concatenate([z.reshape(len(z), -1), np.ones((len(z), 1))], 1)
    W = np.linalg.lstsq(A[:half], truth[:half], rcond=None)[0]
    held = truth[half:]
    return 1 - ((A[half:] @ W - held) ** 2).sum() / ((held - held.mean()) ** 2).sum()


def _follows(rng, noise=0.02, least=30, K=None):
    T, K = 2 * int(rng.integers(least, least + 15)), K or int(rng.integers(2, 6))
    z = rng.normal(size=(T, K, 2))
    return z, 40 + z.reshape(T, -1) @ rng.normal(0, 5, 2 * K) + rng.normal(0, 50 * noise, T)


r2.check("keypoints that follow, with jitter", _follows, atol=1e-3)
r2.check(
    "keypoints that follow exactly",
    lambda rng: _follows(rng, 0),
    atol=1e-3,
    least=lambda rng: _follows(rng, 0, K=1),
)
r2.check(
    "keypoints that know nothing",
    lambda rng: ((z := _follows(rng)[0]), rng.normal(size=len(z))),
    atol=1e-3,
)
r2.mistake(
    "You judge on the frames you fitted: keypoints that know nothing still fit a little. Fit on "
    "the first half, judge on the second.",
    "held = truth[half:]",
    "held, half = truth, 0",
)
r2.mistake(
    "You fit on all frames: those you judge on must not help the fit. Fit on the first half.",
    "A[:half], truth[:half]",
    "A, truth",
)
r2.mistake(
    "You fit on the even frames and judge on the odd ones, their neighbours: fit on the first "
    "half.",
    "A[:half], truth[:half]",
    "A[::2], truth[::2]",
    "truth[half:]",
    "truth[1::2]",
    "A[half:]",
    "A[1::2]",
)
r2.mistake(
    "The mean in the denominator is that of the second half, on which you judge; yours is that of "
    "the first.",
    "held.mean()",
    "truth[:half].mean()",
)
r2.mistake(
    "The mean in the denominator is that of the second half alone; yours is that of all frames.",
    "held.mean()",
    "truth.mean()",
)
r2.mistake(
    "A squared correlation forgives a wrong scale and place: take 1 minus squared errors over "
    "spread.",
    "1 - ((A[half:] @ W - held) ** 2).sum() / ((held - held.mean()) ** 2).sum()",
    "np.corrcoef(A[half:] @ W, held)[0, 1] ** 2",
)
r2.mistake(
    "The map needs a constant: append a column of ones.",
    "np.ones((len(z), 1))",
    "np.zeros((len(z), 1))",
)
r2.mistake(
    "Judge on the second half: yours is fitted on the second and judged on the first.",
    "A[:half], truth[:half]",
    "A[half:], truth[half:]",
    "truth[half:]\n",
    "truth[:half]\n",
    "((A[half:] @ W",
    "((A[:half] @ W",
)
r2.mistake(
    "Sums above and below, or means above and below: yours mixes them.",
    "((A[half:] @ W - held) ** 2).sum()",
    "((A[half:] @ W - held) ** 2).mean()",
)
r2.mistake(
    "Square the errors, and the spread, too.",
    "((A[half:] @ W - held) ** 2).sum() / ((held - held.mean()) ** 2).sum()",
    "np.abs(A[half:] @ W - held).sum() / np.abs(held - held.mean()).sum()",
)
r2.mistake("R^2 is 1 minus the share of the variance that is left.", "return 1 - (", "return (")
r2.mistake(
    "Compare with the spread about the mean of the held-out truth, not about 0.",
    "(held - held.mean())",
    "held",
)
r2.mistake(
    "Divide the errors and the spread by the same number; np.var with ddof=1 has one less.",
    "((held - held.mean()) ** 2).sum()",
    "(((held - held.mean()) ** 2).sum() * len(held) / (len(held) - 1))",
)
r2.mistake(
    "You judge on the first half, to which you fitted: judge on the second.",
    "held = truth[half:]",
    "held = truth[:half]",
    "((A[half:] @ W",
    "((A[:half] @ W",
)
r2.mistake(
    "A frame's 2K numbers are neighbours in z, so a row is z.reshape(len(z), -1): yours mixes the "
    "frames.",
    "z.reshape(len(z), -1)",
    "z.reshape(-1, len(z)).T",
)
r2.mistake(
    "You fit to x alone: each keypoint has two coordinates, and both belong to it.",
    "z.reshape(len(z), -1)",
    "z[..., 0].reshape(len(z), -1)",
)
