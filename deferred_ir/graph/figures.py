"""Figures: numbers that passes publish with each frame, and where a record of a run has them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """A number that a pass publishes by `io.count` or `io.report`, under `name`.

    key: its place in RUN.json, (key,) or (table, key): a table is null in runs in which none of its figures was
    published, a figure by itself 0. (): RUN.json has it not. each_frame: a list of the numbers of all frames, instead
    of the last one's. left_out: what the number counts was left out, and why; `{n}` is the number.
    """

    name: str
    doc: str
    key: tuple[str, ...] = ()
    each_frame: bool = False
    left_out: tuple[str, str] | None = None
