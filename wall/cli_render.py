"""`wall render`: one converged image, its layers, or the frames of a film."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from wall.commands.terminal import console, load_config, parse_size

UpOption = Annotated[str | None, typer.Option(help="What is up in .obj, .ply, .stl: x, y, z, -x, -y or -z")]
ViewOption = Annotated[
    str | None, typer.Option(help="Only this view, as large as its place; else the first, on all of the wall")
]


def render(
    what: Annotated[
        Path,
        typer.Argument(
            metavar="CONFIG|MODEL|NAME", help="A configuration, a model file, or a built-in scene", show_default=False
        ),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="image.png (8-bit sRGB), .exr or .npy (linear float32)")
    ],
    spp: Annotated[int, typer.Option(min=1, max=65536, help="Samples a pixel")] = 64,
    size: Annotated[str | None, typer.Option(help="WIDTHxHEIGHT in pixels; the wall's own if left out")] = None,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1, help="Same seed, same image")] = 1,
    at: Annotated[float, typer.Option(min=0.0, help="Time of the animation, seconds")] = 0.0,
    view: ViewOption = None,
    up: UpOption = None,
    layers: Annotated[
        str | None,
        typer.Option(help="Layers of an .exr, with commas between: albedo, normal, depth, variance, object_id; or all"),
    ] = None,
) -> None:
    """Render one converged image: the same bits for a seed, however many threads or ranks.

    [bold]wall render configs/demo.yaml --spp 64 -o wall.png[/]

    [bold]wall render museum --layers all -o museum.exr[/]
    """
    from wall.commands.one_view import plan_of_view
    from wall.commands.progress import progress_bar
    from wall.commands.render import render_layers
    from wall.commands.terminal import print_notes
    from wall.display.image_file import check_suffix, write_image, write_layers
    from wall.roles.plan import exposure_at, make_layout, make_plan
    from wall.sampling.pixel_layers import LAYERS, checked_layers

    names = LAYERS if layers == "all" else checked_layers(layers.split(",") if layers else (), where="--layers")
    check_suffix(output, layers=bool(names))
    loaded = load_config(what, up=up)
    with progress_bar("rendering") as update:
        plan = make_plan(make_layout(loaded))
        if view is not None:
            plan = plan_of_view(plan, view)
        print_notes(plan)
        found = render_layers(
            plan,
            spp=spp,
            seed=seed,
            size=parse_size(size),
            at=at,
            layers=names,
            progress=lambda done, total: update(completed=done, total=total),
        )
    if found is None:
        return
    image = found["colour"]
    if names:
        write_layers(output, found)
    else:
        write_image(output, image, stops=exposure_at(plan, at))
    console.print(f"wrote {output}: {image.shape[1]}x{image.shape[0]}, {spp} samples a pixel, seed {seed}")
