"""The model of a whole configuration, of its transport and of its output; its other parts have files of their own."""

from __future__ import annotations

import ipaddress
import math
from typing import Annotated, Literal

from annotated_types import Ge, Le
from pydantic import AfterValidator, Field, model_validator

from wall.config.graph import GraphConfig, PresetGraph
from wall.config.sampling import DEFAULT, AnySampling, SamplingConfig
from wall.config.scene import SceneConfig
from wall.config.screens import WallConfig
from wall.config.views import MOST_VIEWS, ReconstructionWish, ViewConfig
from wall.core.fields import Flag, Model, Number, Text, Whole, refusal
from wall.core.network import is_loopback

LARGEST_PORT = 65535


def _range_of(text: str) -> tuple[int, int]:
    """First and last of a range of ports."""
    first, _, last = text.partition("-")
    return int(first), int(last)


def _checked_range(text: str) -> str:
    first, _, last = text.partition("-")
    numbers = first.isascii() and first.isdecimal() and last.isascii() and last.isdecimal()
    if not numbers or len(text) > 11 or not 1 <= int(first) <= int(last) <= LARGEST_PORT:
        raise refusal("is no range of ports", accepted=f"first-last, such as 9000-9100, from 1 to {LARGEST_PORT}")
    if first == last:
        raise refusal("is one port", accepted="two or more: the head listens on two")
    return text


def _checked_network(text: str) -> str:
    try:
        return str(ipaddress.IPv4Network(text))
    except ValueError as error:
        raise refusal(f"is no network: {error}", accepted="IPv4 addresses, such as 10.1.0.0/24 or 10.1.0.7") from error


def _checked_address(text: str) -> str:
    """The text, unless it looks like an IPv4 address and is none."""
    try:
        if not text.strip("0123456789."):
            ipaddress.IPv4Address(text)
        return text
    except ValueError:
        raise refusal("is no address", accepted="four numbers up to 255, such as 10.1.0.7, or a host's name") from None


Address = Annotated[Text, AfterValidator(_checked_address)]
Network = Annotated[Text, AfterValidator(_checked_network)]
PortRange = Annotated[Text, AfterValidator(_checked_range)]

STALE_BEATS = 3  # that a rank may miss before its part of the wall is marked


class TransportConfig(Model):
    """How ranks talk."""

    kind: Literal["zmq", "loopback"] = Field(default="zmq", description="zmq: between processes; loopback: inside one")
    bind: Address = Field(default="127.0.0.1", description="address that ranks listen on; 0.0.0.0 for several hosts")
    ports: PortRange | None = Field(
        default=None, description="range of ports that ranks listen on, such as 9000-9100; default: any free ones"
    )
    encrypt: Literal["auto", "always", "never"] = Field(
        default="auto",
        description="encrypt what ranks send over the network, and let in ranks of the run alone; auto: unless bind is "
        "loopback",
    )
    allow: Annotated[tuple[Network, ...], Field(max_length=64)] = Field(
        default=(), description="networks whose hosts may connect to ranks, such as 10.1.0.0/24; none: all"
    )
    codec: Literal["none", "lz4", "zstd"] = Field(default="none", description="compression of samples on the wire")
    credit_bytes: Annotated[Whole, Ge(16384), Le(1 << 30)] = Field(
        default=131072, description="bytes one renderer may have under way; less = fresher, more = steadier"
    )
    heartbeat_s: Annotated[Number, Ge(0.05), Le(60.0)] = Field(default=0.1, description="seconds between signs of life")
    stale_after_s: Annotated[Number, Ge(0.0), Le(600.0)] | None = Field(
        default=None,
        description="seconds of silence after which a rank's part of the wall is marked on the page and in windows, at "
        "once where its connection closes; 0: never; three heartbeats if left out",
    )
    lost_after_s: Annotated[Number, Ge(0.1), Le(600.0)] = Field(
        default=2.0, description="seconds of silence that mean a rank is lost"
    )
    ends_after_s: Annotated[Number, Ge(1.0), Le(86400.0)] | None = Field(
        default=None,
        description="seconds of silence of all renderers after which the run ends, at least lost_after_s; left out: it "
        "waits for them, and ends where all are known to be dead",
    )
    restarts: Annotated[int, Ge(0), Le(1000)] = Field(
        default=3,
        description="how often in a minute a rank that dies is started again; after that it stays dead until the first "
        "of these starts is a minute old; not under MPI",
    )
    standby: Flag = Field(
        default=False,
        description="when the head dies another one takes its place and the wall goes on, three times a minute at "
        "most; not where its machine dies",
    )

    @property
    def longest_silence_s(self) -> float:
        """Seconds for which all renderers may be silent; infinite where they are waited for."""
        return math.inf if self.ends_after_s is None else max(self.ends_after_s, self.lost_after_s)

    @property
    def encrypted(self) -> bool:
        """Whether ranks have keys."""
        wanted = self.encrypt == "always" or (self.encrypt == "auto" and not is_loopback(self.bind))
        return wanted and self.kind == "zmq"

    @property
    def port_range(self) -> tuple[int, int] | None:
        """First and last port that ranks may listen on; None: any."""
        return None if self.ports is None else _range_of(self.ports)

    @model_validator(mode="after")
    def _fits_together(self) -> TransportConfig:
        if self.lost_after_s < 2 * self.heartbeat_s:
            raise refusal(
                f"one late heartbeat (every {self.heartbeat_s:g} s) would lose a rank",
                accepted=f"at least {2 * self.heartbeat_s:g}, or a shorter heartbeat_s",
                at=("lost_after_s",),
            )
        if self.standby and self.kind == "loopback":
            raise refusal("threads of one process end with it", accepted="kind: zmq, or no standby", at=("standby",))
        if self.stale_after_s is not None and 0.0 < self.stale_after_s < 2 * self.heartbeat_s:
            raise refusal(
                f"one late heartbeat (every {self.heartbeat_s:g} s) would mark a rank's part of the wall",
                accepted=f"at least {2 * self.heartbeat_s:g}, a shorter heartbeat_s, or 0: no marks",
                at=("stale_after_s",),
            )
        return self

    @property
    def marked_after_s(self) -> float:
        """Seconds of silence after which a rank's part of the wall is marked; infinite where nothing is."""
        if self.stale_after_s is None:
            return min(STALE_BEATS * self.heartbeat_s, self.lost_after_s)
        return self.stale_after_s or math.inf


class TlsConfig(Model):
    """Files that encrypt the page, relative to this one."""

    certificate: Text = Field(description="PEM file of the certificate, and of those that vouch for it")
    key: Text = Field(description="PEM file of its private key, without a password")


class BrowserConfig(Model):
    """The page that shows and steers the wall."""

    host: Text = Field(default="127.0.0.1", description="address the page is served on")
    token: Literal["auto", "always", "never"] = Field(
        default="auto",
        description="let in those alone who know the address that is printed; auto: unless host is loopback",
    )
    watch_token: Text | None = Field(
        default=None,
        description="file with the token that lets watch and read metrics, relative to this one; a new one at each "
        "start if left out",
    )
    tls: TlsConfig | None = Field(default=None, description="serve the page encrypted, as https")
    port: Annotated[Whole, Ge(0), Le(65535)] = Field(default=0, description="port of the page; 0 = any free one")
    open: Flag = Field(default=True, description="open the page where there is a desktop")
    embed: Flag = Field(
        default=False, description="pages of this machine, such as a notebook's, may show the page in a frame"
    )
    samples: Flag = Field(
        default=False, description="samples travel to the head even on one machine, so that pages can ask for them"
    )
    load: Flag = Field(
        default=False,
        description="who may steer by the page's address may also load other configurations, which can name any file",
    )

    choices: Flag = Field(
        default=True,
        description="who may steer may choose another configuration or model of the run's folder, or a built-in scene",
    )

    @property
    def tokens(self) -> bool:
        """Whether the page asks for a token."""
        return self.token == "always" or (self.token == "auto" and not is_loopback(self.host))


class OutputConfig(Model):
    """Where results go."""

    directory: Text = Field(
        default="OUT", description="folder of images and summary.json, relative to where wall is started"
    )
    browser: BrowserConfig = Field(default=BrowserConfig(), description="the live page")
    metrics: Annotated[Whole, Ge(0), Le(LARGEST_PORT)] | None = Field(
        default=None,
        description="port at browser.host that serves /metrics and /status.json with or without a page; 0 = any free "
        "one; the page's own port alone if left out",
    )
    record_hz: Annotated[Number, Ge(0.01), Le(240.0)] = Field(
        default=10.0, description="images a second that the recorder keeps"
    )


class Config(Model):
    """A wall, a scene, and how the one is shown on the other."""

    version: Literal[1] = Field(description="version of this format")
    scene: SceneConfig = Field(description="what is rendered")
    wall: WallConfig = Field(description="where the panels stand")
    views: Annotated[tuple[ViewConfig, ...], Field(min_length=1, max_length=MOST_VIEWS)] = Field(
        description="who looks, from where"
    )
    sampling: SamplingConfig = Field(default=DEFAULT, description="which pixels are traced next")
    graph: GraphConfig = Field(default=PresetGraph(), description="how samples become images: sort-first, or nodes")
    reconstruction: ReconstructionWish = Field(
        default="auto",
        description="where adaptive samples become images; auto: at their renderer, else on a real GPU if there is one",
    )
    barrier: Flag = Field(
        default=False,
        description="each update of the scene waits until every view has shown the one before: all have the rate of "
        "the slowest; to compare with, on walls of one renderer",
    )
    transport: TransportConfig = Field(default=TransportConfig(), description="how ranks talk")
    output: OutputConfig = Field(default=OutputConfig(), description="where results go")

    @model_validator(mode="after")
    def _views_differ(self) -> Config:
        for k, view in enumerate(self.views):
            before = [other.id for other in self.views[:k]]
            if view.id in before:
                came = f"views[{before.index(view.id)}] has this id already"
                raise refusal(came, accepted="ids that differ", at=("views", k, "id"))
            for what in ("camera", "time", "selection"):
                link = getattr(view, what)
                if link is not None and link.follow is not None and link.follow not in before:
                    where = ("views", k, what, "follow")
                    raise refusal("is no view before this one", accepted=", ".join(before) or "none is", at=where)
            if view.camera.follow is not None and view.path is not None:
                raise refusal("its camera follows another view's", accepted="no path", at=("views", k, "path"))
        for k, view in enumerate(self.views):
            others = [other.tracking for other in self.views[:k] if other.tracking is not None]
            if view.tracking is not None and any(view.tracking.cannot_share_port(other) for other in others):
                accepted = f"an address of the other kind, IPv4 or IPv6, or another port than {view.tracking.port}"
                problem = "another view is tracked from an address of the other kind at this port"
                raise refusal(problem, accepted=accepted, at=("views", k, "tracking", "source"))
        if len(self.views) > 1 and self.graph.sync != "none":
            raise refusal("shows one view's frames", accepted="sync: none, or one view", at=("graph", "sync"))
        return self

    def selection_of(self, view: int) -> int:
        """The view whose selection a view has: the first, unless it has one of its own or follows another's."""
        own = self.views[view].selection
        if view == 0 or own is None:
            return 0
        return view if own.follow is None else self.selection_of([each.id for each in self.views].index(own.follow))

    def sampling_of(self, view: int) -> AnySampling:
        """The sampling that holds for a view: its own, or the top-level one."""
        return self.views[view].sampling or self.sampling

    def reconstruction_of(self, view: int) -> ReconstructionWish:
        """Where a view's adaptive samples become images: its own wish, or the top-level one."""
        return self.views[view].reconstruction or self.reconstruction
