"""The model of a camera: exposure, blur, noise, JPEG."""

import dataclasses
import io
from typing import Self

import cv2
import numpy as np
from PIL import Image

from resdepth_colmap.scene import ColorImage
from resdepth_colmap.synthetic.render import Floats
from resdepth_colmap.synthetic.textures import Rng


@dataclasses.dataclass(frozen=True, kw_only=True)
class Sensor:
    """A camera and its settings.

    Attributes:
        brightness: Median of the first exposed view, 0..1 in linear light.
        highlight: Upper limit of its 95 % quantile; 1 is nearly white.
        exposure_spread: Deviation of the log exposure between views.
        gamma_spread: Deviation of the log gamma between views.
        vignetting: Share of light lost in the corners.
        blur_px: Deviation of the lens blur.
        noise: Deviation of the noise at mid grey, of full scale.
        quality: JPEG quality.
    """

    brightness: float
    highlight: float
    exposure_spread: float
    gamma_spread: float
    vignetting: float
    blur_px: float
    noise: float
    quality: int

    @classmethod
    def draw(cls, rng: Rng) -> Self:
        """Draw a camera, mostly a good one; exposure varies strongly in 15 %."""
        strong = rng.random() < 0.15
        return cls(
            brightness=float(rng.uniform(0.10, 0.3)),
            highlight=float(rng.uniform(0.5, 1.3)),
            exposure_spread=0.5 if strong else float(rng.uniform(0, 0.06)),
            gamma_spread=0.12 if strong else float(rng.uniform(0, 0.03)),
            vignetting=float(rng.choice([0.0, rng.uniform(0, 0.3)])),
            blur_px=float(rng.uniform(0.3, 1.0)),
            noise=float(np.exp(rng.uniform(np.log(0.002), np.log(0.02)))),
            quality=int(rng.integers(85, 98)),
        )

    def gain_for(self, radiance: Floats) -> float:
        """Exposure that brings the median of an image to `brightness`.

        Less if its 95 % quantile would exceed `highlight`.
        """
        median, bright = np.percentile(radiance, [50, 95])
        middle = self.brightness / max(float(median), 1e-6)
        return min(middle, self.highlight / max(float(bright), 1e-6))

    def expose(self, rng: Rng, radiance: Floats, gain: float) -> ColorImage:
        """The photograph of a radiance image.

        Args:
            rng: Source of randomness, for noise and exposure of this view.
            radiance: Linear light, shape (H, W, 3).
            gain: Exposure of the scene, see `gain_for`.
        """
        exposure = gain * np.exp(rng.normal(0, self.exposure_spread))
        light = radiance * np.float32(exposure)
        light = light * (1 + rng.normal(0, 0.01, 3)).astype(np.float32)
        light = light * self._falloff(light.shape)
        light = np.asarray(cv2.GaussianBlur(light, (0, 0), self.blur_px), np.float32)
        shoulder = 1 - 0.5 * np.exp(1 - 2 * light)
        curve = np.where(light < 0.5, light, shoulder)
        grain = rng.standard_normal(curve.shape, dtype=np.float32)
        curve = curve + self.noise * np.sqrt(0.05 + 0.5 * np.maximum(curve, 0)) * grain
        gamma = np.exp(rng.normal(0, self.gamma_spread)) / 2.2
        screen = np.clip(curve, 0, 1) ** np.float32(gamma)
        return _through_jpeg(np.round(screen * 255).astype(np.uint8), self.quality)

    def _falloff(self, shape: tuple[int, ...]) -> Floats:
        height, width = shape[:2]
        y = (np.arange(height) + 0.5) / height * 2 - 1
        x = (np.arange(width) + 0.5) / width * 2 - 1
        distance2 = (y[:, None] ** 2 + x[None, :] ** 2) / 2
        return (1 - self.vignetting * distance2)[..., None].astype(np.float32)


def _through_jpeg(rgb: ColorImage, quality: int) -> ColorImage:
    memory = io.BytesIO()
    Image.fromarray(rgb).save(memory, format="JPEG", quality=quality)
    with Image.open(io.BytesIO(memory.getvalue())) as image:
        return np.array(image.convert("RGB"), dtype=np.uint8)
