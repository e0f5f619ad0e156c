"""Kinds of study: what is measured on a mesh, and the tables and figures made of it."""

from studies.experiments.anatomy import Anatomy
from studies.experiments.benchmark import Benchmark
from studies.experiments.change import Change
from studies.experiments.experiment import Experiment
from studies.experiments.poses import Poses
from studies.experiments.times import Times

__all__ = ["Anatomy", "Benchmark", "Change", "Experiment", "Poses", "Times"]
