"""The search for the best settings that fit a time: few measurements, and never a choice that was not measured."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deferred_ir.tuning.search import find_best

COSTS = [1.0, 2.0, 3.0, 5.0, 8.0, 13.0]


def search(budget, guesses, costs):
    """Return (choice, its cost), and the choices that were measured."""
    asked = []

    def measure(number):
        asked.append(number)
        return costs[number]

    return find_best(budget, guesses, measure), asked


@pytest.mark.parametrize("factor", [0.1, 1.0, 30.0])
def test_two_measurements_are_enough_where_guesses_are_right_up_to_a_factor(factor):
    costs = [factor * cost for cost in COSTS]
    (choice, cost), asked = search(6 * factor, COSTS, costs)
    assert (choice, cost) == (3, costs[3])
    assert len(asked) <= 2


def test_wrong_guesses_cost_more_measurements_but_no_wrong_choice():
    (choice, _), asked = search(6.0, [1.0] * 6, COSTS)
    assert choice == 3
    assert len(asked) == len(set(asked)) <= 6


def test_the_first_is_left_where_nothing_fits():
    (choice, cost), asked = search(0.5, COSTS, COSTS)
    assert (choice, cost, asked) == (0, 1.0, [0])


@given(st.lists(st.floats(0.1, 100), min_size=1, max_size=8), st.floats(0.01, 1000), st.data())
def test_what_is_chosen_was_measured_and_fits_if_anything_measured_does(costs, budget, data):
    guesses = data.draw(st.lists(st.floats(0.1, 100), min_size=len(costs), max_size=len(costs)))
    (choice, cost), asked = search(budget, guesses, costs)
    assert cost == costs[choice]
    assert len(asked) == len(set(asked))
    assert choice in asked
    if cost > budget:
        assert choice == 0
    else:
        assert all(costs[number] > budget for number in asked if number > choice)
