"""The main job with every hand that is not the Allegro: goal met, and how it ends."""

from __future__ import annotations

import json

import pytest
from commands import script


@pytest.mark.parametrize(
    ("hand", "seed", "grasps"),
    [("trifinger_edu", 1, True), ("dex3_right", 2, True), ("psyonic_right", 1, False)],
)
def test_another_hand_finds_the_axis_and_ends_in_a_grasp_where_it_can(hand, seed, grasps, tmp_path):
    """Psyonic's fingers move along arcs: they cannot open and close along their normals, and Dex3's
    can in a few placements."""
    done = script("plan_grasp", "--hand", hand, "--seed", seed, "--out", tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Goal met." in done.stdout
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["grasp"]["planned"] is grasps
    if grasps:
        assert result["grasp"]["holds_true_object"]
    else:
        assert "No grasp: no grasp of the believed object" in done.stdout
