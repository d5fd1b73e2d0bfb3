"""Fits of cloud parameters to observed radiance histograms, and their reports."""
