"""HTML by the templates of the pages, which escape the values they are given."""

from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup as Markup

_TEMPLATES = Environment(
    loader=FileSystemLoader(Path(__file__).parent / "page" / "templates"),
    autoescape=True,
    undefined=StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)


def render(template: str, **values: Any) -> Markup:
    """Fill a template with values, escaped unless they are `Markup`; its attributes are in double quotes."""
    text = _TEMPLATES.get_template(f"{template}.html").render(values)
    return Markup(text.replace("&#39;", "'"))  # Names of samplers have many.
