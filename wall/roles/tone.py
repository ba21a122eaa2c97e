"""How views are shown: exposure and tone mapping, as edited, by keyframes, or as configured."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING

from wall.config.views import ViewConfig
from wall.core.tone_mapping import TONE_MAPPINGS, Tone
from wall.scene.parameters import EXPOSURE, TONE_MAPPING, Numbers

if TYPE_CHECKING:  # whose first events are made with what is here
    from wall.roles.plan import Plan

NO_PICTURE: Mapping[str, Numbers] = MappingProxyType({})


def configured_tone(view: ViewConfig) -> Tone:
    """How a view is shown where nothing is edited or animated."""
    return Tone(view.exposure, view.tone_mapping)


def tone_at(plan: Plan, scene_time: float, picture: Mapping[str, Numbers] = NO_PICTURE, *, view: int = 0) -> Tone:
    """How a view is shown at a scene time in seconds, under `picture`: the edits of it alone."""
    found, tone = {**plan.scene.values(scene_time), **picture}, configured_tone(plan.layout.config.views[view])
    if EXPOSURE in found:
        tone = tone._replace(stops=found[EXPOSURE][0])
    if TONE_MAPPING in found:
        tone = tone._replace(mapping=TONE_MAPPINGS[int(found[TONE_MAPPING][0])])
    return tone
