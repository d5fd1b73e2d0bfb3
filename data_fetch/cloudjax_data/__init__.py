"""GOES and GFS files, read into typed scenes. Needs no jax."""
