"""Fractal clouds are the soft level set of the cloud function in its shell."""

import functools as ft
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from cloudjax.geometry.footprint import Footprint, Sampling, stretch_of
from cloudjax.geometry.geodesy import geodetic
from cloudjax.geometry.path import Profile, device_array, path_from
from cloudjax.geometry.rays import Rays
from cloudjax.geometry.shells import Chords, Shell
from cloudjax.weather.advection import DisplacementMap
from cloudjax.weather.coarse_fields import CoarseFields, Placed, Response
from cloudjax.weather.masks import AbstractMask

from .cloud_function import CloudFunction
from .fractal_navigation import at_knots, blown, in_noise, masked
from .fractal_path import FractalPath
from .fractal_samples import FractalSamples, Reading, held_alike
from .ladder import Ladder, Rung, common_share, frames, kept, rungs, seed_of_draw
from .level_set import Latent, level_set
from .noise import bands, noise_bands
from .rung_reader import NoiseOfRungs, RungReader
from .source import AbstractCloudSource, Occupancy, Slopes


# Of the logarithm of extinction, where it grows into the cloud.
_MOST_GROWTH = 4.0
# Steps to each point at which gradients of the noise are sampled.
_STEPS_PER_SLOPE = 3
# At which a shell is read at least that has room for its cloud to move.
_POINTS_OF_ROOM = 24
# Standard deviations of all textures together, above which hardly any of them is.
_FARTHEST = 3.0


class FractalCloud(AbstractCloudSource):
    """A `FractalCloud` is a class of fractal clouds in its shell.

    **Fields:**

    - `function`: the parameters of eq. (1).
    - `latent`: the quadrature over sub-pixel structure.
    - `shell`: the air that is marched.
    - `ladders`: of noise, from long waves to short ones.
    - `seed`: by which the rungs are turned and shifted.
    - `thickness_m`: a usual one of the cloud. Sub-pixel structure is common to rays
      over a part of it.
    - `mask`: where the weather lets the clouds stand; None is w = 0 everywhere.
    - `displacements`: of each ladder, the map by which the wind has drawn it; None for
      still air.
    - `fields`: what the clouds are like from place to place, and `response`: how
      strongly they follow; None where they are alike everywhere.
    - `movable`: whether the parameters may move the cloud within its shell. Then only
      that part of the shell is marched in which they leave cloud a chance.
    - `extinction_growth`: κ: extinction is exp(κ CF) times that of the layer in the
      cloud, for liquid water and ice grow from its edge inwards.

    The mask, the maps and the fields are read once, when a view is made; the other
    arrays are parameters.
    """

    function: CloudFunction
    latent: Latent
    shell: Shell = eqx.field(static=True)
    ladders: tuple[Ladder, ...] = eqx.field(static=True)
    seed: int = eqx.field(static=True, default=0)
    thickness_m: float = eqx.field(static=True, default=1500.0)
    mask: AbstractMask | None = None
    displacements: tuple[DisplacementMap | None, ...] | None = None
    fields: CoarseFields | None = None
    response: Response = eqx.field(default_factory=Response)
    movable: bool = eqx.field(static=True, default=False)
    extinction_growth: Float[Array, ""] = eqx.field(
        default_factory=lambda: jnp.asarray(0.0)
    )

    def __check_init__(self):
        f, maps = self.function, self.displacements
        counts = {len(self.ladders), f.weights.shape[0], f.persistences.shape[0]}
        if maps is not None:
            counts.add(len(maps))
        if len(counts) != 1:
            raise ValueError(
                f"{len(self.ladders)} ladders, {f.weights.shape[0]} weights and "
                f"{f.persistences.shape[0]} persistences: give one of each per "
                "ladder, and a displacement map where there are any."
            )
        steps = sum(len(ladder.octaves) for ladder in self.ladders)
        if f.gains.shape[0] != steps:
            raise ValueError(
                f"{f.gains.shape[0]} gains for ladders of {steps} steps: give one each."
            )

    @property
    def rungs(self) -> tuple[Rung, ...]:
        """List the rungs of all ladders, ladder by ladder."""
        return rungs(self.ladders)

    @property
    def frames(
        self,
    ) -> tuple[Float[np.ndarray, "rungs 3 3"], Float[np.ndarray, "rungs 3"]]:
        """Tell how positions [m] become positions in the noise [periods] and shifts."""
        return frames(self.ladders, self.seed)

    def drawn_anew(self, number: int) -> "FractalCloud":
        """Return the clouds of another seed."""
        return replace(self, seed=seed_of_draw(self.seed, number))

    def make_textures(self) -> NoiseOfRungs:
        """Make what the rungs are read from; the noise is made once and kept."""
        every = self.rungs
        noises = tuple(dict.fromkeys(rung.noise for rung in every))
        first = dict(
            zip(noises, np.cumsum([0, *(len(bands(n)) for n in noises)]), strict=False)
        )
        spectra = [rung.spectrum for rung in every]
        return NoiseOfRungs(
            noise=noise_bands(noises),
            band=jnp.asarray([first[rung.noise] + rung.band for rung in every], int),
            frames=jnp.asarray(self.frames[0]),
            wavenumbers=jnp.asarray(np.stack([k for k, _ in spectra]), float),
            powers=jnp.asarray(np.stack([power for _, power in spectra]), float),
            wave_m=jnp.asarray([rung.mean_wave_m for rung in every], float),
        )

    def points(self, sampling: Sampling) -> tuple[int, ...]:
        """Say at how many points of a chord each rung is read, 0 where it is not."""
        depth = self.shell.depth_m
        return tuple(rung.points(sampling, depth) for rung in self.rungs)

    def navigate(self, rays: Rays, chord: Chords, sampling: Sampling) -> FractalPath:
        """Lay rays along chords of the shell, on the host in float64."""
        points = self.points(sampling)
        read = [i for i, count in enumerate(points) if count]
        per_m, shifts = (part[read].astype(float) for part in self.frames)
        laid = at_knots(rays, chord, sampling.knots)
        change, upward, altitude, width, parts = laid
        entry = in_noise(rays.at(chord.entry_m), per_m, shifts)
        mask = masked(upward, self.mask)
        held = None
        if sampling.held_finest_m is not None:
            finest = replace(sampling, finest_m=sampling.held_finest_m)
            held = tuple(i for i, count in enumerate(self.points(finest)) if count)
        path = path_from(*parts)
        way = FractalPath(
            path=path,
            mask=Profile(device_array(mask), ends=True).with_knots(sampling.held_knots),
            width_m=device_array(width),
            stretch=stretch_of(path.middle_slant),
            entry=device_array(entry),
            change_m=device_array(change),
            strain=None,
            points=points,
            held=held,
            placed=self._placed(rays, chord),
        )
        maps = self.displacements
        if maps is None or all(m is None for m in maps):
            return way
        ladders = tuple(self.rungs[i].ladder for i in read)
        knots = device_array(upward), device_array(altitude)
        return blown(
            way, maps, *knots, device_array(per_m), ladders, strains=sampling.strains
        )

    def _placed(self, rays: Rays, chord: Chords) -> Placed | None:
        """Coarse fields vary little along a way: its middle tells them."""
        if self.fields is None:
            return None
        middle = geodetic(rays.at(chord.entry_m + chord.length_m / 2))
        return Placed(device_array(self.fields(*middle[:2])))

    def likelihood(
        self, samples: FractalPath | FractalSamples
    ) -> Float[Array, " rays"]:
        """Estimate how likely a ray is to meet cloud, by the most of its mask."""
        most = self.function.likelihood(samples.mask.values.max(-1), self.ladders)
        return jnp.where(samples.path.length_m > 0, most, 0.0)

    def narrowed(
        self, samples: FractalSamples, steps: int
    ) -> tuple[FractalSamples, Float[Array, " rays"]]:
        """Keep what is between the altitudes at which the barriers shut.

        Each ray has its own: clouds stand higher here than there, and reach farther up
        where the mask is more certain of them.
        """
        if not self.movable:
            return super().narrowed(samples, steps)
        f, placed = self.function, samples.placed
        spread = jnp.sqrt(f.variance(self.ladders))
        most = _FARTHEST * spread + f.mask_gain * samples.mask.values.max(-1)
        lift = jnp.zeros_like(most)
        if placed is not None:
            rough = placed.roughness(self.response)
            most = rough * most + (1 - rough) * f.margin
            lift = placed.lift_m(self.response)
        reach = f.reach_m(most - f.threshold)
        first, last = samples.path.between(
            f.base_m + lift - reach, f.top_m + lift + reach
        )
        return samples.within(first, last, steps), first

    def sample(
        self, way: FractalPath, textures: NoiseOfRungs, *, steps: int, slopes: bool
    ) -> FractalSamples:
        """Read the rungs along the ways, as often as they can change.

        Where only a part of the ways will be marched, the steps do not tell how often.
        """
        if self.movable and way.path.ends_m is None:
            steps = max(steps, _POINTS_OF_ROOM)
        pixel = self.pixel(way, steps)
        amplitude, lost, slope = kept(textures.wavenumbers, textures.powers, pixel)
        reader = RungReader(way, textures, amplitude, self._ladder_of)
        counts = [min(count, steps) for count in way.points]
        few = min(max(1, *counts), max(3, -(-steps // _STEPS_PER_SLOPE)))
        values, gradients = _read(reader, counts, few if slopes else None)
        unread = np.array(counts)[:, None] == 0
        lost = jnp.where(unread, textures.powers.sum(-1)[:, None], lost)
        steep = (textures.powers * textures.wavenumbers**2).sum(-1)[:, None] / 3
        slope = jnp.where(unread, steep, slope) * way.stretched(self._ladder_of)
        common = common_share(textures.wave_m, self.thickness_m, way.stretch)
        up = None
        if slopes:
            up = jnp.moveaxis(way.path.up(way.path.distance_m(few)), 1, 0)
        found = FractalSamples(
            path=way.path,
            mask=way.mask,
            values=values,
            gradients=gradients,
            common=(lost * common).T,
            own=(lost * (1 - common)).T,
            slope=slope.T,
            up=up,
            at=None,
            steps=steps,
            placed=way.placed,
        )
        return found if way.held is None else held_alike(found, way.held)

    def unread(
        self, way: FractalPath, textures: NoiseOfRungs, *, steps: int, slopes: bool
    ) -> FractalSamples:
        """Say of ways without cloud where they run and what the mask is, no more."""
        of_all = ft.partial(self.sample, steps=steps, slopes=slopes)
        forms = jax.eval_shape(of_all, way, textures)
        none = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), forms)
        return replace(none, path=way.path, mask=way.mask, placed=way.placed)

    def pixel(self, way: FractalPath, steps: int) -> Footprint:
        """Find what the rays average over. A step that is longer averages as well."""
        return Footprint.level(way.width_m, way.stretch, way.path.length_m / steps)

    @property
    def _ladder_of(self) -> tuple[int, ...]:
        return tuple(rung.ladder for rung in self.rungs)

    def branch(
        self,
        way: FractalPath,
        textures: NoiseOfRungs,
        distance_m: Float[Array, " rays"],
        direction: Float[Array, "rays 3"],
        ends_m: Float[Array, "rays ends"],
    ) -> FractalPath:
        """Leave the ways in another direction, with the mask where they are left."""
        read = [i for i, count in enumerate(way.points) if count]
        ladders = tuple(self._ladder_of[i] for i in read)
        frames = textures.frames[np.array(read, int)]
        return way.branch(distance_m, direction, ends_m, frames, ladders)

    def occupancy(self, samples: FractalSamples, steps: int) -> Occupancy:
        """Find the soft level set: the share of cloud in each step, for each node.

        Where clouds are denser, the share is that much more.
        """
        f, placed = self.function, samples.placed
        amplitudes = f.amplitudes(self.ladders)
        altitude = samples.path.altitude_m(samples.path.distance_m(steps))
        fractal = samples.fractal(amplitudes, steps)
        mask, rough = samples.mask.in_steps(steps), None
        if placed is not None:
            rough = placed.roughness(self.response)
            fractal, mask = rough[:, None] * fractal, rough[:, None] * mask
            altitude = altitude - placed.lift_m(self.response)[:, None]
        value = f(fractal, mask, altitude)
        if rough is not None:
            # As many clouds stand in smooth places as in rough ones.
            value = value + ((1 - rough) * f.margin)[:, None]
        common, own, steep = self._unresolved(samples, amplitudes, rough)
        shifted, fraction = self.level(value, common, f.smoothing**2 + own)
        growth = self.extinction_growth * jnp.maximum(shifted, 0)
        fraction = fraction * jnp.exp(jnp.clip(growth, -_MOST_GROWTH, _MOST_GROWTH))
        if placed is not None:
            fraction = fraction * placed.density(self.response)[None, :, None]
        slopes = None
        if samples.up is not None:
            gradient = samples.gradient(amplitudes)
            slopes = Slopes(
                gradient if rough is None else rough[None, :, None] * gradient,
                f.rise(altitude),
                jnp.moveaxis(samples.up, 1, 0),
                steep,
            )
        return Occupancy(fraction, self.latent.weights, slopes)

    def level(self, value, common, own):
        """Find the cloud function for each node, and the share of cloud in each step.

        **Arguments:** as of `level_set`.
        """
        return level_set(value, common, own, self.latent)

    def _unresolved(self, samples: FractalSamples, amplitudes, rough):
        """Variance that pixels take: of the common part, of the rest, of slopes."""
        parts = samples.common, samples.own, samples.slope
        sums = [jnp.matmul(part, amplitudes**2, precision="highest") for part in parts]
        return sums if rough is None else [rough**2 * total for total in sums]


def _read(
    reader: RungReader, counts: list[int], few: int | None
) -> tuple[tuple[Reading, ...], tuple[Reading, ...] | None]:
    """Values of the rungs, those that are read equally often together, and gradients.

    **Arguments:** `counts`: at how many points each rung is read. `few`: at how many
    gradients are read at most; None for no gradients.
    """
    values, gradients = [], []
    for count in sorted({*counts} - {0}):
        some = tuple(i for i, other in enumerate(counts) if other == count)
        if few is not None and count <= few:
            value, gradient = reader.with_gradient(some, count)
            gradients.append(gradient)
        else:
            value = reader.values(some, count)
        values.append(value)
    if few is None:
        return tuple(values), None
    many = tuple(i for i, count in enumerate(counts) if count > few)
    if many:
        gradients.append(reader.with_gradient(many, few)[1])
    return tuple(values), tuple(gradients)
