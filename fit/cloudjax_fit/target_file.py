"""Targets as small netCDF files: one group per band, figures derived only."""

import dataclasses
import os
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import xarray as xr

from cloudjax import Band, Ellipsoid, FixedGrid
from cloudjax.light.bands import PLANCK
from cloudjax_data import DataError, earth_sun_distance_au
from cloudjax_data.whole_files import staged
from cloudjax_scenes.cloud_rule import CloudRule
from cloudjax_scenes.imagery import Imagery
from cloudjax_scenes.netcdf import write_netcdf

from .histogram import Quantiles
from .targets import BandStatistics, Target


_KIND = "cloudjax fit target"


def write_target(path: str | os.PathLike[str], target: Target) -> None:
    """Write a target to one file, whole or not at all.

    Quantiles, fractions and backgrounds are rounded to float32; geometry, time,
    coefficients and counts are kept as they are.
    """
    path = Path(path)
    groups = {"/": _root(target)} | {
        f"/{band.name}": _band_dataset(target, number)
        for number, band in target.imagery.bands.items()
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
            return _target(tree.load())
    except (OSError, RuntimeError) as error:
        raise DataError(f"{path} cannot be read as netCDF: write it again.") from error


def _root(target: Target) -> xr.Dataset:
    imagery, grid = target.imagery, target.imagery.grid
    cells = ("latitude", "longitude")
    fractions = np.stack(list(imagery.fractions.values())).astype(np.float32)
    rule = dataclasses.asdict(imagery.rule)
    rule = {key: value for key, value in rule.items() if value is not None}
    return xr.Dataset(
        {
            "fraction": (("cloud_class", *cells), fractions),
            "block_cloud": ("block", _counts(target.block_cloud)),
            "block_valid": ("block", _counts(target.block_valid)),
        }
        | _good(target),
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


def _good(target: Target) -> dict:
    if target.good is None:
        return {}
    return {"good": (("y", "x"), target.good.astype(np.int8))}


def _band_dataset(target: Target, number: int) -> xr.Dataset:
    imagery, known = target.imagery, target.statistics[number]
    band, table = imagery.bands[number], known.quantiles
    solar = {"solar_irradiance": band.solar_irradiance} if band.sunlit else {}
    return xr.Dataset(
        {
            "quantile": ("probability", table.values.astype(np.float32)),
            "block_counts": (("block", "bin"), _counts(known.block_counts)),
            "background": (
                ("latitude", "longitude"),
                imagery.backgrounds[number].astype(np.float32),
            ),
        },
        coords={"probability": table.probabilities},
        attrs={
            "band": band.number,
            "wavelength_um": band.wavelength_um,
            "units": band.units,
            "n_pixels": table.count,
            "low": known.low,
            "high": known.high,
        }
        | solar
        | {f"coefficient_{k}": v for k, v in imagery.coefficients(number).items()},
    )


def _target(tree: xr.DataTree) -> Target:
    a, root = tree.attrs, tree.dataset
    groups = {int(g.attrs["band"]): g.dataset for g in tree.children.values()}
    return Target(
        imagery=_imagery(a, root, groups),
        statistics={number: _statistics(data) for number, data in groups.items()},
        blocks=(int(a["blocks"][0]), int(a["blocks"][1])),
        block_cloud=root["block_cloud"].to_numpy().astype(np.int64),
        block_valid=root["block_valid"].to_numpy().astype(np.int64),
        good=root["good"].to_numpy() == 1 if "good" in root else None,
    )


def _imagery(a, root: xr.Dataset, groups: Mapping[int, xr.Dataset]) -> Imagery:
    time = datetime.fromisoformat(a["time"])
    time = time.replace(tzinfo=time.tzinfo or UTC)
    # Absent from files of earlier versions.
    distance_au = float(a.get("earth_sun_distance_au", earth_sun_distance_au(time)))
    return Imagery(
        name=str(a["name"]),
        platform=str(a["platform"]),
        time=time,
        grid=FixedGrid(
            x_rad=root["x"].to_numpy(),
            y_rad=root["y"].to_numpy(),
            subsatellite_longitude_deg=float(a["subsatellite_longitude_deg"]),
            perspective_height_m=float(a["perspective_height_m"]),
            ellipsoid=Ellipsoid(float(a["semi_major_m"]), float(a["semi_minor_m"])),
            sweep=a["sweep"],
        ),
        rule=_rule(_prefixed(a, "rule_")),
        bands={n: _band(data.attrs, distance_au) for n, data in groups.items()},
        earth_sun_distance_au=distance_au,
        latitude_deg=root["latitude"].to_numpy(),
        longitude_deg=root["longitude"].to_numpy(),
        fractions={
            str(name): root["fraction"].sel(cloud_class=name).to_numpy().astype(float)
            for name in root["cloud_class"].to_numpy()
        },
        backgrounds={
            n: data["background"].to_numpy().astype(float) for n, data in groups.items()
        },
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


def _statistics(data: xr.Dataset) -> BandStatistics:
    a = data.attrs
    return BandStatistics(
        quantiles=Quantiles(
            data["probability"].to_numpy(),
            data["quantile"].to_numpy().astype(float),
            int(a["n_pixels"]),
        ),
        low=float(a["low"]),
        high=float(a["high"]),
        block_counts=data["block_counts"].to_numpy().astype(np.int64),
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


def _counts(counts: np.ndarray) -> np.ndarray:
    return counts.astype(np.int32)
