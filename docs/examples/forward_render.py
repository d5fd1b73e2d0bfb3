"""Render clouds seen by a camera in orbit, and take the gradient of the picture."""

import jax
import jax.numpy as jnp
import numpy as np

import cloudjax as cj


# A scene: two classes of cloud of the paper's Table 1, in a visible and a window band.
scene = cj.make_scene(["C02", "C13"], ["low_cumulus", "cirrus"], cover=0.4, steps=12)
camera = cj.Camera.looking_at(
    20.0, 10.0, 700e3,
    target_latitude_deg=21.5, target_longitude_deg=11.0,
    field_of_view_deg=8.0, rows=60, columns=60,
)  # fmt: skip
sun = cj.sun_over(21.5, 11.0, zenith_deg=50.0, azimuth_deg=120.0)

# The view is found once, on the host; what follows is pure.
view = cj.look(scene, camera, sun)
seen = cj.radiances(scene, view)
clouds = cj.products(scene, view)
image = np.asarray(seen.reflective[0]).reshape(camera.shape)
print(f"C02: {image.mean():.1f} W/(m2 sr um), cover {clouds.fraction.mean():.2f}")


# Parameters of the clouds have paths; any function of the picture has a gradient.
def brightness(values):
    return cj.radiances(cj.put(scene, values), view).reflective.mean()


values = {
    "low_cumulus.cloud.function.threshold": jnp.asarray(-1.25),
    "low_cumulus.extinction_per_m": jnp.asarray(0.045),
    "ground.albedo": jnp.asarray(0.05),
}
for path, slope in jax.jit(jax.grad(brightness))(values).items():
    print(f"brightness by {path}: {slope:.3g}")

# Eight pictures at once, each with another threshold; and the rays one by one.
thresholds = {"low_cumulus.cloud.function.threshold": jnp.linspace(-2.0, 0.0, 8)}
print("by threshold:", np.round(jax.vmap(brightness)(thresholds), 1))
one_by_one = jax.vmap(cj.radiances, (None, 0), out_axes=-1)(scene, view)
assert np.allclose(one_by_one.reflective, seen.reflective, rtol=1e-4)
