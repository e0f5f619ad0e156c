"""Where meshes come from: each dataset turns a name into models, and a model into a mesh, lazily."""

from studies.datasets.dataset import Dataset, DatasetError, Model

__all__ = ["Dataset", "DatasetError", "Model"]
