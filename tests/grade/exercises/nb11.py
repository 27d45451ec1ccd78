"""Notebook 11, the rivals: CycleGAN's loss and its pool, the goal classifier, SAC+AE's losses."""

import numpy as np
import torch
import torch.nn.functional as F

from tests.grade.exercise import exercise


def _normal(rng, *shape, scale=1.0):
    return torch.from_numpy(np.float32(scale * rng.normal(size=shape)))


@exercise(
    "11.1",
    "The generators' loss",
    probe="""
    def probe(w, x, y, lam, c, ask):
        # Generators with weights w (4,), critics with weights c (2,).
        w = w.clone().requires_grad_()
        to_y = lambda v: torch.tanh(w[0] * v) + w[1]
        to_x = lambda v: w[2] * v - w[3] * v.square()
        D_x = lambda v: c[0] * v.mean((1, 2, 3)) + 0.3
        D_y = lambda v: c[1] * torch.sin(v[:, :1]) - 0.4
        loss = cyclegan_loss(x, y, to_y, to_x, D_x, D_y, lam)
        if ask == "loss":
            return loss
        if torch.is_tensor(loss) and loss.requires_grad:
            loss.sum().backward()
        return torch.zeros_like(w) if w.grad is None else w.grad
    """,
)
def cyclegan_loss(x, y, to_y, to_x, D_x, D_y, lam):
    y_of_x, x_of_y = to_y(x), to_x(y)
    game = ((D_y(y_of_x) - 1) ** 2).mean() + ((D_x(x_of_y) - 1) ** 2).mean()
    cycle = (to_x(y_of_x) - x).abs().mean() + (to_y(x_of_y) - y).abs().mean()
    return game + lam * cycle


def _domains(rng, ask, more=0):
    """Images of both domains, `more` further ones of y, and generators' weights near 1."""
    n, *shape = (int(v) for v in rng.integers(1, 6, 4))
    x, y = _normal(rng, n, *shape), _normal(rng, n + more, *shape) + 0.5
    critics = torch.tensor([rng.uniform(0.3, 0.7), rng.uniform(1, 2)], dtype=torch.float32)
    return 1 + _normal(rng, 4, scale=0.3), x, y, float(rng.uniform(0.3, 12)), critics, ask


cyclegan_loss.check("the value of the loss", lambda rng: _domains(rng, "loss"), points=2)
cyclegan_loss.check(
    "more images of one domain than of the other",
    lambda rng: _domains(rng, "loss", int(rng.integers(1, 4))),
)
cyclegan_loss.check(
    "the gradient that reaches the generators",
    lambda rng: _domains(rng, "gradient", int(rng.integers(0, 3))),
    points=2,
    atol=1e-4,
    rtol=1e-3,
)
cyclegan_loss.mistake(
    "The cycle goes both ways: x to y and back, and y to x and back. You have one of them.",
    " + (to_y(x_of_y) - y).abs().mean()",
    "",
)
cyclegan_loss.mistake(
    "Both generators play, each against its own critic: you have one of the two games.",
    " + ((D_x(x_of_y) - 1) ** 2).mean()",
    "",
)
cyclegan_loss.mistake(
    "The generators pull the scores of what they made to 1; to 0 is what the critics do.",
    "(D_y(y_of_x) - 1)",
    "D_y(y_of_x)",
    "(D_x(x_of_y) - 1)",
    "D_x(x_of_y)",
)
for theirs in (
    "F.softplus(-{})",  # of binary_cross_entropy_with_logits, too
    "-torch.log({})",
    "torch.log(1 - torch.sigmoid({}))",
):
    cyclegan_loss.mistake(
        "The game is played in squares here, the mean of (score - 1)^2; yours has logarithms.",
        "((D_y(y_of_x) - 1) ** 2)",
        f"({theirs.format('D_y(y_of_x)')})",
        "((D_x(x_of_y) - 1) ** 2)",
        f"({theirs.format('D_x(x_of_y)')})",
    )
cyclegan_loss.mistake(
    "What to_y has made is a y, and D_y judges it; your critics are swapped.",
    "D_y(y_of_x)",
    "D_x(y_of_x)",
    "D_x(x_of_y)",
    "D_y(x_of_y)",
)
cyclegan_loss.mistake(
    "The cycle compares an image with what comes back, F(G(x)), not with its translation: yours "
    "asks that nothing is translated.",
    "to_x(y_of_x) - x",
    "y_of_x - x",
    "to_y(x_of_y) - y",
    "x_of_y - y",
)
cyclegan_loss.mistake(
    "Back to x leads the other generator, F(G(x)); yours sends G(x) through G again.",
    "to_x(y_of_x) - x",
    "to_y(y_of_x) - x",
    "to_y(x_of_y) - y",
    "to_x(x_of_y) - y",
)
cyclegan_loss.mistake(
    "An x goes to y first, by G, and comes back by F: F(G(x)). Yours is G(F(x)).",
    "to_x(y_of_x) - x",
    "to_y(to_x(x)) - x",
    "to_y(x_of_y) - y",
    "to_x(to_y(y)) - y",
)
cyclegan_loss.mistake(
    "The cycle's loss is the mean of absolute differences, not of squares.", ".abs()", ".square()"
)
cyclegan_loss.mistake(
    "lam weighs the cycle; you weigh the game.", "game + lam * cycle", "lam * game + cycle"
)
cyclegan_loss.mistake(
    "lam weighs both halves of the cycle: mind the brackets.",
    "game + lam * cycle",
    "game + lam * (to_x(y_of_x) - x).abs().mean() + (to_y(x_of_y) - y).abs().mean()",
)
cyclegan_loss.mistake("The cycle has a weight, lam; you leave it out.", "lam * cycle", "cycle")
cyclegan_loss.mistake(
    "G(y), a robot frame sent through the generator that makes robot frames, is the identity loss, "
    "which this kit leaves out: the cycle is G(F(y)).",
    "to_x(y_of_x) - x",
    "to_x(x) - x",
    "to_y(x_of_y) - y",
    "to_y(y) - y",
)
cyclegan_loss.mistake(
    "The loss's value is right, but on the way back the gradient stops at the translation: no "
    "detach there, both generators answer for what comes back.",
    "to_x(y_of_x)",
    "to_x(y_of_x.detach())",
    "to_y(x_of_y)",
    "to_y(x_of_y.detach())",
)
cyclegan_loss.mistake(
    "The loss's value is right, but the critics' verdict does not reach the generators: no detach "
    "before the critics here, that belongs into their own step.",
    "D_y(y_of_x)",
    "D_y(y_of_x.detach())",
    "D_x(x_of_y)",
    "D_x(x_of_y.detach())",
)
cyclegan_loss.mistake(
    "The loss here has two parts, the game and the cycle: you add an identity loss.",
    "game + lam * cycle",
    "game + lam * cycle + lam / 2 * ((to_y(y) - y).abs().mean() + (to_x(x) - x).abs().mean())",
)


@exercise(
    "11.2",
    "The image pool",
    probe="""
    def probe(pool, made, size, coins, places, ask):
        w = torch.ones((), requires_grad=True)  # what made the images
        both = swap(pool, w * made, size, coins, places)
        try:
            shown, pool = both
        except (TypeError, ValueError):
            return both
        if not torch.is_tensor(shown):
            raise ValueError(f"what is shown is a {type(shown).__name__}: stack it to one tensor")
        if torch.is_tensor(pool):
            raise ValueError("the new pool is one tensor: return a list of them, to add to")
        if ask == "gradient":
            tied = [v.requires_grad for v in (shown, *pool)]
            return {"shown": shown, "tied to the generator: what is shown, of the pool": tied}
        return {"shown": shown, "pool": list(pool)}
    """,
)
def swap(pool, made, size, coins, places):
    pool, shown = list(pool), []
    for image, coin, place in zip(made.detach(), coins, places, strict=True):
        if len(pool) < size:
            shown.append(image)
            pool.append(image)
        elif coin < 0.5:
            shown.append(pool[place])
            pool[place] = image
        else:
            shown.append(image)
    return torch.stack(shown), pool


def _pool(rng, size, before, new, ask="values", coins=(0.0, 0.3, 0.5, 0.8), places=None):
    """A pool of `size` that holds `before` images, and `new` ones to come."""
    shape = [int(v) for v in rng.integers(1, 4, 3)]
    pool = [_normal(rng, *shape) for _ in range(before)]
    coins = [float(rng.choice(coins)) for _ in range(new)]
    places = [int(v) for v in rng.integers(0, size if places is None else places, new)]
    return pool, _normal(rng, new, *shape), size, coins, places, ask


def _room(rng):
    size, new = int(rng.integers(5, 9)), int(rng.integers(1, 4))
    return _pool(rng, size, int(rng.integers(0, size - new + 1)), new)


def _full(rng, least=1, **more):
    size = int(rng.integers(least, 6))
    return _pool(rng, size, size, int(rng.integers(4, 9)), **more)


def _filling(rng):
    size = int(rng.integers(3, 6))
    return _pool(rng, size, size - int(rng.integers(1, 3)), int(rng.integers(5, 9)))


swap.check("while there is room, it only takes in", _room)
swap.check("a full pool gives one back for every second", _full, points=2)
swap.check("a pool that becomes full on the way", _filling)
swap.check(
    "an image can come back within its own batch",
    lambda rng: _full(rng, least=2, coins=(0.1, 0.4), places=int(rng.integers(1, 3))),
)
swap.check("nothing it returns is tied to the generator", lambda rng: _full(rng, ask="gradient"))
swap.mistake(
    "Below 0.5 the coin asks for an exchange; yours exchanges above.",
    "coin < 0.5",
    "coin > 0.5",
)
swap.mistake(
    "The values are right, but the images are still tied to the generator, and the critics' step "
    "would change it: detach them first.",
    "made.detach()",
    "made",
)
swap.mistake(
    "What is shown is free of the generator, but the images in the pool are still tied to it: "
    "detach them before they go in.",
    "made.detach()",
    "made",
    "torch.stack(shown), pool",
    "torch.stack(shown).detach(), pool",
)
swap.mistake(
    "The older image leaves the pool, and the new one takes its place; yours keeps the older one.",
    "            pool[place] = image\n",
    "",
)
swap.mistake(
    "The critic is shown the older image, from before the new one took its place.",
    "shown.append(pool[place])",
    "shown.append(image)",
)
swap.mistake(
    "A coin below 0.5 exchanges; yours exchanges at 0.5 and above.", "coin < 0.5", "coin >= 0.5"
)
swap.mistake("A coin of 0.5 is not below 0.5: the new image is shown.", "coin < 0.5", "coin <= 0.5")
swap.mistake(
    "The coin decides only when the pool is full; until then it takes in every new image.",
    "if len(pool) < size:",
    "if len(pool) < size and coin >= 0.5:",
    "elif coin < 0.5:",
    "elif coin < 0.5 and place < len(pool):",
)
swap.mistake(
    "The pool never holds more than `size` images: the new one takes the older one's place, it is "
    "not added.",
    "pool[place] = image",
    "pool.append(image)",
)
swap.mistake(
    "One image after the other: what an earlier one of this batch has put into the pool can come "
    "back. You look into the pool as it was before the batch.",
    "pool, shown = list(pool), []",
    "pool, shown, before = list(pool), [], list(pool) + list(made.detach())",
    "shown.append(pool[place])",
    "shown.append(before[place])",
)
swap.mistake(
    "The image at `place` leaves, and the new one takes just that place; yours lets the oldest go.",
    "            pool[place] = image\n",
    "            pool = [*pool[1:], image]\n",
)
swap.mistake(
    "Every image has a coin of its own; you throw one for the whole batch.",
    "elif coin < 0.5:",
    "elif coins[0] < 0.5:",
)
swap.mistake(
    "When the pool is full, the images that are not exchanged are shown as they are, and the pool "
    "does not take them in.",
    "        else:\n            shown.append(image)",
    "        else:\n            shown.append(image)\n            pool[place] = image",
)
swap.mistake(
    "The new image takes the old one's place; yours goes to the end of the pool.",
    "            pool[place] = image\n",
    "            del pool[place]\n            pool.append(image)\n",
)
swap.mistake(
    "The pool holds `size` images at most; yours grows to one more.",
    "len(pool) < size",
    "len(pool) <= size",
)
swap.mistake(
    "coins[i] and places[i] belong to image i, also where there was room and they are not asked.",
    "for image, coin, place in zip(made.detach(), coins, places, strict=True):",
    "coins, places = iter(coins), iter(places)\n    for image in made.detach():",
    "elif coin < 0.5:",
    "elif next(coins) < 0.5:\n            place = next(places)",
)
swap.mistake(
    "Whether there is room is asked anew for each image: the pool can fill up within a batch.",
    "pool, shown = list(pool), []",
    "pool, shown = list(pool), []\n    room = len(pool) < size",
    "if len(pool) < size:",
    "if room:",
)


@exercise(
    "11.3",
    "The goal classifier's loss, mixed",
    probe="""
    def probe(w, goals, others, share, partner, ask):
        # Logits that are no linear function of the image; w (C, H, W) are the weights.
        w = w.clone().requires_grad_()
        classify = lambda v: (w * torch.sin(2 * v)).sum((1, 2, 3))
        loss = mixup_loss(classify, goals, others, share, partner)
        if ask == "loss":
            return loss
        if torch.is_tensor(loss) and loss.requires_grad:
            loss.sum().backward()
        return torch.zeros_like(w) if w.grad is None else w.grad
    """,
)
def mixup_loss(classify, goals, others, share, partner):
    images = torch.cat([goals, others])
    labels = torch.cat([torch.ones(len(goals)), torch.zeros(len(others))])
    own = share.view(-1, 1, 1, 1)
    mixed = own * images + (1 - own) * images[partner]
    target = share * labels + (1 - share) * labels[partner]
    return F.binary_cross_entropy_with_logits(classify(mixed), target)


def _batch(rng, ask, scale=0.5, share=None, n=None):
    """Goals, others, what stays of each, and a partner for each."""
    P, M, C, H, W = (int(v) for v in rng.integers((1, 3, 1, 2, 3), (5, 7, 4, 6, 9)))
    P, M = n or P, n or M
    W += W == P + M  # or a share without its three dimensions would fit by chance
    goals, others = _normal(rng, P, C, H, W), _normal(rng, M, C, H, W) + 0.3
    stays = rng.uniform(size=P + M) if share is None else np.full(P + M, share)
    partner = torch.from_numpy(rng.permutation(P + M))
    weights = _normal(rng, C, H, W, scale=scale)
    return weights, goals, others, torch.from_numpy(np.float32(stays)), partner, ask


mixup_loss.check(
    "the value of the loss",
    lambda rng: _batch(rng, "loss"),
    points=2,
    least=lambda rng: _batch(rng, "loss", n=1),
)
mixup_loss.check(
    "where all of the own stays, nothing is mixed", lambda rng: _batch(rng, "loss", share=1.0)
)
mixup_loss.check(
    "logits of a hundred, where a probability is 0 or 1",
    lambda rng: _batch(rng, "loss", scale=100.0),
    rtol=1e-3,
)
mixup_loss.check(
    "the gradient that reaches the classifier", lambda rng: _batch(rng, "gradient"), atol=1e-4
)
mixup_loss.mistake(
    "Goals have the label 1, the others 0; yours are swapped.",
    "torch.ones(len(goals)), torch.zeros(len(others))",
    "torch.zeros(len(goals)), torch.ones(len(others))",
)
mixup_loss.mistake(
    "You mix the images and leave the labels as they were: half a goal would count as a whole one.",
    "target = share * labels + (1 - share) * labels[partner]",
    "target = labels",
)
mixup_loss.mistake(
    "You mix the labels and leave the images as they were.",
    "own * images + (1 - own) * images[partner]",
    "images",
)
mixup_loss.mistake(
    "Images and labels are mixed with the same share: yours gives the label what the image's "
    "partner has.",
    "share * labels + (1 - share) * labels[partner]",
    "(1 - share) * labels + share * labels[partner]",
)
mixup_loss.mistake(
    "share is what stays of the own; yours is what comes from the partner.",
    "own = share.view(-1, 1, 1, 1)",
    "share = 1 - share\n    own = share.view(-1, 1, 1, 1)",
)
mixup_loss.mistake(
    "Mix the images and look at the mixture; you look at both and mix what the classifier says.",
    "mixed = own * images + (1 - own) * images[partner]",
    "logits = share * classify(images) + (1 - share) * classify(images[partner])",
    "classify(mixed)",
    "logits",
)
mixup_loss.mistake(
    "Right for small logits, wrong for large ones: a probability of 1 - 1e-40 is 1, and the rest "
    "is lost. binary_cross_entropy_with_logits takes the logit itself.",
    "F.binary_cross_entropy_with_logits(classify(mixed), target)",
    "F.binary_cross_entropy(classify(mixed).sigmoid(), target)",
)
mixup_loss.mistake(
    "The classifier returns logits; take the cross-entropy with logits, or a sigmoid is missing.",
    "F.binary_cross_entropy_with_logits(classify(mixed), target)",
    "((classify(mixed) - target) ** 2).mean()",
)
mixup_loss.mistake(
    "The sigmoid is there twice: binary_cross_entropy_with_logits takes the logit as it is.",
    "classify(mixed), target",
    "classify(mixed).sigmoid(), target",
)
mixup_loss.mistake(
    "The loss is the mean over the batch, not its sum.",
    "classify(mixed), target",
    "classify(mixed), target, reduction='sum'",
)
mixup_loss.mistake(
    "The labels of mixtures are shares, and stay so: yours are rounded to 0 or 1.",
    "target = share * labels + (1 - share) * labels[partner]",
    "target = (share * labels + (1 - share) * labels[partner]).round()",
)
mixup_loss.mistake(
    "share has one number an image, (B,): bring it to (B, 1, 1, 1) before it multiplies images.",
    "share.view(-1, 1, 1, 1)",
    "share",
)
mixup_loss.mistake(
    "A goal and a non-goal are mixed, too: partner counts over the whole batch, goals first.",
    "images[partner]",
    "torch.cat([goals[partner[:len(goals)] % len(goals)],"
    " others[partner[len(goals):] % len(others)]])",
    "share * labels + (1 - share) * labels[partner]",
    "labels",
)
mixup_loss.mistake(
    "Mix with the partners as they came: images you have mixed in place are others already.",
    "mixed = own * images + (1 - own) * images[partner]",
    "mixed = images.clone()\n    for i in range(len(mixed)):\n        mixed[i] = "
    "own[i] * mixed[i] + (1 - own[i]) * mixed[partner[i]]",
)
mixup_loss.mistake(
    "The goals come first, then the others: share and partner count in this order.",
    "torch.cat([goals, others])",
    "torch.cat([others, goals])",
    "torch.cat([torch.ones(len(goals)), torch.zeros(len(others))])",
    "torch.cat([torch.zeros(len(others)), torch.ones(len(goals))])",
)
mixup_loss.mistake(
    "`share` is that of the own image, as it is that of the own label: yours has the images "
    "the other way round.",
    "own * images + (1 - own) * images[partner]",
    "(1 - own) * images + own * images[partner]",
)
mixup_loss.mistake(
    "The logarithm of a sigmoid that has rounded to 0 is minus infinity: "
    "binary_cross_entropy_with_logits takes the logits and is exact at any size.",
    "return F.binary_cross_entropy_with_logits(classify(mixed), target)",
    "c = torch.sigmoid(classify(mixed))\n"
    "    return -(target * c.log() + (1 - target) * (1 - c).log()).mean()",
)
mixup_loss.mistake(
    "A sigmoid that is kept from 0 and 1 bounds the loss and ends its gradient: give the logits "
    "to binary_cross_entropy_with_logits.",
    "F.binary_cross_entropy_with_logits(classify(mixed), target)",
    "F.binary_cross_entropy(torch.sigmoid(classify(mixed)).clamp(1e-7, 1 - 1e-7), target)",
)
mixup_loss.mistake(
    "The share is taken as it is given: the larger of s and 1 - s is another method's.",
    "own = share.view(-1, 1, 1, 1)",
    "share = torch.maximum(share, 1 - share)\n    own = share.view(-1, 1, 1, 1)",
)


@exercise(
    "11.4",
    "Who trains the encoder?",
    probe="""
    def probe(E, D, Q, P, x, a, y, lam, ask):
        # Networks of one layer; E, D, Q, P are the weights of encoder, decoder, critic and actor.
        w = {"encoder": E, "decoder": D, "critic": Q, "actor": P}
        w = {name: v.clone().requires_grad_() for name, v in w.items()}
        encoder = lambda x: torch.tanh(x.flatten(1) @ w["encoder"])
        decoder = lambda h: torch.sin(h @ w["decoder"]).view(-1, *x.shape[1:])
        critic = lambda h, a: torch.sin(torch.cat([h, a], 1) @ w["critic"]).sum(1)
        actor = lambda h: torch.tanh(h @ w["actor"])
        losses = sac_ae_losses(encoder, decoder, critic, actor, x, a, y, lam)
        try:
            losses = tuple(losses)
        except TypeError:
            return losses
        if ask == "losses" or len(losses) != 3:
            return losses
        which, names = {
            "critic": (0, ("encoder", "critic")),
            "autoencoder": (1, ("encoder", "decoder")),
            "actor": (2, ("encoder", "actor")),
        }[ask]
        if torch.is_tensor(losses[which]) and losses[which].requires_grad:
            losses[which].sum().backward()
        of = {name: w[name] for name in names}
        return {n: torch.zeros_like(v) if v.grad is None else v.grad for n, v in of.items()}
    """,
)
def sac_ae_losses(encoder, decoder, critic, actor, x, a, y, lam):
    h = encoder(x)
    critic_loss = ((critic(h, a) - y) ** 2).mean()
    error = ((decoder(h) - x) ** 2).mean()
    autoencoder_loss = error + lam * (h**2).sum(1).mean()
    seen = h.detach()
    actor_loss = -critic(seen, actor(seen)).mean()
    return critic_loss, autoencoder_loss, actor_loss


def _agent(rng, ask):
    """Weights, images, actions, targets; sizes that differ from each other."""
    B, C, H, W, L, A = (int(v) for v in rng.integers((3, 1, 2, 2, 3, 1), (7, 4, 5, 5, 7, 4)))
    N = C * H * W
    weights = (_normal(rng, *s, scale=0.5) for s in ((N, L), (L, N), (L + A, 6), (L, A)))
    x, a, y = _normal(rng, B, C, H, W), _normal(rng, B, A).tanh(), _normal(rng, B)
    return *weights, x, a, y, float(rng.uniform(0.1, 2)), ask


sac_ae_losses.check(
    "the values of the losses",
    lambda rng: _agent(rng, "losses"),
    least=lambda rng: (*(g := _agent(rng, "losses"))[:4], *[v[:1] for v in g[4:7]], *g[7:]),
)
sac_ae_losses.check("what the critic's loss trains", lambda rng: _agent(rng, "critic"))
sac_ae_losses.check("what the autoencoder's loss trains", lambda rng: _agent(rng, "autoencoder"))
sac_ae_losses.check("what the actor's loss trains", lambda rng: _agent(rng, "actor"), points=2)
sac_ae_losses.mistake(
    "The values are right, but the actor's loss runs into the encoder: the actor reads latents and "
    "does not change them, so detach them for it.",
    "seen = h.detach()",
    "seen = h",
)
sac_ae_losses.mistake(
    "The values are right, but the critic's loss does not reach the encoder. It is what tells the "
    "latents what matters for the task: no detach there.",
    "critic(h, a)",
    "critic(h.detach(), a)",
)
sac_ae_losses.mistake(
    "The values are right, but the reconstruction does not train the encoder: the decoder alone "
    "cannot draw what the latents do not hold.",
    "decoder(h)",
    "decoder(h.detach())",
)
sac_ae_losses.mistake(
    "The values are right, but the actor learns nothing: detach the latents it sees, not the "
    "action it takes. The gradient comes from the critic through the action.",
    "critic(seen, actor(seen))",
    "critic(seen, actor(seen).detach())",
)
sac_ae_losses.mistake(
    "The values are right, but one latent is detached and the other is not: the critic in the "
    "actor's loss must not lead into the encoder either.",
    "critic(seen, actor(seen))",
    "critic(h, actor(seen))",
)
sac_ae_losses.mistake(
    "The actor wants a high value, and a loss is made small: there is a minus.",
    "-critic(seen",
    "critic(seen",
)
sac_ae_losses.mistake(
    "The critic judges the action that was done, a; the actor's own action belongs to the actor's "
    "loss.",
    "critic(h, a)",
    "critic(h, actor(h))",
)
sac_ae_losses.mistake(
    "The actor is judged on the action it would do now, not on the one that was done.",
    "critic(seen, actor(seen))",
    "critic(seen, a)",
)
sac_ae_losses.mistake("The latents' square length is missing.", " + lam * (h**2).sum(1).mean()", "")
sac_ae_losses.mistake(
    "A latent's square length is the sum over its numbers; the mean is over the batch.",
    "(h**2).sum(1).mean()",
    "(h**2).mean()",
)
sac_ae_losses.mistake(
    "The square length has no root.", "(h**2).sum(1).mean()", "(h**2).sum(1).sqrt().mean()"
)
sac_ae_losses.mistake(
    "The reconstruction's error is the mean of squares, not of absolute differences.",
    "((decoder(h) - x) ** 2).mean()",
    "(decoder(h) - x).abs().mean()",
)
sac_ae_losses.mistake(
    "Return the critic's loss, the autoencoder's, and the actor's, in this order.",
    "return critic_loss, autoencoder_loss, actor_loss",
    "return autoencoder_loss, critic_loss, actor_loss",
)
sac_ae_losses.mistake(
    "The values are right, but the actor still pulls at the encoder: it has to see the "
    "detached latents, too.",
    "actor(seen))",
    "actor(h))",
)
sac_ae_losses.mistake(
    "y is (B,) as the critic's values are: with (B, 1) every value meets every target.",
    "(critic(h, a) - y)",
    "(critic(h, a) - y[:, None])",
)
