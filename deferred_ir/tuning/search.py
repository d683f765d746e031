"""Find the best of several settings that fits a time, by measuring as few of them as possible."""

from __future__ import annotations

from collections.abc import Callable, Sequence


def find_best(budget: float, guesses: Sequence[float], measure: Callable[[int], float]) -> tuple[int, float]:
    """Return the last choice whose measured cost is at most `budget`, and that cost; the first if none is known to fit.

    guesses: what choices are expected to cost, right up to a common factor, which the measurements tell. measure:
    returns the cost of a choice by its number; each is measured once at most.
    """
    measured: dict[int, float] = {}

    def predict(number: int) -> float:
        if number in measured or not measured:
            return measured.get(number, guesses[number])
        nearest = min(measured, key=lambda other: abs(other - number))
        return guesses[number] * measured[nearest] / guesses[nearest]

    while True:
        best = max((number for number in range(len(guesses)) if predict(number) <= budget), default=0)
        if best in measured:
            return best, measured[best]
        measured[best] = measure(best)
