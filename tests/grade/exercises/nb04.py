"""Notebook 4, MUNIT: content, style, and the losses of Eq. 1-5."""

import numpy as np
import torch

from tests.grade.exercise import exercise


def _tensor(rng, *shape):
    return torch.from_numpy(np.float32(rng.normal(size=shape)))


@exercise("4.1", "Adaptive instance normalisation")
def adain(h, mean, std):
    mu = h.mean((2, 3), keepdim=True)
    sigma = (h.var((2, 3), unbiased=False, keepdim=True) + 1e-5).sqrt()
    return std[:, :, None, None] * (h - mu) / sigma + mean[:, :, None, None]


def _features(rng, B=3, C=4):
    h = 3 * _tensor(rng, B, C, 6, 7) + 5 * _tensor(rng, B, C, 1, 1)
    return h, _tensor(rng, B, C), _tensor(rng, B, C).abs() + 0.2


adain.check("features anywhere", _features, points=2, atol=1e-4, rtol=1e-3)
adain.check(
    "with mean 0 and std 1 only the style is gone",
    lambda rng: (_features(rng)[0], torch.zeros(3, 4), torch.ones(3, 4)),
    atol=1e-4,
    rtol=1e-3,
)
adain.check(
    "channels that hardly vary: 1e-5 is added to the variance",
    lambda rng: ((f := _features(rng))[0] * 1e-3, f[1], f[2]),
    atol=1e-4,
    rtol=1e-3,
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
adain.mistake("Add 1e-5 to the variance; yours is without.", " + 1e-5", "")


@exercise("4.2", "The game of Eq. 1, in squares")
def gan_losses(real, made):
    return ((real - 1) ** 2).mean() + (made**2).mean(), ((made - 1) ** 2).mean()


def _scores(rng):
    return _tensor(rng, 4, 1, 5, 5), _tensor(rng, 4, 1, 5, 5)


gan_losses.check("scores anywhere", _scores, points=2)
gan_losses.check(
    "a critic that is always right, with more made frames than real ones",
    lambda rng: (torch.ones(2, 1, 3, 3), torch.zeros(5, 1, 3, 3)),
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


@exercise(
    "4.3",
    "Three reconstructions (Eq. 2-4)",
    probe="""
    def probe(x, y):
        # Encoders and generators with recognisable constants, one for each domain.
        content = {"x": lambda v: 0.5 * v + 0.1, "y": lambda v: 0.7 * v - 0.2}
        style = {"x": lambda v: v.mean((2, 3)) + 0.3, "y": lambda v: 2 * v.mean((2, 3)) - 0.4}
        decode = {
            "x": lambda c, s: c + 1.5 * s[:, :, None, None],
            "y": lambda c, s: 0.8 * c - s[:, :, None, None],
        }
        return tuple(float(v) for v in reconstructions(x, y, content, style, decode))
    """,
)
def reconstructions(x, y, content, style, decode):
    c_x, s_x = content["x"](x), style["x"](x)
    c_y, s_y = content["y"](y), style["y"](y)
    image = (decode["x"](c_x, s_x) - x).abs().mean()
    code = (content["y"](decode["y"](c_x, s_y)) - c_x).abs().mean()
    look = (style["x"](decode["x"](c_y, s_x)) - s_x).abs().mean()
    return image, code, look


reconstructions.check(
    "two batches of images",
    lambda rng: (_tensor(rng, 2, 3, 6, 6), _tensor(rng, 2, 3, 6, 6)),
    points=3,
)
reconstructions.check(
    "images of another size", lambda rng: (_tensor(rng, 1, 3, 9, 5), _tensor(rng, 1, 3, 9, 5) + 1)
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
    "Eq. 2 compares an image with itself: G_X(c_x, s_x) with x.",
    '(decode["x"](c_x, s_x) - x)',
    '(decode["x"](c_y, s_x) - y)',
)


@exercise("4.4", "All of it (Eq. 5)")
def munit_loss(L, lam_image, lam_content, lam_style):
    return (
        L["gan_x"] + L["gan_y"]
        + lam_image * (L["image_x"] + L["image_y"])
        + lam_content * (L["content_x"] + L["content_y"])
        + lam_style * (L["style_x"] + L["style_y"])
    )  # fmt: skip


def _losses(rng):
    names = [f"{kind}_{domain}" for kind in ("gan", "image", "content", "style") for domain in "xy"]
    return {n: float(rng.uniform(0.1, 2)) for n in names}, *(
        float(rng.uniform(0.2, 10)) for _ in range(3)
    )


munit_loss.check("any losses, any weights", _losses)
munit_loss.check(
    "with all weights 0 the game is left", lambda rng: (_losses(rng)[0], 0.0, 0.0, 0.0)
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
    "Losses add up; you average the two domains.",
    '(L["image_x"] + L["image_y"])',
    '(L["image_x"] + L["image_y"]) / 2',
)
