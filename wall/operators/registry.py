"""List the operators: built-in ones, and those that installed packages add as entry points `wall.operators`."""

from __future__ import annotations

from importlib.metadata import EntryPoint, entry_points
from typing import Any, Literal, get_args, get_origin

from wall.core.errors import ConfigError
from wall.operators.arrange import Crop, Flip, Rotate, Tile
from wall.operators.base import Operator
from wall.operators.blend_edges import BlendEdges
from wall.operators.blend_mask import BlendMask
from wall.operators.colour import Colour, Encode
from wall.operators.curve import Curve
from wall.operators.deep_zoom import DeepZoom
from wall.operators.denoise import Denoise
from wall.operators.depth import Depth
from wall.operators.legend import Legend
from wall.operators.mask import Mask
from wall.operators.means import AgeBlend, Average
from wall.operators.outline import Outline
from wall.operators.over import Over
from wall.operators.overlay import Overlay
from wall.operators.scale import Scale
from wall.operators.selection import Newest
from wall.operators.sources import Constant, ImageSource
from wall.operators.warp import Warp

GROUP = "wall.operators"


def name_of(operator: type[Operator]) -> str | None:
    """The word that `op:` has in the YAML for a class: its `op: Literal["..."]`; None if it is not that."""
    field = operator.model_fields.get("op")
    annotation: Any = field.annotation if field else None
    words = get_args(annotation)
    one_word = get_origin(annotation) is Literal and len(words) == 1 and isinstance(words[0], str)
    return words[0] if one_word else None


BUILT_IN: tuple[type[Operator], ...] = (
    AgeBlend, Average, BlendEdges, BlendMask, Colour, Constant, Crop, Curve, DeepZoom, Denoise, Depth,
    Encode, Flip, ImageSource, Legend, Mask, Newest, Outline, Over, Overlay, Rotate, Scale, Tile, Warp,
)  # fmt: skip
OPERATORS: dict[str, type[Operator]] = {str(name_of(operator)): operator for operator in BUILT_IN}
RESERVED = frozenset({"samples", "reconstruct", "sky", "sink"})  # nodes of a graph that are not operators


def plugins() -> dict[str, type[Operator]]:
    """Operators of installed packages, by the name that `op:` has.

    Raises ConfigError naming the package and the entry point: one that cannot be loaded, is not derived from Operator,
    whose `op` is not its entry point's name, or whose name is taken.
    """
    found: dict[str, type[Operator]] = {}
    owners: dict[str, str] = {}
    for point in sorted(entry_points(group=GROUP), key=lambda point: (point.name, _package(point))):
        name, package = point.name, _package(point)
        where = f"operator '{name}' of the package {package} ({GROUP}: {point.value})"
        if name in OPERATORS or name in RESERVED:
            raise ConfigError(f"{where}: '{name}' is built in, wanted another name")
        if name in found:
            raise ConfigError(f"{where}: the package {owners[name]} has one of the same name, wanted only one of them")
        found[name], owners[name] = _loaded(point, where), package
    return found


def _loaded(point: EntryPoint, where: str) -> type[Operator]:
    try:
        operator = point.load()
    except Exception as error:  # whatever a foreign module raises while it is imported
        raise ConfigError(f"{where}: cannot be loaded, {type(error).__name__}: {error}") from error
    if not (isinstance(operator, type) and issubclass(operator, Operator)):
        raise ConfigError(f"{where}: is {operator!r}, wanted a class derived from wall.operators.base.Operator")
    if name_of(operator) != point.name:
        field = operator.model_fields.get("op")
        came: Any = field.annotation if field else "missing"
        raise ConfigError(f"{where}: its `op` is {came}, wanted Literal['{point.name}']")
    return operator


def _package(point: EntryPoint) -> str:
    return f"{point.dist.name} {point.dist.version}" if point.dist else "(unknown)"
