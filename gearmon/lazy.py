"""Public names of a package that load their module when they are first used.

Kept light: whatever imports any part of gearmon passes through here.
"""

from __future__ import annotations

TYPE_CHECKING = False  # typing takes a moment, in which Ctrl-C would end in a traceback

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from typing import Any


def lazily(
    package: str, offered: Mapping[str, tuple[str, ...]]
) -> tuple[list[str], Callable[[str], Any]]:
    """Return ``__all__`` and the ``__getattr__`` of a package.

    Parameters
    ----------
    package : str
        Its name.
    offered : mapping of str to tuple of str
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

    return sorted(homes), load
