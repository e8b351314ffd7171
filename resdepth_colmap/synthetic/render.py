"""Images and exact depth of a room by ray casting (open3d's Embree, on the CPU)."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from resdepth_colmap.geometry.resize import area_resized
from resdepth_colmap.io.open3d_library import load_open3d
from resdepth_colmap.scene import DepthMap, View
from resdepth_colmap.synthetic.room import Light, Room
from resdepth_colmap.synthetic.texture_atlas import Atlas

o3d = load_open3d()

Floats = npt.NDArray[np.float32]
Indices = npt.NDArray[np.int64]

_SUPERSAMPLING = 2
_OCCLUSION_RAYS = 32
_OCCLUSION_REACH = 1.2  # metres; farther things do not darken a corner
_LIFT = 1e-3  # metres; a ray that starts on a surface must not hit it at once


class _Hits(NamedTuple):
    """Where N rays hit.

    Attributes:
        faces: Index of the face, shape (N,).
        corners: Weights of its corners, shape (N, 3).
        distance: In lengths of the ray, shape (N,); 1 = no hit.
        hit: Whether there is a hit, shape (N,).
    """

    faces: Indices
    corners: Floats
    distance: Floats
    hit: npt.NDArray[np.bool_]


class _Surface(NamedTuple):
    """The surfaces that N rays hit.

    Attributes:
        kind: Index of the material, shape (N,).
        albedo: Reflected share of the light, shape (N, 3).
        start: The point, lifted off the surface, shape (N, 3).
        normal: Unit normal towards the eye, shape (N, 3).
        mirrored: Direction of the mirrored ray, shape (N, 3).
        cosine: Cosine of the angle between normal and ray, shape (N,).
        open_sky: Share of the ambient light that arrives, shape (N,).
    """

    kind: Indices
    albedo: Floats
    start: Floats
    normal: Floats
    mirrored: Floats
    cosine: Floats
    open_sky: Floats


class Tracer:
    """Renders a room: geometry, textures with mip maps, baked occlusion.

    Args:
        room: The room.
        num_threads: Threads of the ray caster.
    """

    def __init__(self, room: Room, num_threads: int = 1) -> None:  # noqa: D107
        self.room = room
        mesh = room.mesh
        self._scene = o3d.t.geometry.RaycastingScene(nthreads=num_threads)
        self._scene.add_triangles(
            o3d.core.Tensor(mesh.vertices.astype(np.float32)),
            o3d.core.Tensor(mesh.faces.astype(np.uint32)),
        )
        sides = mesh.vertices[mesh.faces]
        flat = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
        length = np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-20)
        self._face_normals = (flat / length).astype(np.float32)
        columns = (mesh.normals, mesh.uv, self._bake_occlusion())
        self._attributes = np.column_stack(columns).astype(np.float32)
        self._atlas = Atlas(room.textures)
        kinds = room.materials
        self._texture = np.array([kind.texture for kind in kinds])
        self._tint = np.array([kind.tint for kind in kinds], np.float32)
        self._span = np.array([kind.span for kind in kinds], np.float32)
        self._offset = np.array([kind.offset for kind in kinds], np.float32)
        self._gloss = np.array([kind.gloss for kind in kinds], np.float32)
        self._shininess = np.array([kind.shininess for kind in kinds], np.float32)
        self._emission = np.array([kind.emission for kind in kinds], np.float32)

    def depth(self, view: View) -> DepthMap:
        """Exact depth at the pixel centres, along the optical axis; 0 = no hit."""
        origin, directions = _pixel_rays(view, 1)
        hits = self._cast(origin, directions)
        shape = (view.camera.height_px, view.camera.width_px)
        depth = np.where(hits.hit, hits.distance, 0).reshape(shape)
        return np.asarray(depth, dtype=np.float32)

    def radiance(self, view: View) -> Floats:
        """Linear light at each pixel, shape (H, W, 3); unbounded above."""
        origin, directions = _pixel_rays(view, _SUPERSAMPLING)
        footprint = 1.0 / (view.camera.fx * _SUPERSAMPLING)
        width = view.camera.width_px * _SUPERSAMPLING
        block = self._light_samples(len(directions), width)
        color = self._trace(origin, directions, footprint, block)
        fine = color.reshape(-1, width, 3)
        return area_resized(fine, (view.camera.width_px, view.camera.height_px))

    @staticmethod
    def _light_samples(count: int, width: int) -> Indices:
        """Index of the lamp point of each ray, so that a pixel has all four."""
        index = np.arange(count)
        return np.asarray((index // width) % 2 * 2 + index % width % 2)

    def _cast(self, origin: Floats, directions: Floats) -> _Hits:
        rays = np.empty((len(directions), 6), dtype=np.float32)
        rays[:, :3] = origin
        rays[:, 3:] = directions
        answer = self._scene.cast_rays(o3d.core.Tensor(rays))
        faces = answer["primitive_ids"].numpy()
        distance = answer["t_hit"].numpy()
        hit = np.isfinite(distance)
        second_third = answer["primitive_uvs"].numpy()
        first = 1 - second_third.sum(axis=1, keepdims=True)
        return _Hits(
            faces=np.where(hit, faces, 0).astype(np.int64),
            corners=np.concatenate([first, second_third], axis=1),
            distance=np.where(hit, distance, 1.0),
            hit=hit,
        )

    def _blocked(self, start: Floats, toward: Floats, reach: float = 1.0) -> Floats:
        rays = o3d.core.Tensor(np.concatenate([start, toward], axis=1))
        blocked = self._scene.test_occlusions(rays, tnear=0.0, tfar=reach)
        return np.asarray(blocked.numpy(), dtype=np.float32)

    def _bake_occlusion(self) -> Floats:
        """Open share of the hemisphere at each vertex, shape (V,), 0..1.

        All vertices use the same directions: no noise that could be matched.
        """
        mesh = self.room.mesh
        vertices, normals = mesh.vertices.astype(np.float32), mesh.normals
        middle = (self.room.low + self.room.high) / 2
        outward = np.sum((middle - vertices) * normals, axis=1, keepdims=True)
        normals = np.where(outward < 0, -normals, normals).astype(np.float32)
        across = np.cross(normals, [0.35, 0.9, 0.25])
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-6)
        other = np.cross(normals, across)
        start = (vertices + 4 * _LIFT * normals).astype(np.float32)
        blocked = np.zeros(len(vertices), dtype=np.float32)
        for index in range(_OCCLUSION_RAYS):
            share = (index + 0.5) / _OCCLUSION_RAYS
            radius, angle = np.sqrt(share), index * 2.399963  # the golden angle
            x, y, z = radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1 - share)
            toward = (x * across + y * other + z * normals).astype(np.float32)
            blocked += self._blocked(start, toward, _OCCLUSION_REACH)
        return np.asarray(1 - blocked / _OCCLUSION_RAYS, dtype=np.float32)

    def _trace(
        self,
        origin: Floats,
        directions: Floats,
        footprint: float,
        block: Indices | None,
    ) -> Floats:
        """Light along rays (N, 3), with the lamp points `block` of `_light_samples`.

        None renders a mirror image: no shadows, no highlights.
        """
        hits = self._cast(origin, directions)
        surface = self._surface(hits, origin, directions, footprint)
        kind = surface.kind
        diffuse = surface.open_sky[:, None] * self.room.ambient.astype(np.float32)
        diffuse += self._emission[kind][:, None]
        shine = np.zeros_like(diffuse)
        for index, light in enumerate(self.room.lights):
            arrives, toward = self._illuminate(light, index, surface, block)
            diffuse += arrives
            if block is not None:
                lobe = np.maximum(_dot(surface.mirrored, toward), 1e-6)
                lobe = self._gloss[kind] * lobe ** self._shininess[kind]
                shine += lobe[:, None] * np.sqrt(arrives)
        color = surface.albedo * diffuse + shine
        if block is not None:
            self._add_mirrors(color, surface)
        color[~hits.hit] = 0
        return np.asarray(color, dtype=np.float32)

    def _surface(
        self, hits: _Hits, origin: Floats, directions: Floats, footprint: float
    ) -> _Surface:
        kind = self.room.mesh.slots[hits.faces]
        rows = self._attributes[self.room.mesh.faces[hits.faces]]
        values = np.einsum("nc,nca->na", hits.corners, rows)
        view = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        flat, normal = self._facing(hits, values[:, :3], view)
        grazing = np.maximum(-_dot(flat, view), 0.12)
        span = self._span[kind]
        width = footprint * hits.distance / grazing**0.6 / span
        uv = (values[:, 3:5] + self._offset[kind]) / span[:, None]
        texel = self._atlas.sample(self._texture[kind], uv, width.astype(np.float32))
        cosine = _dot(normal, view)
        point = origin + hits.distance[:, None] * directions
        return _Surface(
            kind=kind,
            albedo=texel * self._tint[kind],
            start=(point + _LIFT * flat).astype(np.float32),
            normal=normal,
            mirrored=(view - 2 * cosine[:, None] * normal).astype(np.float32),
            cosine=-cosine,
            # darker in corners and where the normal points down
            open_sky=(0.25 + 0.75 * values[:, 5]) * (0.75 + 0.25 * normal[:, 2]),
        )

    def _facing(
        self, hits: _Hits, smooth: Floats, view: Floats
    ) -> tuple[Floats, Floats]:
        """Flat and smooth normals, turned towards the eye."""
        flat = self._face_normals[hits.faces]
        flat = np.where(_dot(flat, view)[:, None] > 0, -flat, flat)
        length = np.linalg.norm(smooth, axis=1, keepdims=True)
        smooth = smooth / np.maximum(length, 1e-6)
        turned = np.where(_dot(flat, smooth)[:, None] < 0, -smooth, smooth)
        return flat, turned.astype(np.float32)

    def _illuminate(
        self, light: Light, index: int, surface: _Surface, block: Indices | None
    ) -> tuple[Floats, Floats]:
        """Light of one lamp on surfaces (N, 3), and the unit direction to it (N, 3)."""
        lamp = np.asarray(light.position, dtype=np.float32)
        if block is not None:
            lamp = _lamp_points(light, index)[block]
        toward = np.asarray(lamp - surface.start, dtype=np.float32)
        distance2 = _dot(toward, toward)
        unit = np.asarray(toward / np.sqrt(distance2)[:, None], dtype=np.float32)
        falloff = np.maximum(_dot(unit, surface.normal), 0) / (distance2 + 0.3)
        if block is not None:
            lit = np.flatnonzero(falloff > 0)
            falloff[lit] *= 1 - self._blocked(surface.start[lit], toward[lit])
        return falloff[:, None] * light.color.astype(np.float32), unit

    def _add_mirrors(self, color: Floats, surface: _Surface) -> None:
        """Reflections on the glossy surfaces, stronger where the view grazes."""
        grazing = np.clip(1 - surface.cosine, 0, 1) ** 4
        share = self._gloss[surface.kind] * (0.15 + 0.85 * grazing)
        rows = np.flatnonzero(share > 0.02)
        if len(rows) == 0:
            return
        seen = self._trace(surface.start[rows], surface.mirrored[rows], 0.01, None)
        color[rows] += share[rows, None] * (seen - 0.5 * color[rows])


def _lamp_points(light: Light, index: int) -> Floats:
    """Four points on a lamp, shape (4, 3), for soft shadows."""
    angle = np.arange(4) * (np.pi / 2) + index
    ring = np.stack([np.cos(angle), np.sin(angle), np.sin(2 * angle) / 3], axis=1)
    return np.asarray(light.position + 0.7 * light.radius * ring, dtype=np.float32)


def _dot(first: Floats, second: Floats) -> Floats:
    return np.asarray(np.einsum("ni,ni->n", first, second), dtype=np.float32)


def _pixel_rays(view: View, fineness: int) -> tuple[Floats, Floats]:
    """Rays through the centres of (sub-)pixels; their z in the camera frame is 1.

    The centre of a pixel is at index + 0.5, as in COLMAP's K.
    """
    camera = view.camera
    x = (np.arange(camera.width_px * fineness) + 0.5) / fineness
    y = (np.arange(camera.height_px * fineness) + 0.5) / fineness
    u, v = np.meshgrid((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy)
    in_camera = np.stack([u, v, np.ones_like(u)], axis=2).reshape(-1, 3)
    directions = in_camera @ view.cam_from_world[:, :3]
    return view.center_in_world.astype(np.float32), directions.astype(np.float32)
