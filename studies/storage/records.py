"""The configuration and the origin of results, as they are stored with them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from studies.planning.errors import StudyError
from studies.storage.text import parse_yaml

CONFIG_FILE = "config.yaml"
PROVENANCE_FILE = "provenance.json"

# What the configuration of every study has.
_ENTRIES: dict[str, type] = {"study": Mapping, "title": str, "experiment": Mapping, "dataset": Mapping}


def read_config(folder: Path) -> dict[str, Any]:
    """The configuration that is stored with results.

    Raises
    ------
    StudyError
        if the file is damaged, or something else
    """
    path = folder / CONFIG_FILE
    try:
        record = parse_yaml(path.read_text("utf-8"))
    except (yaml.YAMLError, ValueError) as error:
        raise StudyError(f"{path} is damaged: {' '.join(str(error).split())}") from error
    entries = record if isinstance(record, dict) else {}
    absent = [key for key, kind in _ENTRIES.items() if not isinstance(entries.get(key), kind)]
    if not absent and not isinstance(entries["study"].get("name"), str):
        absent = ["study.name"]
    if absent:
        raise StudyError(f"{path} is not the configuration of a study: it lacks {', '.join(absent)}")
    return record


def read_provenance(folder: Path) -> dict[str, Any]:
    """What is stored about the origin of results.

    Raises
    ------
    StudyError
        if the file is damaged, or something else
    """
    path = folder / PROVENANCE_FILE
    try:
        origin = json.loads(path.read_text("utf-8"))
    except (ValueError, RecursionError) as error:
        raise StudyError(f"{path} is damaged: {' '.join(str(error).split())}") from error
    if not isinstance(origin, dict):
        raise StudyError(f"{path} does not describe the origin of results")
    return origin
