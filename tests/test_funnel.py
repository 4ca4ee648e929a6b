"""Why there is no plan, in a line that can be read: the most frequent reasons, without amounts."""

from __future__ import annotations

from planner.funnel import MOST, in_words
from planner.grasping.grasp import NoGrasp
from planner.plan import NoPlan


def test_reasons_that_differ_by_an_amount_are_one():
    told = in_words(
        (
            ("3 fingers: placements fitted", 480),
            ("3 fingers: out of reach: palm_link and the table overlap by 12.5 mm", 2),
            ("3 fingers: out of reach: palm_link and the table overlap by 3 mm", 1),
            ("3 fingers: out of reach: index: pad normal 46 deg off at best (cone 40)", 1),
        )
    )
    assert told == (
        "with 3 fingers, placements fitted 480, out of reach: palm_link and the table overlap 3, "
        "out of reach: index: pad normal off at best (cone 40) 1"
    )


def test_names_with_numbers_stay_apart():
    told = in_words((("link_2.0 meets link_6.0", 1), ("link_2.0 meets link_7.0", 1)))
    assert told == "link_2.0 meets link_6.0 1, link_2.0 meets link_7.0 1"


def test_rare_reasons_are_counted_only_and_none_is_lost():
    funnel = tuple((f"2 fingers: because of {'x' * k}", 9 - k) for k in range(9))
    told = in_words((*funnel, ("2 fingers: never", 0), ("1 fingers: alone", 5)))
    named = sum(9 - k for k in range(MOST))
    assert f"{45 - named} for {9 - MOST} other reasons; with 1 fingers, alone 5" in told
    assert "never" not in told


def test_errors_keep_the_whole_funnel():
    funnel = (("3 fingers: placements fitted", 10), ("3 fingers: links inside the object", 10))
    for error in (NoPlan(funnel), NoGrasp(funnel)):
        assert error.funnel == funnel
        assert "links inside the object 10" in str(error)
