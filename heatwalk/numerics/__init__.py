"""The numerical kernels behind the method, compiled with numba: nothing here knows about heat or segmentation."""
