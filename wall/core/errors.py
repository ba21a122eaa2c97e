"""Exceptions by cause. Every text says where, what came and what was wanted."""

from __future__ import annotations


class WallError(Exception):
    """Anything that `wall` refuses or gives up on; the text is fit for a user to read."""


class ConfigError(WallError):
    """A configuration that was refused before the first ray (exit code 2)."""


class SceneError(ConfigError):
    """A model or scene that cannot be rendered: where it is, what is wrong with it, what would do."""


class RunError(WallError):
    """A run that failed: a rank died, a peer vanished, a machine refused (exit code 1)."""


class EditError(WallError):
    """An edit of a running wall that is refused, and so changes nothing: what came, what is accepted."""


class LocalProtocolError(WallError):
    """We were about to put something on the wire that the format does not allow: our mistake."""


class RemoteProtocolError(WallError):
    """Bytes came that are not a valid message: their mistake. Dropped and counted, never fatal."""
