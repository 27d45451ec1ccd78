"""Notebook 4, MUNIT: content, style, and the losses of Eq. 1-5."""

import numpy as np
import torch

from tests.grade.exercise import exercise, gradients


def _tensor(rng, *shape):
    return torch.from_numpy(np.float32(rng.normal(size=shape)))


@exercise(
    "4.1",
    "Adaptive instance normalisation",
    probe=gradients("adain", h=0, mean=1, std=2),
)
def adain(h, mean, std):
    mu = h.mean((2, 3), keepdim=True)
    sigma = (h.var((2, 3), unbiased=False, keepdim=True) + 1e-5).sqrt()
    return std[:, :, None, None] * (h - mu) / sigma + mean[:, :, None, None]


def _features(rng, ask="values", scale=1.0):
    B, C, H, W = (int(n) for n in rng.integers((2, 2, 4, 5), (5, 6, 9, 10)))
    h = 3 * _tensor(rng, B, C, H, W) + 5 * _tensor(rng, B, C, 1, 1)
    return scale * h, _tensor(rng, B, C), _tensor(rng, B, C).abs() + 0.2, ask


adain.check(
    "features anywhere",
    _features,
    atol=1e-4,
    rtol=1e-3,
    least=lambda rng: ((f := _features(rng))[0][:1, :1], f[1][:1, :1], f[2][:1, :1], f[3]),
)
adain.check(
    "with mean 0 and std 1 only the style is gone",
    lambda rng: ((f := _features(rng))[0], 0 * f[1], torch.ones_like(f[2]), f[3]),
    atol=1e-4,
    rtol=1e-3,
    least=lambda rng: (
        (f := _features(rng))[0][:, :1],
        0 * f[1][:, :1],
        torch.ones_like(f[2][:, :1]),
        f[3],
    ),
)
adain.check(
    "channels that hardly vary: 1e-5 is added to the variance",
    lambda rng: _features(rng, scale=1e-3),
    atol=1e-4,
    rtol=1e-3,
)
adain.check(
    "the gradient passes through it", lambda rng: _features(rng, "gradient"), atol=1e-4, rtol=1e-3
)
adain.mistake(
    "The values are right, but no gradient leaves your function, and no network would learn: no "
    "detach, no numpy, no torch.no_grad.",
    "std[:, :, None, None] * (h - mu) / sigma + mean[:, :, None, None]",
    "(std[:, :, None, None] * (h - mu) / sigma + mean[:, :, None, None]).detach()",
)
adain.mistake(
    "The values are right, but mu and sigma are functions of h, too: leave their gradient in.",
    "h.mean((2, 3), keepdim=True)",
    "h.mean((2, 3), keepdim=True).detach()",
    "+ 1e-5).sqrt()",
    "+ 1e-5).sqrt().detach()",
)
adain.mistake(
    "You normalise over the whole batch: each image has a style of its own, so average over H and "
    "W only.",
    "(2, 3)",
    "(0, 2, 3)",
)
adain.mistake(
    "You normalise over the channels: each channel keeps statistics of its own.",
    "(2, 3)",
    "(1, 2, 3)",
)
adain.mistake("Divide by the standard deviation, the root of the variance.", ".sqrt()", "")
adain.mistake(
    "mean is added, std multiplies: yours are swapped.",
    "std[:, :, None, None] * (h - mu) / sigma + mean[:, :, None, None]",
    "mean[:, :, None, None] * (h - mu) / sigma + std[:, :, None, None]",
)
adain.mistake("First take out the features' own mean.", "(h - mu)", "h")
adain.mistake(
    "Your variance is divided by n - 1, as torch does by default; `unbiased=False` divides by H * "
    "W.",
    "unbiased=False, ",
    "",
)
adain.mistake(
    "The variance is the mean of (h - mu)^2; yours is the mean of h^2, without mu.",
    "h.var((2, 3), unbiased=False, keepdim=True)",
    "(h**2).mean((2, 3), keepdim=True)",
)
adain.mistake(
    "1e-5 is added to the variance, before the root; yours is added to the root.",
    "(h.var((2, 3), unbiased=False, keepdim=True) + 1e-5).sqrt()",
    "h.var((2, 3), unbiased=False, keepdim=True).sqrt() + 1e-5",
)
adain.mistake(
    "torch's std divides by n - 1, and 1e-5 is added to the variance, before the root: take the "
    "variance with `unbiased=False`, add, and take the root.",
    "(h.var((2, 3), unbiased=False, keepdim=True) + 1e-5).sqrt()",
    "h.std((2, 3), keepdim=True) + 1e-5",
)
adain.mistake(
    "squeeze() drops every axis of length 1, that of one image or one channel, too: leave it out.",
    "h.mean((2, 3), keepdim=True)",
    "h.mean((2, 3)).squeeze()[..., None, None]",
)
adain.mistake("Add 1e-5 to the variance; yours is without.", " + 1e-5", "")
adain.mistake(
    "Each image has a look of its own: you give all of the batch that of the first.",
    "std[:, :, None, None]",
    "std[:1, :, None, None]",
    "mean[:, :, None, None]",
    "mean[:1, :, None, None]",
)
adain.mistake(
    "The statistics go over height and width; yours go along the rows alone.",
    "(2, 3)",
    "3",
)


@exercise(
    "4.2",
    "The game of Eq. 1, in squares",
    probe=gradients("gan_losses", several=True, real=0, made=1),
)
def gan_losses(real, made):
    return ((real - 1) ** 2).mean() + (made**2).mean(), ((made - 1) ** 2).mean()


def _scores(rng, ask="values", most=4):
    """Scores of any shape; real ones and made ones differ in number."""
    real, made = rng.choice(np.arange(2, 9), 2, replace=False)
    more = rng.integers(1, 6, int(rng.integers(0, most)))
    return _tensor(rng, real, *more), _tensor(rng, made, *more), ask


gan_losses.check(
    "scores anywhere",
    _scores,
    least=lambda rng: (_tensor(rng, 1, 1, 1, 1), _tensor(rng, 1, 1, 1, 1), "values"),
)
gan_losses.check(
    "a critic that is always right, with more made frames than real ones",
    lambda rng: ((s := _scores(rng))[0] * 0 + 1, torch.cat([s[1], s[0]]) * 0, s[2]),
)
gan_losses.check("the gradient reaches the scores", lambda rng: _scores(rng, "gradient"), atol=1e-6)
gan_losses.mistake(
    "The values are right, but no gradient leaves your function, and neither network would learn: "
    "no detach, no item, no numpy, no torch.no_grad.",
    "return ((real - 1) ** 2).mean() + (made**2).mean(), ((made - 1) ** 2).mean()",
    "real, made = real.detach(), made.detach()\n"
    "    return ((real - 1) ** 2).mean() + (made**2).mean(), ((made - 1) ** 2).mean()",
)
gan_losses.mistake(
    "The values are right, but the critic's loss does not reach its scores of the made frames: "
    "whoever calls you detaches the frames, you do not detach the scores.",
    "(made**2)",
    "(made.detach() ** 2)",
)
gan_losses.mistake(
    "Means, not sums: the losses do not grow with the number of scores.",
    "((real - 1) ** 2).mean() + (made**2).mean(), ((made - 1) ** 2).mean()",
    "((real - 1) ** 2).sum() + (made**2).sum(), ((made - 1) ** 2).sum()",
)
gan_losses.mistake(
    "Square each score's error, then take the mean; you square the mean.",
    "((real - 1) ** 2).mean() + (made**2).mean(), ((made - 1) ** 2).mean()",
    "(real.mean() - 1) ** 2 + made.mean() ** 2, (made.mean() - 1) ** 2",
)
gan_losses.mistake(
    "The errors are squared; you take their absolute values.",
    "((real - 1) ** 2).mean() + (made**2).mean(), ((made - 1) ** 2).mean()",
    "(real - 1).abs().mean() + made.abs().mean(), (made - 1).abs().mean()",
)
gan_losses.mistake(
    "That is Eq. 1 with its logarithms, of the scores' sigmoids; the kit plays it in squares.",
    "((real - 1) ** 2).mean() + (made**2).mean(), ((made - 1) ** 2).mean()",
    "F.softplus(-real).mean() + F.softplus(made).mean(), F.softplus(-made).mean()",
)
gan_losses.mistake(
    "That is Eq. 1 as it stands, with logarithms, and the critic's share with its sign turned; the "
    "kit plays the game in squares.",
    "((real - 1) ** 2).mean() + (made**2).mean(), ((made - 1) ** 2).mean()",
    "F.softplus(-real).mean() + F.softplus(made).mean(), -F.softplus(made).mean()",
)
gan_losses.mistake(
    "That is the hinge loss; here errors are squared, and the targets are 1 and 0.",
    "((real - 1) ** 2).mean() + (made**2).mean(), ((made - 1) ** 2).mean()",
    "F.relu(1 - real).mean() + F.relu(1 + made).mean(), -made.mean()",
)
gan_losses.mistake(
    "That is Wasserstein's game, in means; here errors are squared, and the targets are 1 and 0.",
    "((real - 1) ** 2).mean() + (made**2).mean(), ((made - 1) ** 2).mean()",
    "made.mean() - real.mean(), -made.mean()",
)
gan_losses.mistake(
    "The targets are 1 for real and 0 for made; yours are 1 and -1.",
    "(made**2).mean()",
    "((made + 1) ** 2).mean()",
)
gan_losses.mistake(
    "The critic's targets are swapped: real frames go to 1, made ones to 0.",
    "((real - 1) ** 2).mean() + (made**2).mean()",
    "(real**2).mean() + ((made - 1) ** 2).mean()",
)
gan_losses.mistake(
    "The generator wants its frames to be taken for real: it pulls their score to 1.",
    ", ((made - 1) ** 2).mean()",
    ", (made**2).mean()",
)
gan_losses.mistake(
    "Return the critic's loss first, then the generator's.",
    "return ((real - 1) ** 2).mean() + (made**2).mean(), ((made - 1) ** 2).mean()",
    "return ((made - 1) ** 2).mean(), ((real - 1) ** 2).mean() + (made**2).mean()",
)
gan_losses.mistake(
    "The targets are swapped in both losses: real is 1 and made is 0 to the critic, and the "
    "generator pulls to 1.",
    "((real - 1) ** 2).mean() + (made**2).mean(), ((made - 1) ** 2).mean()",
    "(real**2).mean() + ((made - 1) ** 2).mean(), (made**2).mean()",
)
gan_losses.mistake(
    "In Eq. 1 the generator minimises what the critic maximises; in squares it has a target of its "
    "own: it pulls the made scores to 1.",
    ", ((made - 1) ** 2).mean()",
    ", -((real - 1) ** 2).mean() - (made**2).mean()",
)
gan_losses.mistake(
    "In Eq. 1 the generator minimises what the critic maximises; in squares it has a target of its "
    "own: it pulls the made scores to 1.",
    ", ((made - 1) ** 2).mean()",
    ", -(made**2).mean()",
)
gan_losses.mistake(
    "The critic has to judge both kinds; yours never sees a real frame.",
    "((real - 1) ** 2).mean() + ",
    "",
)
gan_losses.mistake(
    "There may be more made scores than real ones: take the mean of each kind by itself, then add.",
    "((real - 1) ** 2).mean() + (made**2).mean()",
    "((real - 1) ** 2 + made**2).mean()",
)
gan_losses.mistake(
    "Least squares are often written with a factor 1/2; here there is none.",
    "return ((real - 1) ** 2).mean() + (made**2).mean(), ((made - 1) ** 2).mean()",
    "return (((real - 1) ** 2).mean() + (made**2).mean()) / 2, ((made - 1) ** 2).mean() / 2",
)
gan_losses.mistake(
    "The critic's two means are added; you take half of them.",
    "((real - 1) ** 2).mean() + (made**2).mean()",
    "(((real - 1) ** 2).mean() + (made**2).mean()) / 2",
)
gan_losses.mistake(
    "A mean for the real ones and a mean for the made ones, added: yours is one mean of all "
    "together.",
    "((real - 1) ** 2).mean() + (made**2).mean()",
    "torch.cat([((real - 1) ** 2).flatten(), (made**2).flatten()]).mean()",
)


@exercise(
    "4.3",
    "Three reconstructions (Eq. 2-4)",
    probe="""
    def probe(x, y, w, ask):
        # Encoders and generators of one weight each, (6,).
        w = w.clone().requires_grad_()
        content = {"x": lambda v: w[0] * v + 0.1, "y": lambda v: w[1] * v - 0.2}
        style = {"x": lambda v: w[2] * v.mean((2, 3)), "y": lambda v: w[3] * v.mean((2, 3)) - 0.4}
        g = w[4:]
        decode = {
            "x": lambda c, s: c + g[0] * s[:, :, None, None],
            "y": lambda c, s: g[1] * c - s[:, :, None, None],
        }
        losses = reconstructions(x, y, content, style, decode)
        try:
            losses = tuple(losses)
        except TypeError:
            return losses
        if ask == "losses" or len(losses) != 3:
            return losses
        found = {}
        for name, loss in zip(("image", "content", "style"), losses, strict=True):
            grad, more = None, {"retain_graph": True, "allow_unused": True}
            if torch.is_tensor(loss) and loss.requires_grad:
                (grad,) = torch.autograd.grad(loss.sum(), w, **more)
            grad = torch.zeros_like(w) if grad is None else grad
            found[f"the gradient of the {name} loss for encoders and generators"] = grad
        return found
    """,
)
def reconstructions(x, y, content, style, decode):
    c_x, s_x = content["x"](x), style["x"](x)
    c_y, s_y = content["y"](y), style["y"](y)
    image = (decode["x"](c_x, s_x) - x).abs().mean()
    code = (content["y"](decode["y"](c_x, s_y)) - c_x).abs().mean()
    look = (style["x"](decode["x"](c_y, s_x)) - s_x).abs().mean()
    return image, code, look


def _both(rng, ask="losses"):
    shape = 1 + int(rng.integers(4)), 3, *(int(n) for n in rng.integers(4, 10, 2))
    weights = torch.from_numpy(np.float32(rng.uniform(0.4, 2, 6)))
    return _tensor(rng, *shape), _tensor(rng, *shape) + 1, weights, ask


reconstructions.check("two batches of images", _both, points=2)
reconstructions.check(
    "one image of each domain", lambda rng: ((b := _both(rng))[0][:1], b[1][:1], *b[2:])
)
reconstructions.check(
    "the gradient reaches encoders and generators", lambda rng: _both(rng, "gradient")
)
reconstructions.mistake(
    "The values are right, but the codes that you compare with are the encoders' work, too: no "
    "detach there.",
    " - c_x)",
    " - c_x.detach())",
    " - s_x)",
    " - s_x.detach())",
)
reconstructions.mistake(
    "c_y is made by y's encoder, content[\"y\"]; you use x's.", 'content["y"](y)', 'content["x"](y)'
)
reconstructions.mistake(
    "Eq. 4 paints an x: with x's generator, though the content is y's.",
    'decode["x"](c_y, s_x)',
    'decode["y"](c_y, s_x)',
)
reconstructions.mistake(
    "Eq. 3 swaps the styles: x's content is painted in y with y's style, s_y.",
    'decode["y"](c_x, s_y)',
    'decode["y"](c_x, s_x)',
)
reconstructions.mistake(
    "The values are right, but no gradient leaves your function, and no network would learn: no "
    "detach, no item, no float, no torch.no_grad.",
    "return image, code, look",
    "return image.detach(), code.detach(), look.detach()",
)
reconstructions.mistake(
    "Return Eq. 2, 3 and 4 in this order: image, content, style.",
    "return image, code, look",
    "return image, look, code",
)
reconstructions.mistake("Means of absolute differences, not sums.", ".abs().mean()", ".abs().sum()")
reconstructions.mistake(
    "The norms here are means of absolute differences, not lengths of vectors.",
    ".abs().mean()",
    ".norm()",
)
reconstructions.mistake(
    "Take absolute values before the mean: differences of opposite sign would cancel.",
    ".abs().mean()",
    ".mean().abs()",
)
reconstructions.mistake(
    "Asked for are the losses of domain x; yours are those of y.",
    "(x, y, content, style, decode):",
    "(y, x, content, style, decode):\n"
    "    content, style, decode = (\n"
    '        {"x": d["y"], "y": d["x"]} for d in (content, style, decode)\n'
    "    )",
)
reconstructions.mistake(
    "Eq. 3 compares what was read back with c_x, the content that went in; yours compares it with "
    "y's.",
    'decode["y"](c_x, s_y)) - c_x',
    'decode["y"](c_x, s_y)) - c_y',
)
reconstructions.mistake(
    "That is Eq. 3 of domain y: for x it is c_x that goes into G_Y with s_y and is read back.",
    'content["y"](decode["y"](c_x, s_y)) - c_x',
    'content["x"](decode["x"](c_y, s_x)) - c_y',
)
reconstructions.mistake(
    "Eq. 4: what G_X has made is an x, so its style is read by x's encoder.",
    'style["x"](decode["x"](c_y, s_x))',
    'style["y"](decode["x"](c_y, s_x))',
)
reconstructions.mistake(
    "Eq. 4 compares the style that was read back with s_x; yours compares it with y's.",
    '(decode["x"](c_y, s_x)) - s_x',
    '(decode["x"](c_y, s_x)) - s_y',
)
reconstructions.mistake(
    "Eq. 3 decodes with the other domain's generator: c_x goes into G_Y with s_y, and comes back "
    "by E_Y.",
    'content["y"](decode["y"](c_x, s_y))',
    'content["x"](decode["x"](c_x, s_x))',
)
reconstructions.mistake(
    "Eq. 3: what G_Y has made is a y, so its content is read by y's encoder.",
    'content["y"](decode["y"](c_x, s_y))',
    'content["x"](decode["y"](c_x, s_y))',
)
reconstructions.mistake(
    "Eq. 4 decodes the other domain's content: G_X(c_y, s_x). With c_x nothing is swapped.",
    'style["x"](decode["x"](c_y, s_x))',
    'style["x"](decode["x"](c_x, s_x))',
)
reconstructions.mistake(
    "Yours is the style loss of y. Eq. 4 swaps the other way than Eq. 3, G_X(c_y, s_x), and reads "
    "back s_x.",
    'style["x"](decode["x"](c_y, s_x)) - s_x',
    'style["y"](decode["y"](c_x, s_y)) - s_y',
)
reconstructions.mistake(
    "Eq. 4: the picture with style s_x is G_X(c_y, s_x); G_Y(c_x, s_y) of Eq. 3 has the style s_y.",
    'style["x"](decode["x"](c_y, s_x))',
    'style["x"](decode["y"](c_x, s_y))',
)
reconstructions.mistake(
    "The norms here are means of absolute differences, not of squares.", ".abs()", ".square()"
)
reconstructions.mistake(
    "Eq. 2 decodes what was read from x, content and style: G_X(c_x, s_x); yours has y's style.",
    '(decode["x"](c_x, s_x) - x)',
    '(decode["x"](c_x, s_y) - x)',
)
reconstructions.mistake(
    "Eq. 2 compares an image with itself: G_X(c_x, s_x) with x.",
    '(decode["x"](c_x, s_x) - x)',
    '(decode["x"](c_y, s_x) - y)',
)


@exercise(
    "4.4",
    "All of it (Eq. 5)",
    probe="""
    def probe(L, lam_image, lam_content, lam_style, ask):
        if ask == "value":
            return munit_loss(L, lam_image, lam_content, lam_style)
        L = {name: loss.clone().requires_grad_() for name, loss in L.items()}
        out = munit_loss(L, lam_image, lam_content, lam_style)
        grads = [None] * len(L)
        if torch.is_tensor(out) and out.requires_grad:
            grads = torch.autograd.grad(out.sum(), [*L.values()], allow_unused=True)
        none = torch.zeros((), dtype=torch.float64)
        return {f"the gradient for {k}": none if g is None else g for k, g in zip(L, grads)}
    """,
)
def munit_loss(L, lam_image, lam_content, lam_style):
    return (
        L["gan_x"] + L["gan_y"]
        + lam_image * (L["image_x"] + L["image_y"])
        + lam_content * (L["content_x"] + L["content_y"])
        + lam_style * (L["style_x"] + L["style_y"])
    )  # fmt: skip


def _losses(rng, ask="value"):
    names = [f"{kind}_{domain}" for kind in ("gan", "image", "content", "style") for domain in "xy"]
    return (
        {str(n): torch.tensor(rng.uniform(0.1, 2)) for n in rng.permutation(names)},
        *(float(rng.uniform(0.2, 10)) for _ in range(3)),
        ask,
    )


munit_loss.check("any losses, any weights", _losses)
munit_loss.mistake(
    "A dictionary is asked by its keys: yours relies on the order in which it was filled.",
    'L["gan_x"] + L["gan_y"]\n'
    '        + lam_image * (L["image_x"] + L["image_y"])\n'
    '        + lam_content * (L["content_x"] + L["content_y"])\n'
    '        + lam_style * (L["style_x"] + L["style_y"])',
    "sum(w * v for w, v in zip((1, 1, lam_image, lam_image, lam_content, lam_content, "
    "lam_style, lam_style), L.values()))",
)
munit_loss.mistake(
    "y's losses are part of it: you take x's style loss twice.", 'L["style_y"]', 'L["style_x"]'
)
munit_loss.check(
    "with all weights 0 the game is left", lambda rng: (_losses(rng)[0], 0.0, 0.0, 0.0, "value")
)
munit_loss.check("its gradient reaches every loss", lambda rng: _losses(rng, "gradient"))
munit_loss.mistake(
    "The value is right, but no gradient leaves your function, and nothing would be trained: no "
    "float, no item, no detach.",
    "return (",
    "L = {name: loss.detach() for name, loss in L.items()}\n    return (",
)
munit_loss.mistake("y plays, too: your sum has no gan_y.", ' + L["gan_y"]', "")
munit_loss.mistake("x plays, too: your sum has no gan_x.", 'L["gan_x"] + ', "")
munit_loss.mistake(
    "Losses add up; you average the two domains, the game's, too.",
    "    return (",
    "    L = {name: loss / 2 for name, loss in L.items()}\n    return (",
)
munit_loss.mistake(
    "Losses add up; you average the two domains.",
    '(L["image_x"] + L["image_y"])',
    '(L["image_x"] + L["image_y"]) / 2',
    '(L["content_x"] + L["content_y"])',
    '(L["content_x"] + L["content_y"]) / 2',
    '(L["style_x"] + L["style_y"])',
    '(L["style_x"] + L["style_y"]) / 2',
)
munit_loss.mistake(
    "Both domains play: you add the losses of one.",
    '(L["content_x"] + L["content_y"])',
    'L["content_x"]',
    '(L["style_x"] + L["style_y"])',
    'L["style_x"]',
    '(L["image_x"] + L["image_y"])',
    'L["image_x"]',
)
munit_loss.mistake(
    "A lambda weighs both domains: mind the brackets, yours weighs x alone.",
    '(L["image_x"] + L["image_y"])',
    'L["image_x"] + L["image_y"]',
    '(L["content_x"] + L["content_y"])',
    'L["content_x"] + L["content_y"]',
    '(L["style_x"] + L["style_y"])',
    'L["style_x"] + L["style_y"]',
)
munit_loss.mistake(
    "lam_image weighs both domains: mind the brackets, yours weighs x alone.",
    '(L["image_x"] + L["image_y"])',
    'L["image_x"] + L["image_y"]',
)
munit_loss.mistake(
    "You leave out domain y as a whole, its part of the game, too.",
    ' + L["gan_y"]',
    "",
    ' + L["image_y"]',
    "",
    ' + L["content_y"]',
    "",
    ' + L["style_y"]',
    "",
)
munit_loss.mistake(
    "In Eq. 5 the game's losses have no weight: you leave them out.", 'L["gan_x"] + L["gan_y"]', "0"
)
munit_loss.mistake(
    "lam_content weighs the content codes, lam_style the style codes; yours are swapped.",
    "lam_content, lam_style):",
    "lam_style, lam_content):",
)
munit_loss.mistake(
    "lam_image weighs the images, lam_content the content codes; yours are swapped.",
    "lam_image, lam_content,",
    "lam_content, lam_image,",
)
munit_loss.mistake(
    "lam_image weighs the images, lam_style the style codes; yours are swapped.",
    "(L, lam_image, lam_content, lam_style):",
    "(L, lam_style, lam_content, lam_image):",
)
munit_loss.mistake(
    "In Eq. 5 the game has no weight: you multiply it by lam_image.",
    'L["gan_x"] + L["gan_y"]\n        + lam_image * (L',
    'lam_image * (L["gan_x"] + L["gan_y"]\n        + L',
)
munit_loss.mistake(
    "Each kind of reconstruction has its weight; you use none.",
    "lam_style * ",
    "",
    "lam_content * ",
    "",
    "lam_image * ",
    "",
)
munit_loss.mistake(
    "Losses add up; you average the two domains.",
    '(L["image_x"] + L["image_y"])',
    '(L["image_x"] + L["image_y"]) / 2',
)
