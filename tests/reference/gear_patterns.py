"""Patterns of one gear's turn whose healthy part and damage are known exactly."""

from __future__ import annotations

import numpy as np

from gearmon.signatures.measured.reference import WheelPattern

# A tooth is in the middle of its contact so long after it has entered [mesh periods].
CONTACT_CENTRE = 0.8


class Gear:
    """A gear with its own pitch errors, heard through its own path.

    Parameters
    ----------
    teeth, harmonics, channels : int
    seed : int
        Of pitch errors and path.
    """

    def __init__(self, teeth=23, harmonics=6, channels=2, seed=0):
        generator = np.random.default_rng(seed)
        self.teeth, self.channels, self.harmonics = teeth, channels, harmonics
        self.number = np.arange(1, harmonics * teeth + teeth // 2 + 1)
        self.mesh = (self.number % teeth) == 0
        # the path is smooth: one gain for each mesh harmonic, and little delay between them
        shape = (channels, harmonics + 1)
        size, phase = generator.standard_normal((2, *shape))
        path = 10 ** (0.2 * size) * np.exp(0.4j * phase)
        self.path = path[:, np.minimum((self.number + teeth // 2) // teeth, harmonics)]
        errors = _complex(generator, teeth)
        self.healthy = 0.3 * errors[self.number % teeth] * self.path
        self.healthy[:, self.mesh] *= 30

    def damage(self, tooth, size):
        """Lines of one tooth that yields: a short event once a turn."""
        where = (tooth - 1 + CONTACT_CENTRE) / self.teeth
        return size * self.path * np.exp(-2j * np.pi * self.number * where)

    def recording(
        self, seed, tooth=None, size=1.0, noise=0.03, start=0.0, spread_db=0.0, lines=None
    ):
        """Pattern of a recording that starts `start` turns late.

        `spread_db` is the scatter of the gain of each band and channel, as load changes it.
        """
        generator = np.random.default_rng(seed)
        value = self.healthy + (self.damage(tooth, size) if tooth else 0.0)
        bands = (self.number + self.teeth // 2) // self.teeth
        gains = 10 ** (spread_db * generator.standard_normal((self.channels, bands.max() + 1)) / 20)
        turns = 0.1 * spread_db * generator.standard_normal(gains.shape)
        value = value * (gains * np.exp(1j * turns))[:, bands]
        value = value * np.exp(2j * np.pi * self.number * start)
        value = value + noise * _complex(generator, value.shape)
        kept = slice(None) if lines is None else lines
        return WheelPattern(
            stage=1,
            gear="pinion",
            teeth=self.teeth,
            order=1.0,
            number=self.number[kept],
            mesh=self.mesh[kept],
            amplitude=value[:, kept],
            variance=np.full(value.shape, noise**2)[:, kept],
        )


def _complex(generator, shape):
    """Circular Gaussian numbers of unit power."""
    parts = generator.standard_normal((2, *np.atleast_1d(shape)))
    return (parts[0] + 1j * parts[1]) / np.sqrt(2)
