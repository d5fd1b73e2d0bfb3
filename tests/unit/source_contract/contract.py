"""What every source of cloud promises (`clouds/source.py`), for all of them alike.

A new source is one more entry of `SOURCES`.
"""

import dataclasses
import functools as ft
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from cloudjax import (
    AbstractCloudSource,
    CoarseFields,
    EmittingSlabs,
    FractalCloud,
    GriddedCloud,
    LatLonGrid,
    PlaneParallel,
    Rays,
    Scene,
    Shadows,
    Shell,
    Slabs,
    look,
)
from cloudjax.clouds.columns import ColumnCloud
from cloudjax.clouds.detailed_columns import DetailedColumns
from cloudjax.clouds.kernels import KernelCloud
from cloudjax.geometry.column_grid import ColumnGrid
from cloudjax.geometry.geodesy import ecef
from cloudjax.geometry.map_projections import ConformalConic
from tests.helpers import (
    GEOSTATIONARY_M,
    FunctionMask,
    PlacesGround,
    TurnedAir,
    emissive_bands,
    fractal_cloud,
    ground_points,
    layer,
    limb_rays,
    make_scene,
    rays_to,
    reflective_bands,
    sun,
)


STEPS, RAYS = 5, 12
# Its sixteenth is a tile of few rays: as many as `look` samples at once, so that images
# and views share what is compiled.
TILE = 2048
SUN = sun(50.0)
NEAR = rays_to(GEOSTATIONARY_M, ground_points(RAYS, 20.0, 10.0, 0.08))


def _tilted(latitude_deg, longitude_deg):
    return (latitude_deg - 20) * 4


def _fractal() -> FractalCloud:
    return dataclasses.replace(
        fractal_cloud(nodes=3, smoothing=0.3),
        mask=FunctionMask(_tilted),
        displacements=(TurnedAir.by(2.0), None),
        fields=_fields(),
        extinction_growth=jnp.asarray(0.3),
    )


def _fields() -> CoarseFields:
    """Optical depth, top and roughness that rise to the north and the east."""
    axes = np.linspace(19.0, 21.0, 5), np.linspace(9.0, 11.0, 5)
    slope = (axes[0] - 20)[:, None] + 0.5 * (axes[1] - 10)[None]
    nodes = slope[..., None] * np.array([1.0, 600.0, 0.6])
    return CoarseFields(jnp.asarray(nodes, float), LatLonGrid.from_axes(*axes))


def _gridded(periodic: bool) -> GriddedCloud:
    """24 km wide, more than the rays are apart, with cells as wide as pixels."""
    values = np.random.default_rng(0).uniform(0.1, 0.9, (8, 8, 3))
    return GriddedCloud(
        density=jnp.asarray(values, float),
        shell=Shell(1000.0, 2200.0),
        corner_deg=(19.9, 9.9),
        spacing_m=(3000.0, 3000.0),
        periodic=periodic,
    )


def _columns() -> ColumnCloud:
    """Columns 3 km apart on a Lambert map, over rising ground, half covered."""
    rng = np.random.default_rng(1)
    own = ConformalConic.lambert(10.0, 30.0, 0.0)
    x, y = (float(v[0]) for v in own.project(np.array([19.9]), np.array([9.9])))
    grid = ColumnGrid(own, (x, y), (3e3, 3e3), (8, 9))
    ends = np.array([1000.0, 1150, 1500, 2200])[:, None, None]
    return ColumnCloud.of(
        grid,
        ends + 20 * np.arange(9) + np.zeros((8, 9)),
        "water",
        rng.uniform(0.01, 0.1, (3, 8, 9)),
        rng.uniform(6, 20, (3, 8, 9)),
        rng.uniform(0.3, 0.9, (3, 8, 9)),
        nodes=2,
    )


def _detailed() -> DetailedColumns:
    """Detail from 3 km down to 750 m, of which pixels leave a part."""
    return DetailedColumns.of(_columns(), 750.0, spread=0.4)


def _kernels() -> KernelCloud:
    """Blobs as wide as pixels, about the places that the rays look at."""
    rng = np.random.default_rng(2)
    latitude, longitude = 20 + rng.uniform(-0.1, 0.1, (2, 20)) * [[1], [1]]
    place = ecef(latitude, longitude - 10, rng.uniform(1500, 2500, 20))
    return KernelCloud.of(place, rng.uniform(2e7, 8e7, 20), rng.uniform(1e3, 3e3, 20))


SOURCES: dict[str, Callable[[], AbstractCloudSource]] = {
    "fractal": _fractal,
    "movable fractal": lambda: dataclasses.replace(
        _fractal(), movable=True, shell=Shell(100.0, 4e3)
    ),
    "gridded": ft.partial(_gridded, periodic=False),
    "periodic": ft.partial(_gridded, periodic=True),
    "kernels": _kernels,
    "columns": _columns,
    "detailed columns": _detailed,
    "ready columns": lambda: _columns().ready(),
}
# Whose tests take minutes, and that differ from columns by little.
SLOW = ("ready columns", "detailed columns")
# What depends on places and is read with them. Not parameters.
READ_WITH_PLACES = ("mask", "displacements", "fields")


def _paper_with_shadows(scene: Scene) -> Scene:
    return dataclasses.replace(scene, shadows=Shadows(2, points=3))


def _physical(scene: Scene) -> Scene:
    slabs = PlaneParallel.load()
    return dataclasses.replace(
        scene, reflection=Slabs(slabs), emission=EmittingSlabs(slabs)
    )


# What light does not depend on, and why.
LIGHTS = {
    "paper with shadows": (
        _paper_with_shadows,
        dict.fromkeys(
            (".optics.thermal_co_albedo", ".optics.thermal_asymmetry"),
            "cloud is taken for an absorber where the scene has no emission",
        ),
    ),
    "physical": (_physical, {}),
}
EACH_SOURCE = pytest.mark.parametrize(
    "source",
    [
        pytest.param(source, id=name, marks=[pytest.mark.slow] * (name in SLOW))
        for name, source in SOURCES.items()
    ],
)
EACH_LIGHT = pytest.mark.parametrize("light", LIGHTS.values(), ids=LIGHTS)


def scene_of(source, light=_paper_with_shadows) -> Scene:
    """The source below a cloud that is quick to compile, over uneven ground."""
    both = {
        "reflective": 2,
        "steps": STEPS,
        "asymmetry": [0.85, 0.8],
        "relative_extinction": [1.0, 1.1],
        "co_albedo": [0.01, 0.05],
        "thermal_co_albedo": [0.4],
        "thermal_asymmetry": [0.9],
    }
    above = GriddedCloud(
        density=jnp.asarray([[[0.2, 0.9], [0.7, 0.1]]]),
        shell=Shell(5e3, 7e3),
        corner_deg=(20.0, 10.0),
        spacing_m=(9e3, 9e3),
        periodic=True,
    )
    return light(
        make_scene(
            [
                layer(source(), name="tested", **both),
                layer(above, extinction_per_m=3e-4, name="above", **both),
            ],
            reflective_bands(1, 5),
            emissive_bands(13),
            ground=PlacesGround(),
        )
    )


def parameters_of(scene: Scene) -> list[str]:
    """Names of all arrays of the tested layer that are parameters."""
    named, _ = jax.tree_util.tree_flatten_with_path(scene.layers[0])
    return [
        jax.tree_util.keystr(path)
        for path, leaf in named
        if jnp.issubdtype(leaf.dtype, jnp.floating)
        and not any(
            f".{name}" in jax.tree_util.keystr(path) for name in READ_WITH_PLACES
        )
    ]


def moved_by(scene: Scene, names: list[str], x) -> Scene:
    """Each parameter moved by tenths of its values, each entry by a part of its own."""
    named, tree = jax.tree_util.tree_flatten_with_path(scene.layers[0])
    moved = []
    for path, leaf in named:
        name = jax.tree_util.keystr(path)
        if name in names:
            rng = np.random.default_rng(len(name))
            part = jnp.asarray(0.1 * rng.uniform(0.5, 1, leaf.shape), leaf.dtype)
            leaf = leaf * (1 + x[names.index(name)] * part)
        moved.append(leaf)
    own = jax.tree.unflatten(tree, moved)
    return dataclasses.replace(scene, layers=(own, *scene.layers[1:]))


def view_of(scene: Scene, rays: Rays = NEAR):
    return look(scene, rays, SUN)


def assert_close(one, other, rtol=1e-5, atol=0.0):
    assert jax.tree.structure(one) == jax.tree.structure(other)
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_allclose(a, b, rtol=rtol, atol=atol)


def assert_equal(one, other):
    assert_close(one, other, rtol=0)


def summed(seen):
    """Means and mean squares of each band, of about the size of one."""
    values = jnp.concatenate([seen.reflective, seen.emissive]) / 100
    return jnp.concatenate([values.mean(1), (values**2).mean(1)])


def mixed(pixel_rad: float) -> tuple[Rays, np.ndarray]:
    """Short ways, ways along the limb and rays that miss; and which ones miss."""
    limb, off = limb_rays(500.0, 2e3), limb_rays(1e5, 3e6)
    parts = (limb, NEAR[:4], off, NEAR[4:7])
    misses = np.zeros(11, bool)
    misses[6:8] = True
    return (
        Rays(
            np.concatenate([part.origin_m for part in parts]),
            np.concatenate([part.direction for part in parts]),
            pixel_rad,
        ),
        misses,
    )
