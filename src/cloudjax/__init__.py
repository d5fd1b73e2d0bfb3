"""A differentiable renderer of deterministic, fractal, three-dimensional clouds."""
