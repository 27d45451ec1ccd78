"""Soft actor-critic against its equations, and against the mistakes others made before."""

from copy import deepcopy

import gymnasium as gym
import numpy as np
import pytest
import torch
from moves import (
    Bar,
    Kept,
    columns,
    facts,
    in_file,
    layers,
    look,
    moved,
    noise,
    refusals,
    slopes,
    weights,
)

from lbw_minimal import replay, sac_networks
from lbw_minimal import sac as module
from lbw_minimal.replay import ReplayBuffer
from lbw_minimal.sac import SAC, best_actor, train
from lbw_minimal.sac_networks import Actor, Normaliser, TwinCritic, draw
from lbw_minimal.training import Checkpoint, InputError, load_state, save_state


class Walk(gym.Env):
    """A point on a line is paid for standing at 0.5; 20 steps, never terminal."""

    observation_space = gym.spaces.Box(-2, 2, (1,), np.float32)
    action_space = gym.spaces.Box(-1, 1, (1,), np.float32)
    flip_success = False  # for a test that this label teaches nothing

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        self.t, self.x = 0, self.np_random.uniform(-1, 1)
        return np.array([self.x], np.float32), {}

    def step(self, action):
        self.t, self.x = self.t + 1, float(np.clip(self.x + 0.2 * action[0], -2, 2))
        parts = {"r1": -abs(self.x - 0.5), "r2": 0.0}
        info = {"is_success": (abs(self.x - 0.5) < 0.1) != self.flip_success, "reward_parts": parts}
        return np.array([self.x], np.float32), parts["r1"], False, self.t >= 20, info


class Stop(Exception):
    """Where a test cuts a training off."""


def batch_of(n=8, obs_dim=3, action_dim=2, seed=0, **fixed):
    g = torch.Generator().manual_seed(seed)
    draw = lambda *shape: torch.randn(*shape, generator=g)  # noqa: E731
    batch = {"obs": draw(n, obs_dim), "action": draw(n, action_dim).tanh(), "reward": draw(n)}
    return batch | {"next_obs": draw(n, obs_dim), "terminal": torch.zeros(n)} | fixed


def small(**recipe):
    torch.manual_seed(0)
    return SAC(3, 2, width=16, **recipe)


# The actor and the critics ------------------------------------------------------------------------


def test_log_density_of_a_squashed_action_is_that_of_torch():
    torch.manual_seed(0)
    actor, s = Actor(3, 2, 16), torch.randn(5, 3)
    a, log_pi = actor.sample(s)
    mean, log_std = actor(s)
    normal = torch.distributions.Normal(mean, log_std.exp())
    squashed = torch.distributions.TransformedDistribution(
        normal, torch.distributions.TanhTransform()
    )
    assert torch.allclose(log_pi, squashed.log_prob(a).sum(-1), atol=1e-3)


def test_log_density_stays_finite_at_the_ends_of_the_range():
    actor = Actor(1, 1, 8)
    actor.net[-1].bias.data[0] = 50.0
    a, log_pi = actor.sample(torch.zeros(100, 1))
    assert (a == 1).all() and log_pi.isfinite().all()


def test_the_two_critics_are_two_plain_networks():
    """The batched product against one critic at a time."""
    torch.manual_seed(0)
    critic, s, a = TwinCritic(3, 2, 16), torch.randn(5, 3), torch.randn(5, 2)
    for i in range(2):
        x = torch.cat([s, a], 1)
        for j in range(2):
            x = x @ critic.weights[j][i] + critic.biases[j][i]
            x = (
                (x - x.mean(1, keepdim=True)) / (x.var(1, correction=0, keepdim=True) + 1e-5).sqrt()
            ).relu()
        q = x @ critic.weights[2][i] + critic.biases[2][i]
        assert torch.allclose(critic(s, a)[i], q[:, 0], atol=1e-5)


def test_the_critics_tell_a_small_state_and_action_from_large_ones():
    torch.manual_seed(0)
    critic, s, a = TwinCritic(3, 2, 16), torch.randn(5, 3), torch.randn(5, 2)
    assert (critic(s, a) - critic(2 * s, 2 * a)).abs().mean() > 0.01


# One update ---------------------------------------------------------------------------------------


def test_the_target_holds_the_entropy_term():
    """Equal Q and equal draws: what doubling alpha takes off the target is gamma alpha log pi."""
    sac, batch = small(alpha=0.5), batch_of(reward=torch.zeros(8))
    torch.manual_seed(1)
    _, log_pi = sac.actor.sample(sac.normalise(batch["next_obs"]))
    targets = []
    for alpha in (0.5, 1.0):
        sac.log_alpha.data.fill_(np.log(alpha))
        torch.manual_seed(1)
        targets.append(sac.critic_target(batch))
    assert torch.allclose(targets[0] - targets[1], sac.gamma * 0.5 * log_pi, atol=1e-5)


def test_the_target_by_hand_with_the_recipes_discount_and_temperature():
    """r + gamma (the lesser Q' - alpha log pi)."""
    sac = SAC(1, 1, width=8)
    sac.actor.sample = lambda s: (torch.zeros(8, 1), torch.full((8,), 3.0))
    sac.target.forward = lambda s, a: torch.tensor([[2.0], [2.5]]).expand(2, 8)
    y = sac.critic_target(batch_of(obs_dim=1, action_dim=1, reward=torch.ones(8)))
    assert y.tolist() == pytest.approx(8 * [1 + 0.95 * (2 - 0.02 * 3)])


def test_the_target_takes_the_lesser_of_the_two_critics():
    sac = small()
    sac.target.biases[2].data[:, 0, 0] = torch.tensor([1000.0, -1000.0])
    assert (sac.critic_target(batch_of()) < -900).all()


def test_only_a_terminal_state_ends_the_sum():
    reward = torch.arange(8.0)
    sac = small()
    ended = sac.critic_target(batch_of(reward=reward, terminal=torch.ones(8)))
    goes_on = sac.critic_target(batch_of(reward=reward))
    assert torch.equal(ended, reward) and not torch.isclose(goes_on, reward).any()


def test_the_actor_is_trained_with_alpha():
    """With a huge alpha entropy is all that counts, so the policy must spread."""
    spread = []
    for alpha in (1e-6, 1e3):
        sac, batch = small(alpha=alpha), batch_of(64)
        before = sac.actor(batch["obs"])[1].mean()
        for _ in range(20):
            sac.log_alpha.data.fill_(np.log(alpha))
            sac.update(batch)
        spread.append((sac.actor(batch["obs"])[1].mean() - before).item())
    assert spread[1] > spread[0] + 0.1


def test_alpha_rises_when_entropy_is_below_its_target():
    """Three actions: the target is -3. Entropy -2 is above it, so alpha falls, and -5 below."""
    sac = SAC(3, 3, width=16)
    log_pi = torch.full((8,), 2.0)
    sac.actor.sample = lambda s: (sac.actor(s)[0].tanh(), log_pi)
    before = sac.alpha
    sac.update(batch_of(action_dim=3))
    assert sac.alpha < before
    log_pi[:] = 5.0
    before = sac.alpha
    for _ in range(20):
        sac.update(batch_of(action_dim=3))
    assert sac.alpha > before


def test_the_actors_loss_does_not_train_the_critics():
    sac, batch = small(), batch_of()
    y = sac.critic_target(batch)
    sac.critic_target = lambda batch: y
    loss = (sac.critic(sac.normalise(batch["obs"]), batch["action"]) - y).square().mean(1).sum()
    alone = torch.autograd.grad(loss, list(sac.critic.parameters()))
    sac.update(batch)
    for p, gradient in zip(sac.critic.parameters(), alone, strict=True):
        assert torch.allclose(p.grad, gradient, atol=1e-6)


def plain_update(agent, adams, batch):
    """Notebook 2's: a loss, a gradient and an optimizer for each part."""
    s, y = agent.normalise(batch["obs"]), agent.critic_target(batch)
    critic_loss = (agent.critic(s, batch["action"]) - y).square().mean(1).sum()
    a, log_pi = agent.actor.sample(s)
    alpha = agent.log_alpha.exp()
    actor_loss = (alpha.detach() * log_pi - agent.critic(s, a).amin(0)).mean()
    alpha_loss = alpha * (-log_pi.detach().mean() - agent.target_entropy)
    of_critic, of_actor, of_alpha = adams
    of_actor.zero_grad()
    actor_loss.backward()
    of_critic.zero_grad()  # what the actor's loss left in the critics
    critic_loss.backward()
    of_alpha.zero_grad()
    alpha_loss.backward()
    for adam in adams:
        adam.step()
    with torch.no_grad():
        for slow, quick, pace in (
            (agent.target, agent.critic, agent.tau),
            (agent.test_actor, agent.actor, agent.average),
        ):
            for p, q in zip(slow.parameters(), quick.parameters(), strict=True):
                p += pace * (q - p)


def test_the_fast_update_is_that_of_three_optimizers_in_plain_lines():
    fast = small()
    plain = deepcopy(fast)
    parts = plain.critic.parameters(), plain.actor.parameters(), [plain.log_alpha]
    adams = [torch.optim.Adam(part, 1e-3) for part in parts]
    for seed in range(20):
        batch = batch_of(seed=seed)
        noise = torch.get_rng_state()
        fast.update(batch)
        torch.set_rng_state(noise)
        plain_update(plain, adams, batch)
    assert fast.log_alpha.item() == pytest.approx(plain.log_alpha.item(), abs=1e-6)
    for name in ("actor", "critic", "target", "test_actor"):
        pairs = zip(
            getattr(fast, name).parameters(), getattr(plain, name).parameters(), strict=True
        )
        for p, q in pairs:
            torch.testing.assert_close(p, q, atol=2e-6, rtol=0)


def test_the_target_critics_follow_by_tau():
    sac = small(tau=0.25)
    old = [p.clone() for p in sac.target.parameters()]
    sac.update(batch_of())
    for before, target, critic in zip(
        old, sac.target.parameters(), sac.critic.parameters(), strict=True
    ):
        assert torch.allclose(target, 0.75 * before + 0.25 * critic, atol=1e-6)


def test_what_follows_slowly_keeps_no_graph_of_the_updates():
    """Each of 40,000 updates would stay in memory, half a gigabyte in the end."""
    sac = small()
    sac.update(batch_of())
    for network in (sac.target, sac.test_actor):
        assert not any(p.requires_grad for p in network.parameters())


def test_running_normalisation_is_that_of_all_observations():
    sac, x = (
        small(),
        np.random.default_rng(0).normal([1, -2, 5], [1, 3, 0.5], (500, 3)).astype(np.float32),
    )
    for row in x:
        sac.normalise.observe(row)
    assert sac.normalise.mean.numpy() == pytest.approx(x.mean(0), abs=1e-3)
    assert sac.normalise.var.numpy() == pytest.approx(x.var(0), rel=1e-3)


# The loop -----------------------------------------------------------------------------------------


@pytest.fixture
def buffers(monkeypatch):
    """The replay buffers of trainings to come."""
    made = []
    monkeypatch.setattr(
        module, "ReplayBuffer", lambda *a: made.append(ReplayBuffer(*a)) or made[-1]
    )
    return made


def test_the_time_limit_is_not_stored_as_the_end(buffers):
    train(Walk(), steps=60, seed=0, random_steps=100, width=8)
    assert len(buffers[0]) == 60 and (buffers[0].data["terminal"] == 0).all()


def test_a_buffer_is_told_with_which_transition_an_episode_begins(monkeypatch):
    """One that keeps each frame once, as `FrameBuffer`, has to know."""
    told, add = [], ReplayBuffer.add
    monkeypatch.setattr(
        ReplayBuffer, "add", lambda buffer, **t: told.append(t["first"]) or add(buffer, **t)
    )
    train(Walk(), steps=60, seed=0, random_steps=100, width=8)
    assert np.flatnonzero(told).tolist() == [0, 20, 40] and len(told) == 60


def test_a_transition_is_kept_as_it_happened(buffers):
    """s, a, r and s' of a walk whose laws are known; within an episode s' is the next s."""
    train(Walk(), steps=60, seed=0, random_steps=30, width=8, batch=8)
    obs, action, reward, next_obs, _ = (
        buffers[0].data[k][:60] for k in ("obs", "action", "reward", "next_obs", "terminal")
    )
    np.testing.assert_allclose(next_obs, np.clip(obs + 0.2 * action, -2, 2), atol=1e-6)
    np.testing.assert_allclose(reward, -np.abs(next_obs[:, 0] - 0.5), atol=1e-6)
    same = np.arange(59) % 20 != 19
    np.testing.assert_array_equal(next_obs[:-1][same], obs[1:][same])
    assert not np.allclose(next_obs[:-1][~same], obs[1:][~same])


def test_training_observes_every_state_and_updates_after_the_random_steps(monkeypatch):
    """Twenty steps an episode; from step 31 on, three updates each, of a batch of eight."""
    calls = []
    update = SAC.update
    monkeypatch.setattr(SAC, "update", lambda sac, b: calls.append(len(b["obs"])) or update(sac, b))
    sac, log = train(Walk(), steps=50, seed=0, random_steps=30, width=8, batch=8, updates=3)
    assert [row["step"] for row in log] == [20, 40, 60]
    assert calls == 3 * 30 * [8]
    assert int(sac.normalise.count) == 63  # a start and twenty steps, three times


def test_no_two_episodes_of_a_training_have_one_start_and_each_seed_its_own(monkeypatch):
    starts = []
    reset = Walk.reset
    monkeypatch.setattr(Walk, "reset", lambda env, seed: starts.append(seed) or reset(env, seed))
    for seed in (0, 1):
        train(Walk(), steps=50, seed=seed, random_steps=60, width=8, batch=8)
    assert len(set(starts)) == len(starts) >= 6


def test_an_episodes_row_of_the_log_means_what_was_told_over_those_updates_that_told_it():
    row = module._row(
        3, 9, [{"reward": 1.0}, {"reward": 2.0}], [{"a": 2.0}, {"a": 4.0, "b": 6.0}], {}
    )
    assert (row["return"], row["a"], row["b"]) == (3, 3, 6)


def test_the_critics_begin_as_linear_layers_do():
    """Uniform within one over the root of the number of inputs, here of 4 and of 64."""
    torch.manual_seed(0)
    critic = TwinCritic(3, 1, 64)
    for weight, bound in zip(critic.weights, (0.5, 0.125, 0.125), strict=True):
        assert 0.9 * bound < weight.abs().max() <= bound
    for bias, bound in zip(critic.biases[:2], (0.5, 0.125), strict=True):
        assert 0.9 * bound < bias.abs().max() <= bound


def test_the_first_actions_are_uniform_and_the_later_ones_the_actors(monkeypatch):
    acted = []
    act = SAC.act

    def told(sac, obs, deterministic=False):
        acted.append(deterministic)
        return act(sac, obs, deterministic)

    class Watched(Walk):
        actions: list = []

        def step(self, action):
            self.actions.append(float(action[0]))
            return super().step(action)

    monkeypatch.setattr(SAC, "act", told)
    monkeypatch.setattr(module, "best_actor", lambda env, sac, actors, seed: actors[0])
    train(Watched(), steps=200, seed=0, random_steps=160, width=8, batch=8)
    assert acted == 40 * [False]
    first = np.array(Watched.actions[:160])
    assert first.min() < -0.9 and first.max() > 0.9
    assert abs(first.mean()) < 0.15 and first.std() == pytest.approx(3**-0.5, abs=0.06)


def test_observations_of_an_even_spread_are_brought_to_mean_0_and_deviation_1():
    """What hardly moves is divided by 0.02, and nothing gets beyond 5."""
    sac = small()
    for x in (-1.0, 1.0):
        sac.normalise.observe(np.float32([3 + 2 * x, 0.001 * x, 7]))
    s = sac.normalise(torch.tensor([[5.0, 0.01, 7.5], [1.0, 0.0, 6.99]]))
    assert torch.allclose(s, torch.tensor([[1.0, 0.5, 5.0], [-1.0, 0.0, -0.5]]), atol=1e-4)


def test_an_actors_deviation_stays_between_exp_of_minus_5_and_2():
    actor = Actor(1, 2, 8)
    actor.net[-1].weight.data.zero_()
    actor.net[-1].bias.data = torch.tensor([0.3, -0.3, -50.0, 50.0])
    mean, log_std = actor(torch.zeros(1, 1))
    assert torch.allclose(mean, torch.tensor([[0.3, -0.3]]))
    assert torch.allclose(log_std, torch.tensor([[-5.0, 2.0]]))
    actor.net[-1].bias.data.zero_()
    assert torch.allclose(actor(torch.zeros(1, 1))[1], torch.tensor([[-1.5, -1.5]]))


def test_the_value_of_a_line_with_squared_costs_is_that_of_its_riccati_equation():
    """s' = s + a / 2, reward -(s^2 + a^2 / 10): Q of the best policy, in closed form.

    V(s) = -p s^2 with p = 1 + g p - (g p / 2)^2 / (1 / 10 + g p / 4). Critics that are trained on
    targets of the best action, with a temperature of next to nothing, have to find it.
    """
    gamma = p = 0.8
    for _ in range(200):
        p = 1 + gamma * p - (gamma * p / 2) ** 2 / (0.1 + gamma * p / 4)
    gain = (gamma * p / 2) / (0.1 + gamma * p / 4)
    torch.manual_seed(0)
    sac = SAC(1, 1, width=32, gamma=gamma, tau=0.1, critic_lr=5e-3, actor_lr=0.0, alpha=1e-8)
    # The actor is held at the best policy, a = -gain s, which keeps |a| well below 1 here.
    sac.actor.sample = lambda s: ((-gain * s).clamp(-1, 1), torch.zeros(len(s)))
    rng = np.random.default_rng(0)
    for _ in range(500):
        s, a = (torch.as_tensor(rng.uniform(-0.5, 0.5, (64, 1)), dtype=torch.float32) for _ in "sa")
        r = -(s.square() + a.square() / 10)[:, 0]
        sac.update({"obs": s, "action": a, "reward": r, "next_obs": s + a / 2,
                    "terminal": torch.zeros(64)})  # fmt: skip
    s, a = torch.meshgrid(torch.linspace(-0.4, 0.4, 9), torch.linspace(-0.4, 0.4, 9), indexing="ij")
    s, a = s.reshape(-1, 1), a.reshape(-1, 1)
    true = -(s.square() + a.square() / 10 + gamma * p * (s + a / 2).square())[:, 0]
    with torch.no_grad():
        found = sac.critic(s, a)
    assert (found - true).abs().mean() < 0.02 < true.abs().mean() / 3


def test_a_full_buffer_forgets_the_oldest():
    buffer = ReplayBuffer(1, 1, 3)
    for i in range(5):
        buffer.add(obs=i, action=0, reward=i, next_obs=i, terminal=0)
    assert sorted(buffer.data["reward"]) == [2, 3, 4] and len(buffer) == 3


def numbered(capacity, n):
    buffer = ReplayBuffer(1, 1, capacity)
    for i in range(1, n + 1):
        buffer.add(obs=i, action=i / 10, reward=i, next_obs=i + 1, terminal=i % 2)
    return buffer


def test_a_buffer_gives_what_it_has_and_each_transition_whole():
    batch = numbered(100, 3).sample(np.random.default_rng(0), 60)
    reward = batch["reward"]
    assert set(reward.tolist()) == {1, 2, 3}
    assert torch.equal(batch["obs"][:, 0], reward) and torch.equal(batch["terminal"], reward % 2)
    assert torch.equal(batch["next_obs"][:, 0], reward + 1)
    torch.testing.assert_close(batch["action"][:, 0], reward / 10)


def test_a_full_buffer_comes_back_and_forgets_the_oldest_next(tmp_path):
    buffer, again = numbered(3, 4), ReplayBuffer(1, 1, 3)
    save_state(tmp_path / "state", buffer.state_dict())
    again.load_state_dict(load_state(tmp_path / "state"))
    for one in (buffer, again):
        assert sorted(one.data["reward"]) == [2, 3, 4] and len(one) == 3
        one.add(obs=5, action=0, reward=5, next_obs=6, terminal=0)
        assert sorted(one.data["reward"]) == [3, 4, 5]


def test_a_resumed_run_ends_as_the_uninterrupted_one(tmp_path, monkeypatch):
    recipe = dict(steps=200, seed=3, random_steps=40, width=16, batch=16)
    whole, log = train(Walk(), **recipe)

    class Cut(Walk):
        def reset(self, seed=None, options=None):
            self.episodes = getattr(self, "episodes", 0) + 1
            if self.episodes == 7:
                raise Stop
            return super().reset(seed=seed)

    path = tmp_path / "policy.checkpoint"
    with pytest.raises(Stop):
        train(Cut(), checkpoint=Checkpoint(path, seconds=0), **recipe)
    bar = Bar(monkeypatch, module)
    resumed, log_2 = train(Walk(), checkpoint=Checkpoint(path), **recipe)
    assert log_2 == log and bar.told[0] == "policy 120 of 200"
    for p, q in zip(whole.actor.parameters(), resumed.actor.parameters(), strict=True):
        assert torch.equal(p, q)


def trained():
    sac, obs = small(), np.array([0.1, -0.2, 0.3], np.float32)
    for shift in range(3):
        sac.normalise.observe(obs + shift)
    sac.update(batch_of())
    return sac, obs


def test_a_saved_policy_acts_as_before(tmp_path):
    sac, obs = trained()
    module.save(tmp_path / "policy.safetensors", sac)
    loaded = module.load(tmp_path / "policy.safetensors")
    assert (loaded.act(obs, deterministic=True) == sac.act(obs, deterministic=True)).all()
    module.save(tmp_path / "again.safetensors", loaded)
    first, second = (tmp_path / f"{name}.safetensors" for name in ("policy", "again"))
    assert first.read_bytes() == second.read_bytes()


def test_a_policy_file_holds_what_acts_and_nothing_else(tmp_path):
    """41 inputs, 128 wide: 23 thousand numbers of four bytes."""
    module.save(tmp_path / "policy.safetensors", SAC(41, 3, width=128))
    assert (tmp_path / "policy.safetensors").stat().st_size < 100_000


def test_a_file_of_something_else_is_refused_by_name(tmp_path):
    save_state(tmp_path / "keypoints.safetensors", {"kind": "transporter", "K": 5})
    with pytest.raises(InputError, match=r"keypoints\.safetensors: not a policy"):
        module.load(tmp_path / "keypoints.safetensors")


def test_success_is_logged_and_teaches_nothing():
    recipe = dict(steps=100, seed=0, random_steps=40, width=16, batch=16)
    told_right, log = train(Walk(), **recipe)
    env = Walk()
    env.flip_success = True
    told_wrong, log_2 = train(env, **recipe)
    assert [r["success"] for r in log] == [not r["success"] for r in log_2]
    for p, q in zip(told_right.actor.parameters(), told_wrong.actor.parameters(), strict=True):
        assert torch.equal(p, q)


def test_the_bar_ends_at_its_total_though_the_last_episode_goes_on(capsys):
    """Episodes of 20 steps: the third ends after the fiftieth step."""
    train(Walk(), steps=50, seed=0, random_steps=100, width=8, batch=8)
    assert "50/50" in capsys.readouterr().err.splitlines()[-1].split("\r")[-1]


def test_the_log_has_reward_parts_losses_and_evaluations():
    seen = []
    test = {"evaluate": lambda sac: seen.append(sac) or {"test": 1.0}, "evaluate_every": 2}
    _, log = train(Walk(), steps=80, seed=0, random_steps=20, width=8, batch=8, **test)
    names = "episode step return r1 r2 success alpha entropy critic_loss"
    assert set(names.split()) < set(log[-1])
    assert [("test" in row) for row in log] == [False, True, False, True] and len(seen) == 2


def test_the_actor_that_earns_most_without_noise_is_chosen():
    env, sac, actors = Walk(), SAC(1, 1, width=8), []
    for bias in (-3.0, 0.1, 3.0):  # walks left, hardly, or off to the right
        for p in sac.test_actor.parameters():
            torch.nn.init.zeros_(p)
        sac.test_actor.net[-1].bias.data[0] = bias
        actors.append(deepcopy(sac.test_actor.state_dict()))

    def earned(actor):
        sac.test_actor.load_state_dict(actor)
        obs, _ = env.reset(seed=5)
        total, ended = 0, False
        while not ended:
            obs, reward, terminal, late, _ = env.step(sac.act(obs, deterministic=True))
            total, ended = total + reward, terminal or late
        return total

    for order in (actors, actors[::-1]):
        assert best_actor(env, sac, order, seed=0) is max(actors, key=earned)


def test_all_candidates_act_in_the_same_five_episodes():
    env, sac, starts = Walk(), SAC(1, 1, width=8), []
    reset = env.reset
    env.reset = lambda seed: starts.append(seed) or reset(seed=seed)
    best_actor(env, sac, 2 * [deepcopy(sac.test_actor.state_dict())], seed=0)
    assert starts[:5] == starts[5:] and len(set(starts)) == 5
    trained_on = {module._seed(0, episode) for episode in range(100)}
    assert not trained_on & set(starts)


def test_the_three_windows_of_ten_episodes_that_returned_most_are_kept():
    sac, kept = small(), []
    for mean in (1.0, 4.0, 2.0, 3.0):
        log = [{"return": 99.0}, *5 * [{"return": mean - 1}], *5 * [{"return": mean + 1}]]
        kept = module._best(kept, log, sac)
    assert [candidate["return"] for candidate in kept] == [4, 3, 2]


def test_a_training_takes_what_the_papers_table_was_made_with_unless_it_is_told(monkeypatch):
    """Two updates of 128 transitions a step after 500 random ones, networks 128 wide."""
    asked = {}
    monkeypatch.setattr(module, "learn", lambda *_, **more: asked.update(more) or [])
    sac, _ = train(Walk(), steps=7, seed=0)
    assert (asked["updates"], asked["batch"], asked["random_steps"]) == (2, 128, 500)
    assert (sac.rates, sac.tau, sac.average) == ((1e-3, 1e-3), 0.01, 0.005)
    assert [len(p) for p in sac.actor.net.parameters()] == [128, 128, 128, 128, 2, 2]
    assert [tuple(w.shape) for w in sac.critic.weights] == [(2, 2, 128), (2, 128, 128), (2, 128, 1)]


def test_a_buffer_holds_the_whole_training(monkeypatch):
    held = []
    monkeypatch.setattr(module, "learn", lambda env, sac, buffer, *_, **more: held.append(buffer))
    train(Walk(), steps=7000, seed=0)
    assert held[0].capacity >= 7000


def test_averaged_actors_of_the_best_windows_and_of_the_end_compete(monkeypatch):
    """Returns of 40 episodes rise to the 25th and fall: the third window is best, then the second.

    Of four windows of ten these two are kept, and the end joins.
    """
    seen, at_windows = [], []

    def note(sac):
        at_windows.append(deepcopy(sac.test_actor.state_dict()))
        return {}

    class Tide(Walk):
        def step(self, action):
            obs, _, terminal, _, info = super().step(action)
            return obs, -abs(self.episode - 25.0), terminal, self.t >= 5, info

        def reset(self, seed=None, options=None):
            self.episode = getattr(self, "episode", 0) + 1
            return super().reset(seed=seed)

    def choose(env, sac, actors, seed):
        seen.extend(actors)
        return actors[2]

    monkeypatch.setattr(module, "CANDIDATES", 2)
    monkeypatch.setattr(module, "best_actor", choose)
    recipe = dict(steps=200, seed=0, random_steps=20, width=8, batch=8, evaluate_every=10)
    recipe |= dict(updates=1)
    kept, log = train(Tide(), evaluate=note, **recipe)
    assert len(log) == 40 and len(seen) == 3
    expected = [at_windows[2], at_windows[1], at_windows[3], kept.test_actor.state_dict()]
    for one, other in zip([*seen, seen[2]], expected, strict=True):
        assert all(torch.equal(p, q) for p, q in zip(one.values(), other.values(), strict=True))


def test_the_learning_rates_stay_then_fall_to_zero():
    sac = SAC(1, 1, width=8, critic_lr=1e-3, actor_lr=5e-4)

    def rates(passed):
        sac.anneal(passed)
        return [group["lr"] for group in sac.optimizer.param_groups]

    assert rates(0.1) == rates(0.3) == [1e-3, 5e-4]
    assert rates(0.65) == pytest.approx([5e-4, 2.5e-4])
    assert rates(1.0) == rates(1.1) == [0, 0]


def test_the_target_entropy_falls_from_the_publications_and_stays():
    sac = SAC(1, 2, width=8)
    targets = [sac.target_entropy]
    for passed in (0.0, 0.35, 0.7, 1.0):
        sac.anneal(passed)
        targets.append(sac.target_entropy)
    assert targets == pytest.approx([-2, -2, -4.5, -7, -7])
    quiet = SAC(1, 2, width=8, entropy=-3.5)
    quiet.anneal(0.1)
    assert quiet.target_entropy == pytest.approx(-7)


def test_it_learns_to_stand_at_the_right_place():
    sac, _ = train(Walk(), steps=800, seed=0, random_steps=200, width=32, batch=64, average=0.02)
    env, ends = Walk(), []
    for seed in range(10):
        obs, _ = env.reset(seed=seed)
        for _ in range(20):
            obs = env.step(sac.act(obs, deterministic=True))[0]
        ends.append(obs[0])
    assert np.abs(np.array(ends) - 0.5).max() < 0.15


class Identity(gym.Env):
    """stable-baselines3's `IdentityEnvBox(eps=0.5)`: 1 for an action within 0.5 of the observation.

    The next observation is drawn from [-1, 1] whatever the action; 100 steps. Chance earns 44.
    """

    observation_space = action_space = gym.spaces.Box(-1, 1, (1,), np.float32)

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        self.t = 0
        return self._draw(), {}

    def step(self, action):
        reward = float(abs(action[0] - self.shown[0]) <= 0.5)
        self.t += 1
        return self._draw(), reward, False, self.t >= 100, {}

    def _draw(self):
        self.shown = self.np_random.uniform(-1, 1, 1).astype(np.float32)
        return self.shown


@pytest.mark.parametrize("seed", [0, *(pytest.param(i, marks=pytest.mark.slow) for i in (1, 2))])
def test_it_learns_stable_baselines3s_identity_task(seed):
    """The known answer: a mean of at least 90 of 100 after 400 steps. SB3's own test takes 700."""
    sac, log = train(Identity(), steps=400, seed=seed, random_steps=100, width=64)
    env, returns = Identity(), []
    for episode in range(20):
        obs, ended = env.reset(seed=1000 + episode)[0], False
        returns.append(0.0)
        while not ended:
            obs, reward, _, ended, _ = env.step(sac.act(obs, deterministic=True))
            returns[-1] += reward
    assert log[0]["return"] < 60 and np.mean(returns) >= 90


# Golden figures -----------------------------------------------------------------------------------


def test_the_constants_of_sac_are_those_of_the_shipped_results(golden):
    golden(facts(module) | facts(sac_networks) | facts(replay))


def test_sacs_networks_begin_and_compute_as_they_did(golden):
    """Standard observations, and such as are cut off; means and draws; what has been observed."""
    torch.manual_seed(0)
    actor, critic, normalise = Actor(3, 2, 16), TwinCritic(3, 2, 16), Normaliser(3)
    s, a = 2 * noise(5, 3, seed=1), noise(5, 2, seed=2).tanh()
    figures = {"layers": layers(actor) + layers(critic) + layers(normalise)}
    figures["begin"] = [p.std().item() for p in (*actor.parameters(), *critic.parameters())]
    mean, log_std = actor(s)
    figures |= {"mean": mean, "log std": log_std, "Q": critic(s, a)}
    torch.manual_seed(1)
    figures |= dict(zip(("drawn", "density"), actor.sample(s), strict=True))
    at_the_ends = torch.tensor([[9.0, -9.0], [0.5, 20.0]])  # where tanh rounds to 1
    figures["density at the ends"] = draw(at_the_ends, torch.zeros(2, 2))[1]
    for x in noise(4, 3, seed=3) * torch.tensor([1.0, 0.004, 30.0]):
        normalise.observe(x.numpy())
    figures |= {name: v for name, v in normalise.state_dict().items()}
    figures["normal"] = normalise(s * torch.tensor([9.0, 0.03, 40.0]))
    golden(figures)


def mixed(n=6):
    """Transitions of which some end, with rewards and frames that differ in size."""
    batch = {"obs": noise(n, 3, seed=1), "action": noise(n, 2, seed=2).tanh()}
    batch |= {"next_obs": 2 * noise(n, 3, seed=3) - 0.3, "reward": 3 * noise(n, seed=4)}
    return batch | {"terminal": (torch.arange(n) % 3 == 1).float()}


def test_a_first_update_of_sac_has_the_losses_and_gradients_it_had(golden):
    """A temperature, a discount and normalised observations that show."""
    sac = small(alpha=0.7, gamma=0.8, average=0.1, tau=0.3)
    for x in noise(5, 3, seed=5) * torch.tensor([2.0, 0.5, 1.0]):
        sac.observe(x.numpy())
    for p in (*sac.target.parameters(), *sac.test_actor.parameters()):
        p.mul_(1.5)  # not where the fast ones are
    torch.manual_seed(1)
    figures = {"y": sac.critic_target(mixed())} | sac.update(mixed())
    for name in ("critic", "actor", "target", "test_actor"):
        figures[name] = slopes(getattr(sac, name))
    figures |= {"of log alpha": sac.log_alpha.grad, "followed": look(sac.target.weights[0])}
    golden(figures | {"averaged": look(sac.test_actor.net[0].weight)})


def test_three_updates_of_sac_move_its_networks_as_far_as_they_did(golden):
    """At rates that differ, each kind of network by its own."""
    sac = small(critic_lr=3e-3, actor_lr=2e-3, tau=0.02)
    names = ("actor", "critic", "target", "test_actor")
    before = {name: weights(getattr(sac, name)) for name in names}
    told = []
    for seed in range(3):
        torch.manual_seed(seed)
        told.append(sac.update(mixed()))
    figures = {name: moved(before[name], getattr(sac, name)) for name in names}
    kept = sac.state_dict()
    figures |= {"state": [*kept], "log alpha": kept["log_alpha"]}
    groups = kept["optimizer"]["param_groups"]
    figures |= {k: [g[k] for g in groups] for k in ("lr", "betas", "eps", "weight_decay")}
    golden(figures | columns(told))


def test_rates_and_target_entropies_fall_as_they_fell(golden):
    sac, rows = SAC(2, 3, width=4, critic_lr=1e-3, actor_lr=3e-4, entropy=-0.7), []
    for passed in (0.0, 0.29, 0.31, 0.5, 0.69, 0.71, 0.99, 1.0, 1.2):
        sac.anneal(passed)
        rates = [group["lr"] for group in sac.optimizer.param_groups]
        rows.append([*rates, sac.target_entropy])
    golden({"rates and entropy": rows})


class Room(gym.Env):
    """A point in a plane is paid for its place; its way ends at a wall or after nine steps."""

    observation_space = gym.spaces.Box(-9, 9, (2,), np.float32)
    action_space = gym.spaces.Box(-1, 1, (3,), np.float32)

    def __init__(self):
        self.seeds, self.actions = [], []

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        self.seeds.append(seed)
        self.t, self.x = 0, self.np_random.uniform(-1, 0.5, 2)
        return self.x.astype(np.float32), {}

    def step(self, action):
        self.actions.append(action)
        self.t, self.x = self.t + 1, self.x + 0.3 * action[:2] + [0.1, 0.1 * action[2]]
        left, right = map(float, self.x)
        info = {"reward_parts": {"left": left, "right": -right}, "is_success": left > 0.5}
        return self.x.astype(np.float32), left - right, left > 0.9, self.t >= 9, info


def test_a_short_training_of_sac_goes_as_it_went(golden, monkeypatch, buffers):
    """Random steps, updates, an evaluation, candidates, and the trials that choose one of them."""
    monkeypatch.setattr(module, "WINDOW", 2)
    env, kept, chosen, bar = Room(), Kept(), [], Bar(monkeypatch, module)
    best = module.best_actor
    monkeypatch.setattr(
        module, "best_actor", lambda *of: chosen.append(of[2]) or best(*of)
    )  # fmt: skip
    sac, log = train(
        env, steps=52, seed=4, random_steps=33, width=8, batch=7, checkpoint=kept,
        evaluate=lambda agent: {"tried": agent.alpha}, evaluate_every=3,
    )  # fmt: skip
    n = len(buffers[0])
    figures = {"bar": bar.told} | {
        f"kept: {k}": look(v[:n], 20) for k, v in buffers[0].data.items()
    }
    figures |= {"seeds": str(env.seeds), "steps": len(env.actions), "state": [*kept.states[0]]}
    figures |= {"forced": kept.forced, "capacity": buffers[0].capacity}
    figures["returns"] = [c["return"] for c in kept.states[-1]["candidates"]]
    figures["actions"] = look(np.array(env.actions), 30)
    figures["averaged"] = [look(a["net.4.bias"], 6) for a in chosen[0]]
    figures["acts"] = sac.act(np.float32([0.2, -0.4]), deterministic=True)
    golden(figures | columns(log))


def test_a_random_action_is_held_and_drawn_as_it_was(golden):
    env, kept = Room(), Kept()
    agent, buffer = SAC(2, 3, width=4), ReplayBuffer(2, 3, 40)
    module.learn(
        env, agent, buffer, np.random.default_rng(3), steps=20, seed=1, checkpoint=kept,
        evaluate=None, evaluate_every=1, updates=1, random_steps=90, batch=4, hold=4,
    )  # fmt: skip
    golden({"actions": buffer.data["action"][: len(buffer), 0], "steps": len(buffer)})


def test_what_a_buffer_of_vectors_gives_is_what_it_gave(golden):
    figures = {}
    for n in (3, 9):  # not full, and overwritten
        buffer = numbered(5, n)
        batch = buffer.sample(np.random.default_rng(n), 12)
        figures |= {f"{k} of {n}": v for k, v in batch.items()}
        state = buffer.state_dict()
        figures[f"state of {n}"] = f"{[*state]} {[(k, len(v)) for k, v in state['data'].items()]}"
    golden(figures)


def test_a_policys_file_and_its_acts_are_what_they_were(golden, tmp_path):
    sac, obs = trained()
    module.save(tmp_path / "policy.safetensors", sac)
    saved = load_state(tmp_path / "policy.safetensors")
    policy = module.load(tmp_path / "policy.safetensors")
    torch.manual_seed(2)
    names = [*map(str, saved["actor"]), *saved["normalise"]]
    save_state(tmp_path / "other", {"kind": "pixel policy"})
    told = refusals(tmp_path, lambda: module.load(tmp_path / "other"))
    figures = {"file": in_file(tmp_path / "policy.safetensors"), "names": names, "refusals": told}
    figures["drawn"] = policy.act(3 * obs)
    golden(figures | {"mean": policy.act(3 * obs, deterministic=True)})
