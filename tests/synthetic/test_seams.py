"""Laws of the repeated textures: none shows a seam."""

import numpy as np
import pytest

from resdepth_colmap.synthetic.patterns import REPEATED
from resdepth_colmap.synthetic.textures import RICH, WEAK, Maker, Picture

SIZE = 128
# a printed page has edges of its own, where it meets the next one
SEAMLESS = sorted(
    {maker for maker in (*WEAK, *REPEATED, *RICH) if maker.__name__ != "_print"},
    key=lambda maker: maker.__name__,
)


def _seam(picture: Picture) -> float:
    """Change across the seam of opposite sides, over the largest one elsewhere."""
    ratios = []
    for turned in (picture, picture.transpose(1, 0, 2)):
        changes = np.abs(np.roll(turned, -1, axis=0) - turned).mean(axis=(1, 2))
        ratios.append(changes[-1] / max(float(changes[:-1].max()), 1e-6))
    return float(max(ratios))


@pytest.mark.parametrize("maker", SEAMLESS, ids=lambda maker: maker.__name__)
@pytest.mark.parametrize("seed", [0, 1])
def test_a_surface_goes_on_across_its_seam(maker: Maker, seed: int) -> None:
    picture = np.clip(maker(np.random.default_rng(seed), SIZE), 0, 1)
    assert _seam(picture) < 1.2


def test_a_seam_would_be_noticed() -> None:
    ramp = np.broadcast_to(np.linspace(0, 1, SIZE)[:, None, None], (SIZE, SIZE, 3))
    assert _seam(ramp.astype(np.float32)) > 10
