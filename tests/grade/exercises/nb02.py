"""Notebook 2, soft actor-critic: squashed Gaussian, critics' target, slow copies, temperature."""

import math
from itertools import pairwise

import numpy as np
import torch
import torch.nn.functional as F

from tests.grade.exercise import exercise


def _normal(rng, *shape, scale=1.0):
    return torch.from_numpy(rng.normal(0, scale, shape).astype(np.float32))


def _uniform(rng, low, high, *shape):
    return torch.from_numpy(np.asarray(rng.uniform(low, high, shape), np.float32))


@exercise(
    "2.1",
    "The log-density of a squashed Gaussian",
    probe="""
    def probe(mean, log_std, noise, ask="values"):
        if ask == "values":
            return squash(mean, log_std, noise)
        found = {}
        for i, name in enumerate(("actions", "log-densities")):
            leaves = mean.clone().requires_grad_(), log_std.clone().requires_grad_()
            both = squash(*leaves, noise)
            try:
                out = both[i]
                out.requires_grad
            except (TypeError, IndexError, AttributeError):
                return both
            if out.requires_grad:
                out.sum().backward()
            for leaf, of in zip(leaves, ("mean", "log_std")):
                gradient = torch.zeros_like(leaf) if leaf.grad is None else leaf.grad
                found[f"gradient of the {name} for {of}"] = gradient
        far = squash(torch.full((1, 1), 25.0), torch.zeros(1, 1), torch.zeros(1, 1))[0]
        return found | {"millionths that an action lacks of 1, for a mean of 25": 1e6 * (1 - far)}
    """,
)
def squash(mean, log_std, noise):
    u = mean + log_std.exp() * noise
    log_normal = -log_std - 0.5 * noise**2 - 0.5 * math.log(2 * math.pi)
    log_slope = 2 * (math.log(2) - u - F.softplus(-2 * u))
    return torch.tanh(u), (log_normal - log_slope).sum(-1)


def _moderate(rng, *shape):
    """Means, log-deviations, of which the first row's are very low, and noise."""
    shape = shape or rng.integers((4, 1), (10, 6))
    mean, log_std, noise = (
        _uniform(rng, low, high, *shape) for low, high in ((-1, 1), (-2, -0.5), (-1, 1))
    )
    log_std[0] -= 4.8
    return mean, log_std, noise


def _one_action(rng):
    """One Gaussian, its noise on a grid: the actions run from one bound to the other."""
    mean, log_std = _uniform(rng, -0.6, 0.6, 1, 1), _uniform(rng, -1.5, -0.3, 1, 1)
    return mean.repeat(600, 1), log_std.repeat(600, 1), torch.linspace(-5, 5, 600)[:, None].clone()


def _adds_up_to_one(got, args):
    if not isinstance(got, list | tuple) or len(got) != 2:
        return "it should return two tensors: the actions and their log-densities"
    a, log_pi = (np.asarray(x) for x in got)
    if a.shape != (600, 1) or log_pi.shape != (600,):
        return f"its shapes are {a.shape} and {log_pi.shape}; expected (600, 1) and (600,)"
    if a.dtype.kind != "f" or log_pi.dtype.kind != "f":
        return "it should return floating-point numbers"
    density = np.exp(np.minimum(log_pi.astype(float), 50))
    area = float((np.diff(a[:, 0]) * (density[1:] + density[:-1]) / 2).sum())
    if abs(area - 1) < 0.01:
        return None
    return f"the density over all actions adds up to {area:.3f}; expected 1"


def _far_out(rng):
    shape = rng.integers((5, 2), (9, 5))
    side = torch.from_numpy(rng.choice([-1, 1], shape).astype(np.float32))
    log_std = _uniform(rng, -2, 0, *shape)
    log_std[0] += 4.5
    return side * _uniform(rng, 10, 25, *shape), log_std, _normal(rng, *shape)


squash.check(
    "actions and log-densities near the middle",
    lambda rng: tuple(_moderate(rng)),
    atol=1e-3,
    least=lambda rng: tuple(_moderate(rng, 1, 1)),
)
squash.check(
    "the density over all actions adds up to 1", _one_action, atol=1e-3, verify=_adds_up_to_one
)
squash.check("far out, where tanh is flat, it stays finite and right", _far_out, points=2)
squash.check(
    "their gradients reach mean and log_std, and nothing is clamped",
    lambda rng: (*_moderate(rng), "gradient"),
    atol=1e-3,
)
squash.mistake(
    "The values are right, but the gradient does not pass through u: leave detach out, the noise "
    "comes from outside.",
    "u = mean + log_std.exp() * noise",
    "u = (mean + log_std.exp() * noise).detach()",
)
squash.mistake(
    "The values are right, but the gradient does not pass through the tanh's correction: no detach "
    "there.",
    "log_slope = 2 * (math.log(2) - u - F.softplus(-2 * u))",
    "log_slope = (2 * (math.log(2) - u - F.softplus(-2 * u))).detach()",
)
squash.mistake(
    "The values are right, but no gradient leaves your function: no torch.no_grad, no numpy, no "
    "detach at the end.",
    "torch.tanh(u), (log_normal - log_slope).sum(-1)",
    "torch.tanh(u).detach(), (log_normal - log_slope).sum(-1).detach()",
)
squash.mistake("Return the action, which is tanh(u), not u.", "return torch.tanh(u)", "return u")
squash.mistake(
    "The Gaussian is that of u: you ask for its density at the action.",
    "0.5 * noise**2",
    "0.5 * ((torch.tanh(u) - mean) / log_std.exp()) ** 2",
)
squash.mistake(
    "A Gaussian has the factor 1 / sqrt(2 pi): its logarithm is missing.",
    " - 0.5 * math.log(2 * math.pi)",
    "",
)
squash.mistake(
    "The constant -log(2 pi) / 2 belongs to each of an action's numbers: you take it off once.",
    " - 0.5 * math.log(2 * math.pi)",
    "",
    "(log_normal - log_slope).sum(-1)",
    "(log_normal - log_slope).sum(-1) - 0.5 * math.log(2 * math.pi)",
)
squash.mistake(
    "The noise is scaled by sigma, and what you are given is its logarithm: log_std.exp().",
    "log_std.exp() * noise",
    "log_std * noise",
)
squash.mistake(
    "This is the density of u, before the tanh. The tanh squeezes the axis: which term says by how "
    "much?",
    "(log_normal - log_slope)",
    "log_normal",
)
squash.mistake(
    "Your correction has the wrong sign: where the tanh is flat, many u share a short stretch of "
    "a, and the density of a is higher there than that of u.",
    "log_normal - log_slope",
    "log_normal + log_slope",
)
squash.mistake(
    "Right near the middle, infinite far out: in float32 tanh(10) is exactly 1, and you "
    "take the log of 0. Use the form with softplus.",
    "2 * (math.log(2) - u - F.softplus(-2 * u))",
    "torch.log(1 - torch.tanh(u) ** 2)",
)
squash.mistake(
    "A small constant inside the log keeps it finite, but wrong far out, where the slope is "
    "smaller than that constant. The form with softplus needs none.",
    "2 * (math.log(2) - u - F.softplus(-2 * u))",
    "torch.log(1 - torch.tanh(u) ** 2 + 1e-6)",
)
squash.mistake(
    "A wider Gaussian is a lower one: your log-density of u does not depend on the standard "
    "deviation.",
    "-log_std - 0.5",
    "-0.5",
)
squash.mistake(
    "The numbers of an action are independent: densities multiply, so logs add up. You average "
    "them.",
    ".sum(-1)",
    ".mean(-1)",
)
squash.mistake(
    "One log-density an action, shape (B,), not one for each of its numbers: add up over the last "
    "dimension.",
    ".sum(-1)",
    "",
)
squash.mistake(
    "The Gaussian's exponent has (u - mean) / sigma, which is the noise; yours has u itself.",
    "0.5 * noise**2",
    "0.5 * u**2",
)
squash.mistake(
    "log_std is taken as it is, however high or low; whoever makes it may cut it off.",
    "u = mean",
    "log_std = log_std.clamp(-5, 2)\n    u = mean",
)
squash.mistake(
    "log_std is taken as it is, however high or low; whoever makes it may cut it off.",
    "u = mean",
    "log_std = log_std.clamp(-20, 2)\n    u = mean",
)
squash.mistake(
    "Nothing is clamped: far out the action rounds to exactly 1, and may.",
    "torch.tanh(u),",
    "torch.tanh(u).clamp(-0.99999, 0.99999),",
)
squash.mistake(
    "squeeze() drops every axis of length 1, that of a batch of one, too: leave it out.",
    ".sum(-1)",
    ".sum(-1).squeeze()",
)
squash.mistake(
    "The numbers of one action, the last dimension, are added up; you add up over the batch.",
    ".sum(-1)",
    ".sum(0)",
)
squash.mistake(
    "Where u is cut off, the density is that of another action. The form with softplus bears "
    "any u.",
    "u = mean + log_std.exp() * noise",
    "u = (mean + log_std.exp() * noise).clamp(-10, 10)",
)


@exercise(
    "2.2",
    "The critics' target",
    probe="""
    def probe(*args):
        *args, ask = args
        if ask == "graph":  # as from networks; what leaves torch there may do so, for all we ask
            try:
                networks = (x.clone().requires_grad_() for x in args[3:6])
                critic_target(*args[:3], *networks, *args[6:])
            except RuntimeError:
                pass
        return critic_target(*args)
    """,
)
def critic_target(reward, terminal, truncated, q1, q2, log_pi, alpha, gamma):
    value = torch.minimum(q1, q2) - alpha * log_pi
    return reward + gamma * (1 - terminal) * value


def _transitions(rng, ended=None, ask="values"):
    shape = [int(n) for n in rng.integers((6, 1), (11, 4))][: rng.integers(1, 3)]
    flags = {"terminal": torch.zeros(shape), "truncated": torch.zeros(shape)}
    if ended:
        which = rng.permutation(math.prod(shape)).reshape(shape) < 3
        flags[ended] = torch.from_numpy(which.astype(np.float32))
        if ended == "terminal":  # one of the three at the time limit, too
            flags["truncated"] = flags[ended] * (flags[ended].cumsum(0) == 1)
    reward, q1, q2, log_pi = (_normal(rng, *shape, scale=k) for k in (1, 5, 5, 2))
    alpha, gamma = float(rng.uniform(0.1, 0.8)), float(rng.uniform(0.8, 0.99))
    return reward, flags["terminal"], flags["truncated"], q1, q2, log_pi, alpha, gamma, ask


critic_target.check(
    "in the middle of an episode",
    _transitions,
    points=2,
    least=lambda rng: tuple(x[:1] if torch.is_tensor(x) else x for x in _transitions(rng)),
)
critic_target.check(
    "nothing comes after a terminal step", lambda rng: _transitions(rng, "terminal")
)
critic_target.check(
    "the time limit is not an end", lambda rng: _transitions(rng, "truncated", "graph")
)
critic_target.mistake(
    "Where both flags are 1 the task has ended, and nothing comes after: `terminal` alone decides.",
    "(1 - terminal)",
    "(1 - terminal * (1 - truncated))",
)
critic_target.mistake(
    "You believe the larger of the two critics; the smaller one guards against errors upwards.",
    "torch.minimum",
    "torch.maximum",
)
critic_target.mistake(
    "You average the two critics: an error upwards of one still gets in. Take the smaller, number "
    "by number.",
    "torch.minimum(q1, q2)",
    "0.5 * (q1 + q2)",
)
critic_target.mistake(
    "Take the smaller of the two number by number; yours is the smallest of the whole batch.",
    "torch.minimum(q1, q2)",
    "torch.minimum(q1, q2).min()",
)
critic_target.mistake(
    "The soft value of Eq. 3 has an entropy term, and yours has none: alpha and log_pi are unused.",
    "torch.minimum(q1, q2) - alpha * log_pi",
    "torch.minimum(q1, q2)",
)
critic_target.mistake(
    "A rare action, log_pi very negative, should be worth more; in your target it is worth less.",
    "- alpha * log_pi",
    "+ alpha * log_pi",
)
critic_target.mistake(
    "You cut the future off at the time limit: the clock stopped the episode, but the state goes "
    "on.",
    "(1 - terminal)",
    "(1 - terminal) * (1 - truncated)",
)
critic_target.mistake(
    "You do not look at terminal: after the end there is neither value nor entropy.",
    "(1 - terminal)",
    "1",
)
critic_target.mistake(
    "The next action's entropy lies in the future too: after the end there is none, so the bracket "
    "around Q and entropy is inside what (1 - terminal) cuts off.",
    "(1 - terminal) * value",
    "((1 - terminal) * torch.minimum(q1, q2) - alpha * log_pi)",
)
critic_target.mistake("What comes later counts gamma times as much.", "gamma * ", "")
critic_target.mistake(
    "Where the time limit came there is a future, where the end came there is none: yours are "
    "swapped.",
    "(1 - terminal)",
    "(1 - truncated)",
)
critic_target.mistake(
    "terminal is 1 where it ended: what counts there is 1 - terminal.", "(1 - terminal)", "terminal"
)
critic_target.mistake(
    "The reward of a terminal step counts: only what would come after it does not.",
    "reward + gamma * (1 - terminal) * value",
    "(1 - terminal) * (reward + gamma * value)",
)
critic_target.mistake(
    "The next action's entropy lies in the future too: it belongs inside what is discounted and "
    "cut off.",
    "value = torch.minimum(q1, q2) - alpha * log_pi\n    return reward + gamma * (1 - terminal) * "
    "value",
    "return reward - alpha * log_pi + gamma * (1 - terminal) * torch.minimum(q1, q2)",
)
critic_target.mistake(
    "The smaller value, not the one nearer to 0: values may be negative.",
    "torch.minimum(q1, q2)",
    "torch.where(q1.abs() < q2.abs(), q1, q2)",
)
critic_target.mistake(
    "Each transition has a flag of its own: one that has ended does not end the batch.",
    "(1 - terminal)",
    "(1 - terminal.max())",
)


@exercise(
    "2.3",
    "Slow copies of the critics",
    changes=(0,),
    probe="""
    def probe(slow, fast, tau, times, ask):
        nets = []
        for layers in (slow, fast):
            net = nn.Sequential(*(nn.Linear(*weight.shape[::-1]) for weight, _ in layers))
            for layer, (weight, bias) in zip(net, layers):
                layer.load_state_dict({"weight": weight, "bias": bias})
            nets.append(net)
        target, online = nets[0].requires_grad_(times == 1), nets[1]
        for p in online.parameters():
            p.grad = torch.ones_like(p)
        for _ in range(times):
            value = follow(target, online, tau)
        if ask == "gradient":
            return [p.requires_grad for p in target.parameters()]
        weights = [p.detach() for p in {"target": target, "online": online}[ask].parameters()]
        if ask == "target":
            return weights
        return {"returned": "nothing" if value is None else "something", "weights": weights}
    """,
)
def follow(target, online, tau):
    with torch.no_grad():
        for slow, fast in zip(target.parameters(), online.parameters(), strict=True):
            slow.copy_((1 - tau) * slow + tau * fast)


def _two_nets(rng, times, ask):
    """Networks of one to three layers, as lists of weight and bias."""
    sizes = [int(n) for n in rng.integers(2, 6, rng.integers(2, 5))]
    slow, fast = (
        [[_normal(rng, n, m), _normal(rng, n)] for m, n in pairwise(sizes)] for _ in range(2)
    )
    return slow, fast, float(rng.uniform(0.05, 0.3)), times, ask


follow.check("one step moves weights and biases", lambda rng: _two_nets(rng, 1, "target"))
follow.check(
    "several steps in a row", lambda rng: _two_nets(rng, int(rng.integers(2, 7)), "target")
)
follow.check(
    "the online network stays as it is, and nothing is returned",
    lambda rng: _two_nets(rng, 3, "online"),
)
follow.check("the copy stays out of the gradient", lambda rng: _two_nets(rng, 2, "gradient"))
follow.mistake(
    "Your copy jumps most of the way: tau is the small share that comes from the online network.",
    "(1 - tau) * slow + tau * fast",
    "tau * slow + (1 - tau) * fast",
)
follow.mistake(
    "Your copy equals the online network after one step: tau is not used.",
    "(1 - tau) * slow + tau * fast",
    "fast",
)
follow.mistake(
    "You add a share of the online weights but keep all of the old ones: the two shares have to "
    "sum to 1.",
    "(1 - tau) * slow + tau * fast",
    "slow + tau * fast",
)
follow.mistake(
    "The copy does not change: `p = ...` names a new tensor. Write into the old one, p.copy_(...) "
    "or the like.",
    "slow.copy_((1 - tau) * slow + tau * fast)",
    "slow = (1 - tau) * slow + tau * fast",
)
follow.mistake(
    "You move the online network towards the copy: the online one is the optimizer's alone.",
    "slow.copy_((1 - tau) * slow + tau * fast)",
    "fast.copy_((1 - tau) * fast + tau * slow)",
)
follow.mistake(
    "Only part of the copy moves: go through all parameters, weights and biases.",
    "in zip(target.parameters(), online.parameters(), strict=True)",
    "in list(zip(target.parameters(), online.parameters(), strict=True))[:1]",
)
follow.mistake(
    "Autograd records your averaging, so the copy drags an ever longer graph along: switch it off.",
    "with torch.no_grad()",
    "if True",
)
follow.mistake(
    "The copy changes in place, and nothing is returned: leave the return out.",
    "            slow.copy_((1 - tau) * slow + tau * fast)",
    "            slow.copy_((1 - tau) * slow + tau * fast)\n    return True",
)
follow.mistake(
    "You skip what needs no gradient: the copy's parameters need none, and have to move.",
    "            slow.copy_(",
    "            if slow.requires_grad: slow.copy_(",
)
follow.mistake(
    "Shrink the old weights before you add to them: yours shrinks the share of the online network, "
    "too.",
    "(1 - tau) * slow + tau * fast",
    "(1 - tau) * (slow + tau * fast)",
)
follow.mistake(
    "You follow the weights alone: the biases are parameters, too.",
    "            slow.copy_(",
    "            if slow.dim() > 1: slow.copy_(",
)


@exercise(
    "2.4",
    "The temperature's loss (Eq. 18)",
    probe="""
    def probe(log_alpha, log_pi, target_entropy, ask):
        log_alpha, log_pi = log_alpha.clone().requires_grad_(), log_pi.clone().requires_grad_()
        loss = temperature_loss(log_alpha, log_pi, target_entropy)
        if ask == "loss":
            return loss
        if torch.is_tensor(loss) and loss.requires_grad:
            loss.sum().backward()
        leaf = log_alpha if ask == "alpha" else log_pi
        gradient = torch.zeros_like(leaf) if leaf.grad is None else leaf.grad
        if ask == "alpha":
            return {"alpha after a step of 0.1 downhill": (leaf - 0.1 * gradient).exp()}
        return {"the gradient for log_pi": gradient}
    """,
)
def temperature_loss(log_alpha, log_pi, target_entropy):
    alpha = log_alpha.exp()
    return -(alpha * (log_pi.detach() + target_entropy)).mean()


def _temperature(rng, ask, entropy=0.0, log_alpha=(-3, -0.5), least=24):
    """A batch whose entropy lies that far above its target, and log_alpha between these bounds."""
    target = float(rng.uniform(-6, -1))
    log_pi = _normal(rng, int(rng.integers(least, 2 * least)))
    log_pi = log_pi - log_pi.mean() - target - entropy
    return _uniform(rng, *log_alpha), log_pi, target, ask


temperature_loss.check(
    "the value of the loss",
    lambda rng: _temperature(rng, "loss", rng.choice([-2, 2]), log_alpha=(-6, -5.2)),
    least=lambda rng: _temperature(rng, "loss", 2.0, least=1),
)
temperature_loss.check(
    "entropy below its target: a step downhill raises alpha",
    lambda rng: _temperature(rng, "alpha", -2, log_alpha=(2.2, 3)),
)
temperature_loss.check(
    "entropy above its target: a step downhill lowers alpha",
    lambda rng: _temperature(rng, "alpha", 2),
)
temperature_loss.check(
    "no gradient reaches the policy", lambda rng: _temperature(rng, "policy", -2)
)
temperature_loss.mistake(
    "With your sign alpha falls when the policy has too little entropy, and the policy freezes.",
    "-(alpha",
    "(alpha",
)
temperature_loss.mistake(
    "The entropy is -E[log pi], so it has reached its target where log_pi + target_entropy is 0 on "
    "average; yours is 0 elsewhere.",
    "log_pi.detach() + target_entropy",
    "log_pi.detach() - target_entropy",
)
temperature_loss.mistake(
    "Eq. 18 multiplies by alpha; you multiply by its logarithm.",
    "log_alpha.exp()",
    "log_alpha",
)
temperature_loss.mistake(
    "log_alpha is taken as it is, however high or low: alpha is its exponential.",
    "log_alpha.exp()",
    "log_alpha.clamp(-5, 2).exp()",
)
temperature_loss.mistake(
    "The value is right, but the gradient also runs into log_pi and changes the policy: stop it "
    "there.",
    "log_pi.detach()",
    "log_pi",
)
temperature_loss.mistake(
    "The loss's value is right, but no gradient reaches log_alpha: alpha would never change.",
    "log_alpha.exp()",
    "log_alpha.exp().detach()",
)
temperature_loss.mistake(
    "No gradient reaches log_alpha, so alpha would never change, and one does reach log_pi: the "
    "detach stands at the wrong one.",
    "log_alpha.exp()",
    "log_alpha.exp().detach()",
    "log_pi.detach()",
    "log_pi",
)
temperature_loss.mistake(
    "Eq. 18 is an expectation: the mean over the batch, not its sum.", ".mean()", ".sum()"
)
temperature_loss.mistake(
    "target_entropy is not used: without it alpha never comes to rest.",
    " + target_entropy",
    "",
)
temperature_loss.mistake(
    "alpha multiplies both, log pi and the target: mind the brackets.",
    "(alpha * (log_pi.detach() + target_entropy))",
    "(alpha * log_pi.detach() + target_entropy)",
)
temperature_loss.mistake(
    "The loss is one number, the mean over the batch; yours still has one for each row.",
    ".mean()",
    "",
)
temperature_loss.mistake(
    "A loss may be negative: without the absolute value it knows which way alpha has to go.",
    "-(alpha * (log_pi.detach() + target_entropy)).mean()",
    "(alpha * (log_pi.detach() + target_entropy).mean().abs())",
)
temperature_loss.mistake(
    "The target belongs to each entry of the batch: take the mean of log_pi, not its sum.",
    "(log_pi.detach() + target_entropy)).mean()",
    "(log_pi.detach().sum() + target_entropy)).mean()",
)


@exercise(
    "2.5",
    "The actor's loss (Eq. 7)",
    given=(squash,),
    probe="""
    def probe(weight, peaks, s, noise, log_alpha, ask):
        weight, log_alpha = weight.clone().requires_grad_(), log_alpha.clone().requires_grad_()
        actor = lambda s: (s @ weight).chunk(2, -1)
        critics = lambda s, a: -3 * ((a - torch.tanh(s @ peaks)) ** 2).sum(-1)
        if ask == "loss":  # what a training may have left there
            log_alpha.grad = torch.zeros_like(log_alpha)
        loss = actor_loss(actor, critics, s, noise, log_alpha)
        if ask == "loss":
            return loss
        if torch.is_tensor(loss) and loss.requires_grad:
            loss.sum().backward()
        leaf = weight if ask == "actor" else log_alpha
        return torch.zeros_like(leaf) if leaf.grad is None else leaf.grad
    """,
)
def actor_loss(actor, critics, s, noise, log_alpha):
    mean, log_std = actor(s)
    a, log_pi = squash(mean, log_std, noise)
    q = critics(s, a).amin(0)
    return (log_alpha.exp().detach() * log_pi - q).mean()


def _policy(rng, ask):
    """A linear actor of S numbers, two bowls as critics, a batch of B."""
    B, S, A = (int(n) for n in rng.integers((9, 3, 1), (14, 6, 4)))
    weight, peaks = _normal(rng, S, 2 * A, scale=0.4), _normal(rng, 2, S, A)
    log_alpha = _uniform(rng, 2.2, 3) if ask == "loss" else _uniform(rng, -2, -0.5)
    return weight, peaks, _normal(rng, B, S), _normal(rng, B, A), log_alpha, ask


def _one_state(rng):
    """A state of one number, and an actor for such."""
    weight, peaks, s, noise, *more = _policy(rng, "loss")
    return weight[:1], peaks[:, :1], s[:1, :1], noise[:1], *more


actor_loss.check("the value of the loss", lambda rng: _policy(rng, "loss"), least=_one_state)
actor_loss.check("the gradient that reaches the actor", lambda rng: _policy(rng, "actor"), points=2)
actor_loss.check("no gradient reaches the temperature", lambda rng: _policy(rng, "alpha"))
actor_loss.mistake(
    "Your loss falls when the critics' values fall: the actor learns to do its worst. Mind Q's "
    "sign.",
    "* log_pi - q",
    "* log_pi + q",
)
actor_loss.mistake(
    "You take the larger of the two critics' values: the actor would seek out where one errs "
    "upwards.",
    "amin(0)",
    "amax(0)",
)
actor_loss.mistake(
    "Your loss has the opposite sign: it is made small, so it is alpha log pi minus Q.",
    "(log_alpha.exp().detach() * log_pi - q)",
    "(q - log_alpha.exp().detach() * log_pi)",
)
actor_loss.mistake(
    "You average the two critics: believe the smaller one, number by number.", "amin(0)", "mean(0)"
)
actor_loss.mistake(
    "Take the smaller critic number by number; yours is the smallest value of the whole batch.",
    "amin(0)",
    "amin()",
)
actor_loss.mistake(
    "The loss's value is right, but the entropy's gradient does not reach the actor: log_pi keeps "
    "its graph.",
    "* log_pi - q",
    "* log_pi.detach() - q",
)
actor_loss.mistake(
    "Your loss has no entropy term: alpha and log_pi are unused.",
    "(log_alpha.exp().detach() * log_pi - q)",
    "(-q)",
)
actor_loss.mistake(
    "The loss's value is right, but the critics' slope does not reach the actor: you cut the graph "
    "at a or in the critics.",
    "critics(s, a)",
    "critics(s, a.detach())",
)
actor_loss.mistake(
    "The loss's value is right, but its gradient also changes the temperature, which has a loss of "
    "its own.",
    "log_alpha.exp().detach()",
    "log_alpha.exp()",
)
actor_loss.mistake(
    "log_alpha is taken as it is, however high or low: alpha is its exponential.",
    "log_alpha.exp()",
    "log_alpha.clamp(-5, 2).exp()",
)
actor_loss.mistake(
    "squash takes log_std as it is, and makes its exponential itself.",
    "squash(mean, log_std, noise)",
    "squash(mean, log_std.exp(), noise)",
)
actor_loss.mistake(
    "Entropy is weighted by alpha; you weight it by its logarithm.",
    "log_alpha.exp().detach()",
    "log_alpha.detach()",
)
actor_loss.mistake(
    "Eq. 7 is an expectation: the mean over the batch, not its sum.", "- q).mean()", "- q).sum()"
)
actor_loss.mistake(
    "The loss's value is right, but it is cut off from the actor: no gradient leaves your "
    "function.",
    "- q).mean()",
    "- q).mean().detach()",
)
actor_loss.mistake(
    "alpha weighs the log-density alone, not Q.",
    "(log_alpha.exp().detach() * log_pi - q)",
    "(log_alpha.exp().detach() * (log_pi - q))",
)
actor_loss.mistake(
    "Both critics: you look at the first one alone.", "critics(s, a).amin(0)", "critics(s, a)[0]"
)
actor_loss.mistake(
    "The loss is one number, the mean over the batch; yours still has one for each state.",
    "- q).mean()",
    "- q)",
)
actor_loss.mistake(
    "The noise is given, `noise`; yours draws its own.",
    "squash(mean, log_std, noise)",
    "squash(mean, log_std, torch.randn_like(mean))",
)
actor_loss.mistake(
    "The smaller value is chosen number by number; you take the critic that is lower on average.",
    "critics(s, a).amin(0)",
    "critics(s, a).mean(1).min()",
)
actor_loss.mistake(
    "The critics judge the action that was drawn; you show them the tanh of the mean.",
    "critics(s, a)",
    "critics(s, torch.tanh(mean))",
)
