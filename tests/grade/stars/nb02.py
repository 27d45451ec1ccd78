"""Star 2, how long to hesitate: do policies find the highest of several hills?"""

import math

import torch

from tests.grade.star import Star

PLACES, STARTS, DRAWS = 60, 12, 8  # landscapes, policies in each, draws of a policy in an update
STEPS, HILLS = 500, 3
LR = 0.02  # of Adam, notebook 2's


def height(temperature) -> float:
    """How high policies end, as a share of the highest hill in their landscape: the mean of all.

    temperature(share, entropy) is alpha in an update; share, 0 to 1, is how much of the training
    is over, and entropy the policies' mean.
    """
    with torch.random.fork_rng(), torch.enable_grad():
        torch.manual_seed(0)
        middle = torch.rand(PLACES, 1, 1, HILLS) * 1.6 - 0.8
        high = torch.rand(PLACES, 1, 1, HILLS) * 0.8 + 0.2

        def hills(a):  # (PLACES, STARTS, n) -> the same
            return (high * torch.exp(-(((a[..., None] - middle) / 0.15) ** 2))).sum(-1)

        mean = torch.linspace(-1.2, 1.2, STARTS).repeat(PLACES, 1).requires_grad_()
        log_std = torch.full((PLACES, STARTS), -2.5, requires_grad=True)
        optimizer = torch.optim.Adam([mean, log_std], LR)
        entropy = torch.tensor(0.0)
        for step in range(STEPS):
            noise = torch.randn(PLACES, STARTS, DRAWS)
            u = mean[..., None] + log_std.clamp(-5, 2).exp()[..., None] * noise
            slope = 2 * (math.log(2) - u - torch.nn.functional.softplus(-2 * u))  # of tanh, log
            normal = -(noise**2) / 2 - math.log(2 * math.pi) / 2
            log_pi = normal - log_std.clamp(-5, 2)[..., None] - slope
            alpha = float(temperature(step / (STEPS - 1), entropy.item()))
            loss = (alpha * log_pi - hills(torch.tanh(u))).mean(-1).sum()  # Eq. 7, each its own
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            entropy = -log_pi.detach().mean()
        grid = torch.linspace(-1, 1, 401).expand(PLACES, 1, -1)
        top = hills(grid).amax(-1)
        end = hills(torch.tanh(mean.detach())[..., None])[..., 0]
        return float((end / top).mean())


STAR = Star(height, "of the highest hill", bar=0.93, naive=0.83, ours=0.941)
