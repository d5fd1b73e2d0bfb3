"""numba: rays in parallel, a scalar loop over the steps of each."""

import math

import numba
import numpy as np

from .work import ECCENTRICITY2, EQUATOR_M, POLE_M, Work


def prepare(work: Work):
    scene, light = arguments(work), (work.clouds.extinction_per_m, work.indirect)
    return lambda: shade_all(march(*scene), *light)


def arguments(work: Work) -> tuple:
    """Of `march`."""
    c = work.clouds
    shape = [c.mask_gain, c.threshold, c.base_m, c.top_m, c.barrier_scale_m, *c.weight]
    return (
        work.origin_m,
        work.direction,
        work.sun,
        work.steps,
        *c.voxels,
        np.array(c.period_m),
        np.array(shape),
        c.mask.values,
        np.array([*c.mask.first_deg, *c.mask.step_deg]),
        np.array([c.bottom_m, c.ceiling_m]),
    )


@numba.njit(parallel=True, fastmath=True)
def march(origin, direction, sun, steps, a, b, c, period, shape, mask, axes, shell):
    """Way through cloud, n·s and altitude of the first surface, height of the sun.

    Shape [4 rays]; 0 where there is no cloud.
    """
    found = np.zeros((4, len(direction)), np.float32)
    for ray in numba.prange(len(direction)):
        dx, dy, dz = direction[ray]
        entry, length = chord(origin, dx, dy, dz, shell[0], shell[1])
        if length <= 0:
            continue
        x0, y0, z0 = (
            origin[0] + entry * dx,
            origin[1] + entry * dy,
            origin[2] + entry * dz,
        )
        segment, count, first = length / steps, 0, -1.0
        for k in range(steps):
            s = (k + 0.5) * segment
            x, y, z = x0 + s * dx, y0 + s * dy, z0 + s * dz
            sin_φ, cos_φ, altitude = geodetic(x, y, z)
            latitude = math.degrees(math.atan2(sin_φ, cos_φ))
            longitude = math.degrees(math.atan2(y, x))
            value = shape[0] * look_up(mask, axes, latitude, longitude) - shape[1]
            value -= math.exp((shape[2] - altitude) / shape[4])
            value -= math.exp((altitude - shape[3]) / shape[4])
            value += shape[5] * sample(a, x / period[0], y / period[0], z / period[0])
            value += shape[6] * sample(b, x / period[1], y / period[1], z / period[1])
            value += shape[7] * sample(c, x / period[2], y / period[2], z / period[2])
            if value > 0:
                count += 1
                if first < 0:
                    first = s
        if count > 0:
            x, y, z = x0 + first * dx, y0 + first * dy, z0 + first * dz
            nx, ny, nz = outward(x, y, z, a, b, c, period, shape)
            found[0, ray] = count * segment
            found[1, ray] = nx * sun[0] + ny * sun[1] + nz * sun[2]
            found[2, ray] = geodetic(x, y, z)[2]
            found[3, ray] = sun_height(x0, y0, z0, sun)
    return found


@numba.njit(parallel=True, fastmath=True)
def shade_all(found, extinction_per_m, indirect):
    """Reflectance factors of all rays."""
    seen = np.zeros(found.shape[1], np.float32)
    for ray in numba.prange(len(seen)):
        depth, cosine, _, height = found[:, ray]
        seen[ray] = shade(extinction_per_m * depth, cosine, height, indirect)
    return seen


@numba.njit(fastmath=True)
def chord(origin, dx, dy, dz, bottom_m, ceiling_m):
    """Entry into the shell and way through it; 0 for rays that miss."""
    near, far, hit = intersect(origin, dx, dy, dz, ceiling_m)
    floor, _, hit_floor = intersect(origin, dx, dy, dz, bottom_m)
    if not hit:
        return near, 0.0
    return near, (floor if hit_floor else far) - near


@numba.njit(fastmath=True)
def intersect(origin, dx, dy, dz, altitude_m):
    a = EQUATOR_M + altitude_m
    squash = a / (POLE_M + altitude_m)
    ox, oy, oz = origin[0] / a, origin[1] / a, origin[2] / a * squash
    dz = dz * squash
    square = dx * dx + dy * dy + dz * dz
    closest = -(ox * dx + oy * dy + oz * dz) / square
    x, y, z = ox + closest * dx, oy + closest * dy, oz + closest * dz
    miss2 = x * x + y * y + z * z
    half = math.sqrt(max(1 - miss2, 0.0) / square)
    return (closest - half) * a, (closest + half) * a, miss2 < 1


@numba.njit(fastmath=True)
def geodetic(x, y, z):
    """Sine and cosine of the latitude, altitude; one round of Bowring's."""
    ρ = math.sqrt(x * x + y * y)
    sin_β, cos_β = unit(z * EQUATOR_M, ρ * POLE_M)
    lift = ECCENTRICITY2 * EQUATOR_M**2 / POLE_M
    sin_φ, cos_φ = unit(z + lift * sin_β**3, ρ - ECCENTRICITY2 * EQUATOR_M * cos_β**3)
    sin_β, cos_β = unit(POLE_M * sin_φ, EQUATOR_M * cos_φ)
    altitude = (ρ - EQUATOR_M * cos_β) * cos_φ + (z - POLE_M * sin_β) * sin_φ
    return sin_φ, cos_φ, altitude


@numba.njit(fastmath=True)
def unit(a, b):
    norm = math.sqrt(a * a + b * b)
    return a / norm, b / norm


@numba.njit(fastmath=True)
def look_up(mask, axes, latitude_deg, longitude_deg):
    rows, columns = mask.shape
    row = min(max((latitude_deg - axes[0]) / axes[2], 0.0), rows - 1.0)
    column = ((longitude_deg - axes[1]) / axes[3]) % columns
    i, j = min(int(row), rows - 2), int(column) % columns
    f, g, east = row - i, column - int(column), (j + 1) % columns
    south = mask[i, j] + g * (mask[i, east] - mask[i, j])
    north = mask[i + 1, j] + g * (mask[i + 1, east] - mask[i + 1, j])
    return south + f * (north - south)


@numba.njit(fastmath=True)
def cell(u, n):
    scaled = (u - math.floor(u)) * n
    low = min(int(scaled), n - 1)
    return low, low + 1 if low + 1 < n else 0, scaled - low


@numba.njit(fastmath=True)
def sample(voxels, u, v, w):
    n = len(voxels)
    i, i1, f = cell(u, n)
    j, j1, g = cell(v, n)
    k, k1, h = cell(w, n)
    low, high = voxels[i], voxels[i1]
    near = low[j, k] + h * (low[j, k1] - low[j, k])
    far = low[j1, k] + h * (low[j1, k1] - low[j1, k])
    below = near + g * (far - near)
    near = high[j, k] + h * (high[j, k1] - high[j, k])
    far = high[j1, k] + h * (high[j1, k1] - high[j1, k])
    return below + f * (near + g * (far - near) - below)


@numba.njit(fastmath=True)
def rise(voxels, u, v, w):
    """Gradient of the interpolant per period."""
    n = len(voxels)
    step = 1e-3 / n
    return (
        (sample(voxels, u + step, v, w) - sample(voxels, u - step, v, w)) / (2 * step),
        (sample(voxels, u, v + step, w) - sample(voxels, u, v - step, w)) / (2 * step),
        (sample(voxels, u, v, w + step) - sample(voxels, u, v, w - step)) / (2 * step),
    )


@numba.njit(fastmath=True)
def outward(x, y, z, a, b, c, period, shape):
    """The normal of the level set."""
    sin_φ, cos_φ, altitude = geodetic(x, y, z)
    ρ = math.sqrt(x * x + y * y)
    barrier = math.exp((shape[2] - altitude) / shape[4])
    barrier = (barrier - math.exp((altitude - shape[3]) / shape[4])) / shape[4]
    nx, ny, nz = -barrier * cos_φ * x / ρ, -barrier * cos_φ * y / ρ, -barrier * sin_φ
    for i, voxels in enumerate((a, b, c)):
        p = period[i]
        rx, ry, rz = rise(voxels, x / p, y / p, z / p)
        m = shape[5 + i] / p
        nx, ny, nz = nx - m * rx, ny - m * ry, nz - m * rz
    norm = max(math.sqrt(nx * nx + ny * ny + nz * nz), 1e-12)
    return nx / norm, ny / norm, nz / norm


@numba.njit(fastmath=True)
def sun_height(x, y, z, sun):
    z *= (EQUATOR_M / POLE_M) ** 2
    return (x * sun[0] + y * sun[1] + z * sun[2]) / math.sqrt(x * x + y * y + z * z)


@numba.njit(fastmath=True)
def shade(τ, cosine, height, indirect):
    """Section 2.3: the slab of eqs (3) with a Lambertian surface, and eq. (5)."""
    if height <= 0:
        return 0.0
    reflected = τ / (1 + τ)
    transmitted = 1 / (1 + τ) - math.exp(-τ)
    direct = max(cosine, 0.0) * reflected + max(-cosine, 0.0) * transmitted
    return (1 - indirect) * direct + indirect * height * reflected
