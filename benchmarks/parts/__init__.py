"""The parts of the benchmark: each has `run`, which measures, and `tables`."""
