"""The detector's network, what its map is taught, and how the map is read.

In: a frame beside its clip's median, first and last frame, (B, 12, 84, 84) in [-1, 1]. Out: for tip
and object each, logits over the 42 x 42 cells of a map and one more for "nowhere". Places are in
pixels of an 84x84 frame, from its left and upper edge.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import nn

from lbw_minimal.clips.drawn_shapes import SIZE

WIDTH = 96  # channels
CELLS = 42  # of the map, each way: a cell is two pixels wide
SIGMA = 2.0  # pixels, of the Gaussian that the map is taught
CUT = 0.05  # the chance that a place has nothing to do with that in the frame before
MASK_WEIGHT = 10.0  # of the masks' mean error in the loss
WINDOW = 3  # cells to each side of the peak whose mean is the place


class _Residual(nn.Module):
    def __init__(self, dilation):
        super().__init__()
        self.conv = nn.Conv2d(WIDTH, WIDTH, 3, padding=dilation, dilation=dilation, bias=False)
        self.norm = nn.GroupNorm(4, WIDTH)

    def forward(self, x):
        return x + F.relu(self.norm(self.conv(x)))


class Network(nn.Module):
    """Maps of tip and object."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Sequential(
            nn.PixelUnshuffle(2),  # (B, 48, 42, 42)
            nn.Conv2d(48, WIDTH, 3, 2, 1, bias=False),  # (B, 96, 21, 21)
            nn.GroupNorm(4, WIDTH),
            nn.ReLU(),
        )
        self.where = nn.Conv2d(2, WIDTH, 1, bias=False)  # a cell's coordinates as features
        # The dilations let every cell see most of the frame: where the arm comes from matters.
        self.trunk = nn.Sequential(*map(_Residual, (1, 2, 4, 1, 2, 4, 2, 1)))
        self.maps = nn.Sequential(nn.Conv2d(WIDTH, 4 * 4, 1), nn.PixelShuffle(2))  # (B, 4, 42, 42)
        self.nowhere = nn.Linear(2 * WIDTH, 2)

    def forward(self, images: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Logits (B, 2, 42 * 42 + 1), of tip and object, and (B, 2, 42, 42), of arm and object.

        The first ask on which cell the middle is, the last entry standing for "nowhere"; the second
        ask of each cell whether it shows the thing.
        """
        frame, around = images[:, :3], images[:, 3:]
        # What moves is 0 nowhere else: a difference is easier to learn from than two images.
        h = self.stem(torch.cat([frame, frame.repeat(1, 3, 1, 1) - around], 1))
        line = torch.linspace(-1, 1, h.shape[-1], device=h.device)
        grid = torch.stack(torch.meshgrid(line, line, indexing="xy"))
        h = self.trunk(h + self.where(grid[None]))
        nowhere = self.nowhere(torch.cat([h.mean((2, 3)), h.amax((2, 3))], 1))
        maps = self.maps(h)
        return torch.cat([maps[:, :2].flatten(2), nowhere[..., None]], 2), maps[:, 2:]


def middles() -> torch.Tensor:
    """Where the middles of the map's cells are, (42,) in pixels."""
    return (2 * torch.arange(CELLS) + 1) * SIZE / (2 * CELLS)


def target(places: torch.Tensor) -> torch.Tensor:
    """What the softmax of the logits ought to be, (B, 2, 42 * 42 + 1), for places (B, 2, 2).

    A Gaussian about the place; all on "nowhere" where the place is nan.
    """
    off = middles().to(places.device) - places[..., None]
    bump = torch.exp(-(off**2) / (2 * SIGMA**2))  # (B, 2, 2, 42)
    p = (bump[..., 1, :, None] * bump[..., 0, None, :]).flatten(2)
    p = (p / p.sum(2, keepdim=True)).nan_to_num(0.0)
    return torch.cat([p, places[..., :1].isnan().float()], 2)


def loss(
    logits: torch.Tensor, mask_logits: torch.Tensor, places: torch.Tensor, masks: torch.Tensor
) -> torch.Tensor:
    """Cross-entropy of what `Network` says; places (B, 2, 2), masks (B, 2, 42, 42) in 0..1.

    A place is one cell in 1,764, too rare a hint to learn to see from: every cell of a mask is one.
    """
    where = -(target(places) * logits.log_softmax(2)).sum(2).mean()
    return where + MASK_WEIGHT * F.binary_cross_entropy_with_logits(mask_logits, masks)


def both_ways(network: Network, images: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """What `Network` says of images (B, 12, 84, 84), averaged over them and their mirror images:
    the errors of the two differ."""
    (logits, shown), (mirrored, mirrored_shown) = network(images), network(images.flip(3))
    maps = mirrored[..., :-1].unflatten(2, (CELLS, CELLS)).flip(3).flatten(2)
    logits = (logits + torch.cat([maps, mirrored[..., -1:]], 2)) / 2
    return logits, (shown + mirrored_shown.flip(3)) / 2


def together(p: torch.Tensor) -> torch.Tensor:
    """Maps p (T, 2, 42, 42) of successive frames, weighed by what is near in the frames around.

    A hidden Markov model's forward-backward pass, with cells as states: a tip or an object moves a
    little from frame to frame, and now and then, in a cut, anywhere.
    """

    def spread(one):
        near = F.avg_pool2d(F.avg_pool2d(one, 3, 1, 1), 3, 1, 1)
        one = (1 - CUT) * near + CUT * one.mean((1, 2), keepdim=True)
        return one / one.sum((1, 2), keepdim=True)

    # The root, as errors of neighbouring frames are alike: they are not as good as two witnesses.
    seen = (p + 1e-6).sqrt()
    before, after = torch.ones_like(p), torch.ones_like(p)
    for t in range(1, len(p)):
        before[t] = spread(before[t - 1] * seen[t - 1])
        after[-1 - t] = spread(after[-t] * seen[-t])
    return before * seen * after


def read(logits: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Places (T, 2, 2) and sureness (T, 2) in 0..1 of a clip's logits (T, 2, 42 * 42 + 1).

    A place is the mean of the cells about the peak of `together`, the sureness what the frame's own
    map has there: little, if it has other peaks, or if it says nowhere.
    """
    p = logits.float().softmax(2)[..., :-1].unflatten(2, (CELLS, CELLS))  # (T, 2, 42, 42)
    peak = F.avg_pool2d(together(p), 3, 1, 1).flatten(2).argmax(2)  # (T, 2)
    cell = torch.arange(CELLS)
    near_y = (cell - peak[..., None] // CELLS).abs() <= WINDOW  # (T, 2, 42)
    near_x = (cell - peak[..., None] % CELLS).abs() <= WINDOW
    p = (p + 1e-12) * near_y[..., :, None] * near_x[..., None, :]
    sure = p.sum((2, 3))
    place = torch.stack([p.sum(2) @ middles(), p.sum(3) @ middles()], -1)
    return place / sure[..., None], sure
