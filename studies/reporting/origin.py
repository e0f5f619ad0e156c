"""What the results of a study are made from, as it is stored with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from studies.planning.titles import full_title, subset
from studies.storage.placement import Origin

if TYPE_CHECKING:
    from studies.planning.configuration import Study
    from studies.planning.plan import Plan


@dataclass(frozen=True)
class MadeFrom:
    """What a run of a study is made from.

    Parameters
    ----------
    title : str
        the title of the study, with dataset, methods, and how much of the dataset it is about
    origin : Origin
        configuration, meshes and versions of methods
    trial_ids : sequence of str
        the plan
    command : str
        the command that makes the results again
    swept : mapping of str to str
        the options that a sweep varies
    n_models_of : int or None
        how many models the dataset has without the options that select some; None if that is not known
    """

    title: str
    origin: Origin
    trial_ids: Sequence[str]
    command: str = ""
    swept: Mapping[str, str] | None = None
    n_models_of: int | None = None

    @classmethod
    def of(cls, study: Study, trials: Plan) -> MadeFrom:
        """What the trials of a study are made from."""
        from studies.storage import encodable

        meshes = {encodable(trial.model.name): trial.mesh_digest for trial in trials.examples()}
        for trial in trials.examples():
            for name in trial.model_names():
                if encodable(name) not in meshes:  # such as the last pose of a shape, the second of every pair
                    meshes[encodable(name)] = trial.digest_of(name)
        versions = {segmenter.name: segmenter.version for segmenter in study.segmenters}
        total = study.dataset.total()
        return cls(
            full_title(study.title, study.dataset.name, list(versions), subset(len(meshes), total)),
            Origin(study.record, meshes, versions),
            trials.ids,
            study.command,
            study.swept,
            total,
        )

    @cached_property
    def facts(self) -> dict[str, Any]:
        """What is stored about the run in addition to the versions of all packages."""
        return {
            "segmenter_versions": dict(self.origin.versions),
            **({"n_models_of": self.n_models_of} if self.n_models_of else {}),
            **({"swept": dict(self.swept)} if self.swept else {}),
        }
