"""SAC+AE: soft actor-critic from pixels with an autoencoder (Yarats et al. 2019, arXiv 1910.01741),
the control of the paper's two rivals.

In: a Gymnasium environment that shows the last three frames. Out: a policy and a log, as from
`sac.py`, whose loop and actor-critic these are. Kept from the publication: a latent of 50 numbers
behind LayerNorm and tanh; the critics' loss and the reconstruction's train the encoder, the actor
reads latents and does not; the target's encoder follows at 0.05, its critics at 0.01; an L2 on
latents, weight decay in the decoder; an actor that learns every second update. Not in it: one
pass of the encoder serves both of its losses; the actor reads all of the critics' encoder, its
linear layer too; what `sac.py` says of itself; and the slim size.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch

from lbw_minimal.replay import STACK, Batch, FrameBuffer
from lbw_minimal.sac import SAC, learn
from lbw_minimal.sac_ae_networks import (
    FRAME,
    SIZES,
    Decoder,
    Encoder,
    Patches,
    PixelActor,
    PixelCritic,
)
from lbw_minimal.sac_networks import Policy, draw, length
from lbw_minimal.training import (
    Checkpoint,
    InputError,
    load_state,
    pick_device,
    save_state,
    seed_everything,
)

# The publication's: of the latents' mean square length, and of the decoder's weights.
LATENT_L2, DECODER_DECAY = 1e-6, 1e-7
ACTOR_EVERY = 2  # updates


class SACAE(SAC):
    """Encoder, decoder, actor, twin critics and temperature with their optimizers.

    size: "slim", or "published" at 24 times the cost. tau_encoder: pace of the target's encoder.
    device: where the networks are. The other arguments are those of `SAC`.
    """

    normalise: Patches
    actor: PixelActor
    critic: PixelCritic
    target: PixelCritic

    def __init__(
        self,
        action_dim: int,
        *,
        size: str = "slim",
        gamma: float = 0.95,
        tau: float = 0.01,
        tau_encoder: float = 0.05,
        critic_lr: float = 1e-3,
        actor_lr: float = 1e-3,
        alpha: float = 0.02,
        average: float = 0.005,
        entropy: float = -1.0,
        device: str = "cpu",
    ):
        self.gamma, self.tau, self.tau_encoder, self.average = gamma, tau, tau_encoder, average
        self.size, self.updates, self.device = SIZES[size], 0, pick_device(device)
        self.normalise = Patches(self.size.patch)
        with self.device:
            self.encoder = Encoder(self.size)
            self.decoder = Decoder(self.size)
            self.actor = PixelActor(self.encoder, action_dim, size)
            self.critic = PixelCritic(self.encoder, action_dim, self.size)
            self._set_up(alpha, entropy)
        self._of_actor = [*self.actor.net.parameters(), self.log_alpha]
        groups = [
            {"params": list(self.critic.parameters()), "lr": critic_lr},
            {"params": self._of_actor, "lr": actor_lr},
        ]
        self.optimizer = torch.optim.Adam(groups, fused=True)
        self.rates = critic_lr, actor_lr
        # The encoder has a second Adam, as in the publication: the gradient of the reconstruction
        # is a hundred times smaller than the critics', and in a sum would teach it nothing.
        encoder, decoder = list(self.encoder.parameters()), list(self.decoder.parameters())
        groups = [{"params": encoder}, {"params": decoder, "weight_decay": DECODER_DECAY}]
        self.autoencoder = torch.optim.Adam(groups, lr=critic_lr, fused=True)
        self._of_autoencoder = [*encoder, *decoder]

    def observe(self, obs: np.ndarray) -> None:
        """Frames have a known range, and need no running normalisation."""

    def anneal(self, passed: float) -> None:
        """As in `SAC`; the autoencoder learns at the critics' rate."""
        super().anneal(passed)
        for group in self.autoencoder.param_groups:
            group["lr"] = self.optimizer.param_groups[0]["lr"]

    def update(self, batch: Batch) -> dict[str, float]:
        """One gradient step of critics and encoder; every second one of actor and temperature.

        The decoder learns every `size.decode_every` updates. Returns what the log is told.
        """
        self.updates += 1
        batch = {name: tensor.to(self.device) for name, tensor in batch.items()}
        x, y = self.normalise(batch["obs"]), self.critic_target(batch)
        h = self.encoder(x)
        critic_loss = (self.critic.head(h, batch["action"]) - y).square().mean(1).sum()
        told = {"critic_loss": critic_loss.item(), "q": y.mean().item(), "alpha": self.alpha}
        gradients: tuple[torch.Tensor, ...] = ()
        if self.updates % self.size.decode_every == 0:
            error = self.reconstruction(h, x)
            loss = error + LATENT_L2 * 0.5 * h.square().sum(1).mean()
            gradients = torch.autograd.grad(loss, self._of_autoencoder, retain_graph=True)
            told["reconstruction"] = error.item()

        self.optimizer.zero_grad()
        critic_loss.backward()
        if self.updates % ACTOR_EVERY == 0:
            told |= self._actor_gradient(h.detach())
        self.optimizer.step()
        if gradients:
            for p, gradient in zip(self._of_autoencoder, gradients, strict=True):
                p.grad = gradient.contiguous()  # fused, Adam pairs numbers by place in memory
            self.autoencoder.step()
        self._follow()
        return told

    def reconstruction(self, h: torch.Tensor, x: torch.Tensor) -> torch.Tensor:
        """Mean squared error of the frames that the decoder draws from latents h (B, 50) of x."""
        return (self.decoder(h) - self.normalise.shrunk(x, self.size.shrink)).square().mean()

    def _actor_gradient(self, h):
        """Gradients of actor and temperature from latents h (B, 50), which stay as they are."""
        a, log_pi = draw(*self.actor.head(h))
        alpha = self.log_alpha.exp()
        actor_loss = (alpha.detach() * log_pi - self.critic.head(h, a).amin(0)).mean()
        entropy = -log_pi.detach().mean()
        alpha_loss = alpha * (entropy - self.target_entropy)
        # The actor's loss goes through the critics and must not move them.
        (actor_loss + alpha_loss).backward(inputs=self._of_actor)
        return {"actor_loss": actor_loss.item(), "entropy": entropy.item()}

    @torch.no_grad()
    def _follow(self):
        """Targets and the averaged actor, each at its pace."""
        target, critic = self.target, self.critic
        for slow, fast, pace in (
            (target.encoder.parameters(), self.encoder.parameters(), self.tau_encoder),
            ([*target.weights, *target.biases], [*critic.weights, *critic.biases], self.tau),
            (self.test_actor.parameters(), self.actor.parameters(), self.average),
        ):
            torch._foreach_lerp_(list(slow), list(fast), pace)

    def _modules(self):
        return super()._modules() | {n: getattr(self, n) for n in ("decoder", "autoencoder")}

    def state_dict(self) -> dict[str, Any]:
        """All that `load_state_dict` needs to go on exactly here."""
        return super().state_dict() | {"updates": self.updates}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Be the agent whose `state_dict` came through a file."""
        super().load_state_dict(state)
        self.updates = state["updates"]


def train(
    env: gym.Env,
    *,
    steps: int,
    seed: int,
    size: str = "slim",
    checkpoint: Checkpoint | None = None,
    evaluate: Callable[[SACAE], dict[str, float]] | None = None,
    evaluate_every: int = 10,
    updates: int = 1,
    random_steps: int = 500,
    hold: int = 1,
    **recipe: Any,
) -> tuple[SACAE, list[dict]]:
    """Train on `env` as `sac.train` does.

    env: observations (3, 84, 84, 3) uint8, the last frames as `FrameStackObservation(env, 3)` gives
    them. size: one of `SIZES`. hold: steps for which each random action is kept. recipe: other
    arguments of `SACAE`. The frames are in a file beside the checkpoint, with the suffix `.frames`;
    where there is no checkpoint they are in memory, 21 kB each. Raises InputError for another size
    or observation.
    """
    seen = env.observation_space.shape
    if seen != (STACK, FRAME, FRAME, 3):
        raise InputError(f"observation {seen}: wrap the environment in FrameStackObservation.")
    if size not in SIZES:
        raise InputError(f"size {size!r}: choose one of {', '.join(SIZES)}.")
    rng, A = seed_everything(seed), length(env.action_space)
    agent = SACAE(A, size=size, **recipe)
    path = checkpoint.path.with_suffix(".frames") if checkpoint and checkpoint.path else None
    # An episode has a frame more than steps: twice the steps is enough for the shortest ones.
    buffer = FrameBuffer((FRAME, FRAME, 3), A, 2 * steps + 1000, path)
    log = learn(
        env, agent, buffer, rng, steps=steps, seed=seed, checkpoint=checkpoint, evaluate=evaluate,
        evaluate_every=evaluate_every, updates=updates, random_steps=random_steps,
        batch=SIZES[size].batch, hold=hold,
    )  # fmt: skip
    return agent, log


def save(path: Path | str, agent: SACAE | Policy) -> None:
    """Write what acts at test time to one file: the actor and its encoder."""
    actor = agent.test_actor if isinstance(agent, SACAE) else agent.actor
    parts = {"sizes": actor.sizes, "actor": actor.state_dict()}
    save_state(path, {"kind": "pixel policy"} | parts)


def load(path: Path | str) -> Policy:
    """The policy that `save` wrote; it acts on stacks of three frames (3, 84, 84, 3) uint8.

    Raises InputError if the file holds anything else.
    """
    saved = load_state(path)
    if saved.get("kind") != "pixel policy":
        raise InputError(f"{path}: not a policy from pixels; give the file that SAC+AE wrote.")
    size = SIZES[saved["sizes"]["size"]]
    actor = PixelActor(Encoder(size), **saved["sizes"])
    actor.load_state_dict(saved["actor"])
    return Policy(actor, Patches(size.patch))
