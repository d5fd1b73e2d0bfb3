"""Render clouds seen by a camera in orbit, and take the gradient of the picture."""

import jax
import jax.numpy as jnp
import numpy as np

import cloudjax as cj

# Two classes of cloud, in a visible and a window band of ABI.
scene = cj.make_scene(["C02", "C13"], ["low_cumulus", "cirrus"], cover=0.4, steps=12)
camera = cj.Camera.looking_at(
    20.0,
    10.0,
    700e3,  # degrees north and east, metres
    target_latitude_deg=21.5,
    target_longitude_deg=11.0,
    field_of_view_deg=8.0,
    rows=60,
    columns=60,
)
sun = cj.sun_over(21.5, 11.0, zenith_deg=50.0, azimuth_deg=120.0)

view = cj.look(scene, camera, sun)  # once, on the host
seen = cj.radiances(scene, view)  # pure: jit, grad and vmap work on it
picture = np.asarray(seen.reflective[0]).reshape(camera.shape)
print(f"C02: {picture.mean():.0f} W/(m2 sr um)")


def brightness(values):
    return cj.radiances(cj.put(scene, values), view).reflective.mean()


# What pictures depend on has a path and a derivative, but for masks, winds and maps:
# these are read when the view is made.
threshold = "low_cumulus.cloud.function.threshold"
values = {threshold: jnp.asarray(-1.25), "ground.albedo": jnp.asarray(0.05)}
for path, slope in jax.jit(jax.grad(brightness))(values).items():
    print(f"brightness by {path}: {slope:.3g}")
print("at eight thresholds:", jax.vmap(brightness)({threshold: jnp.linspace(-2, 0, 8)}))
one_by_one = jax.vmap(cj.radiances, (None, 0), out_axes=-1)(scene, view)
assert np.allclose(one_by_one.reflective, seen.reflective, rtol=1e-4)
