"""HTML by templates that escape the values they are given."""

import html
from collections.abc import Iterable
from string import Template
from typing import Any


class Markup(str):
    """HTML as it is, not to be escaped again."""


def fill(template: str, **values: Any) -> Markup:
    """Return a ``string.Template`` with values in place of its names, escaped unless they are `Markup`.

    Iterables of markup are put together. Templates have attributes in double quotes.
    """
    return Markup(Template(template).substitute({name: _text(value) for name, value in values.items()}))


def join(parts: Iterable[Markup]) -> Markup:
    """Put pieces of markup together."""
    return Markup("\n".join(parts))


def _text(value: Any) -> str:
    return value if isinstance(value, Markup) else html.escape(str(value), quote=False).replace('"', "&quot;")
