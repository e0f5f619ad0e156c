"""Fixtures for the tests of perturbations."""

import pytest

from perturb import perturbation


@pytest.fixture
def own_registry(monkeypatch):
    """A registry without the perturbations that tests define, which is discarded after the test."""
    monkeypatch.setattr(perturbation, "_REGISTRY", {})
