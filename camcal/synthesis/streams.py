"""Random streams: one per view and purpose, so that neither order nor parallel work changes a result."""

from __future__ import annotations

import numpy as np

POSE, NOISE = 0, 1
"""What a stream is for: a change in how poses are drawn leaves the noise as it is."""


def random_stream(seed: int, index: int, purpose: int) -> np.random.Generator:
    """Return the generator of view `index` for one purpose: a child of the seed that no other view or purpose shares."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index, purpose)))
