"""Where figures come from: the run's command, day, version, commit and machine."""

from __future__ import annotations

import re
import subprocess
from importlib import metadata
from pathlib import Path

import pytest

from deferred_ir.report import origin


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A checkout with one commit, that the package seems to lie in."""
    package = tmp_path / "deferred_ir" / "__init__.py"
    package.parent.mkdir()
    package.write_text("")
    name = ("-c", "user.name=a", "-c", "user.email=a@b.c")
    for command in (["init", "-q"], ["add", "."], [*name, "commit", "-qm", "first"]):
        subprocess.run(["git", "-C", str(tmp_path), *command], check=True)
    monkeypatch.setattr(origin.deferred_ir, "__file__", str(package))
    return tmp_path


def test_a_run_is_described():
    told = origin.describe_run("deferred-ir profile cornell -o 'my folder'")
    assert told.command == "deferred-ir profile cornell -o 'my folder'"
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d UTC", told.date)
    assert told.version == metadata.version("deferred-ir")
    assert re.search(r"\S, \d+ cores?; \S+ .*; Python 3\.\d+", told.machine)


def test_the_commit_is_that_of_the_checkout_and_says_if_files_differ(checkout):
    head = subprocess.run(["git", "-C", str(checkout), "rev-parse", "HEAD"], capture_output=True, text=True, check=True)
    commit = origin.find_commit()
    assert head.stdout.startswith(commit)
    (checkout / "deferred_ir" / "__init__.py").write_text("changed = True")
    assert origin.find_commit() == f"{commit}-dirty"


def test_an_installed_package_has_no_commit_even_inside_a_checkout(checkout, monkeypatch):
    packages = checkout / "venv" / "site-packages" / "deferred_ir"
    monkeypatch.setattr(origin.deferred_ir, "__file__", str(packages / "__init__.py"))
    assert origin.find_commit() is None


def test_without_git_no_commit_is_known(checkout, monkeypatch):
    monkeypatch.setenv("PATH", str(checkout))
    assert origin.find_commit() is None


def test_a_processor_without_a_name_is_told_by_its_kind(monkeypatch):
    def missing(self, *arguments, **options):
        raise FileNotFoundError

    monkeypatch.setattr(Path, "read_text", missing)
    assert origin.describe_machine().split(",")[0].strip()
