"""A file of obstacles: what it says is what the hand keeps away from, or one clear line."""

import numpy as np
import pinocchio as pin
import pytest
from obstacle_file import SHOWN_TABLE, blocks, read_obstacles

from planner.motions.surroundings import Box
from planner.reaching.reach_task import ReachOptions


def written(tmp_path, text):
    path = tmp_path / "room.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_millimetres_and_degrees_become_metres_and_a_pose(tmp_path):
    path = written(tmp_path, """
        table_mm = -20
        [[box]]
        name = "the shelf"
        centre_mm = [350, 200, 150]
        size_mm = [300, 20, 310]
        yaw_deg = 30
        [[box]]
        centre_mm = [0, 0, 0]
        size_mm = [10, 10, 10]
    """)  # fmt: skip
    rules = ReachOptions(**read_obstacles(path))
    assert rules.table == (0.0, 0.0, 1.0, -0.02)
    shelf, other = rules.boxes
    assert shelf.size == pytest.approx((0.3, 0.02, 0.31))
    turned = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, np.radians(30.0)), np.array(shelf.centre))
    assert shelf.pose.isApprox(turned, 1e-9)
    assert other.name == "box 2"


def test_no_file_is_free_space():
    assert ReachOptions(**read_obstacles(None)) == ReachOptions()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("table_mm = 'low'", "table_mm: expected a finite number, got low"),
        ("tabel_mm = 3", "tabel_mm is unknown; known are box, table_mm"),
        ("[[box]]\ncentre_mm = [0, 0]\nsize_mm = [1, 1, 1]", "centre_mm: expected 3 finite"),
        ("[[box]]\ncentre_mm = [0, 0, 0]\nsize_mm = [1, 0, 1]", "expected three edges > 0"),
        ("[[box]]\nsize_mm = [1, 1, 1]", "centre_mm: expected 3 finite numbers, got None"),
        ("box = [", "--obstacles"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path, text, words):
    with pytest.raises(ValueError, match="--obstacles") as caught:
        read_obstacles(written(tmp_path, text))
    assert words in str(caught.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"--obstacles .*nowhere.toml: .*No such file"):
        read_obstacles(tmp_path / "nowhere.toml")


def test_the_page_shows_a_table_below_the_object_and_every_box(tmp_path):
    """The board's upper face lies in the table's plane, below the object, however it leans."""
    box = Box((0.5, 0.2, 0.1), (0.1, 0.2, 0.3), (0.0, 0.0, np.sin(0.3), np.cos(0.3)))
    n = np.array([0.1, -0.2, 1.0]) / np.linalg.norm([0.1, -0.2, 1.0])
    object_W = np.array([0.5, 0.0, 0.2])
    shown_box, board = blocks(ReachOptions(boxes=(box,), table=(*n, 0.03)), object_W)
    np.testing.assert_array_equal(shown_box.X_WC.homogeneous, box.pose.homogeneous)
    np.testing.assert_array_equal(shown_box.size, box.size)
    face = board.X_WC.translation + 0.5 * SHOWN_TABLE[2] * board.X_WC.rotation[:, 2]
    np.testing.assert_allclose(board.X_WC.rotation[:, 2], n, atol=1e-12)
    assert face @ n == pytest.approx(0.03, abs=1e-12)
    np.testing.assert_allclose(np.cross(object_W - face, n), 0.0, atol=1e-12)
    assert blocks(ReachOptions(), object_W) == ()
