"""Whole images are a loop on the host over tiles of rays, and the work of all cores.

It adds nothing to the march but the loop.
"""
