# SPDX-License-Identifier: MIT
"""A street around a block of houses, rendered for docs/images/hero.webp: boxes with textures,
sunlight, shadows and haze. Nothing of it is anybody's picture.

World: x, y on the ground, z up, m. Camera: x right, y down, z forward.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Shorts = NDArray[np.int16]

WIDTH, HEIGHT, FOCAL, BASELINE_M = 480, 270, 250.0, 0.30
OVERSAMPLED = 2
TEXELS_PER_M, LIGHT_PER_M = 96, 12
SUN = np.array([0.45, -0.62, 0.64]) / np.linalg.norm([0.45, -0.62, 0.64])
SKY_LIGHT, SUN_LIGHT = np.float32([0.40, 0.45, 0.52]), np.float32([1.02, 0.95, 0.82])
HAZE, HAZE_M = np.float32([0.78, 0.83, 0.88]), 160.0
NOISE = 1.5  # grey levels


def noise(rng: np.random.Generator, shape: tuple[int, int], scale: float) -> Floats:
    """Soft noise about 0 that goes on at the edges, with features of `scale` texels."""
    spectrum = np.fft.rfft2(rng.normal(size=shape))
    y, x = np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1])[None]
    smooth = np.fft.irfft2(spectrum * np.exp(-2 * (np.pi * scale) ** 2 * (x**2 + y**2) / 4), shape)
    return np.asarray(smooth / smooth.std(), np.float32)


def stones(rng: np.random.Generator, size: int, rows: int, columns: int, joint: float) -> Floats:
    """Rows of bricks of various shades, each second row moved by half a brick; 0 in the joints."""
    v, u = np.mgrid[0:size, 0:size] / size
    row = np.floor(v * rows).astype(int)
    u = u + (row % 2) * 0.5 / columns
    column = np.floor(u * columns).astype(int) % columns
    shade = rng.normal(1, 0.16, (rows, columns))[row, column]
    off_row, off_column = (v * rows) % 1, (u * columns) % 1
    edge = np.minimum(
        np.minimum(off_row, 1 - off_row) / rows, np.minimum(off_column, 1 - off_column) / columns
    )
    return np.asarray(shade * np.clip(edge * size / joint, 0.45, 1), np.float32)


def facade(rng: np.random.Generator, colour: Floats, bricks: bool) -> Floats:
    """A wall of 3 m by 3 m with a window in it."""
    size = 3 * TEXELS_PER_M
    wall = stones(rng, size, 36, 12, 1.6) if bricks else 1 + 0.03 * noise(rng, (size, size), 2)
    wall = wall * (1 + 0.06 * noise(rng, (size, size), 5) + 0.05 * noise(rng, (size, size), 40))
    tile = wall[..., None] * colour
    v, u = np.mgrid[0:size, 0:size] / TEXELS_PER_M  # v from the top
    frame = (abs(u - 1.5) < 0.62) & (v > 0.55) & (v < 2.15)
    sill = (abs(u - 1.5) < 0.72) & (v >= 2.15) & (v < 2.25)
    glass = (abs(abs(u - 1.5) - 0.28) < 0.23) & (v > 0.66) & (abs(v - 1.1) > 0.05) & (v < 2.08)
    tile[frame] = 0.85 + 0.03 * rng.normal(size=(int(frame.sum()), 1))
    tile[sill] = 0.62
    behind = 0.14 + 0.10 * noise(rng, (size, size), 30) + 0.12 * (u + v < 2.2)
    tile[glass] = np.clip(behind, 0.05, 0.6)[glass][:, None] * np.array([0.9, 1.0, 1.15])
    return np.asarray(tile, np.float32)


def paving(rng: np.random.Generator) -> Floats:
    """4 m by 4 m of cobbles."""
    size = 4 * TEXELS_PER_M
    shade = stones(rng, size, 26, 18, 2.4) * (1 + 0.10 * noise(rng, (size, size), 3))
    shade *= 1 + 0.08 * noise(rng, (size, size), 60)
    return np.asarray(shade[..., None] * np.array([0.50, 0.48, 0.46]), np.float32)


def planks(rng: np.random.Generator) -> Floats:
    """1 m by 1 m of a crate."""
    size = TEXELS_PER_M
    v, u = np.mgrid[0:size, 0:size] / size
    shade = rng.normal(1, 0.13, 6)[np.floor(v * 6).astype(int)] * (
        1 + 0.14 * noise(rng, (size, size), 2)
    )
    shade *= np.where((v * 6) % 1 < 0.1, 0.5, 1)
    border = (np.minimum(u, 1 - u) < 0.09) | (abs(u - v) < 0.07)
    return np.asarray(
        np.where(border, 1.15, shade)[..., None] * np.array([0.62, 0.45, 0.28]), np.float32
    )


@dataclass(frozen=True)
class Box:
    """From corner to corner; a texture, and how many metres wide that is."""

    low: Floats
    high: Floats
    texture: int


@dataclass
class Face:
    """A rectangle in a plane of the world: axis = at, the other two between low and high."""

    axis: int
    at: float
    outwards: float
    low: Floats
    high: Floats
    texture: int
    light: Floats = field(default_factory=lambda: np.ones((1, 1), np.float32))

    @property
    def others(self) -> list[int]:
        return [i for i in range(3) if i != self.axis]

    def points(self) -> Floats:
        """A point for each texel of its light, (h, w, 3)."""
        spans = [
            np.arange(a + 0.5 / LIGHT_PER_M, b, 1 / LIGHT_PER_M)
            for a, b in zip(self.low, self.high, strict=True)
        ]
        grid = np.stack(np.meshgrid(*spans), axis=-1)
        out = np.empty((*grid.shape[:2], 3))
        out[..., self.others], out[..., self.axis] = grid, self.at + 0.01 * self.outwards
        return np.asarray(out, np.float32)


def block() -> list[Box]:
    """Houses around a street that goes around houses; crates stand about."""
    rng = np.random.default_rng(4)
    boxes = []

    def put(
        x: float, y: float, wide: float, deep: float, tall: float, texture: int, lift: float = 0
    ) -> None:
        low, high = np.array([x, y, lift]), np.array([x + wide, y + deep, lift + tall])
        boxes.append(Box(np.float32(low), np.float32(high), texture))

    for x, wide, tall, texture in ((-6, 4, 6, 1), (-2, 3, 9, 2), (1, 5, 4.5, 3)):  # in the middle
        put(x, -3, wide, 6, tall, texture)
    for side in (-1, 1):
        x = -17.0
        while x < 17:
            wide, tall, texture = rng.uniform(4, 8), rng.uniform(5, 13), int(rng.integers(1, 5))
            y = rng.uniform(9.0, 10.2)
            put(x, y if side > 0 else -y - 6, wide - 0.02, 6, tall, texture)
            x += wide
        y = -10.0
        while y < 9:
            deep, tall, texture = rng.uniform(4, 7), rng.uniform(5, 12), int(rng.integers(1, 5))
            x = rng.uniform(12.5, 13.8)
            put(x if side > 0 else -x - 6, y, 6, deep - 0.02, tall, texture)
            y += deep
    for _ in range(26):
        along, size = rng.uniform(0, 4), rng.uniform(0.5, 1.1)
        if along < 2:
            x, y = rng.uniform(-11, 10), 3.2 if along < 1 else -3.2 - size
            x, y = (x, y) if abs(x) < 5 else (x, np.sign(y) * rng.uniform(7.8, 8.4))
        else:
            x, y = (11.2 if along < 3 else -11.8), rng.uniform(-8, 7)
        put(x, y, size, size, size, 5)
        if rng.uniform() < 0.3:
            put(x + 0.1, y + 0.1, size * 0.7, size * 0.7, size * 0.7, 5, size)
    return boxes


@dataclass(frozen=True)
class Camera:
    """Of the picture before it is made smaller."""

    R: Floats  # to the world; (3, 3), or of each row of a rolling shutter, (h, 3, 3)
    p: Floats  # (3,) or (h, 3)
    width: int = WIDTH * OVERSAMPLED
    height: int = HEIGHT * OVERSAMPLED
    focal: float = FOCAL * OVERSAMPLED

    def rays(self) -> Floats:
        """(h, w, 3), in the world, of depth 1."""
        u, v = np.meshgrid(
            np.arange(self.width, dtype=np.float32), np.arange(self.height, dtype=np.float32)
        )
        x, y = (u - (self.width - 1) / 2) / self.focal, (v - (self.height - 1) / 2) / self.focal
        return np.asarray(
            np.stack((x, y, np.ones_like(u)), axis=-1) @ self.R.swapaxes(-1, -2), np.float32
        )

    def eyes(self) -> Floats:
        """(h, 1, 3), in the world: whence each row is seen."""
        return np.broadcast_to(self.p, (self.height, 3))[:, None]

    def window_of(self, face: Face) -> tuple[slice, slice] | None:
        """The part of the picture in which a face may be seen."""
        if self.p.ndim > 1:
            return slice(None), slice(None)
        corners = np.empty((4, 3), np.float32)
        corners[:, face.axis] = face.at
        corners[:, face.others] = [
            (a, b) for a in (face.low[0], face.high[0]) for b in (face.low[1], face.high[1])
        ]
        q = (corners - self.p) @ self.R
        if (q[:, 2] <= 0.05).all():
            return None
        if (q[:, 2] <= 0.05).any():
            return slice(None), slice(None)
        size = np.array([self.width, self.height])
        seen = q[:, :2] / q[:, 2:] * self.focal + (size - 1) / 2
        low = np.clip(np.floor(seen.min(axis=0)), 0, size).astype(int)
        high = np.clip(np.ceil(seen.max(axis=0)) + 1, 0, size).astype(int)
        return (slice(low[1], high[1]), slice(low[0], high[0])) if (high > low).all() else None


class Street:
    """The scene, with its light laid on it once."""

    def __init__(self) -> None:
        rng = np.random.default_rng(1)
        walls = ((0.62, 0.33, 0.25), (0.80, 0.74, 0.62), (0.66, 0.50, 0.38), (0.58, 0.62, 0.62))
        textures = [paving(rng)]
        textures += [facade(rng, np.float32(wall), k in (0, 2)) for k, wall in enumerate(walls)]
        textures += [planks(rng)]
        self.levels = [mipmap(texture) for texture in textures]
        self.stains = 1.0 + 0.10 * noise(rng, (512, 512), 14) + 0.05 * noise(rng, (512, 512), 5)
        self.clouds = noise(rng, (512, 512), 40) + 0.5 * noise(rng, (512, 512), 14)
        self.boxes = block()
        ground = Face(2, 0.0, 1.0, np.float32([-19, -16]), np.float32([19, 16]), 0)
        self.faces = [ground, *(face for box in self.boxes for face in faces_of(box))]
        for face in self.faces:
            face.light = self._light_on(face)

    def _light_on(self, face: Face) -> Floats:
        """(h, w, 2): how much sun and how much sky there is."""
        points = face.points()
        normal = np.zeros(3)
        normal[face.axis] = face.outwards
        sun = np.full(points.shape[:2], max(float(normal @ SUN), 0.0))
        sky = np.full(points.shape[:2], 0.75 + 0.25 * normal[2])
        sky *= 1 - 0.45 * np.exp(-points[..., 2] / 0.35) * (face.axis != 2)
        for box in self.boxes:
            if sun.any():
                sun[hits(points, SUN, box)] = 0
            if face.axis == 2 and box.low[2] == 0:  # it is darker at the foot of a wall
                gap = np.maximum(
                    np.maximum(box.low[:2] - points[..., :2], points[..., :2] - box.high[:2]), 0
                )
                sky *= 1 - 0.5 * np.exp(-np.linalg.norm(gap, axis=-1) / 0.5)
        return np.stack((cv2.GaussianBlur(sun, (0, 0), 0.7), sky), axis=-1).astype(np.float32)

    def picture(self, R_WC: Floats, p_WC: Floats, rng: np.random.Generator) -> NDArray[np.uint8]:
        """(HEIGHT, WIDTH, 3), RGB; a pose for all, or one for each row before it is made smaller."""
        camera = Camera(np.float32(R_WC), np.float32(p_WC))
        rays = camera.rays()
        depth, which = (
            np.full(rays.shape[:2], np.inf, np.float32),
            np.full(rays.shape[:2], -1, np.int16),
        )
        for k, face in enumerate(self.faces):
            if ((camera.p[..., face.axis] - face.at) * face.outwards > 0).all():
                self._cover(k, face, camera, rays, depth, which)
        out = np.empty((*depth.shape, 3), np.float32)
        if (which < 0).any():
            out[which < 0] = self._sky(rays[which < 0])
        for k in np.unique(which[which >= 0]):
            seen = which == k
            points = np.broadcast_to(camera.eyes(), rays.shape)[seen] + depth[seen, None] * rays[seen]
            out[seen] = self._shade(self.faces[k], camera, points, rays[seen], depth[seen])
        small = cv2.resize(out, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
        bright = 255 * np.clip(small, 0, 1) ** (1 / 1.6) + rng.normal(0, NOISE, small.shape)
        return np.clip(np.round(bright), 0, 255).astype(np.uint8)

    @staticmethod
    def _cover(
        k: int, face: Face, camera: Camera, rays: Floats, depth: Floats, which: Shorts
    ) -> None:
        window = camera.window_of(face)
        if window is None:
            return
        rays, eye = rays[window], camera.eyes()[window[0]]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            t = (face.at - eye[..., face.axis]) / rays[..., face.axis]
            ahead = (t > 0.05) & (t < depth[window])
            for i, low, high in zip(face.others, face.low, face.high, strict=True):
                x = eye[..., i] + t * rays[..., i]
                ahead &= (x >= low) & (x <= high)
        depth[window][ahead], which[window][ahead] = t[ahead], k

    def _shade(
        self, face: Face, camera: Camera, points: Floats, rays: Floats, t: Floats
    ) -> Floats:
        a, b = (points[:, i] for i in face.others)
        texture = self.levels[face.texture]
        metres = texture[0].shape[0] / TEXELS_PER_M
        across, up = (a, b) if face.axis != 2 else (b, a)
        tilt = np.maximum(abs(rays[:, face.axis]) / np.linalg.norm(rays, axis=1), 0.05)
        level = np.log2(np.maximum(t / camera.focal * TEXELS_PER_M / np.sqrt(tilt), 1))
        colour = sampled_levels(texture, across / metres, -up / metres, level)
        place = (across * 0.11 + face.at * 0.37) % 1, (up * 0.11 + face.axis * 0.31) % 1
        colour = colour * bilinear(self.stains[..., None], *place)
        lit = bilinear_clamped(
            face.light, (a - face.low[0]) * LIGHT_PER_M, (b - face.low[1]) * LIGHT_PER_M
        )
        colour = colour * (lit[:, :1] * SUN_LIGHT + lit[:, 1:] * SKY_LIGHT)
        haze = 1 - np.exp(-t / HAZE_M)[:, None]
        return np.asarray(colour * (1 - haze) + HAZE * haze, np.float32)

    def _sky(self, rays: Floats) -> Floats:
        up = np.maximum(rays[:, 2], 0)
        steep = np.minimum(up / np.linalg.norm(rays, axis=1), 1)[:, None]
        blue = np.float32([0.72, 0.80, 0.90]) * (1 - steep) + np.float32([0.28, 0.47, 0.78]) * steep
        place = (rays[:, i] / (up + 0.4) * 0.3 for i in (0, 1))
        cloud = np.clip(bilinear(self.clouds[..., None], *place) * 0.35, 0, 0.8)
        return np.asarray(blue * (1 - cloud) + 0.95 * cloud, np.float32)


def faces_of(box: Box) -> list[Face]:
    """All but the one on the ground."""
    out = []
    for axis in range(3):
        others = [i for i in range(3) if i != axis]
        for side, outwards in ((box.low, -1.0), (box.high, 1.0)):
            if not (axis == 2 and outwards < 0):
                out.append(
                    Face(
                        axis,
                        float(side[axis]),
                        outwards,
                        box.low[others],
                        box.high[others],
                        box.texture,
                    )
                )
    return out


def hits(points: Floats, direction: Floats, box: Box) -> NDArray[np.bool_]:
    """Whether the ray from each point meets the box."""
    near, far = np.zeros(points.shape[:2]), np.full(points.shape[:2], np.inf)
    for i in range(3):
        a, b = (
            (box.low[i] - points[..., i]) / direction[i],
            (box.high[i] - points[..., i]) / direction[i],
        )
        near, far = np.maximum(near, np.minimum(a, b)), np.minimum(far, np.maximum(a, b))
    return near < far - 1e-3


def mipmap(texture: Floats) -> list[Floats]:
    """Each level half as large as the one before it."""
    levels = [texture]
    while min(levels[-1].shape[:2]) > 6:
        small = tuple(n // 2 for n in levels[-1].shape[1::-1])
        levels.append(cv2.resize(levels[-1], small, interpolation=cv2.INTER_AREA))
    return levels


def bilinear(texture: Floats, x: Floats, y: Floats) -> Floats:
    """At x, y (n,) in widths and heights of a texture that goes on at its edges; (n, channels)."""
    h, w = texture.shape[:2]
    n, columns = len(x), 256  # OpenCV wants an image of places
    places = [np.zeros(-(-n // columns) * columns, np.float32) for _ in range(2)]
    places[0][:n], places[1][:n] = x % 1 * w - 0.5, y % 1 * h - 0.5
    grid = (place.reshape(-1, columns) for place in places)
    found = cv2.remap(texture, *grid, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    return np.asarray(found.reshape(len(places[0]), -1)[:n])


def bilinear_clamped(texture: Floats, x: Floats, y: Floats) -> Floats:
    """At x, y in texels; the edges go on."""
    h, w = texture.shape[:2]
    return bilinear(texture, (np.clip(x, 0, w - 1) + 0.5) / w, (np.clip(y, 0, h - 1) + 0.5) / h)


def sampled_levels(levels: list[Floats], x: Floats, y: Floats, level: Floats) -> Floats:
    """Of the level that suits the distance, mixed with the next one."""
    low = np.clip(level.astype(int), 0, len(levels) - 1)
    share = np.clip(level - low, 0, 1)[:, None]
    out = np.empty((len(x), 3), np.float32)
    for k in np.unique(low):
        at = low == k
        next_one = levels[min(k + 1, len(levels) - 1)]
        fine, coarse = bilinear(levels[k], x[at], y[at]), bilinear(next_one, x[at], y[at])
        out[at] = fine * (1 - share[at]) + coarse * share[at]
    return out
