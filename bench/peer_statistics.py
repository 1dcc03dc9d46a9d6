# SPDX-License-Identifier: Apache-2.0
"""Do two renderers agree? From independent replicates of both."""

import math

import numpy as np

MARGIN = 2  # pixels: reconstruction filters may end differently at the border
BLOCKS = 4


def student_tail(t, degrees):
    """P(|T| > |t|) of Student's law: Simpson's rule on the density in t = sqrt(n) tan(x)."""
    lower = math.atan(abs(t) / math.sqrt(degrees))
    x = np.linspace(lower, math.pi / 2, 20001)
    f = np.cos(x) ** (degrees - 1) if degrees > 1 else np.ones_like(x)
    h = x[1] - x[0]
    integral = h / 3 * (f[0] + f[-1] + 4 * f[1:-1:2].sum() + 2 * f[2:-1:2].sum())
    return min(1.0, 2 * integral * math.exp(math.lgamma((degrees + 1) / 2) - math.lgamma(degrees / 2)) / math.sqrt(math.pi))


def welch(a, b):
    """p-value that two samples have the same mean; where nothing varies, whether they are equal."""
    va, vb = a.var(ddof=1) / len(a), b.var(ddof=1) / len(b)
    difference = a.mean() - b.mean()
    # Means of the same value differ by rounding.
    rounding = (1e-6 * max(abs(a.mean()), abs(b.mean()))) ** 2
    if va + vb <= rounding:
        return 1.0 if abs(difference) <= 10 * math.sqrt(rounding) else 0.0
    degrees = (va + vb) ** 2 / (va**2 / (len(a) - 1) + vb**2 / (len(b) - 1))
    return student_tail(difference / math.sqrt(va + vb), degrees)


def sidak(values):
    values = list(values)
    return 1 - (1 - min(values)) ** len(values)


def blocks_of(pictures):
    """Mean of the channels of each block, one column a block."""
    grey = pictures.mean(axis=3)
    rows = [part for band in np.array_split(grey, BLOCKS, axis=1) for part in np.array_split(band, BLOCKS, axis=2)]
    return np.array([part.mean(axis=(1, 2)) for part in rows])


def relative_error(a, b):
    mean_a, mean_b = a.mean(axis=0), b.mean(axis=0)
    noise = a.var(axis=0, ddof=1) / len(a) + b.var(axis=0, ddof=1) / len(b)
    weight = 1 / (mean_b**2 + 0.01)
    return float(((mean_a - mean_b) ** 2 * weight).mean()), float((noise * weight).mean())


def noise_of(pictures):
    """relMSE of one picture against the mean of many like it."""
    return float((pictures.var(axis=0, ddof=1) / (pictures.mean(axis=0) ** 2 + 0.01)).mean())


def agreement(virga, mitsuba):
    """Of arrays (replicate, row, column, channel)."""
    inner = (slice(None), slice(MARGIN, -MARGIN), slice(MARGIN, -MARGIN))
    v, m = virga[inner].astype(float), mitsuba[inner].astype(float)
    channels_v, channels_m = v.mean(axis=(1, 2)), m.mean(axis=(1, 2))
    all_v, all_m = channels_v.mean(axis=1), channels_m.mean(axis=1)
    error = math.sqrt(all_v.var(ddof=1) / len(all_v) + all_m.var(ddof=1) / len(all_m))
    relmse, noise = relative_error(v, m)
    return {"bias": float((all_v.mean() - all_m.mean()) / all_m.mean()), "bias_error": float(error / all_m.mean()),
            "channel_bias": [float(x) for x in channels_v.mean(axis=0) / channels_m.mean(axis=0) - 1],
            "p": float(sidak(welch(channels_v[:, c], channels_m[:, c]) for c in range(3))),
            "p_blocks": float(sidak(welch(a, b) for a, b in zip(blocks_of(v), blocks_of(m)))),
            "relmse": relmse, "relmse_noise": noise, "noise_virga": noise_of(v), "noise_mitsuba": noise_of(m)}
