"""Where meshes come from: a dataset lists models, and a model loads its mesh when asked."""

from studies.datasets.dataset import Dataset, DatasetError, Model, make_dataset

__all__ = ["Dataset", "DatasetError", "Model", "make_dataset"]
