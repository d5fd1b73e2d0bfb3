"""Rays are laid through fractal shells: over which places they pass, and through which
noise.

What is compiled is shared by as many clouds as can be: each takes a second.
"""

import functools as ft
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from cloudjax.geometry.arrays import HostArray, namespace
from cloudjax.geometry.geodesy import angles_of, vertical
from cloudjax.geometry.on_host import compiled_for_many
from cloudjax.geometry.path import path_parts, points_along
from cloudjax.geometry.rays import Rays
from cloudjax.geometry.shells import Chords
from cloudjax.weather.advection import DisplacementMap
from cloudjax.weather.drift import drift_m, strain
from cloudjax.weather.masks import AbstractMask

from .fractal_path import FractalPath


@compiled_for_many("knots", handed_over=True)
def at_knots(rays: Rays, chord: Chords, knots: int) -> tuple[Any, ...]:
    """Find ways from the entry to further knots [m]; verticals and altitudes of the
    knots; widths of the pixels; and what `path_from` makes a path of.
    """
    xp = namespace(rays.direction)
    first, *further = points_along(rays, chord, knots)
    change = xp.stack([point - first for point in further], axis=-1)[:, None]
    upward, altitude = vertical(xp.stack([first, *further], axis=-2))
    width = rays.pixel_rad * xp.maximum(chord.entry_m + chord.length_m / 2, 1.0)
    parts = path_parts(rays, chord, upward[:, 0], altitude[:, 0])
    return change, upward, altitude, width, parts


@compiled_for_many(handed_over=True)
def in_noise(
    position_m: Float[HostArray, "rays 3"],
    per_m: Float[HostArray, "read 3 3"],
    shifts: Float[HostArray, "read 3"],
) -> Float[HostArray, "rays read 3"]:
    """Find where positions are in the noise of each rung: in periods, from 0 to 1."""
    xp = namespace(position_m)
    place = xp.einsum("oab,rb->roa", per_m, position_m) + shifts[None]
    return place - xp.floor(place)


@compiled_for_many(exact=False)
def masked(
    upward: Float[HostArray, "rays knots 3"], mask: AbstractMask | None
) -> Float[HostArray, "rays knots"]:
    """Read masks where verticals are.

    It is compiled once for all of one structure, and in the precision of verticals on
    the device, which tells places to a metre or two.
    """
    if mask is None:
        return namespace(upward).zeros(upward.shape[:-1])
    found: Any = mask(*angles_of(upward))
    return found


def blown(
    way: FractalPath,
    maps: Sequence[DisplacementMap | None],
    upward: Float[Array, "rays knots 3"],
    altitude_m: Float[Array, "rays knots"],
    per_m: Float[Array, "read 3 3"],
    ladders: tuple[int, ...],
    *,
    strains: bool,
) -> FractalPath:
    """Lead a way through noise that the wind has drawn.

    **Arguments:** `maps`: of each ladder; `per_m`, `ladders`: of the rungs that are
    read; `strains`: whether it is asked how the wind has strained the air.
    """
    each = {id(m): _drawn(m, upward, altitude_m, strains) for m in maps}
    drifts, strained = zip(*(each[id(m)] for m in maps), strict=True)
    return _drifted(way, drifts, strained if strains else None, per_m, ladders)


@eqx.filter_jit
def _drawn(
    displacement: DisplacementMap | None,
    upward: Float[Array, "rays knots 3"],
    altitude_m: Float[Array, "rays knots"],
    strains: bool,
) -> tuple[Float[Array, "rays knots 3"], Float[Array, "rays 3 3"] | None]:
    """How far the air of the knots has come, and its strain; still air without a map.

    Compiled once for all maps: with those of a cloud in one function each cloud takes
    ten seconds.
    """
    if displacement is None:
        calm = jnp.broadcast_to(jnp.eye(3), (len(upward), 3, 3))
        return 0 * upward, calm if strains else None
    moved = drift_m(upward, altitude_m, displacement)
    return moved, strain(upward[:, 0], displacement) if strains else None


@ft.partial(jax.jit, static_argnames="ladder_of")
def _drifted(
    way: FractalPath,
    drifts: tuple[Float[Array, "rays knots 3"], ...],
    strains: tuple[Float[Array, "rays 3 3"], ...] | None,
    frames: Float[Array, "read 3 3"],
    ladder_of: tuple[int, ...],
) -> FractalPath:
    """A way whose air came from elsewhere, by the drift of each ladder."""
    drift = jnp.stack(drifts, axis=1)
    start, further = drift[:, :, 0], drift[:, :, 1:] - drift[:, :, :1]
    moved = [
        # Written out: products of small matrices are not fused with what follows.
        sum(frame[None, :, axis] * start[:, ladder, axis, None] for axis in range(3))
        for frame, ladder in zip(frames, ladder_of, strict=True)
    ]
    entry = way.entry + jnp.stack(moved, axis=1) if moved else way.entry
    return replace(
        way,
        entry=entry - jnp.floor(entry),
        change_m=way.change_m + jnp.moveaxis(further, 2, 3),
        strain=None if strains is None else jnp.stack(strains, axis=1),
    )
