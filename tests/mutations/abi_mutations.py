"""Changes of files of ABI, one at a time, as people, tools and disks make them."""

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from .netcdf_content import Content, changed
from .verdict import Mutation


# What readers look at; the other variables and attributes are never read.
GLOBALS = (
    "platform_ID",
    "orbital_slot",
    "scene_id",
    "dataset_name",
    "time_coverage_start",
    "time_coverage_end",
)
SCALARS = (
    "t",
    "band_id",
    "band_wavelength",
    "esun",
    "kappa0",
    "planck_fk1",
    "planck_fk2",
    "planck_bc1",
    "planck_bc2",
    "earth_sun_distance_anomaly_in_AU",
    "nominal_satellite_subpoint_lon",
)
_LEFT_NOTHING = (
    AttributeError,
    IndexError,
    KeyError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
)
WRONG_NUMBERS = {
    "nan": np.nan,
    "infinite": np.inf,
    "zero": 0.0,
    "negative": -17.0,
    "huge": 1e30,
    "absent": -999.0,
}
WRONG_ATTRIBUTES = {
    "text": "wrong",
    "empty": "",
    "pair": np.array([3, 4], "f4"),
    "nothing": np.array([], "f4"),
    "nan": np.float32(np.nan),
    "infinite": np.float32(np.inf),
    "zero": np.float32(0.0),
    "negative": np.float32(-5.0),
    "huge": np.float32(1e30),
}


def abi_mutations(image: str = "Rad", flags: str = "DQF") -> list[Mutation]:
    """All changes of the one file of a folder; `apply` takes its path."""
    return [
        *_of_attributes(image, flags),
        *_of_scalars(),
        *_of_variables(image, flags),
        *_of_shapes(image, flags),
        *_of_bytes(),
        *_of_names(),
    ]


def pairs(mutations: list[Mutation], count: int, seed: int) -> list[Mutation]:
    """Two changes at once, drawn at random."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        a, b = (mutations[i] for i in rng.choice(len(mutations), 2, replace=False))

        def both(path: Path, changes=(a, b)) -> None:
            for change in changes:
                # The first may leave nothing that the second can change.
                with contextlib.suppress(*_LEFT_NOTHING):
                    change.apply(path)

        found.append(Mutation(f"{a} and {b}", both))
    return found


def _in_content(name: str, change: Callable[[Content], object]) -> Mutation:
    return Mutation(name, lambda path: changed(path, change))


def _of_attributes(image: str, flags: str) -> Iterator[Mutation]:
    for name in GLOBALS:
        yield _in_content(f"no {name}", lambda c, n=name: c.attributes.pop(n, None))
        for what, value in WRONG_ATTRIBUTES.items():
            yield _in_content(
                f"{name} {what}",
                lambda c, n=name, v=value: c.attributes.update({n: v}),
            )
    of_variables = {
        "goes_imager_projection": (
            "perspective_point_height",
            "semi_major_axis",
            "semi_minor_axis",
            "longitude_of_projection_origin",
            "sweep_angle_axis",
        ),
        image: ("scale_factor", "add_offset", "_Unsigned", "units", "valid_range"),
        flags: ("_Unsigned", "valid_range", "scale_factor", "add_offset"),
        "x": ("scale_factor", "add_offset", "units"),
        "y": ("scale_factor", "add_offset", "units"),
        "t": ("units", "calendar"),
    }
    for variable, names in of_variables.items():
        for name in names:
            yield _in_content(
                f"no {name} of {variable}",
                lambda c, v=variable, n=name: c.variables[v].attributes.pop(n, None),
            )
            for what, value in WRONG_ATTRIBUTES.items():
                yield _in_content(
                    f"{name} of {variable} {what}",
                    lambda c, v=variable, n=name, x=value: c.variables[
                        v
                    ].attributes.update({n: x}),
                )


def _of_scalars() -> Iterator[Mutation]:
    for name in SCALARS:
        for what, value in WRONG_NUMBERS.items():

            def put(c: Content, n=name, x=value) -> None:
                held = c.variables.get(n)
                if held is not None:
                    held.stored = np.full(np.shape(held.stored), x, "f8")
                    held.attributes.pop("_FillValue", None)

            yield _in_content(f"{name} {what}", put)


def _of_variables(image: str, flags: str) -> Iterator[Mutation]:
    for name in (image, flags, "x", "y", "goes_imager_projection", *SCALARS):

        def rename(c: Content, n=name) -> None:
            if n in c.variables:
                c.variables[f"{n}_old"] = c.variables.pop(n)

        def to_text(c: Content, n=name) -> None:
            if n in c.variables:
                c.variables[n].stored = "wrong"
                c.variables[n].attributes = {}

        yield _in_content(f"no {name}", lambda c, n=name: c.variables.pop(n, None))
        yield _in_content(f"{name} renamed", rename)
        yield _in_content(f"{name} as text", to_text)
    for name in (image, flags):
        for kind in ("f4", "f8", "i4", "i8"):

            def cast(c: Content, n=name, k=kind) -> None:
                held = c.variables[n]
                unsigned = held.stored.dtype.str.replace("i", "u")
                held.stored = held.stored.astype(unsigned).astype(k)
                fill = np.asarray(held.attributes["_FillValue"]).astype(unsigned)
                held.attributes["_FillValue"] = fill.astype(k)
                held.attributes.pop("_Unsigned", None)
                held.attributes.pop("valid_range", None)

            yield _in_content(f"{name} as {kind}", cast)
        yield _in_content(f"{name} all fill", lambda c, n=name: _fill(c, n, ...))
        yield _in_content(
            f"{name} half fill", lambda c, n=name: _fill(c, n, np.s_[::2])
        )


def _fill(c: Content, name: str, where) -> None:
    held = c.variables[name]
    held.stored[where] = held.attributes["_FillValue"]


def _of_shapes(image: str, flags: str) -> Iterator[Mutation]:
    changes = {
        "transposed": _swap,
        "mislabelled": _mislabel,
        "flat": _flatten,
        "with 0 times": lambda c, n: _put_ahead(c, n, 0),
        "with 1 times": lambda c, n: _put_ahead(c, n, 1),
        "with 2 times": lambda c, n: _put_ahead(c, n, 2),
    }
    for names in ((image,), (flags,), (image, flags)):
        for what, change in changes.items():

            def all_of(c: Content, names=names, change=change) -> None:
                for n in names:
                    change(c, n)

            yield _in_content(f"{' and '.join(names)} {what}", all_of)
    for axis in "yx":
        for size in (0, 1):
            yield _in_content(
                f"{size} along {axis}",
                lambda c, a=axis, s=size: _cut(c, a, slice(0, s)),
            )
        yield _in_content(
            f"{axis} reversed", lambda c, a=axis: _cut(c, a, slice(None, None, -1))
        )
        yield _in_content(f"{axis} uneven", lambda c, a=axis: _tear(c, a))
        yield _in_content(f"{axis} constant", lambda c, a=axis: _flat(c, a))


def _swap(c: Content, name: str) -> None:
    held = c.variables[name]
    held.dimensions, held.stored = held.dimensions[::-1], held.stored.T


def _put_ahead(c: Content, name: str, size: int) -> None:
    c.dimensions["time"] = size
    held = c.variables[name]
    held.dimensions = ("time", *held.dimensions)
    held.stored = np.repeat(held.stored[None], size, 0)


def _mislabel(c: Content, name: str) -> None:
    """The right sizes, under names of their own."""
    held = c.variables[name]
    for d, size in zip("ab", held.stored.shape, strict=True):
        c.dimensions[f"{name}_{d}"] = size
    held.dimensions = (f"{name}_a", f"{name}_b")


def _flatten(c: Content, name: str) -> None:
    held = c.variables[name]
    c.dimensions[f"{name}_pixels"] = held.stored.size
    held.dimensions = (f"{name}_pixels",)
    held.stored = held.stored.reshape(-1)


def _cut(c: Content, axis: str, part: slice) -> None:
    for held in c.variables.values():
        if axis in held.dimensions:
            where = tuple(part if d == axis else slice(None) for d in held.dimensions)
            held.stored = held.stored[where]
            c.dimensions[axis] = held.stored.shape[held.dimensions.index(axis)]


def _tear(c: Content, axis: str) -> None:
    stored = c.variables[axis].stored
    stored[len(stored) // 2 :] += (stored[1] - stored[0]) * 3


def _flat(c: Content, axis: str) -> None:
    c.variables[axis].stored[...] = c.variables[axis].stored[0]


def _of_bytes() -> Iterator[Mutation]:
    for percent in (0, 1, 2, 5, 10, 20, 35, 50, 65, 80, 90, 95, 99):
        yield Mutation(f"cut at {percent} %", lambda p, s=percent: _cut_bytes(p, s))
    for percent in (0, 3, 12, 33, 50, 67, 90):
        yield Mutation(f"zeros at {percent} %", lambda p, s=percent: _zero_bytes(p, s))
    yield Mutation("bytes appended", lambda p: p.write_bytes(p.read_bytes() + b"more"))
    yield Mutation("a page of a web server", lambda p: p.write_text("<html>404</html>"))


def _cut_bytes(path: Path, percent: int) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: len(content) * percent // 100])


def _zero_bytes(path: Path, percent: int) -> None:
    content = bytearray(path.read_bytes())
    at = len(content) * percent // 100
    size = min(512, len(content) - at)
    content[at : at + size] = bytes(size)
    path.write_bytes(content)


def _of_names() -> Iterator[Mutation]:
    for old, new in {
        "_G17_": "_G16_",
        "C13_": "C14_",
        "M1-": "M2-",
        "_s2019": "_s2018",
        "L1b-Rad": "L2-CMIP",
        "L1b": "L2",
        "RadM1": "DMWM1",
        "OR_ABI": "mine",
        "OR_": "._OR_",
        ".nc": ".NC",
        ".nc ": "",
        "_c20": " (1)_c20",
    }.items():
        yield Mutation(
            f"renamed {old} to {new}", lambda p, o=old, n=new: _name(p, o, n)
        )
    yield Mutation("twice", lambda p: _copy(p, p.name.replace("_c20", "_c19")))
    yield Mutation("twice, once hidden", lambda p: _copy(p, f"._{p.name}"))
    yield Mutation("twice, once renamed", lambda p: _copy(p, "mine.nc"))


def _name(path: Path, old: str, new: str) -> None:
    path.rename(path.with_name(path.name.replace(old.strip(), new)))


def _copy(path: Path, name: str) -> None:
    path.with_name(name).write_bytes(path.read_bytes())
