"""The version of the Heat Walk and the values of its options, which are known without loading what computes it."""

# Increased when a change of the code changes labels, so that stored results of older versions are not reused.
ALGORITHM_VERSION = 2

TIME_UNITS = ("paper", "standard", "fiedler")
DENSITIES = ("vertices", "area")
