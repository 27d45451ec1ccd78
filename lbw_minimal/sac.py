"""Soft actor-critic on vectors (Haarnoja et al. 2018, arXiv 1812.05905), the RL algorithm of the
paper.

In: a Gymnasium environment with vector observations and actions in [-1, 1]. Out: a policy and a log
with a row an episode. Not in the publication: LayerNorm in the critics (keeps Q from running away
when steps are few), running normalisation of observations, four updates a step, a lower target
entropy, a learning rate that falls towards the end, an averaged copy of the actor, and a last round
without noise in which raw and averaged actors of the best episodes compete for acting at test time.
"""

from __future__ import annotations

import math
from copy import deepcopy
from itertools import pairwise

import numpy as np
import torch
import torch.nn.functional as F
from torch import nn

from .training import Checkpoint, load_state, progress, save_state, seed_everything

# exp(-5) acts as good as deterministic; exp(2) is past tanh's ends
LOG_STD_MIN, LOG_STD_MAX = -5.0, 2.0
# aimed at, per number of an action; the published -1 is noise of 0.09, too much to dose a hit
ENTROPY = -2.0
WINDOW = 10  # episodes whose mean return makes the actors at their end candidates
CANDIDATES = 4  # windows that are kept: training goes up and down
# episodes without noise for each candidate; with noise an actor may dose a hit, without overshoot
TRIALS = 5
# of the training: from here the learning rate falls to 0; on slide 38 of 40 for 34 without
FALL_FROM = 0.3
# below it is a keypoint's noise: dividing by less would blow the noise up to a signal
MIN_OBS_STD = 0.02


class Actor(nn.Module):
    """pi(a|s) = tanh(Normal(mean(s), std(s))), every action in (-1, 1)."""

    def __init__(self, obs_dim: int, action_dim: int, width: int):
        super().__init__()
        self.net = nn.Sequential(
            *(nn.Linear(obs_dim, width), nn.ReLU()),
            *(nn.Linear(width, width), nn.ReLU()),
            nn.Linear(width, 2 * action_dim),
        )

    def forward(self, s):
        mean, log_std = self.net(s).chunk(2, dim=-1)  # (B, A), (B, A)
        # A tanh keeps a gradient at both bounds; a hard clamp would not.
        log_std = LOG_STD_MIN + 0.5 * (LOG_STD_MAX - LOG_STD_MIN) * (torch.tanh(log_std) + 1)
        return mean, log_std

    def sample(self, s):
        """Draw actions (B, A) with their log-density (B,), differentiable in the weights."""
        mean, log_std = self(s)
        noise = torch.randn_like(mean)
        u = mean + log_std.exp() * noise
        # log N(u) - log |da/du|, and log(1 - tanh(u)^2) = 2 (log 2 - u - softplus(-2u)) never
        # overflows
        log_normal = -0.5 * noise.square() - log_std - 0.5 * math.log(2 * math.pi)
        log_slope = 2 * (math.log(2) - u - F.softplus(-2 * u))
        return torch.tanh(u), (log_normal - log_slope).sum(-1)


class TwinCritic(nn.Module):
    """Two independent Q(s, a) as one batched network: half the calls of two modules."""

    def __init__(self, obs_dim: int, action_dim: int, width: int):
        super().__init__()
        sizes = [obs_dim + action_dim, width, width, 1]
        self.weights, self.biases = nn.ParameterList(), nn.ParameterList()
        for n_in, n_out in pairwise(sizes):
            bound = n_in**-0.5  # as nn.Linear
            self.weights.append(torch.empty(2, n_in, n_out).uniform_(-bound, bound))
            self.biases.append(torch.empty(2, 1, n_out).uniform_(-bound, bound))

    def forward(self, s, a, frozen: bool = False):
        """Q_1 and Q_2 (2, B) of s (B, S) and a (B, A); `frozen` lets gradients pass to `a`
        alone."""
        W, b = ([p.detach() if frozen else p for p in ps] for ps in (self.weights, self.biases))
        x = torch.cat([s, a], -1).expand(2, -1, -1)  # (2, B, S + A)
        for i in range(2):
            # The bias goes in before LayerNorm, which forgets scale: Q(s, a) would equal Q(2s, 2a).
            x = F.relu(F.layer_norm(torch.baddbmm(b[i], x, W[i]), W[i].shape[-1:]))  # (2, B, width)
        return torch.baddbmm(b[2], x, W[2]).squeeze(-1)  # (2, B)


class ReplayBuffer:
    """The last `capacity` transitions in arrays; `terminal` is 1 only where the task itself
    ended."""

    def __init__(self, obs_dim: int, action_dim: int, capacity: int):
        shapes = {"obs": (obs_dim,), "action": (action_dim,), "next_obs": (obs_dim,)}
        shapes |= {"reward": (), "terminal": ()}
        self.data = {k: np.zeros((capacity, *s), np.float32) for k, s in shapes.items()}
        self.capacity, self.added = capacity, 0

    def __len__(self):
        return min(self.added, self.capacity)

    def add(self, **transition) -> None:
        for k, v in self.data.items():
            v[self.added % self.capacity] = transition[k]
        self.added += 1

    def sample(self, rng: np.random.Generator, batch: int) -> dict[str, torch.Tensor]:
        i = rng.integers(len(self), size=batch)
        return {k: torch.from_numpy(v[i]) for k, v in self.data.items()}

    def state(self) -> dict:
        return {"added": self.added, "data": {k: v[: len(self)] for k, v in self.data.items()}}

    def load_state(self, state: dict) -> None:
        self.added = state["added"]
        for k, v in state["data"].items():
            self.data[k][: len(self)] = v.numpy()


class SAC:
    """Actor, twin critics and temperature with their optimizers.

    obs_dim, action_dim: sizes of the vectors; actions are in [-1, 1]. gamma: discount; 0.95 looks
    20 steps ahead, enough for a reward that is paid at every step. tau: pace of the target critics.
    alpha: first temperature, for rewards of about 1 a step. average: pace of `test_actor`, the
    actor's mean over some 500 updates, until `train` puts the best one there.
    """

    def __init__(
        self,
        obs_dim: int,
        action_dim: int,
        *,
        width: int = 128,
        gamma: float = 0.95,
        tau: float = 0.005,
        critic_lr: float = 1e-3,
        actor_lr: float = 1e-3,
        alpha: float = 0.02,
        average: float = 0.002,
    ):
        self.sizes = {"obs_dim": obs_dim, "action_dim": action_dim, "width": width}
        self.gamma, self.tau, self.average = gamma, tau, average
        self.actor = Actor(obs_dim, action_dim, width)
        self.critic = TwinCritic(obs_dim, action_dim, width)
        self.log_alpha = torch.tensor(math.log(alpha), requires_grad=True)
        self.target_entropy = ENTROPY * action_dim
        self.test_actor = deepcopy(self.actor).requires_grad_(False)
        self.target = deepcopy(self.critic).requires_grad_(False)
        # One optimizer for all three: the calls, not the arithmetic, are what a small network
        # costs.
        groups = [
            {"params": [*self.critic.parameters(), self.log_alpha], "lr": critic_lr},
            {"params": list(self.actor.parameters()), "lr": actor_lr},
        ]
        self.optimizer = torch.optim.Adam(groups, fused=True)
        self.rates = critic_lr, actor_lr
        self._slow = [list(m.parameters()) for m in (self.target, self.test_actor)]
        self._fast = [list(m.parameters()) for m in (self.critic, self.actor)]
        self.obs_count = 0
        self.obs_mean, self.obs_var = torch.zeros(obs_dim), torch.ones(obs_dim)

    @property
    def alpha(self) -> float:
        return self.log_alpha.exp().item()

    def slow_down(self, passed: float) -> None:
        """Set the learning rates for the time when a share `passed` of the training is over."""
        share = min(1.0, max(0.0, 1 - passed) / (1 - FALL_FROM))
        for group, rate in zip(self.optimizer.param_groups, self.rates, strict=True):
            group["lr"] = share * rate

    def observe(self, obs) -> None:
        """Take one observation (S,) into the running mean and variance (Welford)."""
        self.obs_count += 1
        delta, share = torch.as_tensor(obs) - self.obs_mean, 1 / self.obs_count
        self.obs_mean = self.obs_mean + share * delta
        self.obs_var = (1 - share) * (self.obs_var + share * delta.square())

    def normalise(self, obs):
        return ((obs - self.obs_mean) / self.obs_var.sqrt().clamp(min=MIN_OBS_STD)).clamp(-5, 5)

    @torch.no_grad()
    def act(self, obs, deterministic: bool = False) -> np.ndarray:
        """Action (A,) float32 in [-1, 1] for an observation (S,): a sample, or the test actor's
        mean."""
        s = self.normalise(torch.as_tensor(obs, dtype=torch.float32))
        a = torch.tanh(self.test_actor(s)[0]) if deterministic else self.actor.sample(s)[0]
        return a.numpy()

    def critic_target(self, batch) -> torch.Tensor:
        """y = r + gamma (1 - terminal) (min_i Q'_i(s', a') - alpha log pi(a'|s')), a' ~ pi(s').
        (B,)"""
        with torch.no_grad():
            s_next = self.normalise(batch["next_obs"])
            a_next, log_pi = self.actor.sample(s_next)
            value = self.target(s_next, a_next).amin(0) - self.log_alpha.exp() * log_pi
            return batch["reward"] + self.gamma * (1 - batch["terminal"]) * value

    def update(self, batch: dict[str, torch.Tensor]) -> dict[str, float]:
        """One gradient step of critics, actor and temperature on a batch of transitions; returns
        losses."""
        s, y = self.normalise(batch["obs"]), self.critic_target(batch)
        critic_loss = (self.critic(s, batch["action"]) - y).square().mean(1).sum()

        a, log_pi = self.actor.sample(s)
        alpha = self.log_alpha.exp()
        actor_loss = (alpha.detach() * log_pi - self.critic(s, a, frozen=True).amin(0)).mean()
        # Raises alpha while the entropy -E[log pi] is below its target.
        entropy = -log_pi.detach().mean()
        alpha_loss = alpha * (entropy - self.target_entropy)

        self.optimizer.zero_grad()
        (critic_loss + actor_loss + alpha_loss).backward()
        self.optimizer.step()
        for slow, fast, pace in zip(self._slow, self._fast, (self.tau, self.average), strict=True):
            torch._foreach_lerp_(slow, fast, pace)
        return {
            "critic_loss": critic_loss.item(),
            "actor_loss": actor_loss.item(),
            "q": y.mean().item(),
            "alpha": self.alpha,
            "entropy": entropy.item(),
        }

    def actors(self) -> list[dict]:
        """Copies of the raw and the averaged actor's state."""
        return [deepcopy(actor.state_dict()) for actor in (self.actor, self.test_actor)]

    def _modules(self):
        return {
            n: getattr(self, n) for n in ("actor", "critic", "test_actor", "target", "optimizer")
        }

    def state(self) -> dict:
        """All that `load_state` needs to go on exactly here."""
        rest = {n: getattr(self, n) for n in ("log_alpha", "obs_mean", "obs_var", "obs_count")}
        return {n: m.state_dict() for n, m in self._modules().items()} | rest

    def load_state(self, state: dict) -> None:
        for n, m in self._modules().items():
            m.load_state_dict(state[n])
        # in place: the optimizer holds this very tensor
        self.log_alpha.data.copy_(state["log_alpha"])
        self.obs_mean, self.obs_var, self.obs_count = (
            state[f"obs_{n}"] for n in ("mean", "var", "count")
        )


def save(path, sac: SAC) -> None:
    """Write the agent to one file."""
    save_state(path, {"sizes": sac.sizes, "agent": sac.state()})


def load(path) -> SAC:
    """The agent that `save` wrote. Raises InputError if the file is missing or damaged."""
    saved = load_state(path)
    sac = SAC(**saved["sizes"])
    sac.load_state(saved["agent"])
    return sac


def train(
    env,
    *,
    steps: int,
    seed: int,
    checkpoint: Checkpoint | None = None,
    evaluate=None,
    evaluate_every: int = 10,
    updates: int = 4,
    random_steps: int = 500,
    batch: int = 128,
    **recipe,
) -> tuple[SAC, list[dict]]:
    """Train on `env` until the first episode that ends at or after `steps` environment steps.

    env: observations (S,) float32, actions (A,) in [-1, 1]. Its `info["reward_parts"]` and
    `info["is_success"]`, that of an episode's last step, go to the log and nowhere else. updates:
    gradient steps an environment step, after `random_steps` uniformly random ones. evaluate(sac) ->
    dict joins the log every `evaluate_every` episodes. recipe: arguments of `SAC`. Returns the
    agent and the log, a row an episode. A resumed run does what the killed one would have done:
    each episode starts from (seed, episode), and checkpoints are taken between episodes. The
    agent's test-time actor is chosen at the end, by return: see `best_actor`.
    """
    checkpoint = checkpoint or Checkpoint(None)
    rng = seed_everything(seed)
    obs_dim, action_dim = env.observation_space.shape[0], env.action_space.shape[0]
    sac = SAC(obs_dim, action_dim, **recipe)
    buffer = ReplayBuffer(obs_dim, action_dim, steps + 1000)  # a short run can keep all it has seen
    log, step, candidates = [], 0, []
    if saved := checkpoint.load():
        sac.load_state(saved["sac"])
        candidates = saved["candidates"]
        buffer.load_state(saved["buffer"])
        rng.bit_generator.state, log, step = saved["rng"], saved["log"], saved["step"]

    def state():
        rest = {"rng": rng.bit_generator.state, "log": log, "step": step, "candidates": candidates}
        return {"sac": sac.state(), "buffer": buffer.state()} | rest

    bar = progress(steps, "policy", step)
    while step < steps:
        rows, losses, ended = [], [], False
        obs, _ = env.reset(seed=int(np.random.SeedSequence([seed, len(log)]).generate_state(1)[0]))
        sac.observe(obs)
        while not ended:
            explore = step < random_steps
            action = rng.uniform(-1, 1, action_dim).astype(np.float32) if explore else sac.act(obs)
            next_obs, reward, terminal, truncated, info = env.step(action)
            # `truncated` stays out: the time limit is the clock's doing, and s' keeps its value.
            buffer.add(obs=obs, action=action, reward=reward, next_obs=next_obs, terminal=terminal)
            sac.observe(next_obs)
            rows.append({"reward": float(reward), **info.get("reward_parts", {})})
            obs, ended, step = next_obs, terminal or truncated, step + 1
            if step > random_steps:
                sac.slow_down(step / steps)
                losses += [sac.update(buffer.sample(rng, batch)) for _ in range(updates)]
        row = {"episode": len(log), "step": step, "length": len(rows)}
        row |= {
            "return": sum(r["reward"] for r in rows),
            "success": bool(info.get("is_success", False)),
        }
        for many in (rows, losses):
            row |= {k: float(np.mean([r[k] for r in many])) for k in (many[0] if many else ())}
        if evaluate and len(log) % evaluate_every == evaluate_every - 1:
            row |= evaluate(sac)
        log.append(row)
        if len(log) % WINDOW == 0:
            mean = float(np.mean([r["return"] for r in log[-WINDOW:]]))
            candidates.append({"return": mean, "actors": sac.actors()})
            candidates = sorted(candidates, key=lambda c: -c["return"])[:CANDIDATES]
        bar.set_postfix_str(f"return {row['return']:.2f}", refresh=False)
        bar.update(len(rows))
        checkpoint.save(state)
    bar.close()
    checkpoint.save(state, force=True)
    actors = [actor for c in candidates for actor in c["actors"]] + sac.actors()
    sac.test_actor.load_state_dict(best_actor(env, sac, actors, seed))
    return sac, log


def best_actor(env, sac: SAC, actors: list[dict], seed: int) -> dict:
    """Of `actors`, state dicts, the one that earns most in `TRIALS` episodes without noise, alike
    for all."""

    def mean_return(actor):
        sac.test_actor.load_state_dict(actor)
        total = 0.0
        for i in range(TRIALS):
            obs, _ = env.reset(seed=int(np.random.SeedSequence([seed, i, 1]).generate_state(1)[0]))
            ended = False
            while not ended:
                obs, reward, terminal, truncated, _ = env.step(sac.act(obs, deterministic=True))
                total, ended = total + float(reward), terminal or truncated
        return total / TRIALS

    return max(actors, key=mean_return)
