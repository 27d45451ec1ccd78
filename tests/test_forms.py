"""Right answers in forms that ours do not have, four to an exercise: none is refused."""

import pytest

from tests.grade.exercise import everything
from tests.grade.judge import judge

ALL = everything()
FORMS = {
    "0.1": [
        "success_rate = lambda d, t: sum(x < t for x in d) / len(d)",
        "def success_rate(distances, threshold):\n    n = 0\n    for d in distances:\n"
        "        if d < threshold:\n            n = n + 1\n    return n / len(distances)",
        "success_rate = lambda d, t: np.count_nonzero(t > d) / d.size",
        "success_rate = lambda d, t: torch.tensor(d < t).double().mean()",
    ],
    "0.2": [
        "to_pixels = lambda z, size: size * (0.5 + z / 2)",
        "to_pixels = lambda z, size: np.interp(z, [-1, 1], [0, size])",
        "to_pixels = lambda z, size: torch.tensor(z).add(1).mul(size / 2)",
        "to_pixels = lambda z, size: ((z + 1) * size / 2).tolist()",
    ],
    "1.1": [
        "response = lambda t, x0, kp: x0 * (1 + kp**0.5 * t) / np.exp(kp**0.5 * t)",
        "def response(t, x0, kp):\n    w = math.sqrt(kp)\n"
        "    return [x0 * (1 + w * s) * math.exp(-w * s) for s in t]",
        "def response(t, x0, kp):\n    a = np.sqrt(kp) * t\n"
        "    return x0 * np.exp(-a) + x0 * a * np.exp(-a)",
        "response = np.vectorize(lambda t, x0, kp: x0 * (1 + kp**.5 * t) * math.exp(-(kp**.5) * "
        "t))",
    ],
    "1.2": [
        "task_inertia = lambda J, M: np.linalg.inv(np.linalg.multi_dot([J, np.linalg.inv(M), "
        "J.T]))",
        "task_inertia = lambda J, M: np.linalg.pinv(J @ np.linalg.solve(M, J.T))",
        "def task_inertia(J, M):\n    m = np.einsum('ij,jk,lk->il', J, np.linalg.inv(M), J)\n"
        "    return np.linalg.solve(m, np.eye(len(m)))",
        "def task_inertia(J, M):\n    J, M = torch.tensor(J), torch.tensor(M)\n"
        "    return (J @ M.inverse() @ J.mT).inverse()",
    ],
    "1.3": [
        "def osc(J, M, h, e, v, kp):\n    f = task_inertia(J, M).dot(kp * e - 2 * kp**0.5 * v)\n"
        "    return f @ J + h",
        "def osc(J, M, h, e, v, kp):\n    mobility = J @ np.linalg.solve(M, J.T)\n"
        "    return h + J.T @ np.linalg.solve(mobility, kp * e - 2 * np.sqrt(kp) * v)",
        "def osc(J, M, h, e, v, kp):\n    w = math.sqrt(kp)\n"
        "    return h + np.matmul(J.T, task_inertia(J, M) @ (w * (w * e - 2 * v)))",
        "def osc(*args):\n    J, M, h, e, v, kp = args\n    L = task_inertia(J, M)\n"
        "    return (h + J.T @ L @ e * kp - J.T @ L @ v * 2 * kp**0.5).tolist()",
    ],
    "1.4": [
        "def nullspace(J, M):\n    bar = np.linalg.inv(M) @ J.T @ task_inertia(J, M)\n"
        "    return (np.eye(M.shape[0]) - bar @ J).T",
        "def nullspace(J, M):\n    W = np.linalg.inv(M)\n"
        "    return np.identity(len(M)) - J.T @ np.linalg.inv(J @ W @ J.T) @ J @ W",
        "def nullspace(J, M):\n    N = -J.T @ task_inertia(J, M) @ J @ np.linalg.inv(M)\n"
        "    N[np.diag_indices(len(N))] += 1\n    return N",
        "def nullspace(J, M):\n    X = np.linalg.solve(M.T, (J.T @ task_inertia(J, M) @ J).T).T\n"
        "    return np.diag(np.ones(J.shape[1])) - X",
    ],
    "2.1": [
        "def squash(mean, log_std, noise):\n    normal = torch.distributions.Normal(mean, "
        "log_std.exp())\n    u = mean + log_std.exp() * noise\n"
        "    slope = 2 * (math.log(2) - u - F.softplus(-2 * u))\n"
        "    return [u.tanh(), (normal.log_prob(u) - slope).sum(dim=1)]",
        "def squash(mean, log_std, noise):\n    D = torch.distributions\n"
        "    t = D.transforms.TanhTransform()\n    u = mean + log_std.exp() * noise\n"
        "    p = D.Normal(mean, log_std.exp()).log_prob(u)\n"
        "    return t(u), (p - t.log_abs_det_jacobian(u, t(u))).sum(-1)",
        "def squash(mean, log_std, noise):\n    u = torch.addcmul(mean, log_std.exp(), noise)\n"
        "    slope = math.log(4) - 2 * u.abs() - 2 * torch.log1p(torch.exp(-2 * u.abs()))\n"
        "    p = -(noise.square() + math.log(2 * math.pi)) / 2 - log_std\n"
        "    return u.tanh(), torch.einsum('ba->b', p - slope)",
        "def squash(mean, log_std, noise):\n    std = torch.exp(log_std)\n    u = mean + std * "
        "noise\n"
        "    a, A = torch.tanh(u), mean.shape[1]\n"
        "    p = (-0.5 * noise.pow(2) - std.log()).sum(1) - A / 2 * np.log(2 * np.pi)\n"
        "    return a, p - (2 * (np.log(2) - u - F.softplus(-2 * u))).sum(1)",
    ],
    "2.2": [
        "def critic_target(r, end, cut, q1, q2, log_pi, alpha, gamma):\n"
        "    v = torch.stack([q1, q2]).amin(0).sub(log_pi, alpha=alpha)\n"
        "    return r + gamma * torch.where(end > 0, torch.zeros_like(v), v)",
        "def critic_target(r, end, cut, q1, q2, log_pi, alpha, gamma):\n"
        "    return (1 - end) * gamma * (torch.min(q1, q2) - alpha * log_pi) + r",
        "def critic_target(r, end, cut, q1, q2, log_pi, alpha, gamma):\n"
        "    y = r.clone()\n    go = end == 0\n    v = torch.where(q1 < q2, q1, q2) - alpha * "
        "log_pi\n"
        "    y[go] += gamma * v[go]\n    return y",
        "def critic_target(r, end, cut, q1, q2, log_pi, alpha, gamma):\n"
        "    r, end, q1, q2, log_pi = (x.numpy() for x in (r, end, q1, q2, log_pi))\n"
        "    return torch.from_numpy(r + gamma * (1 - end) * (np.minimum(q1, q2) - alpha * "
        "log_pi))",
    ],
    "2.3": [
        "@torch.no_grad()\ndef follow(target, online, tau):\n"
        "    for a, b in zip(target.parameters(), online.parameters()):\n        a.lerp_(b, tau)",
        "def follow(target, online, tau):\n"
        "    for a, b in zip(target.parameters(), online.parameters()):\n"
        "        a.data.mul_(1 - tau).add_(b.data, alpha=tau)",
        "def follow(target, online, tau):\n    new = online.state_dict()\n    "
        "target.load_state_dict(\n"
        "        {k: (1 - tau) * v + tau * new[k] for k, v in target.state_dict().items()})",
        "def follow(target, online, tau):\n    pairs = list(zip(target.parameters(), "
        "online.parameters()))\n    for a, b in pairs:\n"
        "        a.data = a.data + tau * (b.detach() - a.data)",
    ],
    "2.4": [
        "temperature_loss = lambda l, p, h: (-l.exp() * (p.detach() + h)).mean()",
        "def temperature_loss(l, p, h):\n    with torch.no_grad():\n        gap = -p.mean() - h\n"
        "    return torch.exp(l) * gap",
        "temperature_loss = lambda l, p, h: -l.exp() * (p + h).detach().sum() / p.numel()",
        "def temperature_loss(l, p, h):\n    p = p.data\n"
        "    return torch.stack([-l.exp() * x - l.exp() * h for x in p]).mean().reshape(1)",
    ],
    "2.5": [
        "def actor_loss(actor, critics, s, noise, log_alpha):\n"
        "    a, p = squash(*actor(s), noise)\n"
        "    return log_alpha.exp().item() * p.mean() - critics(s, a).min(0).values.mean()",
        "def actor_loss(actor, critics, s, noise, log_alpha):\n    m, l = actor(s)\n"
        "    a, p = squash(m, l, noise)\n    q = critics(s, a)\n    with torch.no_grad():\n"
        "        alpha = log_alpha.exp()\n"
        "    return -(torch.minimum(q[0], q[1]) - alpha * p).sum() / len(s)",
        "def actor_loss(actor, critics, s, noise, log_alpha):\n    m, l = actor(s)\n"
        "    u = m + l.exp() * noise\n    p = torch.distributions.Normal(m, l.exp()).log_prob(u)\n"
        "    p = (p - 2 * (math.log(2) - u - F.softplus(-2 * u))).sum(1)\n"
        "    q = torch.min(*critics(s, u.tanh()))\n"
        "    return torch.mean(math.exp(log_alpha) * p - q)",
        "def actor_loss(actor, critics, s, noise, log_alpha):\n"
        "    a, p = squash(*actor(s), noise)\n    alpha = torch.exp(log_alpha.data)\n"
        "    return torch.einsum('b->', alpha * p - critics(s, a).amin(dim=0)) / s.shape[0]",
    ],
    "3.1": [
        "def minimum_jerk(t, duration, start, end):\n    s = np.minimum(t / duration, 1)\n"
        "    w = 10 * s**3 - 15 * s**4 + 6 * s**5\n    return np.outer(w, end) + np.outer(1 - w, "
        "start)",
        "def minimum_jerk(t, duration, start, end):\n    out = []\n    for x in t:\n"
        "        s = min(max(x / duration, 0), 1)\n"
        "        out.append(start + (end - start) * s**3 * (10 + s * (6 * s - 15)))\n    return "
        "out",
        "def minimum_jerk(t, duration, start, end):\n"
        "    w = np.polyval([6, -15, 10, 0, 0, 0], np.clip(t / duration, 0, 1))\n"
        "    return start[None] + w.reshape(-1, 1) * (end - start)[None]",
        "def minimum_jerk(t, duration, start, end):\n    s = np.where(t < duration, t / "
        "duration, 1.0)\n"
        "    return (start + np.multiply.outer(s**3 * (10 - 15 * s + 6 * s * s), end - "
        "start)).tolist()",
    ],
    "3.3": [
        "def moving_share(x, take, least):\n    n = k = 0\n    for i in range(1, len(x)):\n"
        "        if i % take:\n            n += 1\n            k += abs(x[i] - x[i - 1]) > least\n"
        "    return k / n",
        "def moving_share(x, take, least):\n    d = np.abs(np.diff(x))\n"
        "    return (np.delete(d, np.arange(take - 1, len(d), take)) > least).mean()",
        "def moving_share(x, take, least):\n    parts = np.split(x, len(x) // take)\n"
        "    return np.mean([abs(b - a) > least for p in parts for a, b in zip(p, p[1:])])",
        "def moving_share(x, take, least):\n    r = torch.tensor(x).view(-1, take)\n"
        "    return ((r[:, 1:] - r[:, :-1]).abs() > least).double().mean().item()",
    ],
    "3.4": [
        "to_action = lambda w, g, s: np.minimum(1, np.maximum(-1, (w - g) / s))",
        "to_action = lambda w, g, s: [min(1.0, max(-1.0, (a - b) / s)) for a, b in zip(w, g)]",
        "to_action = lambda w, g, s: np.clip(w - g, -s, s) / s",
        "to_action = lambda w, g, s: tuple(torch.tensor((w - g) / s).clamp(-1, 1))",
    ],
    "4.1": [
        "def adain(h, mean, std):\n    B, C, H, W = h.shape\n    flat = h.reshape(1, B * C, H, W)\n"
        "    out = F.batch_norm(flat, None, None, std.reshape(-1), mean.reshape(-1), "
        "training=True)\n"
        "    return out.reshape(h.shape)",
        "def adain(h, mean, std):\n    n = F.instance_norm(h)\n"
        "    return n * std[..., None, None] + mean[..., None, None]",
        "def adain(h, mean, std):\n    v, m = torch.var_mean(h, (2, 3), correction=0, "
        "keepdim=True)\n"
        "    return (h - m) * torch.rsqrt(v + 1e-5) * std.unsqueeze(2).unsqueeze(3) "
        "+ mean.view(*mean.shape, 1, 1)",
        "def adain(h, mean, std):\n    f = h.flatten(2)\n    m = f.mean(2, keepdim=True)\n"
        "    f = (f.double() - m.double())\n"
        "    s = (f.pow(2).mean(2, keepdim=True) + 1e-5).sqrt()\n"
        "    return (std[..., None] * f / s + mean[..., None]).view(h.shape).float()",
    ],
    "4.2": [
        "gan_losses = lambda r, m: (F.mse_loss(r, torch.ones_like(r)) + F.mse_loss(m, "
        "torch.zeros_like(m)), F.mse_loss(m, torch.ones_like(m)))",
        "def gan_losses(real, made):\n    c = (real - 1).pow(2).mean() + made.square().mean()\n"
        "    return [c, (1 - made).pow(2).mean()]",
        "gan_losses = lambda r, m: torch.stack([((1 - r) ** 2).mean() + (m * m).mean(), "
        "((1 - m) ** 2).mean()])",
        "def gan_losses(real, made):\n    n = lambda x: (x * x).sum() / x.numel()\n"
        "    return n(real - 1) + n(made), n(made - 1)",
    ],
    "4.3": [
        "def reconstructions(x, y, content, style, decode):\n    l1 = F.l1_loss\n"
        "    cx, sx, cy, sy = content['x'](x), style['x'](x), content['y'](y), style['y'](y)\n"
        "    return [l1(decode['x'](cx, sx), x), l1(content['y'](decode['y'](cx, sy)), cx),\n"
        "            l1(style['x'](decode['x'](cy, sx)), sx)]",
        "def reconstructions(x, y, content, style, decode):\n"
        "    c, s = {'x': content['x'](x), 'y': content['y'](y)}, {'x': style['x'](x), "
        "'y': style['y'](y)}\n    d = lambda a, b: torch.mean(torch.abs(a - b))\n"
        "    y_hat, x_hat = decode['y'](c['x'], s['y']), decode['x'](c['y'], s['x'])\n"
        "    return d(decode['x'](c['x'], s['x']), x), d(content['y'](y_hat), c['x']), "
        "d(style['x'](x_hat), s['x'])",
        "def reconstructions(x, y, content, style, decode):\n"
        "    (cx, sx), (cy, sy) = ((content[d](v), style[d](v)) for d, v in zip('xy', (x, y)))\n"
        "    out = (decode['x'](cx, sx) - x, content['y'](decode['y'](cx, sy)) - cx,\n"
        "           style['x'](decode['x'](cy, sx)) - sx)\n"
        "    return tuple(o.abs().mean() for o in out)",
        "def reconstructions(x, y, content, style, decode):\n"
        "    E, S, G = content, style, decode\n    m = lambda v: v.abs().sum() / v.numel()\n"
        "    return (m(x - G['x'](E['x'](x), S['x'](x))),\n"
        "            m(E['x'](x) - E['y'](G['y'](E['x'](x), S['y'](y)))),\n"
        "            m(S['x'](x) - S['x'](G['x'](E['y'](y), S['x'](x)))))",
    ],
    "4.4": [
        "def munit_loss(L, i, c, s):\n    w = {'gan': 1, 'image': i, 'content': c, 'style': s}\n"
        "    return sum(w[k.split('_')[0]] * v for k, v in L.items())",
        "munit_loss = lambda L, *w: sum(a * (L[k + '_x'] + L[k + '_y']) for a, k in "
        "zip((1, *w), ('gan', 'image', 'content', 'style')))",
        "def munit_loss(L, lam_image, lam_content, lam_style):\n    total = 0\n    for d in 'xy':\n"
        "        total += L['gan_' + d] + lam_image * L['image_' + d]\n"
        "        total += lam_content * L['content_' + d] + lam_style * L['style_' + d]\n"
        "    return total",
        "def munit_loss(L, i, c, s):\n    v = torch.stack([L[k + d] for d in ('_x', '_y') for k in "
        "('gan', 'image', 'content', 'style')])\n    return v @ v.new_tensor([1, i, c, s] * 2)",
    ],
    "5.1": [
        "def soft_argmax(logits):\n    B, K, h, w = logits.shape\n"
        "    p = F.softmax(logits.reshape(B, K, -1), 2).reshape(B, K, h, w)\n"
        "    x, y = (torch.arange(n) * 2.0 / n + 1 / n - 1 for n in (w, h))\n"
        "    return torch.stack((torch.einsum('bkhw,w->bk', p, x), "
        "torch.einsum('bkhw,h->bk', p, y)), 2)",
        "def soft_argmax(logits):\n    h, w = logits.shape[-2:]\n"
        "    p = logits.double().flatten(2).softmax(2).unflatten(2, (h, w)).float()\n"
        "    y, x = torch.meshgrid(torch.linspace(1 / h - 1, 1 - 1 / h, h), "
        "torch.linspace(1 / w - 1, 1 - 1 / w, w), indexing='ij')\n"
        "    return torch.stack([(p * x).sum((2, 3)), (p * y).sum((2, 3))], dim=-1)",
        "def soft_argmax(logits):\n    h, w = logits.shape[2:]\n"
        "    e = (logits - logits.amax((2, 3), keepdim=True)).exp()\n"
        "    p = e / e.sum((2, 3), keepdim=True)\n"
        "    x = (torch.arange(w) + 0.5) / w * 2 - 1\n    y = (torch.arange(h) + 0.5) / h * 2 - 1\n"
        "    return torch.cat([(p.sum(2) * x).sum(-1, True), (p.sum(3) * y).sum(-1, True)], -1)",
        "def soft_argmax(logits):\n    B, K, h, w = logits.shape\n    p = "
        "logits.flatten(2).softmax(-1)\n"
        "    cells = torch.tensor([[(2 * j + 1) / w - 1, (2 * i + 1) / h - 1] for i in range(h) "
        "for j in range(w)])\n    return p @ cells",
    ],
    "5.2": [
        "def heat_map(z, sigma, size):\n    c = torch.linspace(1 / size - 1, 1 - 1 / size, size)\n"
        "    y, x = torch.meshgrid(c, c, indexing='ij')\n"
        "    d = (x - z[..., :1, None]) ** 2 + (y - z[..., 1:, None]) ** 2\n"
        "    return 1 - torch.prod(1 - torch.exp(-d / sigma**2), 1)[:, None]",
        "def heat_map(z, sigma, size):\n    c = (torch.arange(size) + 0.5) / size * 2 - 1\n"
        "    free = torch.ones(len(z), 1, size, size)\n    for k in range(z.shape[1]):\n"
        "        x, y = z[:, k, 0], z[:, k, 1]\n"
        "        d = (c[None, None, None] - x[:, None, None, None]) ** 2 + "
        "(c[None, None, :, None] - y[:, None, None, None]) ** 2\n"
        "        free = free * (1 - (-d / sigma**2).exp())\n    return 1 - free",
        "def heat_map(z, sigma, size):\n    c = (2 * torch.arange(size) + 1) / size - 1\n"
        "    g = (-(((c - z.unsqueeze(-1)) / sigma) ** 2)).exp()\n"
        "    h = torch.einsum('bki,bkj->bkij', g[:, :, 1], g[:, :, 0])\n"
        "    return torch.unsqueeze(1 - torch.prod(1 - h, 1), 1)",
        "def heat_map(z, sigma, size):\n    c = (2 * torch.arange(size) + 1) / size - 1\n"
        "    maps = []\n    for points in z:\n        H = torch.zeros(size, size)\n"
        "        for x, y in points:\n"
        "            h = torch.exp(-((c[None] - x) ** 2 + (c[:, None] - y) ** 2) / sigma**2)\n"
        "            H = H + h - H * h\n        maps.append(H[None])\n    return torch.stack(maps)",
    ],
    "5.3": [
        "def transport(px, py, hx, hy):\n    return torch.lerp(px * (1 - hx), py, hy) + 0 * px",
        "transport = lambda px, py, hx, hy: (1 - hx - hy + hx * hy) * px + hy * py",
        "def transport(px, py, hx, hy):\n    kept = px.detach() * (1 - hx.detach())\n"
        "    return kept * (1 - hy) + py * hy",
        "def transport(px, py, hx, hy):\n    return torch.addcmul(px.mul(1 - hx).mul(1 - hy), "
        "hy, py)",
    ],
    "5.4": [
        "def loss(y_hat, y, median):\n    m = (y - median).abs().mean(dim=1)[:, None]\n"
        "    return torch.mean((1 + 10 * m) * (y - y_hat).pow(2))",
        "def loss(y_hat, y, median):\n    e = F.mse_loss(y_hat, y, reduction='none')\n"
        "    w = 1 + 10 * F.l1_loss(y, median.expand_as(y), reduction='none').mean(1, True)\n"
        "    return (w * e).sum() / e.numel()",
        "def loss(y_hat, y, median):\n    w = 1 + 10 * (y - median).abs().sum(1) / 3\n"
        "    return ((y_hat - y) ** 2).mean(1).mul(w).mean()",
        "def loss(y_hat, y, median):\n    e = (y_hat - y) ** 2\n"
        "    m = (y - median).abs().mean(1, keepdim=True)\n    return e.mean() + 10 * (m * "
        "e).mean()",
    ],
    "5.5": [
        "def r2(z, truth):\n    n = len(z) // 2\n    A = np.c_[z.reshape(len(z), -1), "
        "np.ones(len(z))]\n"
        "    w = np.linalg.pinv(A[:n]) @ truth[:n]\n    t = truth[n:]\n"
        "    return 1 - np.mean((A[n:] @ w - t) ** 2) / np.var(t)",
        "def r2(z, truth):\n    f, g = np.split(z.reshape(len(z), -1), 2)\n    s, t = "
        "np.split(truth, 2)\n"
        "    w = np.linalg.lstsq(f - f.mean(0), s - s.mean(), rcond=None)[0]\n"
        "    p = (g - f.mean(0)) @ w + s.mean()\n"
        "    return 1 - ((p - t) ** 2).sum() / ((t - t.mean()) ** 2).sum()",
        "def r2(z, truth):\n    X = torch.tensor(z).flatten(1)\n    X = torch.cat([X, "
        "torch.ones(len(X), "
        "1)], 1)\n    t, n = torch.tensor(truth), len(X) // 2\n"
        "    w = torch.linalg.lstsq(X[:n], t[:n, None]).solution[:, 0]\n    h = t[n:]\n"
        "    return 1 - (X[n:] @ w - h).square().sum() / (h - h.mean()).square().sum()",
        "def r2(z, truth):\n    X = np.hstack([np.ones((len(z), 1)), z.reshape(len(z), -1)])\n"
        "    h = len(X) // 2\n    a, b = X[:h], X[h:]\n    w = np.linalg.solve(a.T @ a, a.T @ "
        "truth[:h])\n"
        "    e, d = truth[h:] - b @ w, truth[h:] - np.mean(truth[h:])\n    return 1 - e @ e / (d "
        "@ d)",
    ],
    "6.1": [
        "r1 = lambda z, z_E: -min(np.linalg.norm(f - z) for f in z_E[:-1])",
        "r1 = lambda z, z_E: max(-math.dist(f.ravel(), z.ravel()) for f in z_E[: len(z_E) - 1])",
        "r1 = lambda z, z_E: -np.linalg.norm((z_E - z).reshape(len(z_E), -1), axis=1)[:-1].min()",
        "r1 = lambda z, z_E: -torch.cdist(torch.tensor(z).view(1, -1), torch.tensor(z_E[:-1])"
        ".flatten(1), compute_mode='donot_use_mm_for_euclid_dist').min()",
    ],
    "6.2": [
        "r2 = lambda z, n, z_E: -min(np.linalg.norm((n - z) - (b - a)) for a, b in zip(z_E, "
        "z_E[1:]))",
        "r2 = lambda z, n, z_E: -np.linalg.norm(np.diff(z_E, axis=0) - (n - z), axis=(1, 2)).min()",
        "r2 = lambda z, n, z_E: -np.sqrt(np.min(np.einsum('nkc,nkc->n', *[np.diff(z_E, axis=0) - n "
        "+ z] * 2)))",
        "r2 = lambda z, n, z_E: max(-math.hypot(*(z_E[q + 1] - z_E[q] - n + z).flat) for q in "
        "range(len(z_E) - 1))",
    ],
    "6.3": [
        "episode_return = lambda z, e, a, b: sum(a * r1(z[t], e) + b * r2(z[t], z[t + 1], e) for "
        "t in "
        "range(len(z) - 1))",
        "def episode_return(z, z_E, lam1, lam2):\n    pairs = list(zip(z[:-1], z[1:]))\n"
        "    return lam1 * sum(r1(a, z_E) for a, _ in pairs) + lam2 * sum(r2(a, b, z_E) for a, b "
        "in pairs)",
        "def episode_return(z, z_E, lam1, lam2):\n"
        "    d = np.linalg.norm(z[:-1, None] - z_E[None, :-1], axis=(2, 3)).min(1)\n"
        "    s = np.diff(z, axis=0)[:, None] - np.diff(z_E, axis=0)[None]\n"
        "    return -lam1 * d.sum() - lam2 * np.linalg.norm(s, axis=(2, 3)).min(1).sum()",
        "def episode_return(z, *more):\n    e, a, b = more\n    if len(z) < 2:\n        return "
        "0.0\n"
        "    return a * r1(z[0], e) + b * r2(z[0], z[1], e) + episode_return(z[1:], e, a, b)",
    ],
    "6.4": [
        "def trim(z, least):\n    out = [z[0]]\n    for f in z[1:-1]:\n"
        "        if not np.linalg.norm(f - out[-1]) < least:\n            out.append(f)\n"
        "    return out + [z[-1]]",
        "def trim(z, least):\n    keep = np.zeros(len(z), bool)\n    keep[0] = keep[-1] = True\n"
        "    last = z[0]\n    for i, f in enumerate(z):\n        if 0 < i < len(z) - 1 and "
        "np.sqrt(((f - last) ** 2).sum()) >= least:\n            keep[i], last = True, f\n"
        "    return z[keep]",
        "def trim(z, least):\n    i, kept = 0, [0]\n    while True:\n"
        "        far = [j for j in range(i + 1, len(z) - 1) if np.linalg.norm(z[j] - z[i]) >= "
        "least]\n"
        "        if not far:\n            return np.stack([*z[kept], z[-1]])\n"
        "        i = far[0]\n        kept.append(i)",
        "def trim(z, least):\n    def go(last, rest):\n        if len(rest) == 1:\n"
        "            return [rest[0]]\n        if math.dist(rest[0].flat, last.flat) >= least:\n"
        "            return [rest[0]] + go(rest[0], rest[1:])\n        return go(last, rest[1:])\n"
        "    return np.array([z[0]] + go(z[0], z[1:])).tolist()",
    ],
    "6.5": [
        "timed_r1 = lambda z, z_E, t: -np.linalg.norm(z - (z_E[t + 1] if t + 1 < len(z_E) else "
        "z_E[-1]))",
        "timed_r1 = lambda z, z_E, t: -math.dist(z.ravel(), z_E[np.clip(t + 1, 0, len(z_E) - "
        "1)].flat)",
        "timed_r1 = lambda z, z_E, t: -float(np.sqrt(((z - z_E[: t + 2][-1]) ** 2).sum()))",
        "timed_r1 = lambda z, z_E, t: torch.dist(torch.tensor(z), "
        "torch.tensor(z_E[min(t, len(z_E) - 2) + 1])).neg()",
    ],
    "7.1": [
        "stopping = lambda v, mu: (0.5 * v * v / (9.81 * mu), v / 9.81 / mu)",
        "stopping = lambda v, mu: [v * v / 2 / mu / 9.81, v / mu / 9.81]",
        "def stopping(v, mu):\n    t = v / (mu * 9.81)\n    return np.array([v * t / 2, t])",
        "def stopping(v, mu):\n    a = torch.tensor(mu * 9.81)\n    return v**2 / a / 2, v / a",
    ],
    "7.2": [
        "speeds = lambda d, s, mu: tuple(np.sqrt(19.62 * mu * np.maximum([d - s, d + s], 0)))",
        "def speeds(d, s, mu):\n    f = lambda x: math.sqrt(2 * mu * 9.81 * x) if x > 0 else 0.0\n"
        "    return [f(d - s), f(d + s)]",
        "def speeds(d, s, mu):\n    low = 0 if s > d else (2 * mu * 9.81 * (d - s)) ** 0.5\n"
        "    return low, (2 * mu * 9.81 * (d + s)) ** 0.5",
        "speeds = lambda d, s, mu: np.sqrt(np.clip([d - s, d + s], 0, None) * 2 * mu * 9.81)",
    ],
    "7.3": [
        "friction = lambda x, dt: -np.polyfit(np.arange(len(x)), x, 2)[0] * 2 / dt**2 / 9.81",
        "def friction(x, dt):\n    t = np.arange(len(x)) * dt\n    A = np.stack([t * 0 + 1, t, "
        "-t * t * "
        "9.81 / 2], 1)\n    return np.linalg.lstsq(A, x, rcond=None)[0][2]",
        "def friction(x, dt):\n    t = np.linspace(0, (len(x) - 1) * dt, len(x))\n"
        "    return -2 * np.polynomial.Polynomial.fit(t, x, 2).convert().coef[2] / 9.81",
        "def friction(x, dt):\n    t = dt * np.arange(len(x))\n"
        "    return -np.poly1d(np.polyfit(t, x, 2)).deriv(2)(0) / 9.81",
    ],
    "7.4": [
        "solved = lambda x, target, dt: [bool(abs(b - a) / dt < 0.02 and abs(b - target) < 0.05) "
        "for "
        "a, b in zip(x, x[1:])]",
        "solved = lambda x, target, dt: np.logical_and(abs(x[1:] - x[:-1]) < 0.02 * dt, "
        "abs(x[1:] - target) < 0.05)",
        "def solved(x, target, dt):\n    x = torch.tensor(x)\n"
        "    return (x.diff().abs() / dt < 0.02) & ((x[1:] - target).abs() < 0.05)",
        "solved = lambda x, target, dt: ~((np.abs(np.diff(x) / dt) >= 0.02) | "
        "(np.abs(x - target) >= 0.05)[1:])",
    ],
    "8.1": [
        "highest_push = lambda radius, mu: mu**-1 * radius",
        "highest_push = lambda radius, mu: np.divide(radius, mu)",
        "def highest_push(radius, mu):\n    m, g = 0.3, 9.81\n    return m * g * radius / (mu * "
        "m * g)",
        "highest_push = lambda radius, mu: np.array([radius / mu])",
    ],
    "8.2": [
        "def foreground(video, threshold):\n    v = video.astype(np.float32)\n"
        "    return np.mean(abs(v - np.median(v, 0, keepdims=True)), axis=3) > threshold",
        "def foreground(video, threshold):\n    v = np.int32(video)\n"
        "    return np.abs(v - np.median(v, axis=0)).sum(-1) > 3 * threshold",
        "def foreground(video, threshold):\n    m = np.median(video, 0)\n"
        "    return np.stack([np.abs(f - m).mean(2) > threshold for f in video])",
        "def foreground(video, threshold):\n    m = np.quantile(video, 0.5, axis=0)\n"
        "    return torch.tensor((abs(video - m)).mean(-1) > threshold)",
    ],
    "8.3": [
        "def share_inside(video, mask):\n    d = np.diff(np.int64(video), axis=0) ** 2\n"
        "    return (d * mask[None, :, :, None]).sum() / d.sum()",
        "def share_inside(video, mask):\n    v = video / 255\n    e = ((v[1:] - v[:-1]) ** "
        "2).sum((0, 3))\n"
        "    return e[mask].sum() / (e[mask].sum() + e[~mask].sum())",
        "def share_inside(video, mask):\n    v = torch.tensor(video).double()\n    e = "
        "v.diff(dim=0)"
        ".square()\n    return (e.sum((0, 3)) * torch.tensor(mask)).sum() / e.sum()",
        "def share_inside(video, mask):\n    a = b = 0.0\n    for f, g in zip(video[:-1], "
        "video[1:]):\n"
        "        e = (g.astype(int) - f.astype(int)) ** 2\n        a += e[mask].sum()\n"
        "        b += e.sum()\n    return a / b",
    ],
    "8.4": [
        "disturbance = lambda a, b, size: np.hypot(*(a - b).transpose(2, 0, 1)).mean(axis=0) * "
        "size / 2",
        "disturbance = lambda a, b, size: [size / 2 * np.mean([math.dist(p, q) for p, q in "
        "zip(a[:, k], "
        "b[:, k])]) for k in range(a.shape[1])]",
        "def disturbance(a, b, size):\n    a, b = ((z + 1) / 2 * size for z in (a, b))\n"
        "    return np.sqrt(((a - b) ** 2).sum(2)).sum(0) / len(a)",
        "disturbance = lambda a, b, size: torch.tensor(a - b).norm(dim=-1).mean(0) * (size / 2)",
    ],
    "9.2": [
        "def observe(recent, target, clock):\n    a, b, c = recent\n"
        "    return np.r_[c.ravel(), (c - b).ravel(), (b - a).ravel(), (target - c).ravel(), "
        "clock]",
        "def observe(r, target, clock):\n    return np.append(np.stack([r[2], r[2] - r[1], r[1] "
        "- r[0], "
        "target - r[-1]]), clock)",
        "def observe(r, target, clock):\n    out = []\n    for x in (r[2], r[2] - r[1], r[1] - "
        "r[0], "
        "target - r[2]):\n        out += x.ravel().tolist()\n    return out + [clock]",
        "def observe(r, target, clock):\n    r, t = torch.tensor(r), torch.tensor(target)\n"
        "    d = r.diff(dim=0).flip(0)\n"
        "    return torch.cat([r[2].flatten(), d.flatten(), (t - r[2]).flatten(), "
        "torch.tensor([clock])])",
    ],
    "9.3": [
        "learn_by_watching = lambda demo, robot, translate, detect, make_reward, train: "
        "train(make_reward(detect(translate(demo)), detect(robot)))",
        "def learn_by_watching(demo, robot, translate, detect, make_reward, train):\n"
        "    pace = detect(robot)\n    frames = translate(demo)\n    seen = detect(frames)\n"
        "    policy = train(make_reward(seen, pace))\n    return policy",
        "def learn_by_watching(demo, robot, translate, detect, make_reward, train):\n"
        "    z = [detect(v) for v in (translate(demo), robot)]\n    return train(make_reward(*z))",
        "def learn_by_watching(*a):\n    demo, robot, translate, detect, make_reward, train = a\n"
        "    return train(reward=make_reward(z_robot=detect(robot), z_E=detect(translate(demo))))",
    ],
    "9.4": [
        "def evaluate(play, n):\n    k = 0\n    for seed in range(1_000_000, 1_000_000 + n):\n"
        "        k += True in play(seed)\n    return k",
        "evaluate = lambda play, n: np.sum([np.any(play(10**6 + i)) for i in range(n)])",
        "evaluate = lambda play, n: len([i for i in range(n) if max(play(1000000 + i))])",
        "evaluate = lambda play, n: float(sum(map(any, map(play, range(1000000, 1000000 + n)))))",
    ],
    "10.1": [
        "def wilson(wins, n):\n    z = 1.96\n    m = (wins + z * z / 2) / (n + z * z)\n"
        "    h = z / (n + z * z) * math.sqrt(wins * (n - wins) / n + z * z / 4)\n"
        "    return max(0, m - h), min(1, m + h)",
        "def wilson(wins, n):\n    z2, p = 1.96**2, wins / n\n    r = np.roots([1 + z2 / n, -2 * "
        "p - z2 / "
        "n, p * p]).real\n    return np.clip(sorted(r), 0, 1)",
        "from collections import namedtuple\nI = namedtuple('I', 'low high')\n"
        "def wilson(wins, n):\n    z, p = 1.96, wins / n\n    c = p + z**2 / (2 * n)\n"
        "    h = z * (p * (1 - p) / n + z**2 / 4 / n**2) ** 0.5\n    s = 1 + z**2 / n\n"
        "    return I(max((c - h) / s, 0.0), min((c + h) / s, 1.0))",
        "def wilson(wins, n):\n    z, p = 1.96, wins / n\n    d = 1 + z * z / n\n"
        "    c, h = (p + z * z / 2 / n) / d, z / d * np.sqrt(p * (1 - p) / n + (z / 2 / n) ** 2)\n"
        "    return [float(np.clip(c + s * h, 0, 1)) for s in (-1, 1)]",
    ],
    "10.2": [
        "chance = lambda p, n, k: 1 - sum(math.comb(n, i) * p**i * (1 - p) ** (n - i) for i in "
        "range(k))",
        "def chance(p, n, k):\n    q = np.array([1.0])\n    for _ in range(n):\n"
        "        q = np.convolve(q, [1 - p, p])\n    return q[k:].sum()",
        "def chance(p, n, k):\n    if k <= 0:\n        return 1.0\n    if n < k:\n        return "
        "0.0\n"
        "    return sum(p**k * (1 - p) ** j * math.comb(k - 1 + j, j) for j in range(n - k + 1))",
        "from fractions import Fraction\ndef chance(p, n, k):\n    p = Fraction(p)\n"
        "    return sum(math.comb(n, i) * p**i * (1 - p) ** (n - i) for i in range(k, n + 1))",
    ],
    "10.3": [
        "difference = lambda a, b, i, j: tuple(np.quantile(a[i].mean(1) - b[j].mean(1), [0.025, "
        "0.975]))",
        "difference = lambda a, b, i, j: np.percentile(a[i].mean(1) - b[j].mean(1), (2.5, 97.5))",
        "def difference(a, b, i, j):\n    d = [a[x].mean() - b[y].mean() for x, y in zip(i, j)]\n"
        "    return [np.quantile(d, q) for q in (0.025, 0.975)]",
        "def difference(a, b, i, j):\n    d = torch.tensor(a)[torch.tensor(i)].mean(1) - "
        "torch.tensor(b)[torch.tensor(j)].mean(1)\n"
        "    return torch.quantile(d, torch.tensor([0.025, 0.975], dtype=d.dtype))",
    ],
    "10.4": [
        "def verdict(idle, random, expert):\n    return ('solved by doing nothing' if any(idle) "
        "else\n"
        "            'solved by chance' if sum(random) / len(random) > 0.05 else\n"
        "            'fair' if all(expert) else 'not even the expert solves it')",
        "def verdict(idle, random, expert):\n    rules = [(idle.sum() > 0, 'solved by doing "
        "nothing'),\n"
        "             (random.sum() * 20 > random.size, 'solved by chance'),\n"
        "             (not np.all(expert), 'not even the expert solves it'), (True, 'fair')]\n"
        "    return next(text for true, text in rules if true)",
        "def verdict(idle, random, expert):\n    return np.select([True in idle, np.mean(random) "
        "> 0.05, "
        "False in expert],\n        ['solved by doing nothing', 'solved by chance', "
        "'not even the expert solves it'], 'fair')[()]",
        "from enum import StrEnum\nclass V(StrEnum):\n    A = 'solved by doing nothing'\n"
        "    B = 'solved by chance'\n    C = 'not even the expert solves it'\n    D = 'fair'\n"
        "def verdict(idle, random, expert):\n    if idle.max():\n        return V.A\n"
        "    if random.mean() > 0.05:\n        return V.B\n    return V.D if expert.min() else V.C",
    ],
    "1.5": [
        "class Point(gym.Env):\n    def reset(self, seed=None, options=None):\n"
        "        gym.Env.reset(self, seed=seed)\n        self.steps = 0\n"
        "        self.place = self.np_random.uniform(-1, 1)\n"
        "        return np.float32([self.place]), {}\n    def step(self, a):\n"
        "        self.place += 0.05 * min(1.0, max(-1.0, a[0]))\n        self.steps += 1\n"
        "        done = bool(-0.05 < self.place < 0.05)\n        out = np.float32([self.place])\n"
        "        return out, 1.0 if done else 0.0, False, self.steps >= 50, {'is_success': done}",
        "class Point(gym.Env):\n    t = 0\n    def look(self):\n"
        "        return np.array([self.x]).astype('float32')\n"
        "    def reset(self, *, seed=None, options=None):\n        super().reset(seed=seed)\n"
        "        self.x = float(self.np_random.uniform(-1, 1))\n        self.t = 0\n"
        "        return self.look(), dict()\n    def step(self, action):\n"
        "        self.x = self.x + 0.05 * np.clip(action, -1, 1)[0]\n        self.t += 1\n"
        "        near = np.abs(self.x) < 0.05\n"
        "        return self.look(), near * 1.0, False, not self.t < 50, dict(is_success=near)",
        "class Base(gym.Env):\n    def reset(self, **how):\n        super().reset(seed=how.get("
        "'seed'))\n        self.left, self.x = 50, self.np_random.uniform(-1, 1)\n"
        "        return self.obs, {}\n    @property\n    def obs(self):\n"
        "        return np.full(1, self.x, np.float32)\nclass Point(Base):\n"
        "    def step(self, action):\n        (a,) = np.clip(action, -1, 1)\n"
        "        self.x, self.left = self.x + a / 20, self.left - 1\n"
        "        ok = int(abs(self.x) < 0.05)\n"
        "        return self.obs, float(ok), False, self.left <= 0, {'is_success': bool(ok)}",
        "class Point(gym.Env):\n    def reset(self, *, seed=None, options=None):\n"
        "        np.random.seed(seed)\n        super().reset(seed=seed)\n"
        "        self.path = [2 * self.np_random.random() - 1]\n"
        "        return np.array(self.path, np.float32), {}\n    def step(self, action):\n"
        "        self.path.append(self.path[-1] + 0.05 * np.clip(action[0], -1, 1))\n"
        "        x = self.path[-1]\n        return (np.array([x], dtype=np.float32), "
        "float(abs(x) < 0.05), False, len(self.path) > 50, {'is_success': abs(x) < 0.05})",
    ],
    "11.1": [
        "def cyclegan_loss(x, y, G, Fx, D_x, D_y, lam):\n    u, v = G(x), Fx(y)\n"
        "    one = lambda s: F.mse_loss(s, torch.ones_like(s))\n"
        "    return one(D_y(u)) + one(D_x(v)) + lam * (F.l1_loss(Fx(u), x) + F.l1_loss(G(v), y))",
        "def cyclegan_loss(x, y, to_y, to_x, D_x, D_y, lam):\n"
        "    total = lam * ((x - to_x(to_y(x))).abs().mean() + (y - to_y(to_x(y))).abs().mean())\n"
        "    return total + (1 - D_y(to_y(x))).pow(2).mean() + (1 - D_x(to_x(y))).pow(2).mean()",
        "def cyclegan_loss(x, y, to_y, to_x, D_x, D_y, lam):\n    loss = 0\n"
        "    for a, there, back, D in ((x, to_y, to_x, D_y), (y, to_x, to_y, D_x)):\n"
        "        b = there(a)\n        loss = loss + torch.mean((D(b) - 1) ** 2)\n"
        "        loss = loss + lam * torch.mean(torch.abs(back(b) - a))\n    return loss",
        "def cyclegan_loss(*a):\n    x, y, to_y, to_x, D_x, D_y, lam = a\n"
        "    u, v = to_y(x), to_x(y)\n    m = lambda t: t.sum() / t.numel()\n"
        "    return (m((D_y(u) - 1).square()) + m((D_x(v) - 1).square()) + lam * m((to_x(u) - "
        "x).abs())"
        " + lam * m((to_y(v) - y).abs())).reshape(1)",
    ],
    "11.2": [
        "from collections import deque\ndef swap(pool, made, size, coins, places):\n"
        "    pool, out = deque(pool), []\n    for i, v in enumerate(made.detach()):\n"
        "        if len(pool) < size:\n            pool.append(v)\n            out.append(v)\n"
        "        elif coins[i] >= 0.5:\n            out.append(v)\n        else:\n"
        "            out.append(pool[places[i]])\n            pool[places[i]] = v\n"
        "    return torch.stack(out), pool",
        "def swap(pool, made, size, coins, places):\n    new = [*pool]\n    out = "
        "made.clone().detach()\n"
        "    for i in range(len(made)):\n        image = made[i].detach().clone()\n"
        "        if len(new) < size:\n            new += [image]\n        elif coins[i] < 0.5:\n"
        "            out[i], new[places[i]] = new[places[i]], image\n    return out, new",
        "@torch.no_grad()\ndef swap(pool, made, size, coins, places):\n"
        "    pool, shown = pool.copy(), torch.empty_like(made)\n"
        "    for i, (v, c, p) in enumerate(zip(made.detach(), coins, places)):\n"
        "        shown[i] = v\n        if len(pool) < size:\n            pool.append(v)\n"
        "            continue\n        if c < 0.5:\n            shown[i] = pool[p]\n"
        "            pool[p] = v\n    return shown, tuple(pool)",
        "def swap(pool, made, size, coins, places):\n    state = list(pool)\n"
        "    def one(v, coin, place):\n        if len(state) < size:\n            state.append(v)\n"
        "            return v\n        if not coin < 0.5:\n            return v\n"
        "        old, state[place] = state[place], v\n        return old\n"
        "    got = list(map(one, made.data, coins, places))\n    return torch.stack(got, 0), state",
    ],
    "11.3": [
        "def mixup_loss(classify, goals, others, share, partner):\n"
        "    v = torch.cat((goals, others))\n    l = (torch.arange(len(v)) < len(goals)).float()\n"
        "    s = share[:, None, None, None]\n    c = classify(torch.lerp(v[partner], v, s))\n"
        "    t = share * l + (1 - share) * l[partner]\n"
        "    return (F.softplus(-c) * t + F.softplus(c) * (1 - t)).mean()",
        "def mixup_loss(classify, goals, others, share, partner):\n"
        "    v = torch.vstack([goals, others])\n"
        "    l = torch.tensor([1.0] * len(goals) + [0.0] * len(others))\n"
        "    mix = lambda a: share.reshape(-1, *[1] * (a.ndim - 1)) * (a - a[partner]) + "
        "a[partner]\n"
        "    return nn.BCEWithLogitsLoss()(classify(mix(v)), mix(l))",
        "def mixup_loss(classify, goals, others, share, partner):\n"
        "    v = torch.cat([goals, others])\n    l = torch.zeros(len(v))\n    l[: len(goals)] = 1\n"
        "    s = share.view(len(v), 1, 1, 1)\n    c = classify(v * s + v[partner] * (1 - s))\n"
        "    t = l * share + l[partner] * (1 - share)\n"
        "    return (-t * F.logsigmoid(c) - (1 - t) * F.logsigmoid(-c)).sum() / len(v)",
        "def mixup_loss(classify, goals, others, share, partner):\n"
        "    v = torch.cat([goals, others])\n    l = torch.cat([goals.new_ones(len(goals)), "
        "others.new_zeros(len(others))])\n    mixed = torch.stack([s * v[i] + (1 - s) * v[p] for "
        "i, "
        "(s, p) in enumerate(zip(share, partner))])\n    t = torch.stack([s * l[i] + (1 - s) * "
        "l[p] "
        "for i, (s, p) in enumerate(zip(share, partner))])\n"
        "    c = classify(mixed)\n    return (c.clamp(min=0) - c * t + "
        "(-c.abs()).exp().log1p()).mean()",
    ],
    "11.4": [
        "def sac_ae_losses(encoder, decoder, critic, actor, x, a, y, lam):\n    h = encoder(x)\n"
        "    q = F.mse_loss(critic(h, a), y)\n"
        "    ae = F.mse_loss(decoder(h), x) + lam * h.pow(2).sum(-1).mean()\n"
        "    with torch.no_grad():\n        still = encoder(x)\n"
        "    return [q, ae, -critic(still, actor(still)).mean()]",
        "def sac_ae_losses(encoder, decoder, critic, actor, x, a, y, lam):\n"
        "    q = (y - critic(encoder(x), a)).square().mean()\n    h = encoder(x)\n"
        "    ae = (x - decoder(h)).square().mean() + lam * torch.linalg.norm(h, "
        "dim=1).pow(2).mean()\n"
        "    d = encoder(x).detach()\n    return q, ae, critic(d, actor(d)).neg().mean()",
        "def sac_ae_losses(encoder, decoder, critic, actor, x, a, y, lam):\n    h = encoder(x)\n"
        "    n = len(x)\n    c = ((critic(h, a) - y) ** 2).sum() / n\n"
        "    e = ((decoder(h) - x) ** 2).flatten(1).mean(1).mean() + lam * (h * h).sum() / n\n"
        "    g = h.data\n    return c, e, -(critic(g, actor(g)).sum() / n)",
        "def sac_ae_losses(encoder, decoder, critic, actor, x, a, y, lam):\n    h = encoder(x)\n"
        "    stop = h.clone().detach()\n    pi = actor(stop)\n    losses = {\n"
        "        'q': torch.mean((critic(h, a) - y) ** 2),\n"
        "        'ae': torch.mean((decoder(h) - x) ** 2) + lam * torch.einsum('bl,bl->b', h, "
        "h).mean(),\n"
        "        'pi': torch.mean(-critic(stop, pi))}\n    return tuple(losses.values())",
    ],
}


@pytest.mark.parametrize("id, k", [(id, k) for id in FORMS for k in range(4)])
def test_a_right_answer_in_another_form_is_not_refused(id, k):
    run = ALL[id].run(FORMS[id][k])
    result = judge(ALL[id], lambda args: (run(args), False), 3)
    assert result.points == result.most, result.lines()
