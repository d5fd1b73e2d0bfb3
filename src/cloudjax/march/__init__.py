"""The march of rays through the clouds of a scene, to radiances and cloud products.

Pure functions of arrays: they can be compiled, differentiated and batched.
"""
