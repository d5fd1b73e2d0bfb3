"""Targets as small netCDF files: one group per band, figures derived only."""

import dataclasses
import os
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import xarray as xr

from cloudjax import Band, Ellipsoid, FixedGrid, LatLonGrid
from cloudjax.light.bands import PLANCK
from cloudjax_data import DataError, earth_sun_distance_au
from cloudjax_data.whole_files import staged
from cloudjax_scenes.background import Background
from cloudjax_scenes.cloud_rule import CloudRule
from cloudjax_scenes.imagery import Imagery
from cloudjax_scenes.imagery_evidence import ClassEvidence
from cloudjax_scenes.netcdf import write_netcdf

from .histogram import Quantiles
from .statistics_file import STATISTICS, read_statistics, statistics_groups
from .targets import Target


_KIND = "cloudjax fit target"
_EVIDENCE = "evidence"
_FIELD_CELLS = ("field_latitude", "field_longitude")
# Scan angles of a background, which may be of fewer and larger pixels than the scene.
_Y, _X = "background_y", "background_x"


def write_target(path: str | os.PathLike[str], target: Target) -> None:
    """Write a target to one file, whole or not at all.

    Fractions and fields are rounded to thousandths, statistics to tenths of a pixel,
    quantiles and backgrounds to float32; geometry, time and coefficients are kept as
    they are.
    """
    path = Path(path)
    groups = {"/": _root(target)} | {
        f"/{band.name}": _band_dataset(target, number)
        for number, band in target.imagery.bands.items()
    }
    groups |= statistics_groups(target.statistics)
    groups |= {
        f"/{_EVIDENCE}/{name}": _evidence_dataset(told)
        for name, told in target.imagery.evidence.items()
    }
    with staged(path.parent) as folder:
        write_netcdf(folder / path.name, xr.DataTree.from_dict(groups))


def read_target(path: str | os.PathLike[str]) -> Target:
    """Read what `write_target` wrote.

    **Raises:** `DataError` if the file cannot be read or holds no target.
    """
    path = Path(path)
    try:
        with xr.open_datatree(path, engine="netcdf4") as tree:
            if tree.attrs.get("kind") != _KIND:
                raise DataError(f"{path} holds no target of a fit: give another file.")
            if STATISTICS not in tree.children:
                raise DataError(
                    f"{path} is of an earlier version, without statistics of texture: "
                    "make it again from its scene."
                )
            return _target(tree.load())
    except (OSError, RuntimeError) as error:
        raise DataError(f"{path} cannot be read as netCDF: write it again.") from error


def _root(target: Target) -> xr.Dataset:
    imagery, grid = target.imagery, target.imagery.grid
    cells = ("latitude", "longitude")
    fractions = _rounded(np.stack(list(imagery.fractions.values())))
    rule = dataclasses.asdict(imagery.rule)
    rule = {key: value for key, value in rule.items() if value is not None}
    return xr.Dataset(
        {
            "fraction": (("cloud_class", *cells), fractions),
            "good": (("y", "x"), target.good.astype(np.int8)),
        },
        coords={
            "cloud_class": list(imagery.fractions),
            "latitude": ("latitude", imagery.latitude_deg, {"units": "degrees_north"}),
            "longitude": (
                "longitude",
                imagery.longitude_deg,
                {"units": "degrees_east"},
            ),
            "x": ("x", grid.x_rad, {"units": "rad"}),
            "y": ("y", grid.y_rad, {"units": "rad"}),
        },
        attrs={
            "kind": _KIND,
            "name": imagery.name,
            "platform": imagery.platform,
            "time": imagery.time.astimezone(UTC).isoformat(),
            "earth_sun_distance_au": imagery.earth_sun_distance_au,
            "blocks": np.array(target.blocks, np.int32),
            "subsatellite_longitude_deg": grid.subsatellite_longitude_deg,
            "perspective_height_m": grid.perspective_height_m,
            "semi_major_m": grid.ellipsoid.semi_major_m,
            "semi_minor_m": grid.ellipsoid.semi_minor_m,
            "sweep": grid.sweep,
        }
        | {f"rule_{key}": value for key, value in rule.items()},
    )


def _rounded(values: np.ndarray) -> np.ndarray:
    """Thousandths take a third of the space of all digits."""
    return np.round(values, 3).astype(np.float32)


def _evidence_dataset(told: ClassEvidence) -> xr.Dataset:
    # Cells of their own, wider than those of the fractions.
    return xr.Dataset(
        {"fields": ((*_FIELD_CELLS, "field"), _rounded(told.nodes))},
        coords={
            name: (name, axis)
            for name, axis in zip(
                _FIELD_CELLS, (told.latitude_deg, told.longitude_deg), strict=True
            )
        },
        attrs={"top_m": told.top_m},
    )


def _band_dataset(target: Target, number: int) -> xr.Dataset:
    imagery, table = target.imagery, target.quantiles[number]
    band = imagery.bands[number]
    solar = {"solar_irradiance": band.solar_irradiance} if band.sunlit else {}
    axes, coordinates = _axes(imagery.background.grid)
    return xr.Dataset(
        {
            "quantile": ("probability", table.values.astype(np.float32)),
            "background": (
                axes,
                imagery.background.radiance[number].astype(np.float32),
            ),
        },
        coords={"probability": table.probabilities} | coordinates,
        attrs={
            "band": band.number,
            "wavelength_um": band.wavelength_um,
            "units": band.units,
            "n_pixels": table.count,
        }
        | solar
        | {f"coefficient_{k}": v for k, v in imagery.coefficients(number).items()},
    )


def _axes(grid: LatLonGrid | FixedGrid) -> tuple[tuple[str, str], dict]:
    """The dimensions of backgrounds, and the coordinates that the root lacks."""
    if isinstance(grid, LatLonGrid):
        return ("latitude", "longitude"), {}
    axes = {_Y: grid.y_rad, _X: grid.x_rad}
    return (_Y, _X), {n: (n, angles, {"units": "rad"}) for n, angles in axes.items()}


def _background(
    grid: FixedGrid, root: xr.Dataset, groups: Mapping[int, xr.Dataset]
) -> Background:
    radiance = {
        n: data["background"].to_numpy().astype(float) for n, data in groups.items()
    }
    some = next(iter(groups.values()))["background"]
    if _X in some.dims:
        x_rad, y_rad = (some[axis].to_numpy() for axis in (_X, _Y))
        return Background(replace(grid, x_rad=x_rad, y_rad=y_rad), radiance)
    # On the cells of the fractions, as in files of earlier versions.
    axes = (root[axis].to_numpy() for axis in ("latitude", "longitude"))
    return Background(LatLonGrid.from_axes(*axes), radiance)


def _target(tree: xr.DataTree) -> Target:
    a, root = tree.attrs, tree.dataset
    bands = [g for g in tree.children.values() if "band" in g.attrs]
    groups = {int(g.attrs["band"]): g.dataset for g in bands}
    evidence = tree.children.get(_EVIDENCE)
    told = {} if evidence is None else evidence.children
    imagery = _imagery(a, root, groups)
    return Target(
        imagery=replace(
            imagery,
            evidence={name: _evidence(group.dataset) for name, group in told.items()},
        ),
        quantiles={number: _quantiles(groups[number]) for number in imagery.bands},
        statistics=read_statistics(tree),
        blocks=(int(a["blocks"][0]), int(a["blocks"][1])),
        good=root["good"].to_numpy() == 1,
    )


def _evidence(data: xr.Dataset) -> ClassEvidence:
    latitude_deg, longitude_deg = (data[axis].to_numpy() for axis in _FIELD_CELLS)
    return ClassEvidence(
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        nodes=data["fields"].to_numpy().astype(float),
        top_m=float(data.attrs["top_m"]),
    )


def _imagery(a, root: xr.Dataset, groups: Mapping[int, xr.Dataset]) -> Imagery:
    time = datetime.fromisoformat(a["time"])
    time = time.replace(tzinfo=time.tzinfo or UTC)
    # Absent from files of earlier versions.
    distance_au = float(a.get("earth_sun_distance_au", earth_sun_distance_au(time)))
    grid = FixedGrid(
        x_rad=root["x"].to_numpy(),
        y_rad=root["y"].to_numpy(),
        subsatellite_longitude_deg=float(a["subsatellite_longitude_deg"]),
        perspective_height_m=float(a["perspective_height_m"]),
        ellipsoid=Ellipsoid(float(a["semi_major_m"]), float(a["semi_minor_m"])),
        sweep=a["sweep"],
    )
    return Imagery(
        name=str(a["name"]),
        platform=str(a["platform"]),
        time=time,
        grid=grid,
        rule=_rule(_prefixed(a, "rule_")),
        bands={n: _band(data.attrs, distance_au) for n, data in groups.items()},
        earth_sun_distance_au=distance_au,
        latitude_deg=root["latitude"].to_numpy(),
        longitude_deg=root["longitude"].to_numpy(),
        fractions={
            str(name): root["fraction"].sel(cloud_class=name).to_numpy().astype(float)
            for name in root["cloud_class"].to_numpy()
        },
        background=_background(grid, root, groups),
    )


def _band(a, distance_au: float) -> Band:
    coefficients = {k: float(v) for k, v in _prefixed(a, "coefficient_").items()}
    planck = None
    if PLANCK[0] in coefficients:
        fk1, fk2, bc1, bc2 = (coefficients[key] for key in PLANCK)
        planck = fk1, fk2, bc1, bc2
    solar = a.get("solar_irradiance")
    if solar is None and "kappa0" in coefficients:
        solar = np.pi * distance_au**2 / coefficients["kappa0"]
    return Band(
        number=int(a["band"]),
        wavelength_um=float(a["wavelength_um"]),
        solar_irradiance=None if solar is None else float(solar),
        planck=planck,
    )


def _quantiles(data: xr.Dataset) -> Quantiles:
    return Quantiles(
        data["probability"].to_numpy(),
        data["quantile"].to_numpy().astype(float),
        int(data.attrs["n_pixels"]),
    )


def _rule(kept: dict) -> CloudRule:
    def band(name):
        return int(kept[name]) if name in kept else None

    return CloudRule(
        bright_band=band("bright_band"),
        bright_reflectance=float(kept["bright_reflectance"]),
        cold_band=band("cold_band"),
        cold_temperature_k=float(kept["cold_temperature_k"]),
    )


def _prefixed(attributes, prefix: str) -> dict:
    return {
        key.removeprefix(prefix): value
        for key, value in attributes.items()
        if key.startswith(prefix)
    }
