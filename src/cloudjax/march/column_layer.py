"""Layers of clouds that a model or particles give, of known water and ice."""

from collections.abc import Sequence

import jax.numpy as jnp

from cloudjax.clouds.columns import AbstractColumns, ColumnCloud
from cloudjax.clouds.detailed_columns import DetailedColumns
from cloudjax.clouds.kernels import KernelCloud
from cloudjax.clouds.source import AbstractCloudSource
from cloudjax.light.cloud_optics import ParticleOptics
from cloudjax.light.optics import Particles, radius_limits_um

from .scene import Layer


def column_layer(
    cloud: ColumnCloud,
    *,
    sunlit: Sequence[int] = (),
    thermal: Sequence[int] = (),
    steps: int = 24,
    extinction_share: float = 1.0,
    ready: bool = False,
    detail_m: float | None = None,
    seed: int = 0,
    name: str | None = None,
) -> Layer:
    """Make the layer of a model's water, or of its ice, for the bands of a scene.

    Extinction follows each cell's content and radius; co-albedo, asymmetry and what
    depends on the band are of particles of the mean radius.

    **Arguments:**

    - `sunlit`, `thermal`: numbers of the bands that see the sun, and of those that
      emit, as the scene lists them.
    - `steps`: of the march through the shell.
    - `extinction_share`: as of `class_layer`.
    - `ready`: find optical depths once, for renders that need no derivatives by
      content and radius.
    - `detail_m`, `seed`: the shortest wave of fractal detail below the columns, as of
      `DetailedColumns`, and by which it is drawn; None for no detail.
    - `name`: of the layer; by default the phase.

    **Raises:** `ValueError` for detail that is coarser than the columns.
    """
    columns: AbstractColumns = cloud.ready() if ready else cloud
    source: AbstractCloudSource = columns
    if detail_m is not None:
        source = DetailedColumns.of(columns, detail_m, seed=seed)
    return _layer(
        source,
        cloud.extinction_per_m,
        Particles(cloud.phase, jnp.asarray(cloud.mean_radius_um(), float)),
        sunlit=sunlit,
        thermal=thermal,
        steps=steps,
        share=extinction_share,
        name=cloud.phase if name is None else name,
    )


def kernel_layer(
    cloud: KernelCloud,
    particles: Particles,
    *,
    sunlit: Sequence[int] = (),
    thermal: Sequence[int] = (),
    steps: int = 24,
    extinction_share: float = 1.0,
    name: str | None = None,
) -> Layer:
    """Make the layer of Gaussian kernels, for the bands of a scene.

    **Arguments:** `particles`: droplets or ice; the others as of `column_layer`.
    """
    return _layer(
        cloud,
        cloud.extinction_per_m,
        particles,
        sunlit=sunlit,
        thermal=thermal,
        steps=steps,
        share=extinction_share,
        name=particles.phase if name is None else name,
    )


def _layer(
    source: AbstractCloudSource,
    extinction_per_m: float,
    particles: Particles,
    *,
    sunlit: Sequence[int],
    thermal: Sequence[int],
    steps: int,
    share: float,
    name: str,
) -> Layer:
    """The layer of a source whose occupancies refer to a physical extinction."""
    radius = jnp.clip(
        jnp.asarray(particles.effective_radius_um, float),
        *radius_limits_um(particles.phase),
    )
    return Layer(
        cloud=source,
        extinction_per_m=jnp.asarray(share * extinction_per_m, float),
        optics=ParticleOptics(
            Particles(particles.phase, radius),
            sunlit=tuple(sunlit),
            thermal=tuple(thermal),
            share=share,
        ),
        name=name,
        steps=steps,
    )
