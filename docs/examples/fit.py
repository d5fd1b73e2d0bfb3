"""Fit the scene that comes with cloudjax, and print what the data determine."""

from cloudjax_fit import FitSettings, embedded_target, fit, write_fit

target = embedded_target()
# Small, and in the paper's light: a minute or two, mostly compiling.
settings = FitSettings(rays=1024, steps=6, max_steps=10, light="paper")
result = fit(target, settings=settings)
for number, distance in result.distances_fit.items():
    band = target.imagery.bands[number]
    print(f"{band.name} {band.units}: W1/std {distance.w1_over_std:.3f}")
for estimate in result.estimates:
    print(estimate.parameter.name, estimate.value, estimate.std, estimate.determined)
print(result.status)  # ten steps do not converge, and the status says so
write_fit(result, "out/example")
