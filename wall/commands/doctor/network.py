"""Checks of what a run listens on and shows on: ports, the page's files, displays."""

from __future__ import annotations

from collections.abc import Iterator

from wall.commands.doctor.finding import Finding, State
from wall.core.network import why_taken
from wall.display.x_server import check_displays
from wall.roles.plan import Layout, window_panels

LISTENERS_OF_HEAD = 2  # for control messages, and for samples and images


def ports(layout: Layout) -> Iterator[Finding]:
    """Whether ranks can listen where the configuration says, on as many ports as one machine may need."""
    transport = layout.config.transport
    bind, between = transport.bind, transport.port_range
    wanted = LISTENERS_OF_HEAD + layout.graph.compositors - 1
    if transport.kind == "loopback":
        return
    if between is None:
        why = why_taken(bind, 0)
        mend = "transport: {bind: 0.0.0.0}, or an address of this machine (ip -br address)"
        found = f"any free ones at {bind}" if not why else f"{bind}: {why}"
        yield Finding(name="ports", state="missing" if why else "ok", found=found, mend=mend)
        return
    whys = [why_taken(bind, port) for port in range(between[0], between[1] + 1)]
    free = whys.count("")
    found = f"{free} of {between[0]}-{between[1]} free at {bind}, up to {wanted} needed"
    mend = f"transport.ports: a wider range{'' if free else f' ({whys[-1]})'}; ss -tlnp says who listens"
    state: State = "ok" if free >= wanted else "warning" if free >= LISTENERS_OF_HEAD else "missing"
    yield Finding(name="ports", state=state, found=found, mend=mend)


def page(layout: Layout) -> Iterator[Finding]:
    """Whether the page and metrics can be served: ports, the token's file, certificate and key."""
    from wall.display.gate import tls_of, token_in  # and aiohttp

    output, folder = layout.config.output, layout.loaded.folder
    for name, port in (("page", output.browser.port), ("metrics", output.metrics)):
        if port is None:
            continue
        why = why_taken(output.browser.host, port)
        key = "output.browser" if name == "page" else "output"
        mend = f"another port in {key}.{'port' if name == 'page' else 'metrics'}, or 0; ss -tlnp says who listens"
        found = f"{output.browser.host}:{port or 'any free port'}" + (f": {why}" if why else "")
        yield Finding(name=name, state="missing" if why else "ok", found=found, mend=mend)
    if output.browser.watch_token is not None:
        token_in(folder / output.browser.watch_token)
    if output.browser.tls is not None:
        tls_of((folder / output.browser.tls.certificate, folder / output.browser.tls.key))


def displays(layout: Layout, host: str) -> Iterator[Finding]:
    """Whether the X displays of windows on this machine can be reached."""
    panels = window_panels(layout, range(layout.size))
    here = [panel for panel in panels if panel.config.host in (None, host)]
    if here:
        check_displays(here)
        yield Finding(name="displays", state="ok", found=f"of {len(here)} panels can be reached")
    elif panels:
        yield Finding(name="displays", state="ok", found="all windows are on other hosts; run wall doctor there")
