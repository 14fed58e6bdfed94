"""Docstrings of the public interface: whole, with units and shapes, and examples that run.

Public are the names that `gearmon` and its rooms list in `__all__`, and the methods of the classes
among them.
"""

from __future__ import annotations

import ast
import doctest
import functools
import importlib
import inspect
import pkgutil
import re
import textwrap
from dataclasses import dataclass, replace
from typing import Any

import pytest

import gearmon
from gearmon.result import Result

_ROOMS = [
    gearmon,
    *(
        importlib.import_module(own.name)
        for own in pkgutil.iter_modules(gearmon.__path__, "gearmon.")
        if own.ispkg
    ),
]
_GIVEN = ("Parameters", "Attributes")
# A number has its unit in its name or in brackets, or is said to have none.
_UNIT = re.compile(
    r"_(hz|s|m|mm|m2|n|pa|rad|deg|db|v|w|j|f|a|c|kg|kg_m3|ms2|rpm|nm|h|ohm|in|share|ratio|turns)\b|"
    r"_per_|\[[^\]]+\]|\b(in modules|any unit|bool|dimensionless|relative|ratios?|shares?|factors?|"
    r"coefficient|multiple|per ?cent|probability|score|grade|tolerance|over (its|the|that)|orders?|"
    r"turns|dB|m/s2)\b",
    re.IGNORECASE,
)
# "name, other : type" or, where another function describes it, "name, other" and "As of ..."
_ENTRY = re.compile(r"([\w*, ]+?)(?: : ?|\n +(?=As |See |Of an array))(.*)", re.S)


@dataclass(frozen=True)
class Public:
    """A public function, class or method."""

    room: str
    name: str
    own: Any

    @property
    def doc(self) -> str:
        return inspect.getdoc(self.own) or ""

    @property
    def is_method(self) -> bool:
        return "." in self.name

    def section(self, name: str) -> str:
        found = re.search(rf"^{name}\n-+\n(.*?)(?=\n\n?\w[\w ]*\n---|\Z)", self.doc, re.S | re.M)
        return found[1] if found else ""

    def described(self) -> dict[str, str]:
        """Parameters with their type and text; what is "as of" another function is said there."""
        kinds = (own for own in getattr(self.own, "__mro__", (self.own,)) if own is not object)
        texts = [replace(self, own=own).section(kind) for own in kinds for kind in _GIVEN]
        entries = re.split(r"^(?=\S)", "\n".join(texts).replace("\\\n", ""), flags=re.M)
        found = map(_ENTRY.match, entries)
        return {name.strip("* "): own[2] for own in found if own for name in own[1].split(",")}


def _functions(own):
    """Methods and properties that a class defines itself."""
    for name, value in vars(own).items():
        inner = getattr(value, "fget", None) or getattr(value, "func", None)
        inner = inner or getattr(value, "__func__", value)
        ours = inspect.isfunction(inner) and inner.__module__.startswith("gearmon.")
        if ours and not name.startswith("_"):
            yield name, inner


def _public():
    seen = set()
    for room in _ROOMS:
        for name in getattr(room, "__all__", ()):
            own = getattr(room, name)
            if id(own) in seen or not (inspect.isclass(own) or inspect.isfunction(own)):
                continue
            seen.add(id(own))
            yield Public(room.__name__, name, own)
            if inspect.isclass(own):
                for method, inner in _functions(own):
                    yield Public(room.__name__, f"{name}.{method}", inner)


PUBLIC = list(_public())


def _undescribed(public, described):
    """Parameters of a function that its docstring leaves out.

    A method that takes no more than one may say all in a sentence.
    """
    if inspect.isclass(public.own) and issubclass(public.own, Exception):
        return []
    taken = [own for own in inspect.signature(public.own).parameters if own not in ("self", "cls")]
    brief = public.is_method and len(taken) < 2
    return [] if brief else [f"parameter {name}" for name in taken if name not in described]


def _unmeasured(described):
    """Numbers and arrays without unit or shape."""
    for name, text in described.items():
        kind = text.partition("\n")[0]
        if "ndarray" in kind and "shape" not in text and "bool" not in kind:
            yield f"shape of {name}"
        if re.search(r"\bfloat|ndarray", kind) and not _UNIT.search(f"{name} {text}"):
            yield f"unit of {name}"


def _unsaid(public):
    """Values that a function returns and errors that it raises, but does not name."""
    if inspect.isclass(public.own):
        return
    given = inspect.signature(public.own).return_annotation not in ("None", None)
    if given and not public.is_method and not any(map(public.section, ("Returns", "Yields"))):
        yield "Returns"
    tree = ast.parse(textwrap.dedent(inspect.getsource(public.own)))
    if any(isinstance(node, ast.Raise) for node in ast.walk(tree)) and not public.section("Raises"):
        yield "Raises"


def _faults(public):
    """What a docstring lacks."""
    described = public.described()
    return [*_undescribed(public, described), *_unmeasured(described), *_unsaid(public)]


def test_docstrings_are_whole():
    lacking = {f"{own.room}: {own.name}": faults for own in PUBLIC if (faults := _faults(own))}
    assert not lacking, "\n".join(f"{name}: {', '.join(own)}" for name, own in lacking.items())


# Their functions compute for minutes what a command asks for; tests/benchmark and tests/study run
# them.
_LONG = {"gearmon.benchmark", "gearmon.study"}


def _code(text):
    return "\n".join(own.source for own in doctest.DocTestParser().get_examples(text))


def _shown(public):
    """The code of the examples that may show a name: its own, its class's, its room's."""
    room = importlib.import_module(public.room)
    whole = public.name.partition(".")[0]
    texts = [public.doc, inspect.getdoc(getattr(room, whole))]
    if room is not gearmon:
        texts += [own.doc for own in PUBLIC if own.own.__module__.startswith(public.room)]
        texts.append(inspect.getdoc(room))
    return "\n".join(_code(text or "") for text in texts)


def test_every_public_name_has_an_example():
    """Of what `gearmon` itself offers, methods have one as well."""
    asked = [
        own
        for own in PUBLIC
        if own.room not in _LONG and (own.room == "gearmon" or not own.is_method)
    ]
    lacking = []
    for public in asked:
        code, word = _shown(public), public.name.split(".")[-1]
        of_a_class = inspect.isclass(public.own) and _code(public.doc)
        if not (of_a_class or re.search(rf"\b{word}\b", code)):
            lacking.append(f"{public.room}: {public.name}")
    assert not lacking


@functools.cache
def prologue():
    """What the examples of the package leave behind, for all others to go on from."""
    found = {"__name__": "examples"}
    test = doctest.DocTestParser().get_doctest(gearmon.__doc__, found, "gearmon", None, 0)
    assert doctest.DocTestRunner().run(test, clear_globs=False).failed == 0
    return test.globs


def _is_result(own):
    """Whether people meet it as an answer: what describes gears and machines is long by nature."""
    return isinstance(own, Result) or type(own).__module__.startswith("gearmon.dynamics.")


def _long(made):
    """Names of results whose short text is none."""
    return [word for word, own in made.items() if _is_result(own) and len(repr(own)) >= 500]


MODULES = [
    own.name
    for own in pkgutil.walk_packages(gearmon.__path__, "gearmon.")
    if not own.name.endswith("__main__")
]


def test_what_the_package_shows_first_has_short_texts():
    assert not _long(prologue())


@pytest.mark.parametrize("room", sorted({name.split(".")[1] for name in MODULES}))
def test_examples_run(room, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    finder, runner = doctest.DocTestFinder(exclude_empty=True), doctest.DocTestRunner()
    for name in MODULES:
        if name.split(".")[1] != room:
            continue
        module = importlib.import_module(name)
        for test in finder.find(module, globs=vars(module) | prologue()):
            runner.run(test, clear_globs=False)
            known = prologue()
            made = {word: own for word, own in test.globs.items() if known.get(word) is not own}
            assert not _long(made), f"{test.name}: these have long texts"
    assert runner.failures == 0
