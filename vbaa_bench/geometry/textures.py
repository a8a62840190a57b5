"""Textures: reflectances that vary over a flat sheet, a body or a beam. Lengths are [m]."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from solver.instrument.arrays import Floats
from vbaa_bench.geometry.mesh import Mesh, mesh_of

# Size of a texel, as a fraction of the correlation length.
TEXEL = 1 / 8
MAX_TEXELS = 2048
_MAX_BEAM_TEXELS = 8192


@dataclass(frozen=True)
class Texture:
    """Reflectances `image` (height, width) and their texture coordinates `uv` (vertices, 2).

    The image spans 0..1 in u along its rows and in v along its columns. Outside it is continued by
    its border values, or repeated. `gloss` (height, width) are factors of the specular reflectance,
    from 0 to 1. On a beam, `uv` is empty: its coordinates are arc length [mm] times `per_mm` and
    the place around it, from 0 to 1.
    """

    image: Floats
    uv: Floats
    repeated: bool = False
    gloss: Floats | None = None
    per_mm: float = 1.0


def gradient_texture(
    places: Floats, near: float, far: float, azimuth: float, length: float
) -> Texture:
    """Create a linear gradient of reflectance from `near` to `far` along `azimuth` [rad].

    It extends over `length`, centred on the origin of `places` (n, 2), and is constant beyond.
    """
    fraction = 0.5 + places @ np.array([np.cos(azimuth), np.sin(azimuth)]) / length
    # A bilinear texture is linear between the centres of two texels.
    uv = np.column_stack([0.25 + 0.5 * fraction, np.full(len(places), 0.5)])
    return Texture(np.array([[near, far]]), uv)


def random_texture(
    places: Floats,
    mean: float,
    contrast: float,
    correlation: tuple[float, float],
    extent: float,
    random: np.random.Generator,
) -> Texture:
    """Create a random texture at `places` (n, 2) that repeats after `extent`.

    The logarithm of reflectance is a Gaussian field whose correlation at a distance (x, y) is
    exp(-r), r^2 = (x/a)^2 + (y/b)^2, with `correlation` (a, b). It has grain of every size up to
    these lengths, like natural and cast materials. Reflectance has the given `mean`; `contrast` is
    its standard deviation over its mean. It is clipped at 1.
    """
    texels = np.array(correlation) * TEXEL
    # The size is limited to MAX_TEXELS texels: the finest textures repeat sooner.
    columns, rows = np.minimum(np.ceil(extent / texels), MAX_TEXELS).astype(int)
    field = gaussian_field((rows, columns), texels, correlation, random)
    spread = np.sqrt(np.log1p(contrast**2))
    image = mean * np.exp(spread * field - spread**2 / 2)
    return Texture(np.minimum(image, 1.0), places / (texels * [columns, rows]), repeated=True)


def image_texture(places: Floats, image: Floats, mean: float, width: float) -> Texture:
    """Repeat an image (height, width), `width` wide, over `places` (n, 2), upright along +y.

    Its relative reflectances are scaled to the given `mean`, and clipped at 1.
    """
    size = np.array([width, width * image.shape[0] / image.shape[1]])
    # The first row of a texture is at v = 0.
    return Texture(np.minimum(mean * image[::-1], 1.0), places / size + 0.5, repeated=True)


def gaussian_field(
    shape: tuple[int, int],
    texels: Floats,
    correlation: tuple[float, float],
    random: np.random.Generator,
) -> Floats:
    """Draw a periodic Gaussian field (rows, columns) with mean 0 and standard deviation 1.

    `texels` (2,) are the sizes of a texel in x and y, in the unit of the `correlation` (a, b).
    """
    rows, columns = shape
    # White noise is multiplied by the square root of the spectrum of exp(-r), which is
    # (1 + (2 pi f)^2)^(-3/2).
    fx, fy = np.fft.rfftfreq(columns, texels[0]), np.fft.fftfreq(rows, texels[1])
    a, b = correlation
    squared = (2 * np.pi) ** 2 * ((a * fx[None, :]) ** 2 + (b * fy[:, None]) ** 2)
    amplitude = (1 + squared) ** -0.75
    noise = np.fft.rfft2(random.standard_normal((rows, columns)))
    field = np.fft.irfft2(noise * amplitude, s=(rows, columns))
    return np.asarray((field - field.mean()) / field.std())


@dataclass(frozen=True)
class Grime:
    """Smudges, dust and uneven gloss of a surface.

    Reflectance varies with the standard deviation `smudge_contrast` over its mean, with the
    correlation length `smudge` [m]; `dust_cover` of the surface has specks of about the size
    `dust` [m] with `dust_reflectance`, which do not shine. Elsewhere the gloss varies evenly
    between 1 - `uneven_gloss` and 1 of the paint's, over the length of smudges.
    """

    smudge_contrast: float
    smudge: float
    dust_cover: float
    dust: float
    dust_reflectance: float
    uneven_gloss: float


def grime_texture(
    grime: Grime, reflectance: float, length: float, girth: float, random: np.random.Generator
) -> Texture:
    """Create the texture of a beam of a `length` and `girth` whose paint has a `reflectance`.

    Its columns run along the beam, its rows around one half of it, which the other half mirrors.
    """
    texel = grime.dust / 3
    # Twice the half, of which one is kept, because the field repeats.
    columns = min(max(math.ceil(length / texel), 64), _MAX_BEAM_TEXELS)
    rows = min(max(math.ceil(girth / texel), 8), 256)
    shape, texels = (rows, columns), np.array([length / columns, girth / rows])
    smudge_lengths = (grime.smudge, min(grime.smudge, girth))
    smudges, gloss = (gaussian_field(shape, texels, smudge_lengths, random) for _ in range(2))
    specks = gaussian_field(shape, texels, (grime.dust, grime.dust), random)
    dusty = specks > np.quantile(specks, 1 - grime.dust_cover)
    spread = np.sqrt(np.log1p(grime.smudge_contrast**2))
    image = reflectance * np.exp(spread * smudges - spread**2 / 2)
    image = np.where(dusty, grime.dust_reflectance, np.minimum(image, 1.0))
    shine = np.where(dusty, 0.0, 1 - grime.uneven_gloss * ndtr(gloss))
    half = slice(0, (rows + 1) // 2)
    return Texture(image[half], np.empty((0, 2)), gloss=shine[half], per_mm=1e-3 / length)


def texel_each(bodies: Sequence[Mesh], reflectances: Floats) -> Texture:
    """Give each of several bodies, which are joined to one mesh in this order, its reflectance."""
    centres = (np.arange(len(bodies)) + 0.5) / len(bodies)
    u = np.repeat(centres, [len(mesh.vertices) for mesh in bodies])
    return Texture(reflectances[None, :], np.column_stack([u, np.full(len(u), 0.5)]))


def unshared(mesh: Mesh) -> Mesh:
    """Give every face its own three vertices, so that faces can have different coordinates."""
    faces = np.arange(3 * len(mesh.faces)).reshape(-1, 3)
    return mesh_of(np.asarray(mesh.vertices)[mesh.faces.ravel()], faces)


def box_mapped(mesh: Mesh) -> Floats:
    """Compute places (3 faces, 2) [m] of the vertices of `unshared(mesh)` on a flat sheet.

    A face that faces z most has x and y, one that faces y has x and z, one that faces x y and z.
    """
    corners = np.asarray(mesh.vertices)[mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    axes = np.array([[1, 2], [0, 2], [0, 1]])[np.abs(across).argmax(axis=1)]
    return np.asarray(np.take_along_axis(corners, axes[:, None, :], axis=2).reshape(-1, 2))
