"""Pictures and exact depth of a room by ray casting (open3d's Embree, on the CPU)."""

import dataclasses

import cv2
import numpy as np
import numpy.typing as npt
import open3d as o3d

from resdepth_colmap.scene import DepthMap, View
from resdepth_colmap.training.room import Light, Room
from resdepth_colmap.training.textures import Picture

Floats = npt.NDArray[np.float32]
Indices = npt.NDArray[np.int64]

_SUPERSAMPLING = 2
_OCCLUSION_RAYS = 32
_OCCLUSION_REACH = 1.2  # metres; farther things do not darken a corner
_LIFT = 1e-3  # metres; a ray that starts on a surface must not hit it at once


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class _Hits:
    """What rays met: faces (N,), weights of their corners (N, 3), distance (N,)."""

    faces: Indices
    corners: Floats
    distance: Floats
    hit: npt.NDArray[np.bool_]


class Tracer:
    """A room made ready for rays: geometry, textures with mip maps, baked occlusion.

    Args:
        room: What to look at.
        num_threads: Threads of the ray caster.
    """

    def __init__(self, room: Room, num_threads: int = 1) -> None:
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
        occlusion = self._bake_occlusion()
        columns = [mesh.normals, mesh.uv, occlusion[:, None]]
        self._attributes = np.concatenate(columns, axis=1).astype(np.float32)
        self._atlas = _Atlas(room.textures)
        kinds = room.materials
        self._texture = np.array([kind.texture for kind in kinds])
        self._tint = np.array([kind.tint for kind in kinds], dtype=np.float32)
        self._span = np.array([kind.span for kind in kinds], dtype=np.float32)
        self._offset = np.array([kind.offset for kind in kinds], dtype=np.float32)
        self._gloss = np.array([kind.gloss for kind in kinds], dtype=np.float32)
        self._shininess = np.array([kind.shininess for kind in kinds], dtype=np.float32)
        self._emission = np.array([kind.emission for kind in kinds], dtype=np.float32)

    def depth(self, view: View) -> DepthMap:
        """Exact depth at the pixel centres, along the optical axis; 0 = nothing hit."""
        origin, directions = _pixel_rays(view, 1)
        hits = self._cast(origin, directions)
        shape = (view.camera.height_px, view.camera.width_px)
        depth = np.where(hits.hit, hits.distance, 0).reshape(shape)
        return np.asarray(depth, dtype=np.float32)

    def radiance(self, view: View) -> Floats:
        """Light that reaches each pixel, linear, shape (H, W, 3); unbounded above."""
        origin, directions = _pixel_rays(view, _SUPERSAMPLING)
        footprint = 1.0 / (view.camera.fx * _SUPERSAMPLING)
        width = view.camera.width_px * _SUPERSAMPLING
        block = self._light_samples(len(directions), width)
        color = self._trace(origin, directions, footprint, block)
        fine = color.reshape(-1, width, 3)
        size = (view.camera.width_px, view.camera.height_px)
        return np.asarray(
            cv2.resize(fine, size, interpolation=cv2.INTER_AREA), np.float32
        )

    @staticmethod
    def _light_samples(count: int, width: int) -> Indices:
        """Which of a lamp's four points a ray asks: all four within each pixel."""
        index = np.arange(count)
        samples: Indices = (index // width) % 2 * 2 + index % width % 2
        return samples

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

        All vertices use one set of directions: no noise that could be matched.
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
        """Light along rays; `block` picks lamp points, None = no shadows, no mirrors."""
        hits = self._cast(origin, directions)
        kind = self.room.mesh.slots[hits.faces]
        rows = self._attributes[self.room.mesh.faces[hits.faces]]
        values = np.einsum("nc,nca->na", hits.corners, rows)
        view = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        flat, normal = self._facing(hits, values[:, :3], view)
        grazing = np.maximum(-np.einsum("ni,ni->n", flat, view), 0.12)
        width = footprint * hits.distance / grazing**0.6 / self._span[kind]
        place = (values[:, 3:5] + self._offset[kind]) / self._span[kind][:, None]
        albedo = (
            self._atlas.sample(self._texture[kind], place, width) * self._tint[kind]
        )
        point = origin + hits.distance[:, None] * directions
        start = (point + _LIFT * flat).astype(np.float32)
        sky = 0.75 + 0.25 * normal[:, 2]
        open_sky = (0.25 + 0.75 * values[:, 5]) * sky
        diffuse = open_sky[:, None] * self.room.ambient.astype(np.float32)
        gloss = self._gloss[kind]
        shine = np.zeros_like(diffuse)
        mirrored = view - 2 * np.einsum("ni,ni->n", normal, view)[:, None] * normal
        for number, light in enumerate(self.room.lights):
            arrives, toward = self._illuminate(light, number, start, normal, block)
            diffuse += arrives
            if block is not None:
                lobe = np.maximum(np.einsum("ni,ni->n", mirrored, toward), 1e-6)
                lobe = lobe ** self._shininess[kind] * gloss
                shine += lobe[:, None] * np.sqrt(np.maximum(arrives, 0))
        color = albedo * (diffuse + self._emission[kind][:, None]) + shine
        if block is not None:
            self._add_mirrors(
                color, start, mirrored, (gloss, -np.einsum("ni,ni->n", normal, view))
            )
        color[~hits.hit] = 0
        return np.asarray(color, dtype=np.float32)

    def _facing(
        self, hits: _Hits, smooth: Floats, view: Floats
    ) -> tuple[Floats, Floats]:
        """Flat and smooth normals, turned towards the eye."""
        flat = self._face_normals[hits.faces]
        flat = np.where(np.einsum("ni,ni->n", flat, view)[:, None] > 0, -flat, flat)
        smooth = smooth / np.maximum(
            np.linalg.norm(smooth, axis=1, keepdims=True), 1e-6
        )
        turned = np.where(
            np.einsum("ni,ni->n", flat, smooth)[:, None] < 0, -smooth, smooth
        )
        return flat, turned.astype(np.float32)

    def _illuminate(
        self,
        light: Light,
        number: int,
        start: Floats,
        normal: Floats,
        block: Indices | None,
    ) -> tuple[Floats, Floats]:
        """Light of one lamp on surfaces (N, 3), and the unit direction to it (N, 3)."""
        position = light.position.astype(np.float32)
        if block is not None:
            angle = np.arange(4) * (np.pi / 2) + number
            ring = np.stack(
                [np.cos(angle), np.sin(angle), 0.3 * np.sin(2 * angle)], axis=1
            )
            position = (position + 0.7 * light.radius * ring).astype(np.float32)[block]
        toward = position - start
        distance2 = np.einsum("ni,ni->n", toward, toward)
        unit = toward / np.sqrt(distance2)[:, None]
        falloff = np.maximum(np.einsum("ni,ni->n", unit, normal), 0) / (distance2 + 0.3)
        if block is not None:
            lit = np.flatnonzero(falloff > 0)
            falloff[lit] *= 1 - self._blocked(start[lit], toward[lit])
        return falloff[:, None] * light.color.astype(np.float32), unit

    def _add_mirrors(
        self,
        color: Floats,
        start: Floats,
        mirrored: Floats,
        gloss_cos: tuple[Floats, Floats],
    ) -> None:
        """Reflections on the glossy surfaces, stronger where the view grazes."""
        gloss, cosine = gloss_cos
        fresnel = gloss * (0.15 + 0.85 * np.clip(1 - cosine, 0, 1) ** 4)
        rows = np.flatnonzero(fresnel > 0.02)
        if len(rows) == 0:
            return
        seen = self._trace(start[rows], mirrored[rows].astype(np.float32), 0.01, None)
        color[rows] += fresnel[rows, None] * (seen - 0.5 * color[rows])


class _Atlas:
    """All textures and their mip levels in one flat array."""

    def __init__(self, textures: list[Picture]) -> None:
        levels: list[npt.NDArray[np.uint8]] = []
        most = max(len(picture) for picture in textures).bit_length()
        self._base = np.zeros((len(textures), most), dtype=np.int64)
        self._sizes = np.array([len(picture) for picture in textures])
        total = 0
        for index, picture in enumerate(textures):
            level = picture
            for step in range(len(picture).bit_length()):
                self._base[index, step] = total
                levels.append(np.round(level * 255).astype(np.uint8).reshape(-1, 3))
                total += len(levels[-1])
                half = max(len(level) // 2, 1)
                level = cv2.resize(level, (half, half), interpolation=cv2.INTER_AREA)
        self._texels = np.concatenate(levels)
        # what a screen shows to what a surface reflects
        self._linear = (np.arange(256, dtype=np.float32) / 255) ** 2.2

    def sample(self, texture: Indices, place: Floats, width: Floats) -> Floats:
        """Linear colours at places (N, 2) in repeats, for footprints (N,) in repeats."""
        full = self._sizes[texture]
        blur = np.log2(np.maximum(width * full, 1.0))
        level = np.minimum(
            np.round(blur).astype(np.int64), np.log2(full).astype(np.int64)
        )
        size = full >> level
        base = self._base[texture, level]
        xy = (place % 1.0) * size[:, None] - 0.5
        corner = np.floor(xy).astype(np.int64)
        share = (xy - corner).astype(np.float32)
        color = np.zeros((len(place), 3), dtype=np.float32)
        for dx, wx in ((0, 1 - share[:, 0]), (1, share[:, 0])):
            x = (corner[:, 0] + dx) & (size - 1)
            for dy, wy in ((0, 1 - share[:, 1]), (1, share[:, 1])):
                row = (corner[:, 1] + dy) & (size - 1)
                texel = self._texels[base + row * size + x]
                color += (wx * wy)[:, None] * self._linear[texel]
        return color


def _pixel_rays(view: View, fineness: int) -> tuple[Floats, Floats]:
    """Rays through the centres of (sub-)pixels; their z in the camera is 1.

    K counts a pixel's centre as index + 0.5 (COLMAP), so it is used as it is.
    """
    camera = view.camera
    x = (np.arange(camera.width_px * fineness) + 0.5) / fineness
    y = (np.arange(camera.height_px * fineness) + 0.5) / fineness
    grid_x, grid_y = np.meshgrid(
        (x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy
    )
    in_camera = np.stack([grid_x, grid_y, np.ones_like(grid_x)], axis=2).reshape(-1, 3)
    directions = in_camera @ view.cam_from_world[:, :3]
    return view.center_in_world.astype(np.float32), directions.astype(np.float32)
