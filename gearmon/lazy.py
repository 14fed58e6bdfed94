"""Public names of a package that load their module when they are first used.

Kept light: whatever imports any part of gearmon passes through here.
"""

from __future__ import annotations

TYPE_CHECKING = False  # typing takes a moment, in which Ctrl-C would end in a traceback

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from typing import Any


def offered_to_checkers(package: str, path: str) -> tuple[list[str], Callable[[str], Any]]:
    """Return ``__all__`` and ``__getattr__`` of a package, from what it shows to type checkers.

    Parameters
    ----------
    package : str
        Its name.
    path : str
        Its ``__init__.py``, with a line ``from package.module import name as name`` a name.
    """
    offered: dict[str, list[str]] = {}
    with open(path, encoding="utf-8") as source:
        for line in source:
            if line.startswith(f"    from {package}."):
                _, home, _, name, *_ = line.split()
                offered.setdefault(home.removeprefix(f"{package}."), []).append(name)
    names = sorted(name for names in offered.values() for name in names)
    return names, lazily(package, offered)


def lazily(package: str, offered: Mapping[str, Sequence[str]]) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a package.

    Parameters
    ----------
    package : str
        Its name.
    offered : mapping of str to sequence of str
        The names that each of its modules offers.
    """
    homes = {name: home for home, names in offered.items() for name in names}

    def load(name: str) -> Any:
        """Load a public name from its home."""
        from importlib import import_module

        if name not in homes:
            from gearmon.errors import nearest_name

            near = nearest_name(name, homes)
            hint = f"; did you mean {near}?" if near else ""
            raise AttributeError(f"module {package!r} has no attribute {name!r}{hint}")
        return getattr(import_module(f"{package}.{homes[name]}"), name)

    return load
