"""The table of maps against rays: a line a row."""

from __future__ import annotations

from deferred_ir.profiling.checks.visibility import Fraction, Row

FRACTIONS = {"mismatch": 17, "leaks": 8, "false_shadows": 15, "light_wrong": 17, "light_leaked": 14, "light_lost": 12}
"""Fields of a row that the table shows in per cent, and the widths of their columns."""
WITH_ERROR = ("mismatch", "light_wrong")


def heading(width: int) -> str:
    """Return the table's first line. width: of the longest scene's name."""
    fractions = [f"{name.replace('_', ' '):>{wide}}" for name, wide in FRACTIONS.items()]
    return f"{'scene':<{width}}  lights       projection    map      pairs{''.join(fractions)}"


def line(row: Row, width: int) -> str:
    """Return a line of the table."""
    fractions = [
        f"{_percent(getattr(row, name), error=name in WITH_ERROR):>{wide}}" for name, wide in FRACTIONS.items()
    ]
    what = f"{row.scene:<{width}}  {row.lights:<11}  {row.projection:<11}"
    return f"{what} {row.map_size:>5}  {row.pairs:>9,}{''.join(fractions)}"


def _percent(fraction: Fraction, *, error: bool) -> str:
    if fraction.value is None or fraction.error is None:
        return "-"
    return f"{100 * fraction.value:.3f}" + (f" +-{100 * fraction.error:.3f}" if error else "")
