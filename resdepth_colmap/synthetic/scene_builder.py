"""The scene builder: collects meshes and gives them materials."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from resdepth_colmap.scene import Matrix
from resdepth_colmap.synthetic.meshes import Mesh, Rng
from resdepth_colmap.synthetic.patterns import random_texture


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Material:
    """Appearance of a surface.

    Attributes:
        texture: Index of its texture.
        tint: Factor of the texture, shape (3,).
        span: Side of one repeat of the texture, in metres.
        offset: Origin of the texture, shape (2,), in metres.
        gloss: Strength of highlights and reflections, 0..1.
        shininess: Phong exponent of the highlight.
        emission: Emitted light, in units of white.
    """

    texture: int
    tint: Matrix
    span: float
    offset: Matrix
    gloss: float = 0.0
    shininess: float = 30.0
    emission: float = 0.0


class SceneBuilder:
    """Collects meshes and gives a material to each of their slots.

    The share of surfaces without texture varies between scenes: about a third of the
    small surfaces and half of the large ones on average.

    Args:
        rng: Source of randomness.
        texels: Side of the textures of objects, a power of two; those of walls are
            twice as large.
    """

    def __init__(self, rng: Rng, texels: int) -> None:  # noqa: D107
        self.rng = rng
        self.parts: list[Mesh] = []
        self.materials: list[Material] = []
        weak = rng.choice([0.12, 0.35, 0.35, 0.6])
        count = int(rng.integers(18, 30))
        small = [random_texture(rng, texels, weak) for _ in range(count)]
        weak = rng.choice([0.25, 0.55, 0.85])
        large = [random_texture(rng, 2 * texels, weak, 0.2) for _ in range(5)]
        self.textures = small + large
        self._num_small = count

    def surface(self, large: bool = False, emission: float = 0.0) -> int:
        """Make a material; returns its index.

        Args:
            large: For floors and walls: coarser textures, less gloss.
            emission: Emitted light, in units of white.
        """
        rng = self.rng
        first = self._num_small if large else 0
        glossy = rng.random() < (0.2 if large else 0.4)
        least, most = (0.6, 3.0) if large else (0.1, 1.2)
        material = Material(
            texture=int(rng.integers(first, len(self.textures))),
            tint=rng.uniform(0.6, 1.1) * rng.uniform(0.9, 1.1, 3),
            span=float(np.exp(rng.uniform(np.log(least), np.log(most)))),
            offset=rng.uniform(0, 3, 2),
            gloss=float(rng.uniform(0.03, 0.5)) if glossy else 0.0,
            shininess=float(np.exp(rng.uniform(1.6, 5.5))),
            emission=emission,
        )
        self.materials.append(material)
        return len(self.materials) - 1

    def add(self, mesh: Mesh, large: bool = False) -> None:
        """Add a mesh, each of its slots with a new material."""
        self.add_with(mesh, [self.surface(large) for _ in range(mesh.num_slots)])

    def add_with(self, mesh: Mesh, surfaces: Sequence[int]) -> None:
        """Add a mesh, its slots with these materials."""
        slots = np.asarray(surfaces)[mesh.slots]
        self.parts.append(dataclasses.replace(mesh, slots=slots))
