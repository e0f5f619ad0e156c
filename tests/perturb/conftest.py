"""Fixtures for the tests of perturbations."""

import pytest

from perturb import perturbation


@pytest.fixture
def own_registry(monkeypatch):
    """A registry of the shipped perturbations only, discarded after the test with what the test registers."""
    monkeypatch.setattr(perturbation, "_REGISTRY", {})


@pytest.fixture(scope="module")
def module_registry():
    """The same for all tests of a module."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(perturbation, "_REGISTRY", {})
        yield
