"""Clouds that nobody has measured: placed by their type, from a table.

A file says which clouds stand where (`sky_file`); they become particles (`placing`),
and so columns that the renderer takes as any other.
"""
