"""README, CONTRIBUTING and docs/: their links, commands and snippets are those of the code."""

import itertools
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from importlib.metadata import distribution

import pandas as pd
import pytest
import yaml
from hydra.core.override_parser.overrides_parser import OverridesParser

import heatwalk
from tests.helpers.documents import PAGES, ROOT, blocks, commands

COMMANDS = sorted({command for page in PAGES for command in commands(page.read_text(encoding="utf-8"))})
SNIPPETS = [
    pytest.param(block.text, id=f"{page.name}-{number}")
    for page in PAGES
    for number, block in enumerate(blocks(page.read_text(encoding="utf-8")))
    if block.language == "python" and not block.title
]


def jobs(words):
    """The options of each job of a command: several for a sweep."""
    words = [word for word in words if word not in ("-m", "--multirun")]
    overrides = OverridesParser.create().parse_overrides(words)
    choices = [
        [f"{override.get_key_element()}={value}" for value in override.sweep_string_iterator()]
        if override.is_sweep_override() and not override.is_discrete_sweep() is False
        else [override.input_line]
        for override in overrides
    ]
    return list(itertools.product(*choices))


@pytest.mark.parametrize("command", COMMANDS)
def test_a_documented_command_composes(command, composed, own_modules):
    for overrides in jobs(shlex.split(command)[3:]):
        cfg = composed(*overrides)
        assert cfg.study.name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_between_pages_lead_to_files_and_headings(page):
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if "://" in target:
            continue
        path, _, anchor = target.partition("#")
        linked = page.parent / path if path else page
        assert linked.exists() or (page.parent.name == "docs" and (ROOT / path).exists()), target
        if anchor and linked.name != "contributing.md":
            headings = re.findall(r"^#+ (.+)$", linked.read_text(encoding="utf-8"), re.MULTILINE)
            assert anchor in {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}
