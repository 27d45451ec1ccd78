"""Soft actor-critic on vectors (Haarnoja et al. 2018, arXiv 1812.05905), the RL algorithm of the
paper.

In: a Gymnasium environment with vector observations and actions in [-1, 1]. Out: a policy and a log
with a row an episode. Not in the publication: LayerNorm in the critics (keeps Q from running away
when steps are few), running normalisation of observations, two updates a step, a target entropy
and a learning rate that fall, an averaged copy of the actor, and a last round without noise in
which the averaged actors of the best episodes compete for acting at test time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch

from lbw_minimal.replay import Batch, ReplayBuffer
from lbw_minimal.sac_networks import Actor, Normaliser, Policy, TwinCritic, length
from lbw_minimal.training import (
    Checkpoint,
    InputError,
    load_state,
    progress,
    save_state,
    seed_everything,
)

# Of the target entropy, per number of an action: where it ends, with little noise, for a hit takes
# just the right strength, and the share of the training over which it falls to that.
ENTROPY_TO, ENTROPY_FALLEN = -3.5, 0.7
WINDOW = 10  # episodes whose mean return makes the averaged actor at their end a candidate
CANDIDATES = 3  # windows that are kept: training goes up and down
# episodes without noise for each candidate; with noise an actor may hit right, without too hard
TRIALS = 5
# of the training: from here the learning rate falls to 0; on slide 38 of 40 for 34 without
FALL_FROM = 0.3


class SAC:
    """Actor, twin critics and temperature with their optimizers.

    obs_dim, action_dim: sizes of the vectors; actions are in [-1, 1]. gamma: discount; 0.95 looks
    20 steps ahead, enough for a reward that is paid at every step. tau: pace of the target
    critics. alpha: first temperature, for rewards of about 1 a step. average: pace of `test_actor`,
    the actor's mean over some 200 updates, until `train` puts the best one there. entropy: aimed at
    in the beginning, per number of an action; -1 is the publication's.
    """

    def __init__(
        self,
        obs_dim: int,
        action_dim: int,
        *,
        width: int = 128,
        gamma: float = 0.95,
        tau: float = 0.01,
        critic_lr: float = 1e-3,
        actor_lr: float = 1e-3,
        alpha: float = 0.02,
        average: float = 0.005,
        entropy: float = -1.0,
    ):
        self.gamma, self.tau, self.average = gamma, tau, average
        self.normalise: Any = Normaliser(obs_dim)
        self.actor = Actor(obs_dim, action_dim, width)
        self.critic = TwinCritic(obs_dim, action_dim, width)
        self._set_up(alpha, entropy)
        # One optimizer for all: the calls, not the arithmetic, are what a small network costs.
        self._of_critic = [*self.critic.parameters(), self.log_alpha]
        self._of_actor: list[torch.Tensor] = list(self.actor.parameters())
        groups = [
            {"params": self._of_critic, "lr": critic_lr},
            {"params": self._of_actor, "lr": actor_lr},
        ]
        self.optimizer = torch.optim.Adam(groups, fused=True)
        self.rates: tuple[float, ...] = critic_lr, actor_lr
        self._slow: list[list[torch.Tensor]] = [
            list(m.parameters()) for m in (self.target, self.test_actor)
        ]
        self._fast: list[list[torch.Tensor]] = [
            list(m.parameters()) for m in (self.critic, self.actor)
        ]

    def _set_up(self, alpha, entropy):
        """What follows from actor and critic, for any of them."""
        self.sizes = self.actor.sizes
        self.log_alpha = torch.tensor(math.log(alpha), requires_grad=True)
        self.entropy = entropy
        self.target_entropy = entropy * self.sizes["action_dim"]
        self.test_actor = deepcopy(self.actor).requires_grad_(False)
        self.target = deepcopy(self.critic).requires_grad_(False)

    @property
    def alpha(self) -> float:
        """The temperature: what a unit of entropy is worth, in rewards."""
        return self.log_alpha.exp().item()

    def anneal(self, passed: float) -> None:
        """Set learning rates and target entropy for a training of which a share has `passed`."""
        share = min(1.0, max(0.0, 1 - passed) / (1 - FALL_FROM))
        for group, rate in zip(self.optimizer.param_groups, self.rates, strict=True):
            group["lr"] = share * rate
        fallen = min(1.0, passed / ENTROPY_FALLEN)
        target = self.entropy + fallen * (ENTROPY_TO - self.entropy)
        self.target_entropy = target * self.sizes["action_dim"]

    def observe(self, obs: np.ndarray) -> None:
        """Take an observation (S,) of training into the running normalisation."""
        self.normalise.observe(obs)

    def act(self, obs: np.ndarray, deterministic: bool = False) -> np.ndarray:
        """Action (A,) in [-1, 1] for an observation (S,): a sample, or the test actor's mean."""
        actor = self.test_actor if deterministic else self.actor
        return Policy(actor, self.normalise).act(obs, deterministic)

    def critic_target(self, batch: Batch) -> torch.Tensor:
        """y (B,) = r + gamma (1 - terminal) (min_i Q'_i(s', a') - alpha log pi(a'|s')), a' ~ pi."""
        with torch.no_grad():
            s_next = self.normalise(batch["next_obs"])
            a_next, log_pi = self.actor.sample(s_next)
            value = self.target(s_next, a_next).amin(0) - self.log_alpha.exp() * log_pi
            return batch["reward"] + self.gamma * (1 - batch["terminal"]) * value

    def update(self, batch: Batch) -> dict[str, float]:
        """One gradient step of critics, actor and temperature; returns what the log is told."""
        s, y = self.normalise(batch["obs"]), self.critic_target(batch)
        critic_loss = (self.critic(s, batch["action"]) - y).square().mean(1).sum()

        a, log_pi = self.actor.sample(s)
        alpha = self.log_alpha.exp()
        actor_loss = (alpha.detach() * log_pi - self.critic(s, a).amin(0)).mean()
        # Raises alpha while the entropy -E[log pi] is below its target.
        entropy = -log_pi.detach().mean()
        alpha_loss = alpha * (entropy - self.target_entropy)

        # The actor's loss goes through the critics and must not move them: each to its own weights.
        self.optimizer.zero_grad()
        (critic_loss + alpha_loss).backward(inputs=self._of_critic)
        actor_loss.backward(inputs=self._of_actor)
        self.optimizer.step()
        paces = self.tau, self.average
        with torch.no_grad():  # or what follows would keep the graph of all updates so far
            for slow, fast, pace in zip(self._slow, self._fast, paces, strict=True):
                torch._foreach_lerp_(slow, fast, pace)
        return {
            "critic_loss": critic_loss.item(),
            "actor_loss": actor_loss.item(),
            "q": y.mean().item(),
            "alpha": self.alpha,
            "entropy": entropy.item(),
        }

    def _modules(self):
        names = ("actor", "critic", "test_actor", "target", "normalise", "optimizer")
        return {n: getattr(self, n) for n in names}

    def state_dict(self) -> dict[str, Any]:
        """All that `load_state_dict` needs to go on exactly here."""
        states = {n: m.state_dict() for n, m in self._modules().items()}
        return states | {"log_alpha": self.log_alpha}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Be the agent whose `state_dict` came through a file."""
        for n, m in self._modules().items():
            m.load_state_dict(state[n])
        # in place: the optimizer holds this very tensor
        self.log_alpha.data.copy_(state["log_alpha"])


def save(path: Path | str, agent: SAC | Policy) -> None:
    """Write what acts at test time to one file; what training takes is in its checkpoint."""
    actor = agent.test_actor if isinstance(agent, SAC) else agent.actor
    parts = {"actor": actor.state_dict(), "normalise": agent.normalise.state_dict()}
    save_state(path, {"kind": "policy", "sizes": agent.sizes} | parts)


def load(path: Path | str) -> Policy:
    """The policy that `save` wrote. Raises InputError if the file holds anything else."""
    saved = load_state(path)
    if saved.get("kind") != "policy":
        raise InputError(f"{path}: not a policy; give the file that SAC's training wrote.")
    actor, normalise = Actor(**saved["sizes"]), Normaliser(saved["sizes"]["obs_dim"])
    actor.load_state_dict(saved["actor"])
    normalise.load_state_dict(saved["normalise"])
    return Policy(actor, normalise)


def train(
    env: gym.Env,
    *,
    steps: int,
    seed: int,
    checkpoint: Checkpoint | None = None,
    evaluate: Callable[[SAC], dict[str, float]] | None = None,
    evaluate_every: int = 10,
    updates: int = 2,
    random_steps: int = 500,
    batch: int = 128,
    **recipe: Any,
) -> tuple[SAC, list[dict]]:
    """Train on `env` until the first episode that ends at or after `steps` environment steps.

    env: observations (S,) float32, actions (A,) in [-1, 1]. Its `info["reward_parts"]` and
    `info["is_success"]`, that of an episode's last step, go to the log and nowhere else. updates:
    gradient steps an environment step, after `random_steps` uniformly random ones. evaluate(sac)
    joins the log every `evaluate_every` episodes. recipe: arguments of `SAC`. Returns the agent and
    the log, a row an episode. A resumed run does what the killed one would have done: each episode
    starts from (seed, episode), and checkpoints are taken between episodes. The agent's test-time
    actor is chosen at the end, by return: see `best_actor`.
    """
    rng = seed_everything(seed)
    sac = SAC(length(env.observation_space), length(env.action_space), **recipe)
    # A short run can keep all it has seen.
    buffer = ReplayBuffer(sac.sizes["obs_dim"], sac.sizes["action_dim"], steps + 1000)
    log = learn(
        env, sac, buffer, rng, steps=steps, seed=seed, checkpoint=checkpoint, evaluate=evaluate,
        evaluate_every=evaluate_every, updates=updates, random_steps=random_steps, batch=batch,
    )  # fmt: skip
    return sac, log


def learn(
    env: gym.Env,
    sac: SAC,
    buffer: Any,
    rng: np.random.Generator,
    *,
    steps: int,
    seed: int,
    checkpoint: Checkpoint | None,
    evaluate: Callable[[Any], dict[str, float]] | None,
    evaluate_every: int,
    updates: int,
    random_steps: int,
    batch: int,
    hold: int = 1,
) -> list[dict]:
    """The loop of `train`, for any agent that is a `SAC` and any buffer with its methods.

    hold: steps for which a random action is kept. Returns the log.
    """
    checkpoint = checkpoint or Checkpoint(None)
    stateful = {"sac": sac, "buffer": buffer, "rng": rng}
    now, state = checkpoint.resume(stateful, step=0, log=[], candidates=[])
    bar = progress(steps, "policy", min(now.step, steps))
    while now.step < steps:
        rows: list[dict] = []
        losses, ended = [], False
        obs, _ = env.reset(seed=_seed(seed, len(now.log)))
        sac.observe(obs)
        while not ended:
            if now.step >= random_steps:
                action = sac.act(obs)
            elif len(rows) % hold == 0:
                action = _uniform(rng, env)
            next_obs, reward, terminal, truncated, info = env.step(action)
            # `truncated` stays out: the time limit is the clock's doing, and s' keeps its value.
            step = {"obs": obs, "action": action, "reward": reward, "next_obs": next_obs}
            buffer.add(first=not rows, terminal=terminal, **step)
            sac.observe(next_obs)
            rows.append({"reward": float(reward), **info.get("reward_parts", {})})
            obs, ended, now.step = next_obs, terminal or truncated, now.step + 1
            if now.step > random_steps:
                sac.anneal(now.step / steps)
                losses += [sac.update(buffer.sample(rng, batch)) for _ in range(updates)]
        now.log.append(_row(len(now.log), now.step, rows, losses, info))
        if evaluate and len(now.log) % evaluate_every == 0:
            now.log[-1] |= evaluate(sac)
        if len(now.log) % WINDOW == 0:
            now.candidates = _best(now.candidates, now.log, sac)
        bar.set_postfix_str(f"return {now.log[-1]['return']:.2f}", refresh=False)
        bar.update(min(now.step, steps) - bar.n)  # the last episode may be longer than is left
        checkpoint.save(state)
    bar.close()
    checkpoint.save(state, force=True)
    actors = [c["actor"] for c in now.candidates] + [deepcopy(sac.test_actor.state_dict())]
    sac.test_actor.load_state_dict(best_actor(env, sac, actors, seed))
    return now.log


def _uniform(rng, env):
    """An action that knows nothing."""
    return rng.uniform(-1, 1, env.action_space.shape).astype(np.float32)


def _seed(*key):
    """A seed of its own for every key, such as (seed, episode)."""
    return int(np.random.SeedSequence(key).generate_state(1)[0])


def _row(episode, step, rows, losses, info):
    """An episode in the log: sums and means of its steps and updates."""
    row = {"episode": episode, "step": step, "length": len(rows)}
    row |= {"return": sum(r["reward"] for r in rows), "success": bool(info.get("is_success"))}
    for many in (rows, losses):
        names = dict.fromkeys(k for r in many for k in r)  # not every update tells all of them
        row |= {k: float(np.mean([r[k] for r in many if k in r])) for k in names}
    return row


def _best(candidates, log, sac):
    """The candidates with the highest mean return, the present averaged actor among them."""
    mean = float(np.mean([r["return"] for r in log[-WINDOW:]]))
    candidates = [*candidates, {"return": mean, "actor": deepcopy(sac.test_actor.state_dict())}]
    return sorted(candidates, key=lambda c: -c["return"])[:CANDIDATES]


def best_actor(env: gym.Env, sac: SAC, actors: list[dict], seed: int) -> dict:
    """Of `actors`, state dicts, the one that earns most in `TRIALS` episodes without noise."""

    def mean_return(actor):
        sac.test_actor.load_state_dict(actor)
        total = 0.0
        for i in range(TRIALS):  # the same starts for all
            obs, _ = env.reset(seed=_seed(seed, i, 1))
            ended = False
            while not ended:
                obs, reward, terminal, truncated, _ = env.step(sac.act(obs, deterministic=True))
                total, ended = total + float(reward), terminal or truncated
        return total / TRIALS

    return max(actors, key=mean_return)
