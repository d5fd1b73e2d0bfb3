"""Dr.Jit, the compiler of Mitsuba 3, on a CPU: `Texture3f` and a symbolic loop."""

import drjit as dr
import numpy as np
from drjit.llvm import Array3f, Float, TensorXf, Texture3f, UInt32

from .work import ECCENTRICITY2, EQUATOR_M, POLE_M, Work


def prepare(work: Work):
    c = work.clouds
    textures = [
        # Texels are at the middles of cells, and the last axis of a tensor is the
        # first coordinate: `sample` below takes care of both.
        Texture3f(TensorXf(v[..., None]), wrap_mode=dr.WrapMode.Repeat)
        for v in c.voxels
    ]
    mask = Float(np.ascontiguousarray(c.mask.values).ravel())
    direction = Array3f(np.ascontiguousarray(work.direction.T))
    dr.eval(mask, direction)

    def run() -> np.ndarray:
        # Opaque numbers are arguments of the kernel: a change compiles nothing.
        def number(x):
            return dr.opaque(Float, float(x))

        p = {name: number(value) for name, value in _numbers(work).items()}
        seen = render(direction, textures, mask, p, work)
        dr.eval(seen)
        return seen.numpy()

    return run


def _numbers(work: Work) -> dict[str, float]:
    c = work.clouds
    names = (
        "mask_gain threshold base_m top_m barrier_scale_m bottom_m ceiling_m "
        "extinction_per_m"
    )
    found = {name: getattr(c, name) for name in names.split()}
    found |= {f"weight_{i}": m for i, m in enumerate(c.weight)}
    found |= {f"period_{i}": m for i, m in enumerate(c.period_m)}
    for i, axis in enumerate("xyz"):
        found[f"origin_{axis}"], found[f"sun_{axis}"] = work.origin_m[i], work.sun[i]
    return found | {"indirect": work.indirect}


def render(direction, textures, mask, p, work: Work):
    """Reflectance factors of all rays."""
    origin = Array3f(p["origin_x"], p["origin_y"], p["origin_z"])
    sun = Array3f(p["sun_x"], p["sun_y"], p["sun_z"])
    entry, length = chord(origin, direction, p["bottom_m"], p["ceiling_m"])
    start = dr.fma(direction, entry, origin)
    segment = length / work.steps
    steps = dr.opaque(UInt32, work.steps)

    def march(k, count, first):
        s = (Float(k) + 0.5) * segment
        position = dr.fma(direction, s, start)
        sin_φ, cos_φ, altitude = geodetic(position)
        latitude = dr.rad2deg(dr.atan2(sin_φ, cos_φ))
        longitude = dr.rad2deg(dr.atan2(position.y, position.x))
        value = p["mask_gain"] * look_up(mask, work, latitude, longitude)
        value += shape(position, altitude, textures, p)
        inside = value > 0
        first = dr.select(inside & (first < 0), s, first)
        return k + 1, count + dr.select(inside, 1, 0), first

    width = dr.width(direction)
    _, count, first = dr.while_loop(
        (dr.zeros(UInt32, width), dr.zeros(Float, width), dr.full(Float, -1, width)),
        lambda k, count, first: (k < steps) & (length > 0),
        march,
    )
    normal = outward(dr.fma(direction, first, start), textures, p)
    seen = shade(count * segment, dr.dot(normal, sun), sun_height(start, sun), p)
    return dr.select(count > 0, seen, 0)


def chord(origin, direction, bottom_m, ceiling_m):
    """Entry into the shell and way through it; 0 for rays that miss."""
    near, far, hit = intersect(origin, direction, ceiling_m)
    floor, _, hit_floor = intersect(origin, direction, bottom_m)
    return near, dr.select(hit, dr.select(hit_floor, floor, far) - near, 0)


def intersect(origin, direction, altitude_m):
    a = EQUATOR_M + altitude_m
    squash = Array3f(1, 1, a / (POLE_M + altitude_m))
    o, d = origin * squash / a, direction * squash
    square = dr.squared_norm(d)
    closest = -dr.dot(o, d) / square
    miss2 = dr.squared_norm(dr.fma(d, closest, o))
    half = dr.sqrt(dr.maximum(1 - miss2, 0) / square)
    return (closest - half) * a, (closest + half) * a, miss2 < 1


def geodetic(position):
    """Sine and cosine of the latitude, altitude; one round of Bowring's."""
    ρ, z = dr.hypot(position.x, position.y), position.z
    sin_β, cos_β = _unit(z * EQUATOR_M, ρ * POLE_M)
    lift = ECCENTRICITY2 * EQUATOR_M**2 / POLE_M
    sin_φ, cos_φ = _unit(
        z + lift * sin_β * sin_β * sin_β,
        ρ - ECCENTRICITY2 * EQUATOR_M * cos_β * cos_β * cos_β,
    )
    sin_β, cos_β = _unit(POLE_M * sin_φ, EQUATOR_M * cos_φ)
    altitude = (ρ - EQUATOR_M * cos_β) * cos_φ + (z - POLE_M * sin_β) * sin_φ
    return sin_φ, cos_φ, altitude


def _unit(a, b):
    scale = dr.rsqrt(a * a + b * b)
    return a * scale, b * scale


def look_up(mask, work: Work, latitude_deg, longitude_deg):
    grid = work.clouds.mask
    rows, columns = grid.values.shape
    row = (latitude_deg - grid.first_deg[0]) / grid.step_deg[0]
    row = dr.clip(row, 0, rows - 1)
    turn = (longitude_deg - grid.first_deg[1]) / (grid.step_deg[1] * columns)
    column = (turn - dr.floor(turn)) * columns
    i, j = dr.minimum(UInt32(row), rows - 2), dr.minimum(UInt32(column), columns - 1)
    f, g, east = row - Float(i), column - Float(j), (j + 1) % columns

    def at(i, j):
        return dr.gather(Float, mask, i * columns + j)

    south, north = (dr.lerp(at(r, j), at(r, east), g) for r in (i, i + 1))
    return dr.lerp(south, north, f)


def shape(position, altitude, textures, p):
    """Eq. (1) but for the mask."""
    h = p["barrier_scale_m"]
    value = -p["threshold"] - dr.exp((p["base_m"] - altitude) / h)
    value -= dr.exp((altitude - p["top_m"]) / h)
    for i, texture in enumerate(textures):
        place = _place(position / p[f"period_{i}"], texture)
        value += p[f"weight_{i}"] * texture.eval(place)[0]
    return value


def _place(u, texture):
    u = u - dr.floor(u)
    return Array3f(u.z, u.y, u.x) + 0.5 / texture.shape[0]


def outward(position, textures, p):
    """The normal of the level set, from the eight texels around the point."""
    sin_φ, cos_φ, altitude = geodetic(position)
    h = p["barrier_scale_m"]
    barrier = dr.exp((p["base_m"] - altitude) / h) - dr.exp((altitude - p["top_m"]) / h)
    level = cos_φ * dr.rsqrt(position.x * position.x + position.y * position.y)
    total = barrier / h * Array3f(position.x * level, position.y * level, sin_φ)
    for i, texture in enumerate(textures):
        n, period = texture.shape[0], p[f"period_{i}"]
        place = _place(position / period, texture)
        scaled = place * n - 0.5
        f = scaled - dr.floor(scaled)
        t = [texel[0] for texel in texture.eval_fetch(place)]
        along_x = [dr.lerp(t[2 * i], t[2 * i + 1], f.x) for i in range(4)]
        rise = [t[2 * i + 1] - t[2 * i] for i in range(4)]
        rise_x = dr.lerp(
            dr.lerp(rise[0], rise[1], f.y), dr.lerp(rise[2], rise[3], f.y), f.z
        )
        rise_y = dr.lerp(along_x[1] - along_x[0], along_x[3] - along_x[2], f.z)
        rise_z = dr.lerp(along_x[2] - along_x[0], along_x[3] - along_x[1], f.y)
        total += p[f"weight_{i}"] * n / period * Array3f(rise_z, rise_y, rise_x)
    return -total / dr.maximum(dr.norm(total), 1e-12)


def sun_height(start, sun):
    vertical = Array3f(start.x, start.y, start.z * (EQUATOR_M / POLE_M) ** 2)
    return dr.dot(vertical, sun) / dr.norm(vertical)


def shade(depth, cosine, height, p):
    """Section 2.3: the slab of eqs (3) with a Lambertian surface, and eq. (5)."""
    τ = p["extinction_per_m"] * depth
    reflected = τ / (1 + τ)
    transmitted = 1 / (1 + τ) - dr.exp(-τ)
    direct = dr.maximum(cosine, 0) * reflected + dr.maximum(-cosine, 0) * transmitted
    seen = (1 - p["indirect"]) * direct + p["indirect"] * height * reflected
    return dr.select(height > 0, seen, 0)
