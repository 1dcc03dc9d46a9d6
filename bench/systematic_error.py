# SPDX-License-Identifier: Apache-2.0
"""What is systematic in how pictures of several seeds differ from the truth, apart from their noise.

Differences of two independent seeds have nothing in common but what is systematic: the mean of their products over pixels expects
its square, whatever the noise is and without knowing it. Errors are one standard deviation, from leaving out each seed in turn.
"""

import dataclasses
import math

import numpy as np

FLOOR = 0.01  # of relMSE and bias, as in `virga compare`


@dataclasses.dataclass(frozen=True)
class Estimate:
    value: float
    error: float

    def text(self, scale=1, digits=None):
        """With as many digits as the error leaves two of."""
        value, error = self.value * scale, self.error * scale
        if digits is None:
            digits = 5 if not error > 0 else min(6, max(0, 1 - math.floor(math.log10(error))))
        return f"{value:.{digits}f} ± {error:.{digits}f}"


def jackknife(estimate, count):
    """`estimate` of the seeds whose numbers it is given."""
    everyone = np.arange(count)
    left = np.array([estimate(np.delete(everyone, k)) for k in everyone])
    return Estimate(estimate(everyone), math.sqrt((count - 1) / count * ((left - left.mean())**2).sum()))


def relmse(differences, reference):
    """Of what is systematic: relMSE that no number of passes mends. `differences`: (seed, row, column, channel)."""
    weighted = (differences / np.sqrt(reference**2 + FLOOR)).reshape(len(differences), -1)
    products = weighted @ weighted.T / weighted.shape[1]

    def pairs(chosen):
        own = products[np.ix_(chosen, chosen)]
        return (own.sum() - np.trace(own)) / (len(chosen) * (len(chosen) - 1))

    return jackknife(pairs, len(differences))


def _mean_of(values):
    return Estimate(float(values.mean()), float(values.std(ddof=1) / math.sqrt(len(values))))


def bias(differences, reference):
    """Mean signed relative difference."""
    return _mean_of((differences / (np.abs(reference) + FLOOR)).mean(axis=(1, 2, 3)))


def squared(differences, reference):
    """relMSE of one seed's picture, noise and all."""
    return _mean_of((differences**2 / (reference**2 + FLOOR)).mean(axis=(1, 2, 3)))
